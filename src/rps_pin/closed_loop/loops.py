"""The loops of a tree: how far open they are, and how they change with the joints.

With e(q) the gaps of all closures, one below the other, J v is their rate (in the rows that
`closure` describes) and J a + J' v their acceleration, J' being the derivative of J.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rps_pin.closed_loop.closure import LoopClosure
from rps_pin.errors import InputError, MechanismError

Array = NDArray[np.float64]


class LoopErrors(NamedTuple):
    """How far the loops are from being closed; the rows are those of the closures in order."""

    position: Array
    """Gaps, shape (nc,), m; for angular rows the rotation vector between the frames, rad."""
    velocity: Array
    """Their rates, shape (nc,), m/s and rad/s."""
    acceleration: Array
    """Their second derivatives, shape (nc,), m/s^2 and rad/s^2; for angular rows the difference of
    the frames' angular accelerations, which is that where their angular velocities agree."""


class Loops:
    """The closures of one model with the scratch memory that evaluating them takes.

    Parameters
    ----------
    model
        The open tree.
    closures
        What closes its loops.
    characteristic_length
        See `ClosedLoopModel`.

    Attributes
    ----------
    size : int
        Number of rows, nc.
    length : float
        The characteristic length, m.
    row_scale, column_scale : (nc,) and (nv,) arrays
        ``row_scale[:, None] * J * column_scale`` has entries of one unit: angular rows count with
        the length as their lever, angular velocities are those of a point at that lever.
    data, calls, constraints, constraint_data
        For calling Pinocchio: `getConstraintsJacobian` reads what each of the `calls` refreshes.

    Raises
    ------
    MechanismError
        If a frame is unknown, or two closures have one name.
    InputError
        If the characteristic length is not positive.
    """

    def __init__(
        self,
        model: pin.Model,
        closures: Sequence[LoopClosure],
        characteristic_length: float | None = None,
    ) -> None:
        self.model = model
        self.closures = tuple(closures)
        refuse_twice("closure", [closure.name for closure in self.closures])
        self.size = sum(closure.size for closure in self.closures)
        self.frames = [closure.frame_ids(model) for closure in self.closures]
        self.data = model.createData()
        self.constraints = pin.StdVec_RigidConstraintModel()
        self.constraint_data = pin.StdVec_RigidConstraintData()
        for closure in self.closures:
            constraint = closure.constraint_model(model)
            self.constraints.append(constraint)
            self.constraint_data.append(constraint.createData())
        # Iterating a StdVec makes new Python objects each time; kept pairs cost a tenth.
        self.calls = [
            (constraint.calc, data)
            for constraint, data in zip(self.constraints, self.constraint_data, strict=True)
        ]
        self.length = self._length(characteristic_length)
        self.row_scale = np.concatenate(
            [np.zeros(0)] + [np.repeat([1.0, self.length], 3)[: c.size] for c in self.closures]
        )
        self.column_scale = np.where(self._is_angular(), 1 / self.length, 1.0)

    def rows(self, closure: str) -> slice:
        """Return the rows of a closure by its name, or say which there are."""
        start = 0
        for candidate in self.closures:
            if candidate.name == closure:
                return slice(start, start + candidate.size)
            start += candidate.size
        names = ", ".join(candidate.name for candidate in self.closures)
        raise MechanismError(f"no closure {closure!r}; there are: {names}")

    def jacobian(self, q: Array) -> Array:
        """Return J at a configuration, shape (nc, nv)."""
        model, data = self.model, self.data
        pin.computeJointJacobians(model, data, q)
        for calc, constraint_data in self.calls:
            calc(model, data, constraint_data)
        jacobian: Array = pin.getConstraintsJacobian(
            model, data, self.constraints, self.constraint_data
        )
        return jacobian.reshape(self.size, model.nv)  # a single row or column comes flat

    def gaps(self, q: Array) -> Array:
        """Return e(q), shape (nc,), m and rad."""
        pin.framesForwardKinematics(self.model, self.data, q)
        placements = self.data.oMf
        return np.concatenate(
            [np.zeros(0)]
            + [
                _gap(closure, placements[a], placements[b])
                for closure, (a, b) in zip(self.closures, self.frames, strict=True)
            ]
        )

    def errors(self, q: Array, v: Array, a: Array) -> LoopErrors:
        """Return gaps, their rates and their accelerations."""
        model, data = self.model, self.data
        gaps = self.gaps(q)
        pin.forwardKinematics(model, data, q, v, a)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        rates, accelerations = [np.zeros(0)], [np.zeros(0)]
        for closure, (frame_a, frame_b) in zip(self.closures, self.frames, strict=True):
            rate = pin.getFrameVelocity(model, data, frame_a, axes) - pin.getFrameVelocity(
                model, data, frame_b, axes
            )
            acceleration = pin.getFrameClassicalAcceleration(
                model, data, frame_a, axes
            ) - pin.getFrameClassicalAcceleration(model, data, frame_b, axes)
            rates.append(rate.vector[: closure.size])
            accelerations.append(acceleration.vector[: closure.size])
        return LoopErrors(gaps, np.concatenate(rates), np.concatenate(accelerations))

    def worst(self, gaps: Array) -> tuple[float, str]:
        """Return the largest gap (m; angles with the length as lever) and its closure's name."""
        worst, name = 0.0, ""
        scaled = self.row_scale * gaps
        for closure in self.closures:
            own = scaled[self.rows(closure.name)]
            gap = float(max(np.linalg.norm(own[:3]), np.linalg.norm(own[3:])))
            if not gap <= worst:
                worst, name = gap, closure.name
        return worst, name

    def _length(self, given: float | None) -> float:
        """Return the given length, or the longest lever of a closure, or 1 m if there is none."""
        if given is not None:
            if not (np.isfinite(given) and given > 0):
                raise InputError(f"characteristic_length = {given}: it must be positive")
            return float(given)
        levers = [
            float(np.linalg.norm(self.model.frames[frame].placement.translation))
            for pair in self.frames
            for frame in pair
            if self.model.frames[frame].parentJoint != 0  # the world is no lever
        ]
        return max(levers, default=0.0) or 1.0

    def _is_angular(self) -> NDArray[np.bool_]:
        """Return which velocity components are angular: they move joint frames by turning them."""
        neutral = pin.neutral(self.model)
        pin.computeJointJacobians(self.model, self.data, neutral)
        angular = np.zeros(self.model.nv, dtype=bool)
        for index, joint in enumerate(self.model.joints):
            if index == 0:
                continue
            columns = slice(joint.idx_v, joint.idx_v + joint.nv)
            local = pin.getJointJacobian(self.model, self.data, index, pin.ReferenceFrame.LOCAL)
            own = local.reshape(6, self.model.nv)[:, columns]
            angular[columns] = np.abs(own[3:]).max(axis=0) > 1e-12
        return angular


def refuse_twice(what: str, names: Sequence[str]) -> None:
    """Raise `MechanismError` if a name comes twice."""
    twice = {name for name in names if list(names).count(name) > 1}
    if twice:
        raise MechanismError(f"{what} {min(twice)!r} is named twice")


def _gap(closure: LoopClosure, a: pin.SE3, b: pin.SE3) -> Array:
    """Return a closure's position error: p_a - p_b, and log(R_a R_b') if it is rigid."""
    gap: Array = a.translation - b.translation
    if closure.kind == "rigid":
        gap = np.concatenate([gap, pin.log3(a.rotation @ b.rotation.T)])
    return gap

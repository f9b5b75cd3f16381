"""A mechanism with closed loops: an open Pinocchio tree, its loop closures, its actuated joints."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Any

import eigenpy
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray
from pinocchio import computeJointJacobians, getConstraintsJacobian, rnea
from scipy.linalg.blas import dgemv, dnrm2

from rps_pin.closed_loop.closing import close_gaps
from rps_pin.closed_loop.closure import LoopClosure
from rps_pin.closed_loop.inverse_dynamics import (
    InverseDynamics,
    condition_number,
    solve_by_allowed_motions,
)
from rps_pin.closed_loop.loops import LoopErrors, Loops, refuse_twice
from rps_pin.closed_loop.reading import model_from_urdf
from rps_pin.closed_loop.vectors import checked_vector
from rps_pin.errors import ClosureError, InputError, MechanismError, SingularityError

Array = NDArray[np.float64]

#: Past this condition number half of the digits are lost (1 / sqrt of the rounding unit), and no
#: machine is built well enough to know its forces.
MAX_CONDITION = 1e8

#: A loop counts as closed below this gap, in units of the characteristic length.
_CLOSED = 1e-12
#: What `velocity` and `acceleration` accept of their arguments, relative to the rates given.
_CONSISTENT = 1e-8

_INFINITY = math.inf


class ClosedLoopModel:
    """Any mechanism: an open tree whose loops are closed by Pinocchio constraint models.

    Build once, call often: the scratch memory is allocated here. For that reason one object serves
    one thread; `model` itself is never written to and may be shared.

    Parameters
    ----------
    model
        The open tree. Its gravity is used as it stands.
    closures
        What closes its loops.
    actuated
        Names of the actuated joints; `tau` comes in this order.
    characteristic_length
        Length (m) that makes angles and lengths comparable: in condition numbers, and in the norm
        that `close` makes small. Left out, it is the longest lever of a closure, that is, the
        distance of a closed frame from the joint that carries it (1 m if all are zero).
    max_condition
        `SingularityError` is raised where the condition number exceeds this.

    Raises
    ------
    MechanismError
        If a frame or joint is unknown or named twice, or no joint is actuated.
    """

    def __init__(
        self,
        model: pin.Model,
        closures: Sequence[LoopClosure],
        actuated: Sequence[str],
        *,
        characteristic_length: float | None = None,
        max_condition: float = MAX_CONDITION,
    ) -> None:
        self.model = model
        self.closures = tuple(closures)
        self.actuated = (actuated,) if isinstance(actuated, str) else tuple(actuated)
        if not max_condition >= 1:
            raise InputError(f"max_condition = {max_condition}: it must be at least 1")
        self.max_condition = max_condition
        refuse_twice("actuated joint", self.actuated)
        self._loops = loops = Loops(model, closures, characteristic_length)
        self._actuated = self._velocity_indices(self.actuated)
        self._passive = np.setdiff1d(np.arange(model.nv), self._actuated)
        self._scales = loops.row_scale[:, None], loops.column_scale[self._passive]
        self._square = loops.size == self._passive.size > 0
        # What a call of `inverse_dynamics` needs, in two look-ups.
        self._pinocchio = (
            model,
            loops.data,
            loops.calls,
            loops.constraints,
            loops.constraint_data,
        )
        self._algebra = (
            eigenpy.PartialPivLU(self._passive.size),
            self._passive,
            self._passive.size,
            np.concatenate([self._passive, self._actuated]),
            self._least_harmless_rcond(),
            self._scales,
        )

    @classmethod
    def from_urdf(
        cls,
        path_or_xml: str | os.PathLike[str],
        closures: Sequence[LoopClosure],
        actuated: Sequence[str],
        *,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        characteristic_length: float | None = None,
        max_condition: float = MAX_CONDITION,
    ) -> ClosedLoopModel:
        """Build a mechanism from a URDF: a file's path, or the XML text itself.

        Parameters
        ----------
        path_or_xml
            Path of a URDF file, or its text (recognised by its leading ``<``). A joint of type
            ``floating`` becomes a free-flyer.
        closures, actuated, characteristic_length, max_condition
            As for the class.
        gravity
            Acceleration of gravity in world axes, shape (3,), m/s^2.

        Raises
        ------
        InputError
            If the file cannot be read, or gravity is no finite vector.
        MechanismError
            If it is no URDF, or as for the class.
        """
        model = model_from_urdf(path_or_xml)
        model.gravity.linear = checked_vector(gravity, 3, "gravity")
        return cls(
            model,
            closures,
            actuated,
            characteristic_length=characteristic_length,
            max_condition=max_condition,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Give copies, and other processes, scratch memory of their own."""
        return _rebuilt, (
            type(self),
            (self.model, self.closures, self.actuated),
            {
                "characteristic_length": self.characteristic_length,
                "max_condition": self.max_condition,
            },
        )

    # What it is made of ---------------------------------------------------------------------------

    @property
    def constraint_size(self) -> int:
        """Number of closure rows, nc."""
        return self._loops.size

    @property
    def characteristic_length(self) -> float:
        """Length that makes angles and lengths comparable, m."""
        return self._loops.length

    @property
    def actuated_indices(self) -> NDArray[np.intp]:
        """Indices of the actuated joints in a velocity vector, shape (na,)."""
        return self._actuated.copy()

    def rows(self, closure: str) -> slice:
        """Return the rows of a closure, by its name, in `constraint_forces` and `LoopErrors`.

        Raises
        ------
        MechanismError
            If there is no closure of that name; lists those there are.
        """
        return self._loops.rows(closure)

    # Position, velocity, acceleration -------------------------------------------------------------

    def loop_errors(
        self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None
    ) -> LoopErrors:
        """Return how far the loops are from closed at position, velocity and acceleration level.

        Parameters
        ----------
        q, v, a
            Configuration (nq,), velocity (nv,) and acceleration (nv,) as Pinocchio has them; v and
            a are zero if left out.
        """
        still = np.zeros(self.model.nv)
        return self._loops.errors(
            *self._checked_state(q, still if v is None else v, still if a is None else a)
        )

    def loop_gap(self, q: ArrayLike) -> float:
        """Return the largest gap between two closed frames, m.

        An angle between rigidly closed frames counts with the characteristic length as its lever.
        """
        return self._loops.worst(self._loops.gaps(checked_vector(q, self.model.nq, "q")))[0]

    def close(self, q_guess: ArrayLike) -> Array:
        """Return a configuration near a guess in which every loop is closed.

        The loops are closed by least-norm steps from the guess (see `closing`): the answer lies
        near it, and need not be the nearest. Joint limits are not considered.

        Parameters
        ----------
        q_guess
            Configuration, shape (nq,); quaternions need not be of unit length.

        Returns
        -------
        array
            Closed configuration, shape (nq,), gaps at most 1e-12 characteristic lengths.

        Raises
        ------
        InputError
            If the guess has the wrong shape, is not finite, or holds a quaternion of no length.
        ClosureError
            If the loops do not close from there; says by how much, and which.
        """
        guess = pin.normalize(self.model, checked_vector(q_guess, self.model.nq, "q_guess"))
        if not pin.isNormalized(self.model, guess, 1e-9):
            raise InputError("q_guess holds a quaternion of no length: it is no orientation")
        q = close_gaps(
            guess,
            gaps=lambda q: self._loops.row_scale * self._loops.gaps(q),
            jacobian=lambda q: self._scales[0] * self._loops.jacobian(q) * self._loops.column_scale,
            integrate=lambda q, step: pin.integrate(self.model, q, self._loops.column_scale * step),
            tolerance=_CLOSED * self.characteristic_length,
        )
        gap, closure = self._loops.worst(self._loops.gaps(q))
        if not gap <= _CLOSED * max(self.characteristic_length, 1.0):
            before, _ = self._loops.worst(self._loops.gaps(guess))
            raise ClosureError(
                f"the loops do not close from this guess: closure {closure!r} stays open by "
                f"{gap:.6g} m (largest gap of the guess: {before:.6g} m)",
                gap,
            )
        return q

    def velocity(self, q: ArrayLike, v_actuated: ArrayLike) -> Array:
        """Return the velocity that keeps the loops closed while the actuators move as asked.

        Solves J v = 0 for the passive rows: J_p v_p = -J_a v_a.

        Parameters
        ----------
        q
            Closed configuration, shape (nq,).
        v_actuated
            Velocities of the actuated joints, shape (na,).

        Returns
        -------
        array
            Velocity, shape (nv,).

        Raises
        ------
        SingularityError
            If the actuators do not determine the motion.
        ClosureError
            If no motion of the mechanism has these actuator velocities (redundant actuation).
        """
        q_ = checked_vector(q, self.model.nq, "q")
        rates = checked_vector(v_actuated, self._actuated.size, "v_actuated")
        return self._complete(self._loops.jacobian(q_), rates, np.zeros(self.constraint_size))

    def acceleration(self, q: ArrayLike, v: ArrayLike, a_actuated: ArrayLike) -> Array:
        """Return the acceleration that keeps the loops closed while the actuators accelerate so.

        Solves J a + J' v = 0 (J' the derivative) for the passive rows.

        Parameters
        ----------
        q, v
            Closed configuration (nq,) and a velocity that keeps it closed (nv,).
        a_actuated
            Accelerations of the actuated joints, shape (na,).

        Raises
        ------
        SingularityError, ClosureError
            As `velocity`; also if v itself opens the loops.
        """
        q_ = checked_vector(q, self.model.nq, "q")
        v_ = checked_vector(v, self.model.nv, "v")
        accelerations = checked_vector(a_actuated, self._actuated.size, "a_actuated")
        errors = self._loops.errors(q_, v_, np.zeros(self.model.nv))
        opening = float(np.abs(self._loops.row_scale * errors.velocity).max(initial=0.0))
        speed = float(np.abs(v_ / self._loops.column_scale).max(initial=0.0))
        if opening > _CONSISTENT * max(speed, 1.0):
            raise ClosureError(
                f"v opens the loops at {opening:.3g} m/s; complete it with velocity() first",
                opening,
            )
        return self._complete(self._loops.jacobian(q_), accelerations, errors.acceleration)

    def condition(self, q: ArrayLike) -> float:
        """Return the condition number of J_p: how near a configuration is to a singularity.

        J_p is the closures' Jacobian with respect to the passive joints, angles made lengths with
        `characteristic_length`. Its condition number is 1 at best and infinite where the actuators
        no longer determine the motion, or where a closure's rows fail (a parallel, or type II, or a
        constraint singularity). Its inverse is the relative distance to the nearest singular
        matrix, a number between 0 and 1.
        """
        jacobian = self._loops.jacobian(checked_vector(q, self.model.nq, "q"))
        return self._condition(jacobian)

    # Dynamics -------------------------------------------------------------------------------------

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> InverseDynamics:
        """Return the forces that make the mechanism move as asked: constrained RNEA (see module).

        For speed the motion is taken at its word: q must be closed, and v and a keep it so (as
        `close`, `velocity` and `acceleration` make them, or `loop_errors` shows).

        Parameters
        ----------
        q, v, a
            Configuration (nq,), velocity (nv,) and acceleration (nv,) as Pinocchio has them.

        Returns
        -------
        InverseDynamics
            `tau` (na,), `constraint_forces` (nc,), `residual`, `condition`.

        Raises
        ------
        InputError
            If an argument has the wrong shape or is not finite.
        SingularityError
            If the configuration is singular (condition number above `max_condition`), or actuators
            and mobility do not match.
        """
        model, data, calls, constraints, constraint_data = self._pinocchio
        try:
            force = rnea(model, data, q, v, a)
            computeJointJacobians(model, data, q)
        except (TypeError, ValueError):  # a list, an array of integers, or a wrong shape
            given, checked = (q, v, a), self._checked_state(q, v, a)
            if all(array is one for array, one in zip(checked, given, strict=True)):
                raise  # a complaint of Pinocchio's own
            return self.inverse_dynamics(*checked)
        for calc, scratch in calls:  # getConstraintsJacobian reads what they refresh
            calc(model, data, scratch)
        jacobian = getConstraintsJacobian(model, data, constraints, constraint_data)
        if not self._square:
            return self._inverse_dynamics_by_motions(
                jacobian.reshape(self.constraint_size, model.nv), force
            )

        factors, passive, size, order, harmless_rcond, scales = self._algebra
        passive_jacobian = jacobian.take(passive, axis=1)
        factors.compute(passive_jacobian.T)
        multipliers = factors.solve(force.take(passive))  # J_p' lambda = rnea_p
        if not factors.rcond() > harmless_rcond:
            self._checked_state(q, v, a)
            self._refuse_singular(jacobian)
        # rnea - J' lambda, the passive rows first: they are the residual, the actuated ones tau.
        rest = dgemv(-1.0, jacobian.T, multipliers, 1.0, force).take(order)
        residual = dnrm2(rest, size)
        if not residual < _INFINITY:
            self._checked_state(q, v, a)
        return InverseDynamics(rest[size:], multipliers, residual, (scales, passive_jacobian))

    def _inverse_dynamics_by_motions(self, jacobian: Array, force: Array) -> InverseDynamics:
        if not np.isfinite(force).all():
            raise InputError("q, v and a must be finite")
        self._refuse_singular(jacobian)
        tau, multipliers = solve_by_allowed_motions(
            self._loops.row_scale[:, None] * jacobian,
            self._actuated,
            force,
            self._loops.column_scale,
        )
        multipliers = self._loops.row_scale * multipliers
        rest = force - jacobian.T @ multipliers
        return InverseDynamics(
            tau,
            multipliers,
            float(np.linalg.norm(rest[self._passive])),
            (self._scales, jacobian[:, self._passive]),
        )

    # Inner workings -------------------------------------------------------------------------------

    def _complete(self, jacobian: Array, actuated: Array, drift: Array) -> Array:
        """Return x with x_a given and J x + drift = 0: J_p x_p = -J_a x_a - drift."""
        self._refuse_singular(jacobian)
        rows, columns = self._scales
        right = -rows[:, 0] * (jacobian[:, self._actuated] @ actuated + drift)
        left = rows * jacobian[:, self._passive] * columns
        scaled, *_ = np.linalg.lstsq(left, right, rcond=None)
        opening = float(np.abs(left @ scaled - right).max(initial=0.0))
        size = float(np.abs(right).max(initial=0.0))
        if opening > _CONSISTENT * max(size, 1e-3):
            raise ClosureError(
                f"no motion of the mechanism has these {self._actuated.size} actuated values: "
                f"the loops would open at a rate of {opening:.3g} (asked for: {size:.3g})",
                opening,
            )
        full = np.empty(self.model.nv)
        full[self._actuated] = actuated
        full[self._passive] = columns * scaled
        return full

    def _condition(self, jacobian: Array) -> float:
        rows, columns = self._scales
        return condition_number(rows * jacobian[:, self._passive] * columns)

    def _refuse_singular(self, jacobian: Array) -> None:
        condition = self._condition(jacobian)
        if not condition <= self.max_condition:
            raise SingularityError(
                "the actuated joints do not determine the motion here: the condition number is "
                f"{condition:.3g}, and at most {self.max_condition:.3g} is accepted",
                condition,
                self.max_condition,
            )

    def _checked_state(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike
    ) -> tuple[Array, Array, Array]:
        """Return q, v and a as finite arrays of the right shapes."""
        return (
            checked_vector(q, self.model.nq, "q"),
            checked_vector(v, self.model.nv, "v"),
            checked_vector(a, self.model.nv, "a"),
        )

    def _least_harmless_rcond(self) -> float:
        """Return the reciprocal condition estimate above which no closer look is needed.

        The estimate is in the 1-norm, without scaling, and rarely off by more than a factor of 3
        (Higham). The norms differ by at most a factor of the size, the scaling by at most the
        ratios of its factors; one of 100 is for the estimate.
        """
        if not self._square:
            return 0.0
        spread = sum(float(np.ptp(np.log(scale))) for scale in self._scales)
        return min(100 * self._passive.size * math.exp(spread) / self.max_condition, 1.0)

    def _velocity_indices(self, joints: Sequence[str]) -> NDArray[np.intp]:
        if not joints:
            raise MechanismError("a mechanism needs at least one joint to actuate")
        indices: list[int] = []
        for name in joints:
            if not self.model.existJointName(name) or name == "universe":
                names = ", ".join(list(self.model.names)[1:])
                raise MechanismError(f"no joint {name!r} to actuate; there are: {names}")
            joint = self.model.joints[self.model.getJointId(name)]
            indices.extend(range(joint.idx_v, joint.idx_v + joint.nv))
        return np.array(indices, dtype=np.intp)


def _rebuilt(
    cls: type[ClosedLoopModel], description: tuple[Any, ...], options: dict[str, Any]
) -> ClosedLoopModel:
    return cls(*description, **options)

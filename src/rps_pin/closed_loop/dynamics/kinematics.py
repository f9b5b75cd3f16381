"""Velocities and accelerations of a mechanism whose loops stay closed.

With J the closures' Jacobian, every velocity with J v = 0 is v = T u, u the velocities of some
joints that move independently of each other (S_i their rows): T = N (S_i N)^-1 for any basis N of
the motions with J N = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.assembly.positions import ClosedLoopPositions
from rps_pin.closed_loop.constraints.closures import Closure
from rps_pin.closed_loop.constraints.loops import refuse_twice
from rps_pin.closed_loop.dynamics.passive_factors import PassiveSolver
from rps_pin.errors import ClosureError, InputError, SingularityError
from rps_pin.numerics.linear_algebra import (
    condition_number,
    least_norm,
    null_space,
    singular_values,
)
from rps_pin.validation import real_vector

#: Past this condition number half of the digits are lost (1 / sqrt of the rounding unit), and no
#: machine is built well enough to know its forces.
MAX_CONDITION = 1e8

#: What `velocity` and `acceleration` accept of their arguments, relative to the rates given.
_CONSISTENT = 1e-8


class ClosedLoopKinematics(ClosedLoopPositions):
    """The kinematics of `ClosedLoopModel`, which see for the parameters."""

    def __init__(
        self,
        model: pin.Model,
        closures: Sequence[Closure],
        actuated: Sequence[str],
        *,
        home: ArrayLike | None = None,
        characteristic_length: float | None = None,
        max_condition: float = MAX_CONDITION,
    ) -> None:
        super().__init__(
            model, closures, actuated, home=home, characteristic_length=characteristic_length
        )
        if not max_condition >= 1:
            raise InputError(f"max_condition = {max_condition}: it must be at least 1")
        self.max_condition = max_condition
        self._solver = PassiveSolver(self._passive, self._actuated, *self._scales, max_condition)
        self._ones = np.eye(self._actuated.size)

    # Velocity and acceleration --------------------------------------------------------------------

    def jacobian(self, q: ArrayLike) -> Array:
        """Return J, shape (nc, nv): the rates of the closures' rows are J v (see `rows`)."""
        return self._loops.jacobian(real_vector(q, self.model.nq, "q")).copy()

    def allowed_motions(self, q: ArrayLike) -> Array:
        """Return a basis N of the velocities that keep the loops closed, shape (nv, mobility).

        J N = 0; the columns are orthonormal once angles are made lengths by
        `characteristic_length`.
        """
        scale = self._loops.column_scale
        jacobian = self._scaled(self._loops.jacobian(real_vector(q, self.model.nq, "q")))
        return scale[:, None] * null_space(jacobian)

    def motion_basis(self, q: ArrayLike, independent: Sequence[str] | None = None) -> Array:
        """Return T, shape (nv, m): v = T u, u the velocities of m joints moving independently.

        Parameters
        ----------
        q
            Closed configuration, shape (nq,).
        independent
            Names of the joints; the actuated ones if left out.

        Raises
        ------
        SingularityError
            If these joints do not determine the motion, or do not move independently, here.
        """
        chosen = self._independent(independent)
        if chosen is self._actuated:
            jacobian = self._loops.jacobian(real_vector(q, self.model.nq, "q"))
            solved = self._solver.solve(jacobian, jacobian.take(chosen, axis=1))
            if solved is not None:
                return self._basis(solved)
        motions = self.allowed_motions(q)
        own = motions[chosen]
        if own.shape[0] != own.shape[1]:
            raise SingularityError(
                f"{own.shape[0]} independent velocities are named, for a mobility of "
                f"{own.shape[1]} at this configuration",
                np.inf,
                self.max_condition,
            )
        # N is orthonormal in one unit: joints that take part in all motions have a block of size 1.
        scaled = own / self._loops.column_scale[chosen][:, None]
        smallest = float(singular_values(scaled).min(initial=1.0))
        condition = 1 / smallest if smallest > 0 else np.inf
        if not condition <= self.max_condition:
            raise SingularityError(
                "these joints do not determine the motion here: the condition number is "
                f"{condition:.3g}, and at most {self.max_condition:.3g} is accepted",
                condition,
                self.max_condition,
            )
        return np.asarray(np.linalg.solve(own.T, motions.T).T, dtype=np.float64)

    def frame_jacobian(
        self,
        q: ArrayLike,
        frame: str,
        independent: Sequence[str] | None = None,
        *,
        axes: Literal["world", "frame"] = "world",
    ) -> Array:
        """Return the closed-loop Jacobian of a frame, shape (6, m): its twist is this times u.

        Parameters
        ----------
        q
            Closed configuration, shape (nq,).
        frame
            Name of a frame of the model.
        independent
            The joints that u belongs to, as for `motion_basis`.
        axes
            Of the twist (linear, then angular, of the frame's origin): the world's or its own.

        Raises
        ------
        MechanismError
            If there is no such frame; lists those there are.
        SingularityError
            As `motion_basis`.
        """
        basis = self.motion_basis(q, independent)
        reference = self._reference(axes)
        jacobian = pin.computeFrameJacobian(
            self.model,
            self._loops.data,
            real_vector(q, self.model.nq, "q"),
            self._frame(frame),
            reference,
        )
        product: Array = jacobian.reshape(6, self.model.nv) @ basis
        return product

    def velocity(
        self, q: ArrayLike, v_actuated: ArrayLike, independent: Sequence[str] | None = None
    ) -> Array:
        """Return the velocity that keeps the loops closed while some joints move as asked.

        Solves J v = 0 for the other rows: J_p v_p = -J_a v_a.

        Parameters
        ----------
        q
            Closed configuration, shape (nq,).
        v_actuated
            Velocities of the actuated joints, shape (na,), or of those named.
        independent
            Names of the joints that move as asked, if not the actuated ones.

        Returns
        -------
        array
            Velocity, shape (nv,).

        Raises
        ------
        SingularityError
            If these joints do not determine the motion.
        ClosureError
            If no motion of the mechanism has these velocities (more joints than mobility).
        """
        q_ = real_vector(q, self.model.nq, "q")
        given = self._independent(independent)
        rates = real_vector(v_actuated, given.size, "v_actuated")
        still = np.zeros(self.constraint_size)
        return self._complete(self._loops.jacobian(q_), given, rates, still)

    def acceleration(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a_actuated: ArrayLike,
        independent: Sequence[str] | None = None,
    ) -> Array:
        """Return the acceleration that keeps the loops closed while some joints accelerate so.

        Solves J a + J' v = 0 (J' the derivative) for the other rows.

        Parameters
        ----------
        q, v
            Closed configuration (nq,) and a velocity that keeps it closed (nv,).
        a_actuated
            Accelerations of the actuated joints, shape (na,), or of those named.
        independent
            Names of the joints that accelerate as asked, if not the actuated ones.

        Raises
        ------
        SingularityError, ClosureError
            As `velocity`; also if v itself opens the loops.
        """
        q_ = real_vector(q, self.model.nq, "q")
        v_ = real_vector(v, self.model.nv, "v")
        given = self._independent(independent)
        accelerations = real_vector(a_actuated, given.size, "a_actuated")
        drift = self._loops.drift(q_, v_)
        jacobian = self._loops.jacobian(q_)
        opening = float(np.abs(self._loops.row_scale * (jacobian @ v_)).max(initial=0.0))
        speed = float(np.abs(self._units() * v_).max(initial=0.0))
        if opening > _CONSISTENT * max(speed, 1.0):
            raise ClosureError(
                f"v opens the loops at {opening:.3g} m/s; complete it with velocity() first",
                opening,
            )
        return self._complete(jacobian, given, accelerations, drift)

    def condition(self, q: ArrayLike) -> float:
        """Return the condition number of J_p: how near a configuration is to a singularity.

        J_p is the closures' Jacobian with respect to the passive joints, angles made lengths with
        `characteristic_length`. Its condition number is 1 at best and infinite where the actuators
        no longer determine the motion, or where a closure's rows fail (a parallel, or type II, or a
        constraint singularity). Its inverse is the relative distance to the nearest singular
        matrix, a number between 0 and 1.
        """
        jacobian = self._loops.jacobian(real_vector(q, self.model.nq, "q"))
        return self._condition(jacobian)

    # Inner workings -------------------------------------------------------------------------------

    def _basis(self, solved: Array) -> Array:
        """Return T, whose passive rows are -J_p^-1 J_a = -solved."""
        basis = np.zeros((self.model.nv, self._actuated.size))
        basis[self._passive], basis[self._actuated] = -solved, self._ones
        return basis

    def _complete(self, jacobian: Array, given: Indices, values: Array, drift: Array) -> Array:
        """Return x with x_a given and J x + drift = 0: J_p x_p = -J_a x_a - drift."""
        rest = self._passive
        if given is self._actuated:
            right = (jacobian.take(given, axis=1) @ values + drift)[:, None]
            solved = self._solver.solve(jacobian, right)
            if solved is not None:
                full = np.empty(self.model.nv)
                full[given], full[rest] = values, -solved[:, 0]
                return full
        else:
            rest = np.setdiff1d(np.arange(self.model.nv), given)
        rows, columns = self._scales[0], self._loops.column_scale[rest]
        left = rows * jacobian[:, rest] * columns
        self._refuse(condition_number(left))
        right = -rows[:, 0] * (jacobian[:, given] @ values + drift)
        scaled = least_norm(left, right)
        opening = float(np.abs(left @ scaled - right).max(initial=0.0))
        size = float(np.abs(right).max(initial=0.0))
        if opening > _CONSISTENT * max(size, 1e-3):
            raise ClosureError(
                f"no motion of the mechanism has these {given.size} actuated values: "
                f"the loops would open at a rate of {opening:.3g} (asked for: {size:.3g})",
                opening,
            )
        full = np.empty(self.model.nv)
        full[given] = values
        full[rest] = columns * scaled
        return full

    def _condition(self, jacobian: Array) -> float:
        rows, columns = self._scales
        return condition_number(rows * jacobian[:, self._passive] * columns)

    def _refuse_singular(self, jacobian: Array) -> None:
        self._refuse(self._condition(jacobian))

    def _refuse(self, condition: float) -> None:
        if not condition <= self.max_condition:
            raise SingularityError(
                "the actuated joints do not determine the motion here: the condition number is "
                f"{condition:.3g}, and at most {self.max_condition:.3g} is accepted",
                condition,
                self.max_condition,
            )

    def _independent(self, joints: Sequence[str] | None) -> Indices:
        if joints is None:
            return self._actuated
        refuse_twice("independent joint", list(joints))
        return self._velocity_indices(joints, "to move independently")

    def _reference(self, axes: str) -> Any:
        references = {
            "world": pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
            "frame": pin.ReferenceFrame.LOCAL,
        }
        if axes not in references:
            raise InputError(f"axes = {axes!r}; it must be 'world' or 'frame'")
        return references[axes]

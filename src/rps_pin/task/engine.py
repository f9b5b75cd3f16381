"""The Pinocchio engine with the batches that generated code has, for the maps of a task."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.codegen.engine.batches import Errors, by_samples
from rps_pin.one_thread import guarded


class Forces(NamedTuple):
    """Of inverse dynamics."""

    tau: Array
    """The actuators' forces, shape (..., na)."""


class PinocchioEngine:
    """Calls of a `ClosedLoopModel`, sample by sample; named as those of `CompiledMechanism`."""

    def __init__(self, mechanism: ClosedLoopModel) -> None:
        self._mechanism = mechanism
        model = mechanism.model
        self._nq, self._nv, self._count = model.nq, model.nv, mechanism.actuated_indices.size

    def complete(
        self,
        values: ArrayLike,
        q_guess: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        restarts: int = 20,
        errors: Errors = "raise",
    ) -> Array:
        """Return configurations with given actuated coordinates, (..., nq)."""
        guess = self._mechanism.home if q_guess is None else q_guess

        def answer(x: Array, q: Array) -> Array:
            return self._mechanism.complete(x, q, within_limits=within_limits, restarts=restarts)

        return self._each(answer, (values, guess), (self._nq,), errors)

    def continued(self, values: Array, q: Array) -> tuple[Array, Bools]:
        """Return configurations (n, nq) continued to actuated coordinates, and which of them are.

        What is returned of the others has no meaning.
        """
        found = self.complete(values, q, within_limits=False, restarts=0, errors="mask")
        return found, np.asarray(np.isfinite(found).all(axis=-1))

    def velocity(self, q: ArrayLike, v_actuated: ArrayLike, errors: Errors = "raise") -> Array:
        """Return velocities of given actuated ones, (..., nv)."""
        return self._each(self._mechanism.velocity, (q, v_actuated), (self._nv,), errors)

    def acceleration(
        self, q: ArrayLike, v: ArrayLike, a_actuated: ArrayLike, errors: Errors = "raise"
    ) -> Array:
        """Return accelerations of given actuated ones, (..., nv)."""
        return self._each(self._mechanism.acceleration, (q, v, a_actuated), (self._nv,), errors)

    def motion_basis(self, q: ArrayLike, errors: Errors = "raise") -> Array:
        """Return T, (..., nv, m)."""
        return self._each(self._mechanism.motion_basis, (q,), (self._nv, self._count), errors)

    @guarded("_mechanism.system.guard")
    def gaps(self, q: ArrayLike, errors: Errors = "raise") -> Array:
        """Return the gaps of the closures' rows, (..., nc)."""
        gaps = self._mechanism.system.equations.gaps
        return self._each(gaps, (q,), (self._mechanism.constraint_size,), errors)

    @guarded("_mechanism.system.guard")
    def closed(self, q: ArrayLike, errors: Errors = "raise") -> Array:
        """Return q, (..., nq), refused where the loops are open."""
        system = self._mechanism.system

        def answer(q: Array) -> Array:
            system.equations.jacobian(q)
            system.refuse_open(q)
            return q

        return self._each(answer, (q,), (self._nq,), errors)

    def frame_placement(self, q: ArrayLike, frame: str, errors: Errors = "raise") -> Array:
        """Return homogeneous placements of a frame, (..., 4, 4)."""

        def answer(q: Array) -> Array:
            return self._mechanism.frame_placement(q, frame)

        return self._each(answer, (q,), (4, 4), errors)

    def frame_jacobian(self, q: ArrayLike, frame: str, errors: Errors = "raise") -> Array:
        """Return Jacobians of a frame by the actuated coordinates, (..., 6, m), world axes."""

        def answer(q: Array) -> Array:
            return self._mechanism.frame_jacobian(q, frame)

        return self._each(answer, (q,), (6, self._count), errors)

    def jacobian(self, q: ArrayLike, errors: Errors = "raise") -> Array:
        """Return J, (..., nc, nv)."""
        shape = (self._mechanism.constraint_size, self._nv)
        return self._each(self._mechanism.jacobian, (q,), shape, errors)

    def mass_matrix(self, q: ArrayLike, errors: Errors = "raise") -> Array:
        """Return the reduced mass matrix, (..., m, m)."""
        return self._each(self._mechanism.mass_matrix, (q,), (self._count, self._count), errors)

    def inverse_dynamics(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, errors: Errors = "raise"
    ) -> Forces:
        """Return the actuators' forces of motions, (..., na)."""

        def answer(q: Array, v: Array, a: Array) -> Array:
            return self._mechanism.inverse_dynamics(q, v, a).tau

        return Forces(self._each(answer, (q, v, a), (self._count,), errors))

    @staticmethod
    def _each(
        answer: Callable[..., Any],
        given: Sequence[ArrayLike],
        shape: tuple[int, ...],
        errors: Errors,
    ) -> Array:
        return np.asarray(by_samples(lambda *x: (answer(*x),), given, [shape], errors)[0])

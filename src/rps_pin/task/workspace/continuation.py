"""Configurations continued from others in batches, in their assembly mode.

A way is the straight line of the task's coordinates from those of a closed configuration to others.
The Pinocchio engine follows it in steps of its own (`ClosedLoopModel.complete`). Generated code
divides it into up to 64 parts and asks in each that Newton's steps contract
(`CompiledMechanism.continued`). That is not enough beside a singularity, where two assembly modes
are near each other. A change of mode is a change of sign of

    det(U' A_1 V),   A_0 = U S V',

A_0 and A_1 the closures' Jacobians by all joints, the task held, at the ends of the way; of a
square A, of the sign of its determinant. It needs a configuration between in which A is singular,
so that A changes by as much as its least singular value. Where |A^-1| times the motion of all
joints is well below 1, there is none, and the sign is not looked at.

Where generated code fails or changes its mode, 31/32 of the rest of the way are tried, and then
what is left; the way is given up where these 31/32 fail. So a goal just before a singularity is
reached, down to 1e-7 of the way, and one beyond it costs two failures, some 40 us. A way that
passes a singularity within about a hundredth of its length can be given up too.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.numerics.linear_algebra import rank, singular_values
from rps_pin.task.task import Task

#: What is left of the rest of a way in the next try; and the least rest of a way.
_LEFT, _LEAST = 1 / 32, 1e-7
#: |T| times the motion of the joints, in characteristic lengths, from where signs are looked at.
_SUSPICIOUS = 0.2
#: Singular values of A below this, relative to the largest, are zero.
_ZERO = 1e-8


class Speeds(NamedTuple):
    """How joints move with the task's coordinates, at n configurations."""

    gain: Array
    """K = d(actuators)/d(task), shape (n, na, m); NaN where it does not exist."""
    steepness: Array
    """|T| of all joints' speeds in one unit, shape (n,), which stands for |A^-1|."""


class Continuation:
    """Continues configurations of a task.

    Parameters
    ----------
    task
        The task.
    start
        A configuration of the mode, shape (nq,), and its task coordinates, (m,).
    """

    def __init__(self, task: Task, start: tuple[Array, Array]) -> None:
        self._task, self._engine = task, task.engines[0]
        self._system = task.extended.system
        free = np.ones(task.extended.model.nv, dtype=bool)
        free[self._system.actuated] = False
        self._others = np.flatnonzero(free)
        self._nq, self._nv = task.mechanism.model.nq, task.mechanism.model.nv
        self._joint_units = task.mechanism.velocity_scale
        self._actuated = task.mechanism.actuated_indices
        length = task.mechanism.characteristic_length
        self._arcs = task.mechanism.system.arcs / length
        self._start = task.joined(*start)[None]

    def speeds(self, q: Array, x: Array) -> Speeds:
        """Return the speeds at configurations (n, nq) with task coordinates (n, m)."""
        if not self._task.compiled:
            gain = self._task.jacobian(q, x=x, errors="mask")
            return Speeds(gain, np.zeros(len(q)))
        basis = self._task.basis(q, x=x, errors="mask")
        scaled = basis / self._task.scale / self._joint_units[:, None]
        size = np.sqrt(np.einsum("nij,nij->n", scaled, scaled))
        return Speeds(basis[:, self._actuated], np.where(np.isfinite(size), size, np.inf))

    def __call__(
        self, q: Array, start: Array, goal: Array, steepness: Array
    ) -> tuple[Array, Bools]:
        """Return configurations (n, nq) at goals, and which of them are reached in their mode.

        What is returned of the others has no meaning.

        Parameters
        ----------
        q, start
            Closed configurations, shape (n, nq), and their task coordinates, (n, m).
        goal
            Task coordinates, shape (n, m).
        steepness
            That of `speeds` at q, shape (n,).
        """
        whole = self._task.joined(q, start)
        if not self._task.compiled:
            found, reached = self._engine.continued(goal, whole)
            return found[:, : self._nq], reached
        found, reached = self._tried(goal, whole, steepness)
        if not reached.all():
            left = np.flatnonzero(~reached)
            found[left], reached[left] = self._in_pieces(whole[left], start[left], goal[left])
        return found[:, : self._nq], reached

    def _tried(self, goal: Array, whole: Array, steepness: Array) -> tuple[Array, Bools]:
        """Return configurations of the extended mechanism at goals, and which are reached."""
        found, reached = self._engine.continued(goal, whole)
        motion = np.abs(found - whole)[:, : self._nq] * self._arcs
        with np.errstate(invalid="ignore"):
            suspicious = ~(steepness * motion.max(axis=-1) < _SUSPICIOUS) & reached
        at = np.flatnonzero(suspicious)
        reached[at] = self._same_sign(whole[at], found[at])
        return found, reached

    def _in_pieces(self, q: Array, start: Array, goal: Array) -> tuple[Array, Bools]:
        rest = np.ones(len(q))
        active = np.arange(len(q))
        steep = np.full(len(q), np.inf)
        while active.size:
            way = goal[active] - start[active]
            most = goal[active] - (_LEFT * rest[active])[:, None] * way
            moved, ok = self._tried(most, q[active], steep[active])
            active = active[ok]
            q[active] = moved[ok]
            rest[active] *= _LEFT
            moved, ok = self._tried(goal[active], q[active], steep[active])
            q[active[ok]] = moved[ok]
            rest[active[ok]] = 0.0
            active = active[~ok & (rest[active] > _LEAST)]
        return q, rest == 0

    def _same_sign(self, first: Array, second: Array) -> Bools:
        """Return whether no singularity lies between configurations of the extended mechanism."""
        count, sign = self._mode
        if not count:
            return np.ones(len(first), dtype=bool)
        B = self._by_others(second)
        if sign:
            return np.asarray(np.sign(np.linalg.det(B)) == sign)
        left, _, right = np.linalg.svd(self._by_others(first), full_matrices=False)
        left, right = left[..., :count], right[..., :count, :]
        product = np.swapaxes(left, -1, -2) @ B @ np.swapaxes(right, -1, -2)
        return np.asarray(np.linalg.det(product) > 0)

    def _by_others(self, whole: Array) -> Array:
        return self._system.scaled(self._engine.jacobian(whole))[..., self._others]

    @cached_property
    def _mode(self) -> tuple[int, float]:
        """The rank of A, and the sign of its determinant; 0 if it is not square and regular."""
        A = self._by_others(self._start)
        if not A.size:  # nothing but the task's own joints moves
            return 0, 0.0
        values = singular_values(A[0])
        count = rank(values / max(float(values[0]), 1e-300), _ZERO)
        square = A.shape[-2] == A.shape[-1] == count
        return count, float(np.sign(np.linalg.det(A[0]))) if square else 0.0

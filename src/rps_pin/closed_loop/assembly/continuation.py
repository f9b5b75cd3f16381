"""Following closed configurations while some coordinates move: the assembly mode is kept.

Coordinates x (of joints that are given) move on a straight line; the others, y, follow so that the
loops stay closed, e(x, y) = 0. With J = [A B] the closures' Jacobian by y and x, in one unit,

    A y' + B x' = 0,   y' = -A+ B x'

is the tangent (of least norm, where y is not determined), which predicts the end of a step. Chord
steps dy = -A+ e correct it, with the A of the step's beginning; Newton's steps with the A of its
end reach rounding error. A step from y_k to y_k+1 is taken if, A of rank r having the singular
vectors U, V and values S at its beginning,

    |S^-1 U' A_k+1 V - 1| <= 1/2,   |first chord step| <= |prediction| / 4,
    |second chord step| <= |first| / 4,

and nothing moves by more than 0.3 rad, or 0.3 characteristic lengths (of a frame that is farther
away than joints within limits let it: 0.3 of how much farther). The first bound says that no
singularity lies between: with A changing evenly, A is regular all along, and its determinant keeps
its sign. The others are the contraction that the theorem of Newton and Kantorovich asks for: the
steps end in the solution that continues y_k. Otherwise the step is shortened. Near a singularity A+
grows without bound, and the steps shrink to nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.assembly.closing import closed_gap
from rps_pin.closed_loop.assembly.reach import FarFrame
from rps_pin.closed_loop.constraints.rank_rule import largest
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.numerics.linear_algebra import rank

#: Largest relative change of A, and ratios of the corrections, in a step.
_CHANGE, _CONTRACTION = 0.5, 0.25
#: Largest motion in a step, rad or characteristic lengths.
_REACH = 0.3
#: Corrections below this, in characteristic lengths, are as good as none; and rounding error.
_SMALL, _ROUNDING = 1e-9, 1e-14
#: Gap that a step may leave in rows without influence, characteristic lengths.
_OPEN = 1e-8
#: The path ends in a singularity where a step is shorter than this share of it.
_SHORTEST = 1e-11
_MOST_STEPS = 20_000
_MOST_CORRECTIONS = 12
#: Singular values that count beside the beginning, but not there: above this, and above gaps, in
#: characteristic lengths, times a factor.
_NO_RANK, _OF_GAPS = 1e-8, 100.0
#: Share of B x' outside the range of A above which x cannot move so.
_INCONSISTENT = 1e-6


class Followed(NamedTuple):
    """How far a path was followed."""

    q: Array
    """The last configuration, shape (nq,)."""
    share: float
    """Share of the path that was followed; 1 if all of it."""
    condition: float
    """Condition number of A there."""
    consistent: bool
    """False where the closures do not let the given coordinates move so."""
    is_long: bool = False
    """Whether it ended after the most steps, at no singularity."""


class _Point:
    """A closed configuration, and the singular value decomposition of A there."""

    def __init__(self, path: Path, q: Array, size: int | None = None) -> None:
        system = path.system
        jacobian = system.scaled(system.equations.jacobian(q))
        self.q, self.others, self.given = q, jacobian[:, path.others], jacobian[:, path.given]
        self.gaps = system.row_scale * system.equations.current_gaps(q)
        left, values, right = np.linalg.svd(self.others, full_matrices=False)
        self.rank = rank(values, system.rule.tolerance)
        size = self.rank if size is None else size
        self.condition = 1.0 if size == 0 else np.inf
        if size and values[size - 1] > 0:
            self.condition = float(values[0] / values[size - 1])
        with np.errstate(divide="ignore"):
            self._inverse = left[:, :size] / values[:size]  # U / S
        self._right = right[:size].T
        #: The largest singular value that does not count, as `rank` sees it.
        self.beyond = float(values[size]) / largest(values) if values.size > size else 0.0
        #: The largest gap of rows that count.
        gaps = self.gaps if system.rule.rank is None else left[:, :size].T @ self.gaps
        self.open = float(np.abs(gaps).max(initial=0.0))

    def solve(self, right: Array) -> Array:
        """Return A+ b."""
        return np.asarray(self._right @ (self._inverse.T @ right))

    def change(self, other: _Point) -> float:
        """Return |S^-1 U' A V - 1|, A that of another point, by Frobenius' norm."""
        product = self._inverse.T @ other.others @ self._right
        return float(np.linalg.norm(product - np.eye(product.shape[0])))


class _SingularStart(Exception):  # noqa: N818 (no error: it is caught here)
    """The rank of A is larger beside the beginning than there."""


class Path:
    """The straight line of given coordinates from those of a closed configuration to others.

    Joints of several coordinates (balls, free-flyers) move on their geodesic.

    Parameters
    ----------
    system
        The system.
    given
        Velocities of the given joints, shape (k,).
    start
        A closed configuration, shape (nq,).
    target
        The same with the given coordinates as they are wanted, shape (nq,).
    far
        The output frame that the target puts beyond its reach, if it does.
    """

    def __init__(
        self,
        system: ConstraintSystem,
        given: Indices,
        start: Array,
        target: Array,
        far: FarFrame | None = None,
    ) -> None:
        self.system, self.given = system, given
        free = np.ones(system.model.nv, dtype=bool)
        free[given] = False
        self.others = np.flatnonzero(free)
        self._start, self._target = start, target
        self._rate = pin.difference(system.model, start, target)[given]
        self._scale, self._length = system.column_scale, system.equations.length
        rule = system.rule
        self._closed_gap = 10 * closed_gap(system, start) + rule.gap
        self._no_rank = max(_NO_RANK, rule.tolerance)
        self._inconsistent = max(_INCONSISTENT, rule.consistent)
        self._of_given = system.coordinates_of(given)
        self._far, self._angular = far, system.equations.angular_velocities

    def follow(self) -> Followed:
        """Follow the path to its end, or to a singularity."""
        limit = self.system.max_condition
        point = _Point(self, self._start)
        if self.system.rule.rank is not None:  # closed along U_1 of J, not quite along that of A
            self._closed(point, last=True)
            point = _Point(self, point.q)
        size, done, share = point.rank, 0.0, 1.0
        if not point.condition <= limit:
            return Followed(point.q, 0.0, point.condition, True)
        for _ in range(_MOST_STEPS):
            tangent, consistent = self._tangent(point)
            if not consistent:
                return Followed(point.q, done, point.condition, done > 0)
            share = min(share, 1 - done, self._longest(point.q, tangent))
            end = 1 - done <= share * (1 + 1e-9)
            try:
                reached, change = self._step(point, tangent, share, size, end)
            except _SingularStart:
                return Followed(point.q, 0.0, np.inf, True)
            if reached is not None:
                point, done = reached, 1.0 if end else done + share
                if end:
                    return Followed(point.q, 1.0, point.condition, True)
            share *= min(3.0, max(0.1, 0.8 * _CHANGE / max(change, 1e-9)))
            if share < _SHORTEST:
                return Followed(point.q, done, point.condition, True)
        return Followed(point.q, done, point.condition, True, is_long=True)

    def _longest(self, q: Array, tangent: Array) -> float:
        """Return the share of the path in which nothing moves too far."""
        moves = np.abs(tangent / self._scale)
        if self._far is not None:
            more = max(1.0, self._far.beyond(q) / self._length)
            moves = np.where(self._angular, moves, moves / more)
        return _REACH * self._length / max(float(moves.max(initial=0.0)), 1e-300)

    def _tangent(self, point: _Point) -> tuple[Array, bool]:
        """Return the velocity for the whole path in unit time, (nv,), and whether it is one."""
        wanted = point.given @ (self._rate / self._scale[self.given])
        along = point.solve(-wanted)
        rest = float(np.linalg.norm(point.others @ along + wanted))
        velocity = np.zeros(self.system.model.nv)
        velocity[self.given] = self._rate
        velocity[self.others] = self._scale[self.others] * along
        size = float(np.linalg.norm(self._rate / self._scale[self.given]))
        tolerance = max(self._inconsistent, self._of_gaps(point))
        return velocity, rest <= tolerance * size

    def _step(
        self, begin: _Point, tangent: Array, share: float, size: int, last: bool
    ) -> tuple[_Point | None, float]:
        """Return the point at a step's end, or None if it is too long; and the change of A."""
        model, rejected = self.system.model, 2 * _CHANGE
        move = share * tangent
        q = pin.integrate(model, begin.q, move)
        if last:
            q[self._of_given] = self._target[self._of_given]
        small, ahead = _SMALL * self._length, float(np.linalg.norm(move / self._scale))
        before = np.inf
        for k in range(2):  # chord steps
            correction = begin.solve(-self._gaps(q))
            length = float(np.linalg.norm(correction))
            if length > small and not length <= _CONTRACTION * (ahead if k == 0 else before):
                return None, rejected
            q, before = self._moved(q, correction), length
            if length <= small:
                break
        end = _Point(self, q, size)
        change = begin.change(end)
        if not (change <= _CHANGE and end.condition <= self.system.max_condition):
            return None, max(change, rejected) if np.isfinite(change) else rejected
        if not self._closed(end, last):
            return None, rejected
        if end.beyond > self._of_gaps(end) and _Point(self, end.q, size).beyond > self._no_rank:
            raise _SingularStart
        return end, change

    def _of_gaps(self, point: _Point) -> float:
        """Return the largest singular value that open loops give to rows that are redundant."""
        return max(self._no_rank, _OF_GAPS * point.open / self._length)

    def _closed(self, point: _Point, last: bool) -> bool:
        """Close the loops at a point by Newton's steps; to rounding error if it is the last."""
        enough = (_ROUNDING if last else _SMALL) * self._length
        gaps, before = point.gaps, np.inf
        for _ in range(_MOST_CORRECTIONS):
            correction = point.solve(-gaps)
            length = float(np.linalg.norm(correction))
            if length > _SMALL * self._length and not length <= _CONTRACTION * before:
                return False
            if length >= before / 2:  # rounding error
                break
            point.q = self._moved(point.q, correction)
            gaps, before = self._gaps(point.q), length
            if length <= enough:
                break
        # Rows that count nothing here must be closed by the others.
        return float(np.abs(gaps).max(initial=0.0)) <= _OPEN * self._length + self._closed_gap

    def _gaps(self, q: Array) -> Array:
        return np.asarray(self.system.row_scale * self.system.equations.gaps(q))

    def _moved(self, q: Array, step: Array) -> Array:
        velocity = np.zeros(self.system.model.nv)
        velocity[self.others] = self._scale[self.others] * step
        moved: Array = pin.integrate(self.system.model, q, velocity)
        return moved

"""Boxes over which no configuration closes, in any assembly mode: each leg by itself.

Given the output frame's pose, the equations fall apart into legs with unknowns of their own. If one
leg does not close at any pose of a box, within its joints' limits, nothing does. The unknowns of a
leg are cut into pieces; a piece is left out where bounds of an equation exclude zero. A leg that
does not close with limits of turning joints is tried without these, which tells why.

What legs share, the part of the output frame's pose that the task does not say, is bounded by how
far it may be from the start's.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.numerics.bits import Flags, bit_of, distinct
from rps_pin.numerics.intervals import Interval
from rps_pin.task.certification.equations import Equations
from rps_pin.task.certification.reasons import closed_beyond_limits, out_of_reach

#: Pieces of a leg's unknowns are no more than this for each box, and cut no oftener.
_PIECES, _DEPTH = 64, 12
#: Unknowns of a leg, at most: more make too many pieces.
_MOST_UNKNOWNS = 3
#: A little more than half a turn, rad.
_HALF_TURN = math.pi + 1e-9
#: Pieces evaluated at a time.
_BLOCK = 16_384


class _Leg(NamedTuple):
    """Equations with unknowns that no other ones have."""

    function: Any
    unknowns: Indices
    lower: Array
    upper: Array
    reason: str
    """Why nothing closes where it does not."""
    freer: _Leg | None
    """The same without limits of turning joints, if it has such."""


class Exclusion:
    """Proof that nothing closes.

    Parameters
    ----------
    equations
        Of the task.
    z
        The start's state, shape (nz,).
    free
        How far what the task does not say of the output frame's pose may be from the start's: each
        part, rad or characteristic lengths.
    """

    def __init__(self, equations: Equations, z: Array, free: float) -> None:
        self._equations, self._z = equations, z
        shared, size = equations.symbols.shared, equations.size
        self._lower, self._upper = np.full(size, -free), np.full(size, free)
        ranges = _ranges(equations, z)
        self._lower[shared:], self._upper[shared:] = ranges.lower[shared:], ranges.upper[shared:]
        self._legs = self._apart(ranges)
        told = [one.reason for leg in self._legs for one in (leg, leg.freer) if one]
        #: Names of the reasons, in the order of their bits.
        self.reasons = distinct(told)

    def _apart(self, ranges: _Ranges) -> list[_Leg]:
        """Return the legs whose unknowns are bounded, and few."""
        one = self._equations.symbols
        rows, columns = one.by_unknowns(one.gaps).sparsity().get_triplet()
        own = [(i, k) for i, k in zip(rows, columns, strict=True) if k >= one.shared]
        n = self._equations.size
        at = [i for i, _ in own], [n + k for _, k in own]
        graph = csr_array((np.ones(len(own)), at), shape=(2 * n, 2 * n))
        _, labels = connected_components(graph, directed=False)
        legs = []
        for label in np.unique(labels[:n]):
            of_leg = np.flatnonzero(labels == label)
            equations, unknowns = of_leg[of_leg < n], of_leg[of_leg >= n] - n
            finite = np.isfinite(self._lower[unknowns]) & np.isfinite(self._upper[unknowns])
            if finite.all() and len(unknowns) <= _MOST_UNKNOWNS:
                function = self._equations.function(one.gaps[equations.tolist()])
                legs.append(self._leg(function, unknowns, ranges))
        return legs

    def _leg(self, function: Any, unknowns: Indices, ranges: _Ranges) -> _Leg:
        """Return a leg, with its reasons."""
        limited = [int(k) for k in unknowns if ranges.limited[k]]
        turning = [k for k in limited if ranges.turning[k]]
        slides = [k for k in limited if k not in turning]
        reason = self._reason(unknowns, limited)
        if not turning:
            return _Leg(function, unknowns, *self._ends(unknowns), reason, None)
        lower, upper = self._ends(unknowns)
        whole = np.isin(unknowns, turning)
        wide = np.where(whole, -_HALF_TURN, lower), np.where(whole, _HALF_TURN, upper)
        freer = _Leg(function, unknowns, *wide, self._reason(unknowns, slides), None)
        return _Leg(function, unknowns, lower, upper, reason, freer)

    def _ends(self, unknowns: Indices) -> tuple[Array, Array]:
        return self._lower[unknowns], self._upper[unknowns]

    def _reason(self, unknowns: Indices, limited: list[int]) -> str:
        """Return why a leg does not close, within the limits of some of its unknowns."""
        if limited:
            return closed_beyond_limits([self._joint_of(k) for k in limited])
        return out_of_reach(list(dict.fromkeys(self._joint_of(int(k)) for k in unknowns)))

    def _joint_of(self, unknown: int) -> str:
        """Return the name of the joint of an unknown."""
        at = next(one.z.start for one in self._equations.unknowns
                  if one.y.start <= unknown < one.y.stop)  # fmt: skip
        model = self._equations.task.mechanism.model
        starts = [int(joint.idx_q) for joint in list(model.joints)[1:]]
        joint = int(np.searchsorted(starts, at, side="right"))
        return str(model.names[joint])

    def excluded(self, x: Array, half: Array) -> Flags:
        """Return over which boxes, of middles and half widths (n, m), nothing closes, shape (n,).

        Bits of the reasons, 0 where something may.
        """
        why = np.zeros(len(x), dtype=np.uint64)
        for leg in self._legs:
            out = np.flatnonzero(self._leg_excluded(leg, x, half))
            reason = np.full(len(out), bit_of(self.reasons, leg.reason))
            if leg.freer is not None and out.size:
                freer = self._leg_excluded(leg.freer, x[out], half[out])
                reason[freer] = bit_of(self.reasons, leg.freer.reason)
            why[out] |= reason
        return why

    def _leg_excluded(self, leg: _Leg, x: Array, half: Array) -> Bools:
        """Return over which boxes a leg does not close."""
        count, k = len(x), len(leg.unknowns)
        box = np.arange(count)
        low, high = (np.repeat(end[None], count, axis=0) for end in (leg.lower, leg.upper))
        widest = float(np.max(leg.upper - leg.lower, initial=0.0))
        size = half.max(axis=-1) / self._equations.task.mechanism.characteristic_length
        depth = np.ceil(np.log2(widest / np.maximum(size, 1e-12)))
        depth = np.minimum(depth, _DEPTH)
        corners = np.array(list(np.ndindex(*([2] * k))))
        hopeless = np.zeros(count, dtype=bool)
        for level in range(_DEPTH + 1):
            alive = self._alive(leg, x[box], half[box], low, high)
            box, low, high = box[alive], low[alive], high[alive]
            pieces = np.bincount(box, minlength=count)
            hopeless |= (pieces > _PIECES) | ((pieces > 0) & (level >= depth))
            kept = ~hopeless[box]
            box, low, high = box[kept], low[kept], high[kept]
            if not box.size:
                break
            middle = (low + high) / 2
            ends = np.stack([low, middle, high], axis=1)
            first = np.arange(k)
            low = np.concatenate([ends[:, corner, first] for corner in corners])
            high = np.concatenate([ends[:, corner + 1, first] for corner in corners])
            box = np.tile(box, len(corners))
        open_ = hopeless.copy()
        open_[box] = True
        return ~open_

    def _alive(self, leg: _Leg, x: Array, half: Array, low: Array, high: Array) -> Bools:
        """Return which pieces may hold a configuration."""
        found = np.ones(len(x), dtype=bool)
        for i in range(0, len(x), _BLOCK):
            part = slice(i, i + _BLOCK)
            n = len(x[part])
            lower, upper = (
                np.repeat(one[:, None], n, axis=1) for one in (self._lower, self._upper)
            )
            lower[leg.unknowns], upper[leg.unknowns] = low[part].T, high[part].T
            z = np.repeat(self._z[None], n, axis=0)
            box = Interval((x[part] - half[part]).T, (x[part] + half[part]).T).widened(0.0)
            with np.errstate(invalid="ignore", over="ignore"):
                (gaps,) = leg.function(*self._equations.inputs(z, box, Interval(lower, upper)))
            for gap in gaps:
                if isinstance(gap, Interval):
                    found[part] &= ~((gap.lower > 0) | (gap.upper < 0))
        return found


class _Ranges(NamedTuple):
    """What y may be, shape (unknowns,) each."""

    lower: Array
    upper: Array
    limited: Bools
    """Whether these are limits of a joint; else a whole turn."""
    turning: Bools
    """Whether a whole turn makes no difference."""


def _ranges(equations: Equations, z: Array) -> _Ranges:
    """Return the least and greatest y of joints' limits, or of a whole turn."""
    limited, turning = (np.zeros(equations.size, dtype=bool) for _ in range(2))
    lower, upper = np.full(equations.size, -np.inf), np.full(equations.size, np.inf)
    limits = equations.task.mechanism.system.limits
    of_limits = {int(q): k for k, q in enumerate(limits.q)}
    for one in equations.unknowns:
        at = one.y.start
        if one.kind == "pair":
            lower[at], upper[at] = -_HALF_TURN, _HALF_TURN
        if one.kind not in ("number", "turn") or one.z.start not in of_limits:
            continue
        k, here = of_limits[one.z.start], float(z[one.z.start])
        # Raised by more than the rounding of these, and of the tolerance of limits.
        low, high = (float(end[k]) - here for end in (limits.lower, limits.upper))
        lower[at] = low / one.unit - 1e-9 * (1 + abs(low) / one.unit)
        upper[at] = high / one.unit + 1e-9 * (1 + abs(high) / one.unit)
        turning[at] = one.kind == "turn"
        limited[at] = not turning[at] or upper[at] - lower[at] < 2 * math.pi
        if not limited[at]:
            lower[at], upper[at] = -_HALF_TURN, _HALF_TURN
    return _Ranges(lower, upper, limited, turning)

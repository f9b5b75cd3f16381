"""Boxes over which no configuration closes, in any assembly mode: each leg by itself.

Given the output frame's pose, the equations fall apart into legs with unknowns of their own. If one
leg does not close at any pose of a box, within its joints' limits, nothing does. The unknowns of a
leg are cut into pieces; a piece is left out where bounds of an equation exclude zero.

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
from rps_pin.numerics.intervals import Interval
from rps_pin.task.certification.equations import Equations

#: Pieces of a leg's unknowns are no more than this for each box, and cut no oftener.
_PIECES, _DEPTH = 64, 12
#: Unknowns of a leg, at most: more make too many pieces.
_MOST_UNKNOWNS = 3
#: Pieces evaluated at a time.
_BLOCK = 16_384


class _Leg(NamedTuple):
    """Equations with unknowns that no other ones have."""

    function: Any
    unknowns: Indices
    lower: Array
    upper: Array


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
        ends = _ranges(equations, z)
        self._lower[shared:], self._upper[shared:] = ends[0][shared:], ends[1][shared:]
        self._legs = self._apart()

    def _apart(self) -> list[_Leg]:
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
                ends = self._lower[unknowns], self._upper[unknowns]
                legs.append(_Leg(function, unknowns, *ends))
        return legs

    def excluded(self, x: Array, half: Array) -> Bools:
        """Return over which boxes, of middles and half widths (n, m), nothing closes."""
        out = np.zeros(len(x), dtype=bool)
        for leg in self._legs:
            at = np.flatnonzero(~out)
            out[at] = self._leg_excluded(leg, x[at], half[at])
        return out

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


def _ranges(equations: Equations, z: Array) -> tuple[Array, Array]:
    """Return the least and greatest y of joints' limits, or of a whole turn; (unknowns,) each."""
    lower, upper = np.full(equations.size, -np.inf), np.full(equations.size, np.inf)
    limits = equations.task.mechanism.system.limits
    of_limits = {int(q): k for k, q in enumerate(limits.q)}
    for one in equations.unknowns:
        at = one.y.start
        if one.kind == "pair":
            lower[at], upper[at] = -math.pi, math.pi
        if one.kind not in ("number", "turn") or one.z.start not in of_limits:
            continue
        k, here = of_limits[one.z.start], float(z[one.z.start])
        # Raised by more than the rounding of these, and of the tolerance of limits.
        low, high = (float(end[k]) - here for end in (limits.lower, limits.upper))
        lower[at] = low / one.unit - 1e-9 * (1 + abs(low) / one.unit)
        upper[at] = high / one.unit + 1e-9 * (1 + abs(high) / one.unit)
        if one.kind == "turn" and not upper[at] - lower[at] < 2 * math.pi:
            lower[at], upper[at] = -math.pi - 1e-9, math.pi + 1e-9
    return lower, upper

"""Boxes proven one beside the other, from that of the start: one assembly mode, never jumped.

Two boxes that touch have the same configurations if that of one, at a point of both, is within what
the other has alone. So boxes are joined to those that are joined to the start's. What is open at a
level is cut for the next: boxes over which nothing is proven, and those whose configurations are
proven but not whether these are inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.numerics.bits import Flags, distinct
from rps_pin.numerics.boxes import Ball, CertifiedBoxes, Places, Progress, ends_of, met
from rps_pin.numerics.intervals import Interval
from rps_pin.task.certification.equations import Equations
from rps_pin.task.certification.exclusion import Exclusion
from rps_pin.task.certification.margins import Margins
from rps_pin.task.certification.newton import LEAST, Sheets, sheets

#: Boxes worked on at a time.
_BLOCK = 2048
#: Gaps at the middle of a box that is not worth trying to exclude, in its half width.
_NEAR = 0.5
#: Errors of floats in what is compared, in the unit of y, far below `newton._LEAST`.
_ROUNDED = 1e-10
#: Changes of charts of balls lengthen differences by less than this, below 0.3 (Cayley's parameters
#: a and b of 0.3 at most: |1 + b^| / (1 - a b) + |a + b + b x a| |b| / (1 - a b)^2 < 1.5, times
#: sqrt(3) for largest entries).
_LONGER, _SMALL_TURN = 3.0, 0.3


class Start(NamedTuple):
    """Where the growth begins."""

    x: Array
    """Task coordinates, shape (m,)."""
    z: Array
    """State, shape (nz,)."""


@dataclass
class _Level:
    """Boxes of one level that are joined to the start, by their keys."""

    keys: list[Indices] = field(default_factory=list)
    sheets: list[Sheets] = field(default_factory=list)
    _sorted: tuple[Indices, Indices, Sheets] | None = None

    def add(self, keys: Indices, found: Sheets) -> None:
        self.keys.append(keys)
        self.sheets.append(found)
        self._sorted = None

    def look(self, keys: Indices) -> tuple[Bools, Indices]:
        """Return which of the keys are here, and where in `all`."""
        if not self.keys:
            return np.zeros(len(keys), dtype=bool), np.zeros(len(keys), dtype=np.intp)
        if self._sorted is None:
            keys_ = np.concatenate(self.keys)
            order = np.argsort(keys_)
            self._sorted = keys_[order], order, joined(self.sheets)
            self.keys, self.sheets = [keys_], [self._sorted[2]]
        known, order, _ = self._sorted
        at = np.minimum(np.searchsorted(known, keys), len(known) - 1)
        return known[at] == keys, order[at]

    @property
    def all(self) -> Sheets:
        assert self._sorted is not None
        return self._sorted[2]


def joined(parts: list[Sheets]) -> Sheets:
    """Return several as one."""
    return Sheets._make(np.concatenate(part) for part in zip(*parts, strict=True))


class Growth:
    """Growth over the boxes into which a box of task coordinates is cut."""

    def __init__(
        self,
        equations: Equations,
        margins: Margins,
        start: Start,
        lower: Array,
        upper: Array,
        *,
        exclusion: Exclusion,
        undecided: float,
        most_boxes: int,
        progress: Progress = iter,
        balls: Sequence[Ball] = (),
    ) -> None:
        self._balls = balls
        self._equations, self._margins, self._start = equations, margins, start
        self._lower, self._upper, self._exclusion = lower, upper, exclusion
        #: The bits of the exclusion's reasons follow those of the margins.
        self._reasons = distinct([*margins.reasons, *exclusion.reasons])
        self._undecided, self._most, self._progress = undecided, most_boxes, progress
        self._free = np.flatnonzero(upper > lower)
        self._bits = min(30, 62 // max(len(self._free), 1))
        self._levels: list[_Level] = []
        self._length = equations.task.mechanism.characteristic_length
        self._inside: list[Places] = []
        self._outside: list[Places] = []
        self._why: list[Flags] = []

    def run(self) -> CertifiedBoxes:
        """Return the boxes."""
        m = len(self._lower)
        halves = np.array(list(np.ndindex(*(1 + (self._upper > self._lower)))), dtype=np.int32)
        places = np.zeros((1, 1 + m), dtype=np.int32)
        from_ = np.full(1, -1, dtype=np.intp)  # of which sheet each place is a part
        guess = self._start.z[None].copy()
        above: Sheets | None = None
        while True:
            ends = ends_of(places, self._lower, self._upper)
            meets, _ = met(self._balls, Interval(*(end.T for end in ends)))
            places, from_, guess = places[meets], from_[meets], guess[meets]
            places, parts, above, from_, guess = self._level(places, above, from_, guess)
            none = np.zeros((0, 1 + m), dtype=np.int32)
            inside, outside = (
                np.concatenate([none, *one]) for one in (self._inside, self._outside)
            )
            why = np.concatenate([np.zeros(0, dtype=np.uint64), *self._why])
            found = CertifiedBoxes(
                *(self._lower, self._upper, (inside, outside, places), parts),
                *(self._reasons, why),
            )
            small = found.share_undecided <= self._undecided
            deep = len(self._levels) > self._bits
            if not len(places) or small or deep or len(places) > self._most:
                return found
            cut = np.repeat(places, len(halves), axis=0)
            cut[:, 0] += 1
            cut[:, 1:] = (1 + (self._upper > self._lower)) * cut[:, 1:] + np.tile(
                halves, (len(places), 1)
            )
            places, from_ = cut, np.repeat(from_, len(halves))
            guess = np.repeat(guess, len(halves), axis=0)

    # One level ------------------------------------------------------------------------------------

    def _level(
        self, places: Places, above: Sheets | None, from_: Indices, guess: Array
    ) -> tuple[Places, Array, Sheets | None, Indices, Array]:
        """Decide what can be decided of boxes of one level, and return the others."""
        work = _Work(places, from_, *self._middles(places), guess)
        self._levels.append(_Level())
        if above is not None:
            self._within(work, above)
        self._flood(work)
        self._exclude(work)
        outside = work.why != 0
        for one, into in ((work.inside, self._inside), (outside, self._outside)):
            into.append(places[one])
        self._why.append(work.why[outside])
        rest = np.flatnonzero(~(work.inside | outside))
        parts = work.shares[rest]
        kept, sources = [], np.full(len(rest), -1, dtype=np.intp)
        count = 0
        if work.found:
            new = joined(work.found)
            at = np.full(len(places), -1, dtype=np.intp)
            at[np.concatenate(work.found_at)] = np.arange(len(new.x))
            here = at[rest] >= 0
            kept.append(new.taken(at[rest][here]))
            sources[here] = np.arange(count := int(here.sum()))
        old = np.flatnonzero((sources < 0) & (from_[rest] >= 0))
        if old.size and above is not None:
            kept.append(above.taken(from_[rest][old]))
            sources[old] = count + np.arange(len(old))
        return places[rest], parts, joined(kept) if kept else None, sources, work.guess[rest]

    def _middles(self, places: Places) -> tuple[Array, Array]:
        """Return middles and half widths of boxes, (n, m) each; no narrower than they are."""
        low, high = ends_of(places, self._lower, self._upper)
        middle = (low + high) / 2
        half = np.maximum(high - middle, middle - low)
        return middle, np.where(half > 0, np.nextafter(half, np.inf), 0.0)

    def _within(self, work: _Work, above: Sheets) -> None:
        """Prove boxes that are parts of boxes that are joined to the start already."""
        at = np.flatnonzero(work.from_ >= 0)
        for i in self._progress(range(0, len(at), _BLOCK)):
            block = at[i : i + _BLOCK]
            self._prove(work, block, above.taken(work.from_[block]), work.x[block], store=False)

    def _flood(self, work: _Work) -> None:
        """Join boxes to their neighbours, front by front."""
        keys = self._keys(work.places[:, 1:])
        order = np.argsort(keys)
        known = keys[order]
        level = int(work.places[0, 0]) if len(work.places) else 0
        fresh = work.from_ < 0
        front = self._from_start(work, fresh)
        for coarser in range(level):
            front = np.concatenate([front, self._beside(work, fresh, coarser)])
        while front.size:
            following = []
            for step in self._steps():
                beside = work.places[front, 1:] + step
                ok = ((beside >= 0) & (beside < 2**level)).all(axis=-1)
                wanted = self._keys(beside[ok])
                if not wanted.size:
                    continue
                at = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
                there = known[at] == wanted
                index, source = order[at[there]], front[ok][there]
                new = fresh[index]
                index, first = np.unique(index[new], return_index=True)
                source = source[new][first]
                fresh[index] = False
                following.append(self._join(work, index, source, -step, level))
            front = np.concatenate(following) if following else np.zeros(0, dtype=np.intp)

    def _steps(self) -> list[Array]:
        return [
            way * np.eye(len(self._lower), dtype=np.int32)[k] for k in self._free for way in (-1, 1)
        ]

    def _keys(self, at: Places) -> Indices:
        found = np.zeros(len(at), dtype=np.intp)
        for k in self._free:
            found = (found << self._bits) | at[:, k]
        return found

    def _from_start(self, work: _Work, fresh: Bools) -> Indices:
        """Prove the boxes that hold the start."""
        x, z = self._start
        within = (np.abs(x - work.x) <= work.half * (1 + 1e-12) + 1e-15).all(axis=-1)
        at = np.flatnonzero(within & fresh)
        if not at.size:
            return at
        fresh[at] = False
        n, size, m = len(at), self._equations.size, len(x)
        x_, half, z_ = (np.repeat(one[None], n, axis=0) for one in (x, np.zeros(m), z))
        slopes, none = np.zeros((n, size, m)), np.zeros((n, size))
        near, proven = np.full((n, size), LEAST), np.ones(n, dtype=bool)
        source = Sheets(x_, half, z_, slopes, slopes, none, none, near, proven)
        return self._prove(work, at, source, x_, store=True)

    def _beside(self, work: _Work, fresh: Bools, coarser: int) -> Indices:
        """Prove boxes beside coarser ones that are joined to the start."""
        joined_ = self._levels[coarser]
        level = int(work.places[0, 0])
        front = []
        for step in self._steps():
            at = np.flatnonzero(fresh)
            beside = work.places[at, 1:] + step
            at, beside = (
                one[((beside >= 0) & (beside < 2**level)).all(axis=-1)] for one in (at, beside)
            )
            there, source = joined_.look(self._keys(beside >> (level - coarser)))
            at = at[there]
            if not at.size:
                continue
            fresh[at] = False
            front.append(self._in_blocks(work, at, joined_.all.taken(source[there]), step))
        return np.concatenate(front) if front else np.zeros(0, dtype=np.intp)

    def _join(self, work: _Work, at: Indices, source: Indices, step: Array, level: int) -> Indices:
        """Prove boxes from neighbours of the same level, the neighbour a step on."""
        if not at.size:
            return at
        there, where = self._levels[level].look(self._keys(work.places[source, 1:]))
        assert there.all()
        return self._in_blocks(work, at, self._levels[level].all.taken(where), step)

    def _in_blocks(self, work: _Work, at: Indices, source: Sheets, step: Array) -> Indices:
        found = []
        for i in self._progress(range(0, len(at), _BLOCK)):
            block = at[i : i + _BLOCK]
            point = work.x[block] + step * work.half[block]
            part = source.taken(np.arange(i, i + len(block)))
            found.append(self._prove(work, block, part, point, store=True))
        return np.concatenate(found)

    def _prove(
        self, work: _Work, at: Indices, source: Sheets, point: Array, *, store: bool
    ) -> Indices:
        """Prove boxes with the configurations of a source, which has `point` in common with each.

        Returns which are joined to it.
        """
        equations, x = self._equations, work.x[at]
        guess = equations.moved(source.z, _linear(source, x))
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            z = equations.closed(guess, x)
        there = np.flatnonzero(np.isfinite(z).all(axis=-1))
        work.closed[at[there]] = True
        work.guess[at[there]] = z[there]
        if not there.size:
            return at[:0]
        found = sheets(equations, z[there], x[there], work.half[at[there]])
        same = found.proven & self._same(source.taken(there), found, point[there])
        ok = np.flatnonzero(same)
        joined_, one = at[there[ok]], found.taken(ok)
        if ok.size:
            judged = self._margins.judged(one)
            work.inside[joined_], work.why[joined_] = judged.inside, judged.why
            work.shares[joined_] = judged.shares
            work.joined[joined_] = True
            work.found.append(one)
            work.found_at.append(joined_)
            if store:
                self._levels[-1].add(self._keys(work.places[joined_, 1:]), one)
        return joined_

    def _same(self, source: Sheets, found: Sheets, point: Array) -> Bools:
        """Return whether sources and others have the same configuration at points of both.

        That at a point is found in floats, and proven to be within a bound.
        """
        at_middle = (point == found.x).all(axis=-1)
        z, within = found.z.copy(), found.at_middle.copy()
        ok = np.ones(len(point), dtype=bool)
        aside = np.flatnonzero(~at_middle & found.proven)
        if aside.size:
            x = point[aside]
            guess = self._equations.moved(found.z[aside], _linear(found.taken(aside), x))
            with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
                z[aside] = self._equations.closed(guess, x)
            there = np.isfinite(z[aside]).all(axis=-1)
            z[aside[~there]] = found.z[aside[~there]]
            exact = sheets(self._equations, z[aside], x, np.zeros(x.shape))
            ok[aside] = there & exact.proven
            within[aside] = exact.within
        return ok & self._holds(source, point, z, within) & self._holds(found, point, z, within)

    def _holds(self, one: Sheets, point: Array, z: Array, within: Array) -> Bools:
        """Return whether configurations within bounds of z, at points, are those of sheets."""
        y = self._equations.apart(one.z, z)
        error = within.copy()
        ok = np.ones(len(point), dtype=bool)
        for unknown in self._equations.unknowns:
            if unknown.kind == "quaternion":
                here = unknown.y
                error[:, here] = _LONGER * error[:, here].max(axis=-1, keepdims=True)
                ok &= (np.abs(y[:, here]) < _SMALL_TURN).all(axis=-1)
        away = np.abs(y - _linear(one, point))
        return np.asarray(ok & (away + error + _ROUNDED <= one.alone).all(axis=-1))

    def _exclude(self, work: _Work) -> None:
        """Prove of boxes that are not joined that there is no configuration."""
        at = np.flatnonzero(~(work.closed | (work.from_ >= 0)))
        for i in self._progress(range(0, len(at), _BLOCK)):
            block = at[i : i + _BLOCK]
            with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
                z, gap = self._equations.nearest(work.guess[block], work.x[block])
            good = np.isfinite(z).all(axis=-1)
            work.guess[block[good]] = z[good]
            # A leg that closes, or nearly, at the middle closes somewhere in the box.
            block = block[~(gap < _NEAR * work.half[block].max(axis=-1) / self._length)]
            legs = self._exclusion.excluded(work.x[block], work.half[block])
            work.why[block] = legs << np.uint64(len(self._margins.reasons))


@dataclass
class _Work:
    """Boxes of one level, and what is known of them."""

    places: Places
    from_: Indices
    x: Array
    half: Array
    guess: Array
    """States in floats, closed at the middles or near."""
    inside: Bools = field(init=False)
    why: Flags = field(init=False)
    """Reasons of boxes outside, 0 of others."""
    joined: Bools = field(init=False)
    closed: Bools = field(init=False)
    """Whether a configuration was found in floats, at the middle."""
    shares: Array = field(init=False)
    found: list[Sheets] = field(default_factory=list)
    found_at: list[Any] = field(default_factory=list)

    def __post_init__(self) -> None:
        n = len(self.places)
        self.inside, self.joined, self.closed = (np.zeros(n, dtype=bool) for _ in range(3))
        self.why = np.zeros(n, dtype=np.uint64)
        self.shares = np.zeros((n, 2))


def _linear(one: Sheets, x: Array) -> Array:
    """Return S (x - x_0), shape (n, unknowns)."""
    return np.asarray(np.einsum("nij,nj->ni", one.slopes, x - one.x))

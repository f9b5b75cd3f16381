"""Boxes of numbers of which something is proven, or its contrary, by bounds and by cutting.

What is to be proven is that some margins, functions of the numbers, are positive. Bounds of each
over a box prove it, or the contrary; boxes of which neither is proven are halved along each edge. A
margin that is proven of a box is not asked again of its parts. Of the boxes that are left, shares
are proven all the same where planes bound them (`Enclosure.share_above`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError
from rps_pin.numerics.intervals import Enclosure, Interval
from rps_pin.validation import non_negative_number, real_vector, whole_number

Verdict = Literal["inside", "outside", "partly", "undecided"]
#: Places of a box among those of its size: its level, and counts from the least corner.
Places = NDArray[np.int32]
Progress = Callable[[Iterable[int]], Iterable[int]]

#: Boxes worked on at a time: few enough for a processor's cache.
_BLOCK = 4096
_MOST_LEVELS = 30


class Bounds(NamedTuple):
    """What is known of a margin over boxes, shape (n,) each."""

    positive: Bools
    """Whether it is proven to be positive."""
    negative: Bools
    """Whether it is proven to be negative."""
    share_positive: Array
    """Share of each box in which it is proven to be positive."""
    share_negative: Array
    """The same, negative."""


class Ball(NamedTuple):
    """A disc or a ball of some coordinates, to which what is asked is restricted."""

    columns: Sequence[int]
    centre: Array
    radius: float

    def met(self, box: Interval) -> tuple[Bools, Interval]:
        """Return which boxes (m, n) meet it, and boxes that hold what they have of it."""
        columns, at = list(self.columns), self.centre[:, None]
        near = np.maximum(np.maximum(box.lower[columns] - at, at - box.upper[columns]), 0.0)
        # Raised by more than the rounding of all this.
        most = self.radius + 1e-12 * (self.radius + float(np.abs(self.centre).max()))
        squared = (near * near).sum(axis=0)
        reach = np.sqrt(np.maximum(most * most - (squared - near * near), 0.0)) * (1.0 + 1e-12)
        reach += 1e-12 * most
        low, high = box.lower.copy(), box.upper.copy()
        low[columns] = np.maximum(low[columns], at - reach)
        high[columns] = np.minimum(high[columns], at + reach)
        meets = squared <= most * most
        return meets, Interval(np.where(meets, low, box.lower), np.where(meets, high, box.upper))


def met(balls: Sequence[Ball], box: Interval) -> tuple[Bools, Interval]:
    """Return which boxes (m, n) meet all balls, and boxes that hold what they have of these."""
    meets = np.ones(box.lower.shape[1], dtype=bool)
    for ball in balls:
        here, box = ball.met(box)
        meets &= here
    return meets, box


#: Bounds of some margins over boxes of shape (coordinates, n).
Group = Callable[[Interval], Sequence[Bounds]]


@dataclass(frozen=True, eq=False)
class CertifiedBoxes:
    """A box of coordinates, cut into boxes that are proven inside or outside.

    Where discs or balls were given (`round`), what is proven of a box is so of its points in these,
    "outside" perhaps of others too; boxes without such points are in none of the three. Volumes are
    those of whole boxes.
    """

    lower: Array
    """Least coordinates of the box, shape (m,)."""
    upper: Array
    """Greatest coordinates, shape (m,); equal to the least where a coordinate is held."""
    places: tuple[Places, Places, Places]
    """Of the boxes inside, outside and undecided, shape (n, 1 + m) each."""
    parts: Array
    """Shares of each undecided box that are proven inside and outside, by planes, shape (n, 2)."""

    def __repr__(self) -> str:
        counts = (len(self.inside), len(self.outside), len(self.undecided))
        whole = sum(self.volumes)
        told = ", ".join(
            f"{name} {share / whole:.3%} ({count:,} boxes)"
            for name, share, count in zip(
                ("inside", "outside", "undecided"), self.volumes, counts, strict=True
            )
        )
        return f"<CertifiedBoxes {self.lower.tolist()} to {self.upper.tolist()}: {told}>"

    @property
    def inside(self) -> Array:
        """Boxes proven inside, shape (n, 2, m): their least and greatest coordinates."""
        return self._boxes(0)

    @property
    def outside(self) -> Array:
        """Boxes proven outside, shape (n, 2, m)."""
        return self._boxes(1)

    @property
    def undecided(self) -> Array:
        """Boxes of which neither is proven, shape (n, 2, m)."""
        return self._boxes(2)

    @property
    def volumes(self) -> tuple[float, float, float]:
        """Volumes inside, outside and undecided, in the product of the units; `parts` count.

        Of the coordinates that are not held.
        """
        edges = (self.upper - self.lower)[self.upper > self.lower]
        whole = float(np.prod(edges))
        inside, outside, cut = (
            whole * np.ldexp(1.0, -len(edges) * one[:, 0]) for one in self.places
        )
        sums = [float(one.sum()) for one in (inside, outside, *(cut * self.parts.T))]
        return sums[0] + sums[2], sums[1] + sums[3], float(cut.sum()) - sums[2] - sums[3]

    @property
    def share_undecided(self) -> float:
        """The undecided volume over that inside; infinite if nothing is inside."""
        inside, _, undecided = self.volumes
        return undecided / inside if inside else math.inf

    @property
    def verdict(self) -> Verdict:
        """What is proven of the whole box.

        ``"partly"``: parts are inside and parts are outside.
        """
        inside, outside, _ = (volume > 0.0 for volume in self.volumes)
        if inside and outside:
            return "partly"
        if len(self.places[2]):
            return "undecided"
        return "inside" if inside else "outside"

    def _boxes(self, which: int) -> Array:
        return np.moveaxis(np.array(ends_of(self.places[which], self.lower, self.upper)), 0, 1)


def prove(
    groups: Mapping[str, tuple[int, Group]],
    lower: Array,
    upper: Array,
    *,
    undecided: float,
    most_boxes: int,
    progress: Progress = iter,
    balls: Sequence[Ball] = (),
) -> CertifiedBoxes:
    """Return which parts of a box are proven to have positive margins.

    Parameters
    ----------
    groups
        Margins that are bounded together, by name: how many, and their bounds. The cheapest first.
    lower, upper
        The box, shape (m,) each; a coordinate is held where they are equal.
    undecided
        Undecided share of the volume inside at which the cutting ends.
    most_boxes
        It ends also where this many boxes are undecided.
    progress
        Wraps the loops over blocks of boxes.
    balls
        Points outside of these do not count: boxes that do not meet them are left out.

    Raises
    ------
    InputError
        If a number that ends the cutting is not one.
    """
    undecided = non_negative_number(undecided, "undecided")
    whole_number(most_boxes, "most_boxes", least=1)
    halves = np.array(list(np.ndindex(*(1 + (upper > lower)))), dtype=np.int32)
    places = np.zeros((1, 1 + len(lower)), dtype=np.int32)
    asked = np.ones((1, sum(count for count, _ in groups.values())), dtype=bool)
    decided: tuple[list[Places], list[Places]] = ([], [])
    while True:
        left: list[tuple[Places, Bools, Array]] = []
        for i in progress(range(0, len(places), _BLOCK)):
            block, open_ = places[i : i + _BLOCK], asked[i : i + _BLOCK]
            meets, box = met(balls, Interval(*(end.T for end in ends_of(block, lower, upper))))
            block, open_, box = block[meets], open_[meets], box[:, meets]
            with np.errstate(invalid="ignore", over="ignore"):  # no bounds: NaN proves nothing
                out, parts = _judged(groups, box, open_)
            proven = ~open_.any(axis=1) & ~out
            decided[0].append(block[proven])
            decided[1].append(block[out])
            rest = ~(proven | out)
            left.append((block[rest], open_[rest], parts[rest] * (0.0 if balls else 1.0)))
        places, asked, parts = (np.concatenate(one) for one in zip(*left, strict=True))
        inside, outside = (np.concatenate(one) for one in decided)
        found = CertifiedBoxes(lower, upper, (inside, outside, places), parts)
        deep = len(places) and places[0, 0] >= _MOST_LEVELS
        small = found.share_undecided <= undecided
        if not len(places) or deep or small or len(places) > most_boxes or len(halves) == 1:
            return found
        cut = np.repeat(places, len(halves), axis=0)
        cut[:, 0] += 1
        cut[:, 1:] = (1 + (upper > lower)) * cut[:, 1:] + np.tile(halves, (len(places), 1))
        places, asked = cut, np.repeat(asked, len(halves), axis=0)


def checked_box(
    lower: ArrayLike, upper: ArrayLike, size: int, *, held: bool = False
) -> tuple[Array, Array]:
    """Return the ends of a box, shape (size,) each.

    Parameters
    ----------
    lower, upper
        As they are given.
    size
        Number of coordinates.
    held
        Whether some of the coordinates may be held: lower and upper are equal.

    Raises
    ------
    InputError
        If they are not of that shape, or the box is empty.
    """
    low, high = real_vector(lower, size, "lower"), real_vector(upper, size, "upper")
    apart = low < high
    if not (apart.any() and (low <= high).all() if held else apart.all()):
        raise InputError(
            f"the box from {low.tolist()} to {high.tolist()} is empty: lower must be below upper"
        )
    return low, high


def bounded(margins: Callable[..., Sequence[Any]], box: Interval, slack: float) -> list[Bounds]:
    """Return bounds of functions of the coordinates, by slopes over boxes (m, n).

    `margins` takes the coordinates, as enclosures and as intervals. Values within `slack` of zero
    are not proven to be negative.
    """
    middle = Interval((box.lower + box.upper) / 2)
    offsets = box - middle
    over = margins(*Enclosure.coordinates(box))
    at = margins(*(middle[i] for i in range(len(box.lower))))
    found = []
    for margin, centre in zip(over, at, strict=True):
        values = margin.about(centre, offsets)
        above = margin.share_above(centre, offsets)
        below = (-margin).share_above(-(centre + slack), offsets)
        found.append(Bounds(values.lower > 0.0, values.upper < -slack, above, below))
    return found


def _judged(
    groups: Mapping[str, tuple[int, Group]], box: Interval, asked: Bools
) -> tuple[Bools, Array]:
    """Return which boxes are outside, and the shares of each inside and outside, (n, 2).

    What is proven of a box is cleared in `asked`.
    """
    out = np.zeros(len(asked), dtype=bool)
    inside, outside = np.ones(len(asked)), np.zeros(len(asked))
    first = 0
    for count, bounds_of in groups.values():
        columns = range(first, first := first + count)
        which = np.flatnonzero(asked[:, columns].any(axis=1) & ~out)
        if not which.size:
            continue
        for column, margin in zip(columns, bounds_of(box[:, which]), strict=True):
            asked[which, column] &= ~margin.positive
            out[which] |= margin.negative
            inside[which] -= np.where(margin.positive, 0.0, 1.0 - margin.share_positive)
            outside[which] = np.maximum(outside[which], margin.share_negative)
    return out, np.stack([np.maximum(inside, 0.0), outside], axis=-1)


def ends_of(places: Places, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the least and greatest coordinates of boxes, (n, m) each; equal where they touch."""
    parts = np.ldexp(1.0, -places[:, :1])
    at = places[:, 1:].astype(np.float64)

    def corner(share: Array) -> Array:
        return np.where(share < 1.0, lower + (upper - lower) * share, upper)

    return corner(at * parts), corner((at + 1.0) * parts)

"""Proofs over boxes by bounds of margins and by cutting.

What is to be proven is that some margins, functions of the numbers, are positive. Bounds of each
over a box prove it, or the contrary; boxes of which neither is proven are halved along each edge. A
margin that is proven of a box is not asked again of its parts. Of the boxes that are left, shares
are proven all the same where planes bound them (`Enclosure.share_above`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError
from rps_pin.numerics.bits import Flags, bit_of, distinct
from rps_pin.numerics.boxes.balls import Ball, met
from rps_pin.numerics.boxes.bounds import Bounds
from rps_pin.numerics.boxes.found import CertifiedBoxes, Places, ends_of
from rps_pin.numerics.intervals import Interval
from rps_pin.validation import non_negative_number, real_vector, whole_number

Progress = Callable[[Iterable[int]], Iterable[int]]

#: Boxes worked on at a time: few enough for a processor's cache.
_BLOCK = 4096
_MOST_LEVELS = 30

#: Bounds of some margins over boxes of shape (coordinates, n).
Group = Callable[[Interval], Sequence[Bounds]]
#: Groups by name: the reasons of boxes in which a margin is negative, one for each, and the bounds.
Groups = Mapping[str, tuple[Sequence[str], Group]]


def prove(
    groups: Groups,
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
        Margins that are bounded together, the cheapest first.
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
        If a number that ends the cutting is not one, or there are more than 64 reasons.
    """
    undecided = non_negative_number(undecided, "undecided")
    whole_number(most_boxes, "most_boxes", least=1)
    halves = np.array(list(np.ndindex(*(1 + (upper > lower)))), dtype=np.int32)
    places = np.zeros((1, 1 + len(lower)), dtype=np.int32)
    names = [name for each, _ in groups.values() for name in each]
    reasons = distinct(names)
    bits = np.array([bit_of(reasons, name) for name in names], dtype=np.uint64)
    asked = np.ones((1, len(names)), dtype=bool)
    decided: tuple[list[Places], list[Places]] = ([], [])
    reason: list[Flags] = []
    while True:
        left: list[tuple[Places, Bools, Array]] = []
        for i in progress(range(0, len(places), _BLOCK)):
            block, open_ = places[i : i + _BLOCK], asked[i : i + _BLOCK]
            meets, box = met(balls, Interval(*(end.T for end in ends_of(block, lower, upper))))
            block, open_, box = block[meets], open_[meets], box[:, meets]
            with np.errstate(invalid="ignore", over="ignore"):  # no bounds: NaN proves nothing
                why, parts = _judged(groups, bits, box, open_)
            out = why != 0
            reason.append(why[out])
            proven = ~open_.any(axis=1) & ~out
            decided[0].append(block[proven])
            decided[1].append(block[out])
            rest = ~(proven | out)
            left.append((block[rest], open_[rest], parts[rest] * (0.0 if balls else 1.0)))
        places, asked, parts = (np.concatenate(one) for one in zip(*left, strict=True))
        inside, outside = (np.concatenate(one) for one in decided)
        found = CertifiedBoxes(
            lower, upper, (inside, outside, places), parts, reasons, np.concatenate(reason)
        )
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


def _judged(groups: Groups, bits: Flags, box: Interval, asked: Bools) -> tuple[Flags, Array]:
    """Return why boxes are outside, 0 of others, and the shares inside and outside, (n, 2).

    What is proven of a box is cleared in `asked`.
    """
    why = np.zeros(len(asked), dtype=np.uint64)
    inside, outside = np.ones(len(asked)), np.zeros(len(asked))
    first = 0
    for names, bounds_of in groups.values():
        columns = range(first, first := first + len(names))
        which = np.flatnonzero(asked[:, columns].any(axis=1))
        if not which.size:
            continue
        for column, margin in zip(columns, bounds_of(box[:, which]), strict=True):
            asked[which, column] &= ~margin.positive
            why[which] |= np.where(margin.negative, bits[column], np.uint64(0))
            inside[which] -= np.where(margin.positive, 0.0, 1.0 - margin.share_positive)
            outside[which] = np.maximum(outside[which], margin.share_negative)
    return why, np.stack([np.maximum(inside, 0.0), outside], axis=-1)

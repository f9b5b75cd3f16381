"""Bounds of margins over boxes, by slopes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.numerics.intervals import Enclosure, Interval


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


def either(one: Bounds, other: Bounds) -> Bounds:
    """Return bounds of the larger of two margins."""
    both = one.share_negative + other.share_negative - 1.0  # where they overlap, at least
    return Bounds(
        one.positive | other.positive,
        one.negative & other.negative,
        np.maximum(one.share_positive, other.share_positive),
        np.maximum(both - 1e-12, 0.0),
    )

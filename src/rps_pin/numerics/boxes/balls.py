"""Discs and balls of coordinates, which restrict what is asked of boxes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.numerics.intervals import Interval


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

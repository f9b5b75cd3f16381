"""Trajectories of functions of time, for paths whose events are known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rps_pin.trajectories.path import PathSample


class Moving:
    """x(t) = start + way s(t), with s and its first two derivatives given."""

    def __init__(
        self, start: Any, way: Any, duration: float, *laws: Callable[[Any], Any], **options: Any
    ) -> None:
        self.start, self.way = np.asarray(start, float), np.asarray(way, float)
        self.duration, self.laws = duration, laws

    def sample(self, t: Any) -> PathSample:
        times = np.asarray(t, dtype=float)
        s, ds, dds = (np.asarray(law(times) + 0 * times)[..., None] for law in self.laws)
        return PathSample(self.start + s * self.way, ds * self.way, dds * self.way)


def uniform(start: Any, end: Any, duration: float = 1.0) -> Moving:
    """A straight line at a constant rate."""
    way = (np.asarray(end, float) - start) / duration
    return Moving(start, way, duration, lambda t: t, lambda t: 1.0, lambda t: 0.0)


def swinging(middle: Any, reach: Any, w: float, duration: float) -> Moving:
    """x(t) = middle + reach sin(w t)."""
    return Moving(
        middle,
        reach,
        duration,
        lambda t: np.sin(w * t),
        lambda t: w * np.cos(w * t),
        lambda t: -(w**2) * np.sin(w * t),
    )

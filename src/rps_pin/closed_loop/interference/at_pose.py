"""Interference of a mechanism's links at one configuration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.interference.distances import LinkDistance, LinkDistances


class Interference(NamedTuple):
    """What `ClosedLoopModel.interference` found."""

    found: tuple[LinkDistance, ...]
    """The pairs of links nearer than the clearance, the deepest first."""
    nearest: LinkDistance | None
    """The pair with the least distance; None where no pair is checked."""
    pairs: int
    """How many pairs were checked."""
    clearance: float
    """m."""

    @property
    def ok(self) -> bool:
        """Whether all pairs keep the clearance."""
        return not self.found

    def __str__(self) -> str:
        pairs = f"{self.pairs} pair{'' if self.pairs == 1 else 's'}"
        told = f"{pairs} of links, {len(self.found)} nearer than {self.clearance:.6g} m"
        if self.nearest is None:
            return told
        return "\n".join((f"{told}; nearest: {self.nearest}", *map(str, self.found)))


def interference_at(distances: LinkDistances, q: Array, clearance: float) -> Interference:
    """Return the pairs nearer than a clearance, and the nearest; far ones by their balls alone."""
    distances.set_state(q)
    bounds = distances.bounds()
    near: list[LinkDistance] = []
    for pair in np.argsort(bounds, kind="stable"):
        least = min((one.distance for one in near), default=np.inf)
        if bounds[pair] > max(least, clearance):
            break
        near.append(distances.distance(int(pair)))
    near.sort(key=lambda one: one.distance)
    found = tuple(one for one in near if one.distance < clearance)
    return Interference(found, near[0] if near else None, len(distances.pairs), clearance)

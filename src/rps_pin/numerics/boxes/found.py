"""A box cut into boxes that are proven inside or outside, with the reasons."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rps_pin.arrays import Array, Bools
from rps_pin.numerics.bits import Flags, holds

Verdict = Literal["inside", "outside", "partly", "undecided"]
#: Places of a box among those of its size: its level, and counts from the least corner.
Places = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class CertifiedBoxes:
    """A box of coordinates, cut into boxes that are proven inside or outside.

    A box that is proven outside has the reasons that hold at all of its points: limits that are
    broken there, of which others may be broken too, at some of its points.

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
    reasons: tuple[str, ...]
    """Names of the reasons to be outside, in the order of the bits of `reason`."""
    reason: Flags
    """Why each box outside is so, shape (n,): bit k is that of ``reasons[k]``, one or more."""

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

    def mask(self, reason: str) -> Bools:
        """Return which of the boxes outside have a reason, by its name, shape (n,).

        Raises
        ------
        InputError
            If there is no such reason.
        """
        return holds(self.reason, self.reasons, reason)

    def reason_shares(self) -> dict[str, float]:
        """Return the share that each reason has of the volume of the boxes outside, largest first.

        A box with several reasons counts under each of them; reasons of no box are left out.
        """
        free = int(np.count_nonzero(self.upper > self.lower))
        size = np.ldexp(1.0, -free * self.places[1][:, 0])
        found = {name: float(size[self.mask(name)].sum()) for name in self.reasons}
        whole = float(size.sum())
        ordered = sorted(found.items(), key=lambda one: -one[1])
        return {name: part / whole for name, part in ordered if part}

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


def ends_of(places: Places, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the least and greatest coordinates of boxes, (n, m) each; equal where they touch."""
    parts = np.ldexp(1.0, -places[:, :1])
    at = places[:, 1:].astype(np.float64)

    def corner(share: Array) -> Array:
        return np.where(share < 1.0, lower + (upper - lower) * share, upper)

    return corner(at * parts), corner((at + 1.0) * parts)

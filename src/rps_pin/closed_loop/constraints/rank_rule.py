"""Rule by which the rank of a mechanism's closures is decided, of exact files and of rounded ones.

Numbers of an exact file are exact to rounding error: a singular value of J (all entries in one
unit) counts above 1e-10 of the largest, and loops close to 1e-12. Most files are rounded. Then
rows that would be redundant are only nearly so, and forbid motions that the mechanism has: a plane
five-bar with one hinge turned by 1.5708 rad instead of pi/2 has singular values (2.6, 0.22, 3e-6)
instead of (2.6, 0.22, 0). The tolerance is put into that gap. With U_1 the left singular vectors of
the values above it, at each configuration,

    U_1' e(q) = 0,   U_1' J v = 0,   U_1' (J a + J' v) = 0

are the mechanism's equations, and what remains of the gaps e(q) outside U_1 is accepted up to the
accuracy of the file. `assembly.rounding` finds out which files are rounded, and by how much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rps_pin.arrays import Array
from rps_pin.numerics.linear_algebra import RANK_TOLERANCE, full_svd, rank

#: Opening rate that velocities and accelerations may leave, relative to the rates given.
_CONSISTENT = 1e-8


@dataclass(frozen=True)
class Rounding:
    """What the rounded numbers of a file do to its closures.

    Attributes
    ----------
    kept, dropped : float
        Smallest singular value that counts and largest that does not, over the largest (or over 1
        if that is less), at regular configurations; ``dropped`` is 0 where rows are redundant.
    gap : float
        Largest gap that stays open where the independent rows are closed, m.
    closures : tuple of str
        Closures that have a part in the rows that are nearly redundant, or whose gap stays open.
    axes : tuple of (str, float)
        Joints whose axes are not quite parallel to those of others, and by which angle, rad.
    """

    kept: float
    dropped: float
    gap: float
    closures: tuple[str, ...]
    axes: tuple[tuple[str, float], ...] = ()

    def __str__(self) -> str:
        values = f"singular values {self.kept:.2g}, then {self.dropped:.2g}"
        names = ", ".join(repr(name) for name in self.closures)
        text = f"closure{'s' if len(self.closures) > 1 else ''} {names} (" + (
            values if self.dropped else f"open by {self.gap:.2g} m"
        )
        text += f", open by {self.gap:.2g} m)" if self.dropped and self.gap else ")"
        if self.axes:
            each = ", ".join(f"{name} by {angle:.2g} rad" for name, angle in self.axes)
            text += f"; not parallel to the other axes: {each}"
        return text


@dataclass(frozen=True)
class RankRule:
    """Tolerance of the rank of one mechanism, and the gap that its loops may keep.

    Attributes
    ----------
    tolerance : float
        As for `linear_algebra.rank`, of J with all entries in one unit.
    rank : int or None
        Of a rounded file: the rank at regular configurations. None: the file is exact.
    gap : float
        Largest gap that is accepted outside the independent rows, m.
    rounding : Rounding or None
        Why the file counts as rounded.
    """

    tolerance: float = RANK_TOLERANCE
    rank: int | None = None
    gap: float = 0.0
    rounding: Rounding | None = None

    @property
    def consistent(self) -> float:
        """Opening rate that is accepted, relative to the rates given."""
        return _CONSISTENT if self.rank is None else max(_CONSISTENT, self.tolerance)

    def independent(self, jacobian: Array) -> Array:
        """Return U_1, shape (nc, r), at a J with all entries in one unit.

        At least as many columns as the regular rank: near a singularity no row is lost.
        """
        left, values, _ = full_svd(jacobian)
        return left[:, : max(self.rank or 0, rank(values, self.tolerance))]


EXACT = RankRule()


def largest(value: Array) -> float:
    """Return the largest singular value, or 1 if that is less: what a tolerance is relative to."""
    return max(float(value[0]), 1.0) if np.size(value) else 1.0

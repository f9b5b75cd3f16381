"""Interpretations of Table 1: a grid that was declared before it was computed.

An interpretation is a path (the units of z_0, r_h and p_h, the branch, the radii, the forms of
Eq. 5 and 29) and a robot that follows it (masses and inertias, Eq. 14, 16 and 19, gravity). Every
combination of the lists below is computed; nothing is fitted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Literal, NamedTuple

from rps_pin.paper import paper_data as paper
from rps_pin.paper.paper_helix import Form, PaperHelix
from rps_pin.trajectories.helix import Branch

# The path -----------------------------------------------------------------------------------------

#: A printed length in millimetres, were it in another unit: m per unit.
UNITS = {"mm": 1e-3, "cm": 1e-2, "dm": 1e-1, "m": 1.0}
#: What g and h measure: metres per printed millimetre of the radius.
RADII = {
    "radii": 1e-3,
    "diameters": 1e-3 / 2,
    "sides of the triangles": 1e-3 / math.sqrt(3.0),
}
BRANCHES: tuple[Branch, ...] = ("+", "-")
#: Of Eq. 5 and of Eq. 29.
FORMS: tuple[Form, ...] = ("corrected", "printed")


@dataclass(frozen=True)
class PathInterpretation:
    """One way to read what Table 1 and Eq. 26 to 29 say of the path."""

    height_unit: str
    """Unit of z_0, of `UNITS`."""
    helix_unit: str
    """Unit of r_h and p_h, of `UNITS`."""
    radii: str
    """What g and h are, of `RADII`."""
    branch: Branch
    eq_5: Form
    eq_29: Form

    @property
    def base_radius(self) -> float:
        """The distance g in m."""
        return paper.BASE_RADIUS_MM * RADII[self.radii]

    @property
    def platform_radius(self) -> float:
        """The distance h in m."""
        return paper.PLATFORM_RADIUS_MM * RADII[self.radii]

    @property
    def helix_radius(self) -> float:
        """The distance r_h in m."""
        return paper.HELIX_RADIUS * UNITS[self.helix_unit]

    @property
    def helix_pitch(self) -> float:
        """The distance p_h in m."""
        return paper.HELIX_PITCH * UNITS[self.helix_unit]

    @property
    def height(self) -> float:
        """The height z_0 in m."""
        return paper.HELIX_HEIGHT * UNITS[self.height_unit]

    @property
    def as_meant(self) -> bool:
        """Whether g and h are radii, and Eq. 5 and 29 are corrected."""
        return (self.radii, self.eq_5, self.eq_29) == ("radii", "corrected", "corrected")

    def path(self) -> PaperHelix:
        """Return the helix.

        Raises
        ------
        InputError
            If it lies out of reach: r_h exceeds h.
        """
        return PaperHelix(
            self.platform_radius,
            self.helix_radius,
            self.helix_pitch,
            self.height,
            branch=self.branch,
            eq_5=self.eq_5,
            eq_29=self.eq_29,
        )


def path_interpretations(*, quick: bool = False) -> Iterator[PathInterpretation]:
    """Yield every combination; `quick` leaves out units, and other radii and Eq. 5 than meant."""
    units = ("mm", "m") if quick else tuple(UNITS)
    helix_units = ("mm", "dm") if quick else tuple(UNITS)
    radii = ("radii",) if quick else tuple(RADII)
    eq_5 = FORMS[:1] if quick else FORMS
    for choice in product(units, helix_units, radii, BRANCHES, eq_5, FORMS):
        yield PathInterpretation(*choice)


# The bodies ---------------------------------------------------------------------------------------


class Bodies(NamedTuple):
    """The masses of Table 1, and what its I_leg is about; its inertias stay as printed."""

    platform_mass: float
    """Kg."""
    leg_mass: float
    """Kg."""
    about: Literal["joint", "com"]
    """``"com"`` is Eq. 16 as printed."""


#: Platform and legs whose inertias Table 1's would be: a disc of radius h, I_zz = m h^2 / 2, and a
#: rod of length 2 r about its end, I_leg = m (2 r)^2 / 3; kg.
DISC_MASS = 2 * paper.PLATFORM_INERTIA[2] / (1e-3 * paper.PLATFORM_RADIUS_MM) ** 2
ROD_MASS = 3 * paper.LEG_INERTIA / (2e-3 * paper.LEG_COM_MM) ** 2

#: Legs of 100 times the mass cannot have I_leg about the joint: it would be less than m_leg r^2.
BODIES: dict[str, Bodies] = {
    "as printed": Bodies(paper.PLATFORM_MASS, paper.LEG_MASS, "joint"),
    "as printed, Eq. 16 as printed": Bodies(paper.PLATFORM_MASS, paper.LEG_MASS, "com"),
    "masses of a disc and rods": Bodies(DISC_MASS, ROD_MASS, "joint"),
    "masses x 100, Eq. 16 as printed": Bodies(
        100 * paper.PLATFORM_MASS, 100 * paper.LEG_MASS, "com"
    ),
}
#: Eq. 19 as printed weighs the platform as if it had 1 kg.
GRAVITIES = ("gravity", "Eq. 19 as printed", "no gravity")
EQ_14 = ("R I R'", "R I R")
STANDARD_GRAVITY = 9.81


class BodyInterpretation(NamedTuple):
    """One way to read what the paper says of the bodies."""

    bodies: str
    """Of `BODIES`."""
    gravity: str
    """Of `GRAVITIES`."""
    eq_14: str
    """Of `EQ_14`: corrected, or as printed."""


def body_interpretations() -> list[BodyInterpretation]:
    """Return every combination."""
    return [BodyInterpretation(*choice) for choice in product(BODIES, GRAVITIES, EQ_14)]

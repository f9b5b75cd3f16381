"""Beams: cross-sections, materials, and the springs of one segment.

A segment of length h is two rigid halves with six springs between them, at its middle. In the
section's axes, x along the beam, their compliances are

    x   h / (E A)
    y   h^3 / (12 E I_z) + h / (G A_y)
    z   h^3 / (12 E I_y) + h / (G A_z)
    rx  h / (G J)
    ry  h / (E I_y)
    rz  h / (E I_z).

Seen from the end of the segment, the compliance of these springs is that of a cantilever of length
h, of Timoshenko or, without the shear areas A_y and A_z, of Bernoulli. So small deflections under
loads at a beam's ends are exact with one segment. The beam's own weight, its vibration and its
buckling converge with the square of the number of segments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import fixed_array, positive_number, whole_number

#: Terms of the series of a rectangle's torsion constant: the next one is below 1e-12 of it.
_TERMS = 120
#: Relative difference of second moments up to which the axes of a section do not matter.
_ALIKE = 1e-9


@refuses_other_kinds
@dataclass(frozen=True)
class Section:
    """A beam's cross-section, in axes y and z through its centroid.

    Parameters
    ----------
    area
        A, m^2.
    second_moment_y, second_moment_z
        I_y, the integral of z^2, and I_z, that of y^2, m^4; y and z are principal axes.
    torsion_constant
        J of Saint-Venant, m^4.
    shear_area_y, shear_area_z
        Areas that carry shear along y and z, m^2; None: no shear deformation (Bernoulli).

    Raises
    ------
    InputError
        If a number is not positive.
    """

    area: float
    second_moment_y: float
    second_moment_z: float
    torsion_constant: float
    shear_area_y: float | None = None
    shear_area_z: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None or "shear" not in field.name:
                unit = "m^2" if "area" in field.name else "m^4"
                positive_number(value, field.name, unit)

    @classmethod
    def rectangle(cls, width: float, height: float) -> Section:
        """Return a rectangle, `width` along y and `height` along z, m; shear areas 5/6 A.

        With a >= b its sides, J = a b^3 / 3 (1 - 192 b / (pi^5 a) sum tanh(n pi a / 2 b) / n^5)
        over odd n (Timoshenko and Goodier, Theory of Elasticity, article 109).
        """
        positive_number(width, "width", "m")
        positive_number(height, "height", "m")
        area, a, b = width * height, max(width, height), min(width, height)
        odd = np.arange(1, 2 * _TERMS, 2)
        series = float(np.sum(np.tanh(odd * math.pi * a / (2 * b)) / odd**5.0))
        torsion = a * b**3 / 3 * (1 - 192 * b / (math.pi**5 * a) * series)
        bending_y, bending_z = width * height**3 / 12, height * width**3 / 12
        return cls(area, bending_y, bending_z, torsion, 5 / 6 * area, 5 / 6 * area)

    @classmethod
    def tube(
        cls, outer_diameter: float, inner_diameter: float = 0.0, poisson_ratio: float = 0.3
    ) -> Section:
        """Return a round tube, or a round bar if the inner diameter (m) is 0.

        The shear areas are those of Cowper (The shear coefficient in Timoshenko's beam theory,
        Journal of Applied Mechanics 33, 1966), which depend on Poisson's ratio.
        """
        positive_number(outer_diameter, "outer_diameter", "m")
        if not 0 <= inner_diameter < outer_diameter:
            raise InputError(
                f"inner_diameter = {shown(inner_diameter)}: it must be from 0 to less than the "
                f"outer one, {outer_diameter} m"
            )
        if not -1 < poisson_ratio <= 0.5:
            raise InputError(f"poisson_ratio = {shown(poisson_ratio)}: it must be from -1 to 0.5")
        area = math.pi / 4 * (outer_diameter**2 - inner_diameter**2)
        bending = math.pi / 64 * (outer_diameter**4 - inner_diameter**4)
        m2, nu = (inner_diameter / outer_diameter) ** 2, poisson_ratio
        whole = (1 + m2) ** 2
        share = 6 * (1 + nu) * whole / ((7 + 6 * nu) * whole + (20 + 12 * nu) * m2)
        return cls(area, bending, bending, 2 * bending, share * area, share * area)


@refuses_other_kinds
@dataclass(frozen=True)
class Material:
    """What a beam is of.

    Parameters
    ----------
    young_modulus, shear_modulus
        E and G, Pa.
    density
        kg/m^3: the beam's mass is taken out of its link's and spread along the beam. None: the
        link's mass stays in one piece, fixed to the node nearest to its centre of mass.

    Raises
    ------
    InputError
        If a number is not positive.
    """

    young_modulus: float
    shear_modulus: float
    density: float | None = None

    def __post_init__(self) -> None:
        positive_number(self.young_modulus, "young_modulus", "Pa")
        positive_number(self.shear_modulus, "shear_modulus", "Pa")
        if self.density is not None:
            positive_number(self.density, "density", "kg/m^3")


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class Beam:
    """A beam in a link, from one place to another.

    Every joint, closure and frame of the link is fixed to the nearest node of its beams: the beams'
    starts, ends and the ends of their segments.

    Parameters
    ----------
    link
        Name of the link: its own, or that of the joint that carries it.
    start, end
        Places on the link: names of a frame on it, of its own joint, of a joint that it carries, or
        of a closure that holds it.
    section, material
        What it is made of.
    up
        Direction in the link's axes, shape (3,), whose part across the beam is the section's z.
        May be left out where I_y = I_z and the shear areas are equal.
    segments
        Number of segments.

    Raises
    ------
    InputError
        If a number or direction is not possible, or ``up`` is needed and left out.
    """

    link: str
    start: str
    end: str
    section: Section
    material: Material
    up: Sequence[float] | None = None
    segments: int = 1

    def __post_init__(self) -> None:
        whole_number(self.segments, "segments")
        one = self.section
        if self.up is not None:
            up = fixed_array(self.up, "up", (3,))
            if not up.any():
                raise InputError("up has no direction: it is zero")
            object.__setattr__(self, "up", up)
        elif abs(one.second_moment_y - one.second_moment_z) > _ALIKE * one.second_moment_z or (
            one.shear_area_y != one.shear_area_z
        ):
            raise InputError(
                "the section is not the same about y and z: give 'up', its z direction"
            )

    def compliances(self, length: float) -> Array:
        """Return the compliances of one segment's springs (x, y, z, rx, ry, rz), shape (6,).

        m/N and rad/(N m); `length` is the whole beam's, m.
        """
        h = length / self.segments
        E, G, s = self.material.young_modulus, self.material.shear_modulus, self.section
        shear_y, shear_z = (
            0.0 if area is None else h / (G * area) for area in (s.shear_area_y, s.shear_area_z)
        )
        return np.array(
            [
                h / (E * s.area),
                h**3 / (12 * E * s.second_moment_z) + shear_y,
                h**3 / (12 * E * s.second_moment_y) + shear_z,
                h / (G * s.torsion_constant),
                h / (E * s.second_moment_y),
                h / (E * s.second_moment_z),
            ]
        )

    def inertia_per_length(self) -> tuple[float, Array]:
        """Return mass (kg/m) and rotary inertia about x, y, z (kg m), (3,); 0 without density."""
        density, s = self.material.density or 0.0, self.section
        polar = s.second_moment_y + s.second_moment_z
        return density * s.area, density * np.array([polar, s.second_moment_y, s.second_moment_z])

"""Numbers of the paper as printed: Tables 1 and 2, and what Section 3 states. SI units.

Typed from the paper once, here; everything else in `rps_pin.paper` takes them from here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array

#: The paper, and what is known of its publication.
TITLE = "Analysis of a parallel robot for micro movements"
REFERENCE = (
    "Authors, venue and year are not known: the available text does not name them. Its most recent "
    "source is Almeida (2018), so it was written in 2018 or later. Table 1's robot and the helix "
    "are taken from Sokolov, whom it cites as 2003 and as 2013."
)

# Table 1, in the units it prints ------------------------------------------------------------------

#: g and h, mm.
BASE_RADIUS_MM, PLATFORM_RADIUS_MM = 460.0, 230.0
#: m, kg.
PLATFORM_MASS = 0.18
#: I_xx, I_yy, I_zz, kg m^2; the products of inertia are zero.
PLATFORM_INERTIA = (0.093, 0.093, 0.187)
#: r, mm; m_leg, kg; I_leg, kg m^2.
LEG_COM_MM, LEG_MASS, LEG_INERTIA = 200.0, 0.09, 0.05
#: r_h, p_h and z_0, mm as printed.
HELIX_RADIUS, HELIX_PITCH, HELIX_HEIGHT = 0.75, 0.5, 0.4
#: t_a, t_b and t_t, s.
PRINTED_TIMES = (0.5, 4.2, 5.2)


# Table 2 ------------------------------------------------------------------------------------------


class ForceRange(NamedTuple):
    """Least and greatest actuator forces of legs 1 to 3, N."""

    least: tuple[float, float, float]
    greatest: tuple[float, float, float]

    def numbers(self) -> Array:
        """Return the six numbers, shape (6,): the least three, then the greatest three."""
        return np.array([*self.least, *self.greatest])

    @property
    def largest(self) -> float:
        """The largest size of a force, N."""
        return float(np.abs(self.numbers()).max())


#: Table 2, "Sokolov, 2003": with moving rods, by virtual work.
SOKOLOV = ForceRange((-329.0, 11.0, -422.0), (509.0, 95.0, 426.0))
#: Table 2, "This study" (its columns are headed d_1, d_3, d_3; the second is read as d_2).
THIS_STUDY = ForceRange((-305.0, 6.0, -382.0), (438.0, 78.0, 369.0))


# Section 3 ----------------------------------------------------------------------------------------

#: Legs of 200 to 250 mm in steps of 1 mm, "totaling 50 points"; |p_x|, |p_y| within 2.5 mm.
STROKE_MM = (200.0, 250.0)
STEP_MM = 1.0
STATED_POINTS = 50
STATED_REACH_MM = 2.5
#: Of Eq. 8, for equal legs in Fig. 2.
STATED_SOLUTIONS = 8
#: h of Fig. 3, mm.
WORKSPACE_PLATFORM_RADIUS_MM = 120.0


# Equation 29 --------------------------------------------------------------------------------------

#: sqrt(1 + 9 pi^2), of which every branch of Eq. 29 is made.
ROOT = math.sqrt(1 + 9 * math.pi**2)
#: t_a, t_(a+b) and t_t that make the corrected phi(t) smooth and end at 2 pi, s.
RAMP_END, BRAKE_START, END = 0.5, ROOT / 2, 0.5 + ROOT / 2

"""What the paper states in words and in Table 1, beside what is computed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from rps_pin.paper import paper_data as paper
from rps_pin.paper.helix_law import HelixLaw
from rps_pin.paper.readings import DISC_MASS, ROD_MASS
from rps_pin.paper.workspace_comparison import PaperComparison, paper_comparison
from rps_pin.rps.kinematics.assembly_modes import AssemblyModes
from rps_pin.rps.kinematics.pose import position
from rps_pin.rps.parameters import RPSParameters

HOLDS, CORRECTED, OPEN = "holds", "corrected", "open"


class Statement(NamedTuple):
    """One statement of the paper."""

    where: str
    stated: str
    found: str
    """What is computed."""
    verdict: str
    """`HOLDS`, `CORRECTED` or `OPEN`."""


def kinematic_statements(
    modes: AssemblyModes, degree: int, counts: dict[int, int]
) -> list[Statement]:
    """Return the statements of Section 2.2 and the one on the theoretical workspace.

    Parameters
    ----------
    modes
        Of equal legs.
    degree
        Of Eq. 8 in cos(phi_1), see `formula_checks.degree_of_eq_8`.
    counts
        How many random triples of lengths have so many real solutions.
    """
    above = int(modes.above.sum())
    spread = ", ".join(f"{times} times {n}" for n, times in counts.items())
    excess, reach = theoretical_reach()
    return [
        Statement(
            "Sec. 2.2, Eq. 8",
            f"up to {paper.STATED_SOLUTIONS} results",
            f"degree {degree} in cos φ_1, and each zero is a pair ±φ: {2 * degree} complex "
            f"solutions in {degree} pairs mirrored in the base plane. Real ones of random legs: "
            f"{spread}",
            CORRECTED,
        ),
        Statement(
            "Fig. 2",
            f"{paper.STATED_SOLUTIONS} results for equal legs",
            f"{len(modes.angle)} real ones: {above} with the centre above the base, "
            f"{len(modes.angle) - above} below",
            HOLDS if len(modes.angle) == paper.STATED_SOLUTIONS else CORRECTED,
        ),
        Statement(
            "Sec. 3, Fig. 3",
            "the centre stays within a cylinder of radius h",
            f"its distance from the axis is h sin²(β/2) (to {excess:.0e} h or better), which "
            f"grows to {reach:.6f} h at half a turn",
            HOLDS if reach <= 1 + 1e-12 else CORRECTED,
        ),
    ]


def workspace_statements(rows: tuple[PaperComparison, ...]) -> list[Statement]:
    """Return the statements of Section 3 on the discretised workspace; the first row is g = h."""
    low, high = paper.STROKE_MM
    points = round((high - low) / paper.STEP_MM) + 1
    first = rows[0]
    climb, across = first.z[1] - first.z[0], first.x[1] - first.x[0]
    limit = greatest_base_radius()
    return [
        Statement(
            "Sec. 3",
            f"{paper.STEP_MM:g} mm steps from {low:g} to {high:g} mm, {paper.STATED_POINTS} points",
            f"{points} points, or steps of {(high - low) / (paper.STATED_POINTS - 1):.4f} mm",
            HOLDS if points == paper.STATED_POINTS else CORRECTED,
        ),
        Statement(
            "Sec. 3, Fig. 6",
            f"p_x and p_y do not exceed {paper.STATED_REACH_MM:g} mm",
            f"g is not given; g ≥ h = {paper.WORKSPACE_PLATFORM_RADIUS_MM:g} mm is asked for. True "
            f"for g from h to {1e3 * limit:.2f} mm and false beyond",
            OPEN,
        ),
        Statement(
            "Sec. 3, Fig. 6",
            "p_z alone has the scale of the legs' stroke",
            f"g = h: p_z spans {1e3 * climb:.1f} mm, p_x {1e3 * across:.2f} mm",
            HOLDS if climb > 5 * across else CORRECTED,
        ),
        Statement(
            "Fig. 4",
            "the theoretical workspace is much larger",
            f"g = h: the cylinder's volume is {first.cylinder_volume / first.volume:,.0f} times "
            "the effective one's",
            HOLDS if first.cylinder_volume > 10 * first.volume else CORRECTED,
        ),
    ]


def table_1_statements(law: HelixLaw, longest_leg: float) -> list[Statement]:
    """Return what Table 1 says beside what follows; `longest_leg` of its helix from 0.4 m, m."""
    ramp, steady, end = paper.PRINTED_TIMES
    xx, yy, zz = paper.PLATFORM_INERTIA
    gyration = math.sqrt(paper.LEG_INERTIA / paper.LEG_MASS)
    return [
        Statement(
            "Table 1, Eq. 29",
            f"t_a = {ramp:g} s, t_b = {steady:g} s, t_t = {end:g} s",
            f"t_b = {law.end - 2 * paper.RAMP_END:.5f} s, t_t = {law.end:.5f} s, where φ' is zero "
            f"and φ = {law.turn_at_end / math.pi:.6f} π. The printed ones are these rounded; φ at "
            f"{end:g} s is short of 2π by {2 * math.pi - law.turn_at_printed_end:.4f} rad",
            CORRECTED,
        ),
        Statement(
            "Eq. 26 to 29",
            "the helix of r_h = 0.75 and p_h = 0.5 in one unit",
            f"the centre's greatest speed is {law.greatest_speed:.5f} units/s, its ramps "
            f"{law.ramp:.5f} units/s²",
            "the proportions explain Eq. 29",
        ),
        Statement(
            "Table 1",
            f"I = ({xx:g}; {yy:g}; {zz:g}) kg m²",
            f"I_zz exceeds I_xx + I_yy by {zz - xx - yy:.3f}, and a rigid body's cannot: rounding "
            "(a flat disc has I_zz = I_xx + I_yy). MuJoCo refuses such a body, Pinocchio takes it",
            CORRECTED if zz > xx + yy else HOLDS,
        ),
        Statement(
            "Table 1",
            f"m = {paper.PLATFORM_MASS:g} kg",
            f"a disc of radius h with this I_zz has {DISC_MASS:.2f} kg; with {paper.PLATFORM_MASS} "
            f"kg it would reach {math.sqrt(2 * zz / paper.PLATFORM_MASS):.2f} m far",
            OPEN,
        ),
        Statement(
            "Table 1",
            f"m_leg = {paper.LEG_MASS:g} kg, I_leg = {paper.LEG_INERTIA:g} kg m²",
            f"the radius of gyration is {gyration:.3f} m, and the longest leg is {longest_leg:.3f} "
            f"m; a rod of 2 r with this I_leg has {ROD_MASS:.2f} kg",
            OPEN,
        ),
    ]


def table_2_statements() -> list[Statement]:
    """Return what Table 2 says of itself."""
    this, sokolov = paper.THIS_STUDY.numbers(), paper.SOKOLOV.numbers()
    ratio = np.abs(this / sokolov)
    return [
        Statement(
            "Sec. 4.3, Table 2",
            "the forces are slightly smaller than Sokolov's",
            f"by the table they are {ratio.min():.2f} to {ratio.max():.2f} times his",
            HOLDS if ratio.max() < 1 else CORRECTED,
        ),
    ]


def theoretical_reach() -> tuple[float, float]:
    """Return the error of |(p_x, p_y)| = h sin^2(beta/2) to half a turn, and its greatest value.

    Both over h, and the error not less than 1e-12.
    """
    beta, way = np.meshgrid(np.linspace(0.0, math.pi, 181), np.linspace(0.0, 2 * math.pi, 73))
    pose = np.stack([np.ones_like(beta), beta * np.cos(way), beta * np.sin(way)], axis=-1)
    sideways = np.hypot(*np.moveaxis(position(pose, 1.0)[..., :2], -1, 0))
    error = float(np.abs(sideways - np.sin(beta / 2) ** 2).max())
    return max(error, 1e-12), float(sideways.max())


def greatest_base_radius() -> float:
    """Return the greatest g for which p_x and p_y stay within the paper's 2.5 mm, m.

    The extremes lie at corners of the stroke: two lengths a leg will do.
    """
    micro = RPSParameters.from_preset("micro")

    def beyond(base_radius: float) -> float:
        return paper_comparison(micro, [base_radius], points=2)[0].reach - (
            1e-3 * paper.STATED_REACH_MM
        )

    return float(brentq(beyond, micro.platform_radius, 1.5 * micro.platform_radius, xtol=1e-9))

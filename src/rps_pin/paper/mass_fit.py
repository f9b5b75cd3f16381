"""Fits of the platform's mass to Table 2, for every path that has forces.

The interpretations of `rps_pin.paper.interpretations` fit nothing. Here the platform's mass is
fitted and everything else is as Table 1 prints it, for every path, so that one path's gain can be
compared with the others'. Then the numbers of the best path are changed, to see whether Table 1's
are the best ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from rps_pin.arrays import Array
from rps_pin.paper import paper_data as paper
from rps_pin.paper.comparison import (
    Labels,
    PathResult,
    closest_labels,
    dense_times,
    force_range,
)
from rps_pin.paper.force_parts import ForceParts, UnitRobot, force_parts
from rps_pin.paper.interpretations import PathInterpretation
from rps_pin.paper.paper_data import ForceRange
from rps_pin.paper.paper_helix import PaperHelix
from rps_pin.rps.singularity.path_check import check_path

#: Masses tried before the best one is refined, kg.
_MASSES = np.geomspace(1e-2, 1e3, 61)

#: Changes of z_0, r_h and p_h, m.
MOVES = {
    "z_0": (-5e-3, -1e-3, 1e-3, 2e-3),
    "r_h": (-0.5e-3, 0.5e-3, 1e-3),
    "p_h": (-5e-3, -1e-3, 1e-3, 5e-3),
}


class MassFit(NamedTuple):
    """The platform's mass that brings a path nearest to a column of Table 2."""

    path: PathInterpretation
    platform_mass: float
    """Kg."""
    leg_mass: float
    """Kg; Table 1's unless it was left free, too."""
    labels: Labels
    """What our legs are called in Table 2."""
    forces: ForceRange
    """In Table 2's order of legs, N."""
    distance: float
    """To that column."""


class MovedPath(NamedTuple):
    """A path with one number moved."""

    moved: str
    """``"z_0"``, ``"r_h"`` or ``"p_h"``."""
    by: float
    """m."""
    parts: ForceParts | None
    """Its forces by cause; None if it crosses a singularity."""


class MovedFit(NamedTuple):
    """The platform's mass that brings a moved path nearest to a column of Table 2."""

    moved: str
    by: float
    platform_mass: float
    """Kg; NaN if the path crosses a singularity."""
    distance: float
    """Likewise."""


def mass_fits(paths: Iterable[PathResult], printed: ForceRange = paper.THIS_STUDY) -> list[MassFit]:
    """Return the best platform's mass of every path that has forces, the nearest first."""
    regular = ((one.interpretation, one.parts) for one in paths)
    fits = [fit_mass(path, parts, printed) for path, parts in regular if parts is not None]
    return sorted(fits, key=lambda fit: round(fit.distance, 9))


def fit_mass(path: PathInterpretation, parts: ForceParts, printed: ForceRange) -> MassFit:
    """Return the platform's mass that brings a path nearest to a column of Table 2."""

    def miss(log_mass: float) -> float:
        return _fit(path, parts, printed, math.exp(log_mass), paper.LEG_MASS).distance

    tried = np.log(_MASSES)
    best = int(np.argmin([miss(x) for x in tried]))
    low, high = tried[max(best - 1, 0)], tried[min(best + 1, tried.size - 1)]
    refined = minimize_scalar(miss, bounds=(low, high), method="bounded", options={"xatol": 1e-6})
    return _fit(path, parts, printed, math.exp(float(refined.x)), paper.LEG_MASS)


def fit_both_masses(start: MassFit, parts: ForceParts, printed: ForceRange) -> MassFit:
    """Return a fit of the platform's and the legs' mass that starts from a fit of one mass.

    The legs' mass is at least Table 1's and at most I_leg / r^2, the largest with this inertia.
    """
    heaviest = paper.LEG_INERTIA / (1e-3 * paper.LEG_COM_MM) ** 2

    def miss(masses: Array) -> float:
        return _fit(start.path, parts, printed, masses[0], masses[1]).distance

    found = minimize(
        miss,
        np.array([start.platform_mass, start.leg_mass]),
        method="Nelder-Mead",
        bounds=[(0.0, None), (paper.LEG_MASS, heaviest)],
        options={"xatol": 1e-5, "fatol": 1e-9, "maxiter": 2000},
    )
    return _fit(start.path, parts, printed, float(found.x[0]), float(found.x[1]))


def moved_paths(path: PathInterpretation, *, quick: bool = False) -> list[MovedPath]:
    """Return a path with Eq. 29 corrected, with z_0, r_h or p_h moved; `quick` moves z_0 only."""
    given = {"r_h": path.helix_radius, "p_h": path.helix_pitch, "z_0": path.height}
    moves = {"z_0": MOVES["z_0"]} if quick else MOVES
    robot = UnitRobot(path.base_radius, path.platform_radius)
    rows = []
    for name, changes in moves.items():
        for by in changes:
            numbers = (given | {name: given[name] + by}).values()
            helix = PaperHelix(path.platform_radius, *numbers, branch=path.branch, eq_5=path.eq_5)
            check = check_path(robot, helix, tolerance=1e-6, least_steps=500)
            if any(event.kind != "grazes" for event in check.singularities):
                rows.append(MovedPath(name, by, None))
                continue
            times = dense_times(helix.duration, check.minimum_time, 1000)
            rows.append(MovedPath(name, by, force_parts(robot, helix.sample(times))))
    return rows


def moved_fits(
    path: PathInterpretation, moved: Iterable[MovedPath], printed: ForceRange
) -> list[MovedFit]:
    """Return the best mass for each of a path's moved ones."""
    rows = []
    for name, by, parts in moved:
        mass = distance = math.nan
        if parts is not None:
            _, mass, _, _, _, distance = fit_mass(path, parts, printed)
        rows.append(MovedFit(name, by, mass, distance))
    return rows


def forces_of_fit(parts: ForceParts, fit: MassFit) -> Array:
    """Return the forces (n, 3) of a fit along its path, in Table 2's order of legs, N."""
    forces = _forces(parts, fit.platform_mass, fit.leg_mass)
    ordered: Array = fit.labels.sign * forces[:, list(fit.labels.order)]
    return ordered


def _forces(parts: ForceParts, mass: float, leg_mass: float) -> Array:
    """Return the forces of Table 1's robot with other masses (I_leg about the joint), N."""
    force: Array = (
        mass * (parts.mass + parts.weight)
        + parts.inertia
        + paper.LEG_INERTIA * parts.leg_inertia
        + leg_mass * paper.LEG_COM_MM * 1e-3 * parts.leg_weight
    )
    return force


def _fit(
    path: PathInterpretation, parts: ForceParts, printed: ForceRange, mass: float, leg_mass: float
) -> MassFit:
    found = force_range(_forces(parts, mass, leg_mass))
    return MassFit(path, mass, leg_mass, *closest_labels(found, printed))

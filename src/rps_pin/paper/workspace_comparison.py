"""Workspace statements of the paper's Section 3, compared with computed workspaces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics.pose import position
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.compute import parameters_of, workspace
from rps_pin.rps.workspace.geometry import volume
from rps_pin.rps.workspace.grids import leg_grid

#: "The values for p_x and p_y do not exceed 2,5 mm, for a 50-mm variation of the leg lengths."
STATED_REACH = 2.5e-3
STATED_STROKE = 50e-3


class PaperComparison(NamedTuple):
    """The workspace of one base radius, compared with the paper's statement. SI units."""

    base_radius: float
    """g, which the paper does not give, m."""
    stroke: float
    """Variation of the leg lengths, m."""
    x: tuple[float, float]
    """Least and greatest p_x, m."""
    y: tuple[float, float]
    """Least and greatest p_y, m."""
    z: tuple[float, float]
    """Least and greatest p_z, m."""
    reach: float
    """Greatest |p_x| or |p_y|, m."""
    stated_reach: float
    """The paper's 2.5 mm, m."""
    holds: bool
    """Whether the reach is within what the paper states."""
    tilt: float
    """Greatest tilt, rad."""
    volume: float
    """Of the centre's positions, each counted once, m^3."""
    cylinder_volume: float
    """Of the theoretical cylinder of radius h between the same heights, m^3."""
    unreachable: int
    """Points of the grid whose lengths do not close in the mode above the base, or lie beyond a
    singularity."""


@refuses_other_kinds
def paper_comparison(
    parameters: RPSParameters | None = None,
    base_radii: Sequence[float] = (0.120, 0.150, 0.180, 0.210, 0.240),
    *,
    points: int = 51,
) -> tuple[PaperComparison, ...]:
    """Return the paper's statement and the computed workspace for each base radius g.

    The paper limits the legs' lengths only; limits of angles and spherical joints are left out.

    Parameters
    ----------
    parameters
        The robot, with its stroke; the ``micro`` preset if None.
    base_radii
        Values of g, m.
    points
        Lengths per leg; 51 are the paper's 1 mm steps.

    Raises
    ------
    InputError
        If there is no base radius, or one is not positive.
    UnreachableError
        If legs at mid-stroke carry no level platform for one of them.
    """
    given = RPSParameters.from_preset("micro") if parameters is None else parameters_of(parameters)
    if len(base_radii) == 0:
        raise InputError("base_radii is empty: at least one is needed")
    free = with_length_limits_only(given)
    return tuple(_row(free.replace(base_radius=float(g)), points) for g in base_radii)


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
        return paper_comparison(micro, [base_radius], points=2)[0].reach - (STATED_REACH)

    return float(brentq(beyond, micro.platform_radius, 1.5 * micro.platform_radius, xtol=1e-9))


def with_length_limits_only(parameters: RPSParameters) -> RPSParameters:
    """Return a robot as in Section 3: only the legs' lengths are limited."""
    return parameters.replace(leg_angle_limits=(-math.pi, math.pi), spherical_cone_limit=math.pi)


def _row(parameters: RPSParameters, points: int) -> PaperComparison:
    space = workspace(parameters, leg_grid(parameters, points))
    inside = space.inside
    position, pose = space.position[inside], space.pose[inside]
    x, y, z = ((float(p.min()), float(p.max())) for p in position.T)
    reach = float(np.abs(position[:, :2]).max())
    shortest, longest = parameters.leg_length_limits
    return PaperComparison(
        base_radius=parameters.base_radius,
        stroke=longest - shortest,
        x=x,
        y=y,
        z=z,
        reach=reach,
        stated_reach=STATED_REACH,
        holds=reach <= STATED_REACH,
        tilt=float(np.hypot(pose[:, 1], pose[:, 2]).max()),
        volume=volume(space).position,
        cylinder_volume=math.pi * parameters.platform_radius**2 * (z[1] - z[0]),
        unreachable=int(np.count_nonzero(~inside)),
    )

"""Options of a helix, for the commands that take one."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Annotated

import typer

from rps_pin.errors import InputError
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.helix import PAPER_DURATION, HelixPath, helix

DEFAULT_RADIUS = 0.75e-3
DEFAULT_PITCH = 0.5e-3
DEFAULT_DURATION = PAPER_DURATION
#: z_0 of Table 1 as interpreted here, and its base radius g, m.
_PAPER_HEIGHT, _PAPER_BASE_RADIUS = 0.4, 0.46


class Branch(StrEnum):
    """The two tilts that carry the centre along the same helix."""

    PLUS = "+"
    MINUS = "-"


RadiusOption = Annotated[float, typer.Option(help="Radius r_h of the helix, m.")]
PitchOption = Annotated[float, typer.Option(help="Pitch p_h: the climb in one turn, m.")]
HeightOption = Annotated[
    float | None,
    typer.Option(
        help="Height z_0 of the platform at the start, m. Default: the middle of the legs' "
        "stroke; without limits, the paper's 0.4 m in proportion to the base.",
        show_default=False,
    ),
]
BranchOption = Annotated[
    Branch,
    typer.Option(help="Which tilt: **+** the paper's (alpha, beta), **-** its (alpha, -beta)."),
]
DurationOption = Annotated[
    float, typer.Option(help="Duration, s. Eq. 29 as corrected lasts 5.2388 s.")
]


def chosen_helix(
    robot: RPSRobot,
    radius: float,
    pitch: float,
    height: float | None,
    branch: Branch,
    duration: float,
) -> HelixPath:
    """Return the helix that the options describe."""
    if height is None:
        height = middle_height(robot.parameters, pitch)
    sizes = {"radius": radius, "pitch": pitch, "height": height, "duration": duration}
    return helix(robot, branch=branch.value, **sizes)


def middle_height(parameters: RPSParameters, pitch: float) -> float:
    """Return a height (m) from which a robot can climb by `pitch`, if it can at all.

    A level platform then passes the middle of the legs' stroke half-way.
    """
    g, h = parameters.base_radius, parameters.platform_radius
    length = sum(parameters.leg_length_limits) / 2
    if math.isinf(length):
        return _PAPER_HEIGHT * g / _PAPER_BASE_RADIUS
    if length <= abs(g - h):
        raise InputError(
            f"legs of {length:.6g} m, the middle of their stroke, do not reach from a base of "
            f"radius {g} m to a level platform of radius {h} m; give --height"
        )
    return math.sqrt(length**2 - (g - h) ** 2) - pitch / 2

"""The options that describe a helix, for every command that takes one."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.helix import HelixPath, helix

DEFAULT_RADIUS = 0.75e-3
DEFAULT_PITCH = 0.5e-3
DEFAULT_HEIGHT = 0.4


class Branch(StrEnum):
    """The two tilts that carry the centre along the same helix."""

    PLUS = "+"
    MINUS = "-"


RadiusOption = Annotated[float, typer.Option(help="Radius r_h of the helix, m.")]
PitchOption = Annotated[float, typer.Option(help="Pitch p_h: the climb in its one turn, m.")]
HeightOption = Annotated[float, typer.Option(help="Height z_0 of the platform at the start, m.")]
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
    height: float,
    branch: Branch,
    duration: float,
) -> HelixPath:
    """Return the helix that the options describe."""
    return helix(
        robot,
        radius=radius,
        pitch=pitch,
        height=height,
        branch=branch.value,
        duration=duration,
    )

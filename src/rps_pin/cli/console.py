"""What the commands share: the robot's option, and how it is read."""

from __future__ import annotations

from typing import Annotated

import typer

from rps_pin.cli.completion import names_or_files, preset_names
from rps_pin.rps import robot_file
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.unit_doubts import unit_doubts

RobotOption = Annotated[
    str,
    typer.Option(
        "--robot",
        "-r",
        metavar="PRESET|FILE",
        help="A preset, **sokolov** (the paper's Table 1) or **micro**, or a YAML parameter file.",
        show_default=True,
        autocompletion=names_or_files(preset_names),
    ),
]


def load_robot(name_or_file: str) -> RPSRobot:
    """Return the robot of a preset's name or of a parameter file; doubt its units aloud."""
    robot = robot_file.load_robot(name_or_file)
    for doubt in unit_doubts(robot.parameters):
        typer.echo(f"note: {name_or_file}: {doubt}. Units are SI: m, kg, kg m^2", err=True)
    return robot

"""What the commands share: the robot's option, the console, the way errors look."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from rps_pin.errors import InputError
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot

RobotOption = Annotated[
    str,
    typer.Option(
        "--robot",
        "-r",
        metavar="PRESET|FILE",
        help="A preset, **sokolov** (the paper's Table 1) or **micro**, or a YAML parameter file.",
        show_default=True,
    ),
]


def complain(message: str) -> None:
    """Write an error to standard error, as one line."""
    line = " ".join(message.split())
    Console(stderr=True, soft_wrap=True).print(
        f"[bold red]error:[/] {escape(line)}", highlight=False
    )


def load_robot(name_or_file: str) -> RPSRobot:
    """Return the robot of a preset's name or of a parameter file's path.

    Raises
    ------
    InputError
        If it is neither.
    """
    if name_or_file in RPSParameters.presets():
        return RPSRobot.from_preset(name_or_file)
    if not Path(name_or_file).exists():
        raise InputError(
            f"{name_or_file!r} is no file, and no preset; the presets are: "
            f"{', '.join(RPSParameters.presets())}"
        )
    return RPSRobot(RPSParameters.from_yaml(name_or_file))

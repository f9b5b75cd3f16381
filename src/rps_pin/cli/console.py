"""What the commands share: the robot's option."""

from __future__ import annotations

from typing import Annotated

import typer

from rps_pin.cli.completion import names_or_files, preset_names
from rps_pin.rps.robot_file import load_robot

__all__ = ["RobotOption", "load_robot"]

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

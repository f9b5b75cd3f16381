"""What the commands share: the robot's option, the console, the way errors look."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from rps_pin.cli.completion import names_or_files, preset_names
from rps_pin.rps.robot_file import load_robot

__all__ = ["RobotOption", "complain", "load_robot"]

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


def complain(message: str) -> None:
    """Write an error to standard error, as one line."""
    line = " ".join(message.split())
    Console(stderr=True, soft_wrap=True).print(
        f"[bold red]error:[/] {escape(line)}", highlight=False
    )

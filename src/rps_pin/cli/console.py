"""Options and output that commands share: the robot, JSON, files, progress."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress, track
from rich.table import Table

from rps_pin.bounds import STEPS, most
from rps_pin.cli.completion import names_or_files, preset_names
from rps_pin.cli.printing import PlainConsole, say
from rps_pin.rps import robot_file
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.unit_doubts import LARGEST, unit_doubts

#: Bytes of a number in a table; and of a file whose size is told before it is written.
BYTES, LARGE = 20, 100e6
#: A vector: a pose (z, tilt_x, tilt_y), three leg lengths, a direction.
Three = tuple[float, float, float]

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
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON only.")]
RateOption = Annotated[float, typer.Option(help="Samples per second, Hz.")]
#: Of commands with a fixed folder, and of those that name it after their file.
FolderOption = Annotated[
    Path, typer.Option("--output", "-o", help="Folder for the results; it is made.")
]
NamedFolderOption = Annotated[
    Path | None,
    typer.Option("--output", "-o", help="Folder for the results; default: named after the file."),
]


def pose_option(words: str) -> Any:
    """Return an option that takes a pose."""
    return typer.Option(metavar="Z TILT_X TILT_Y", help=words)


def load_robot(name_or_file: str) -> RPSRobot:
    """Return the robot of a preset's name or of a parameter file; print doubts about its units."""
    robot = robot_file.load_robot(name_or_file)
    for doubt in unit_doubts(robot.parameters):
        say(f"note: {name_or_file}: {doubt}. Units are SI: m, kg, kg m^2", err=True)
    return robot


def doubt_pose(name: str, pose: Three, degrees: bool) -> None:
    """Print a note on a pose of a height beyond `LARGEST`, or of a tilt beyond half a turn.

    The tilts are in radians or degrees.
    """
    height, *tilts = pose
    doubt_lengths(name, "a height", [height])
    if math.hypot(*tilts) > (180.0 if degrees else math.pi):
        given = " ".join(f"{value:g}" for value in tilts)
        told = f"note: {name}: a tilt of {given} {'deg' if degrees else 'rad'} is more than "
        told += "half a turn"
        if not degrees:
            radians = " ".join(f"{value:g}" for value in np.radians(tilts))
            told += f". Tilts are in radians; {given} degrees would be {radians} (see --degrees)"
        say(told, err=True)


def doubt_lengths(name: str, what: str, values: Sequence[float]) -> None:
    """Print a note on lengths of which one is beyond `LARGEST`."""
    if any(abs(value) > LARGEST for value in values):
        given, metres = (
            " ".join(f"{scale * value:g}" for value in values) for scale in (1.0, 1e-3)
        )
        say(
            f"note: {name}: {what} of {given} m? Lengths are in metres; {given} mm would be "
            f"{metres}",
            err=True,
        )


def tell_size(name: str, rows: float, columns: int) -> None:
    """Print a note on a table that will be larger than `LARGE`, before it is computed."""
    size = BYTES * rows * columns
    if size > LARGE and rows <= most(STEPS):  # more are refused elsewhere
        say(
            f"note: {name} will have {rows:.3g} rows of {columns} columns, about "
            f"{1e-6 * size:.3g} MB. Ctrl-C stops it",
            err=True,
        )


def print_json(answer: dict[str, Any]) -> None:
    """Print a result as JSON, paths as strings."""
    typer.echo(json.dumps(answer, indent=2, default=str))


def text_console(as_json: bool = False, **options: Any) -> Console:
    """Return a console for text without highlighting; it prints nothing where JSON is printed."""
    return PlainConsole(quiet=as_json, **options)


def table_of(
    rows: Iterable[Sequence[str]], *headers: str, right: slice = slice(0), **options: Any
) -> Table:
    """Return a table of rows, some columns aligned to the right; without headers, none is shown."""
    table = Table(*headers, show_header=bool(headers), **options)
    for column in table.columns:  # rather than numbers without their last digits
        column.overflow = "fold"
    for column in table.columns[right]:
        column.justify = "right"
    for row in rows:
        table.add_row(*row)
    return table


def print_files(console: Console, files: list[Path]) -> None:
    """Print which files were written."""
    console.print("Written:")
    for file in files:
        console.print(f"  {file}", soft_wrap=True)


def progress_bar(console: Console, task: str) -> Callable[[Iterable[Any]], Iterable[Any]]:
    """Return a wrapper of loops that shows a progress bar on a terminal."""
    return lambda items: track(
        items, task, console=console, transient=True, disable=not console.is_terminal
    )


@contextmanager
def share_bar(console: Console, task: str) -> Iterator[Callable[[float], None]]:
    """Show a progress bar on a terminal; give a function that takes the share that is done."""
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        shown = bar.add_task(task, total=1.0)
        yield lambda done: bar.update(shown, completed=done)

"""``rps-pin new``: files of an own robot, to edit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rps_pin.cli.outputs import OverwriteOption, check_outputs
from rps_pin.cli.own_robot import Kind, own_robot
from rps_pin.cli.printing import say
from rps_pin.files import write_text
from rps_pin.rps.parameters import robot_name


def new_command(
    kind: Annotated[
        Kind,
        typer.Argument(metavar="KIND", help="**3rps**, **stewart**, **delta** or **five-bar**."),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Folder for the files; it is made. Default: the robot's name."
        ),
    ] = None,
    name: Annotated[str, typer.Option(help="Name of the robot and of its files.")] = "mine",
    overwrite: OverwriteOption = False,
) -> None:
    """Write the files of a robot of your own, with comments, to change the numbers in.

    A 3-RPS is **NAME.yaml**, its parameters. The others are **NAME.urdf**, the open tree, and
    **NAME.yaml**, the description that closes its loops. **path.yaml** is a trajectory of it. All
    work at once; what can be done with them is printed.

    Exit status: 0 done; 1 an error; 2 wrong usage.

    Examples:

    - `rps-pin new 3rps`

    - `rps-pin new stewart --name hexapod -o robots`
    """
    try:
        robot_name(name)
    except ValueError as error:
        raise typer.BadParameter(f"{name!r}: {error}", param_hint="--name") from None
    folder = Path(name) if output is None else output
    robot = own_robot(kind, name)
    check_outputs([folder / file for file in robot.files], overwrite)
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in robot.files.items():
        write_text(folder / file, text)
        say(f"wrote {folder / file}")
    say("\nTry:")
    where = "" if folder == Path() else f"{folder}/"
    for command in robot.commands:
        say(f"  rps-pin {command.format(where)}")

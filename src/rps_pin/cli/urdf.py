"""``rps-pin urdf``: the URDF of a 3-RPS."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rps_pin.cli.console import RobotOption, load_robot
from rps_pin.cli.outputs import OverwriteOption, check_outputs
from rps_pin.cli.printing import say
from rps_pin.files import write_text


def urdf_command(
    robot: RobotOption = "sokolov",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File to write; default, and -: standard output."),
    ] = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Write the URDF of a 3-RPS: of a preset, or of a parameter file.

    URDF has no loops: the file holds the open legs, the free platform, and for each leg the two
    frames that the spherical joint connects, *platform_ball_i* and *leg_i_ball*.

    Example: `rps-pin urdf --robot micro -o micro.urdf`
    """
    text = load_robot(robot).urdf
    if output is None or str(output) == "-":
        typer.echo(text, nl=False)
        return
    check_outputs([output], overwrite)
    write_text(output, text)
    say(f"wrote {output}")

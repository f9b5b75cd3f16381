"""``rps-pin check``: a helix against singularities and limits."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from rps_pin.cli import helix_options as helix
from rps_pin.cli.console import JsonOption, RobotOption, load_robot, print_json
from rps_pin.rps.singularity.measures import GRAZE
from rps_pin.rps.singularity.path_check import check_path
from rps_pin.rps.singularity.path_events import LimitEvent, PathCheck, SingularityEvent


def check_command(
    robot: RobotOption = "sokolov",
    radius: helix.RadiusOption = helix.DEFAULT_RADIUS,
    pitch: helix.PitchOption = helix.DEFAULT_PITCH,
    height: helix.HeightOption = None,
    branch: helix.BranchOption = helix.Branch.PLUS,
    duration: helix.DurationOption = helix.DEFAULT_DURATION,
    threshold: Annotated[
        float,
        typer.Option(help="Distance to a singularity (0 to 1) below which a path grazes it."),
    ] = GRAZE,
    as_json: JsonOption = False,
) -> None:
    """Check a helix for singularities that it crosses or grazes, and limits that it leaves.

    Each event is located to a nanosecond. No force is computed.

    Exit status: 0 the path is clear; 1 it is not; 2 wrong usage.

    Examples:

    - `rps-pin check` the paper's helix: clear

    - `rps-pin check --radius 0.075 --pitch 0.05` crosses two singularities

    - `rps-pin check --radius 0.075 --pitch 0.05 --branch -` crosses none
    """
    machine = load_robot(robot)
    path = helix.chosen_helix(machine, radius, pitch, height, branch, duration)
    found = check_path(machine, path, threshold=threshold)
    if as_json:
        events = {name: [_plain(e) for e in getattr(found, name)] for name in _EVENTS}
        print_json(_plain(found) | events | {"robot": machine.parameters.name, "ok": found.ok})
    else:
        console = Console(soft_wrap=True)
        for line in found.lines():
            console.print(line, highlight=False, markup=False)
    if not found.ok:
        raise typer.Exit(1)


#: Fields of `PathCheck` that hold events.
_EVENTS = ("singularities", "limits")


def _plain(found: PathCheck | SingularityEvent | LimitEvent) -> dict[str, object]:
    """Return a named tuple as a dictionary without arrays, for JSON."""
    return {
        name: value.tolist() if isinstance(value, np.ndarray) else value
        for name, value in found._asdict().items()
    }

"""``rps-pin check``: a helix against singularities and limits."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import typer

from rps_pin.cli import console as common
from rps_pin.cli import helix_options as helix
from rps_pin.rps.singularity.path_check import check_path
from rps_pin.task.paths.findings import GRAZE


def check_command(
    robot: common.RobotOption = "sokolov",
    radius: helix.RadiusOption = helix.DEFAULT_RADIUS,
    pitch: helix.PitchOption = helix.DEFAULT_PITCH,
    height: helix.HeightOption = None,
    branch: helix.BranchOption = helix.Branch.PLUS,
    duration: helix.DurationOption = helix.DEFAULT_DURATION,
    threshold: Annotated[
        float,
        typer.Option(help="Distance to a singularity (0 to 1) below which a path grazes it."),
    ] = GRAZE,
    as_json: common.JsonOption = False,
) -> None:
    """Check a helix for singularities that it crosses or grazes, and limits that it leaves.

    Each event is located to a nanosecond. No force is computed.

    Exit status: 0 the path is clear; 1 it is not; 2 wrong usage.

    Examples:

    - `rps-pin check` the paper's helix: clear

    - `rps-pin check --radius 0.075 --pitch 0.05` crosses two singularities

    - `rps-pin check --radius 0.075 --pitch 0.05 --branch -` crosses none
    """
    machine = common.load_robot(robot)
    path = helix.chosen_helix(machine, radius, pitch, height, branch, duration)
    found = check_path(machine, path, threshold=threshold)
    if as_json:
        common.print_json(_plain(found) | {"robot": machine.parameters.name, "ok": found.ok})
    else:
        common.text_console(soft_wrap=True).print(str(found))
    raise typer.Exit(not found.ok)


def _plain(value: Any) -> Any:
    """Return named tuples as dictionaries, and arrays as lists, for JSON."""
    if hasattr(value, "_asdict"):
        return {name: _plain(part) for name, part in value._asdict().items()}
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return value.tolist() if isinstance(value, np.ndarray) else value

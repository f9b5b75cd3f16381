"""``rps-pin check``: a path against singularities and limits."""

from __future__ import annotations

import json
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from rps_pin.cli.console import RobotOption, load_robot
from rps_pin.cli.helix_options import (
    DEFAULT_PITCH,
    DEFAULT_RADIUS,
    Branch,
    BranchOption,
    DurationOption,
    HeightOption,
    PitchOption,
    RadiusOption,
    chosen_helix,
)
from rps_pin.rps.singularity.measures import GRAZE
from rps_pin.rps.singularity.path_check import check_path
from rps_pin.rps.singularity.path_events import LimitEvent, PathCheck, SingularityEvent
from rps_pin.trajectories.helix import PAPER_DURATION


def check_command(
    robot: RobotOption = "sokolov",
    radius: RadiusOption = DEFAULT_RADIUS,
    pitch: PitchOption = DEFAULT_PITCH,
    height: HeightOption = None,
    branch: BranchOption = Branch.PLUS,
    duration: DurationOption = PAPER_DURATION,
    threshold: Annotated[
        float,
        typer.Option(help="Distance to a singularity (0 to 1) below which a path grazes it."),
    ] = GRAZE,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the findings as JSON, and nothing else.")
    ] = False,
) -> None:
    """Check a helix: where and when it meets a singularity, grazes one, or leaves a limit.

    Every event is bracketed to a nanosecond. No force is computed.

    Exit status: 0 the path is clear; 1 it is not; 2 wrong usage.

    Examples:

    - `rps-pin check` the paper's helix: clear

    - `rps-pin check --radius 0.075 --pitch 0.05` crosses two singularities

    - `rps-pin check --radius 0.075 --pitch 0.05 --branch -` crosses none
    """
    machine = load_robot(robot)
    path = chosen_helix(machine, radius, pitch, height, branch, duration)
    found = check_path(machine, path, threshold=threshold)
    if as_json:
        answer = _plain(found) | {
            "robot": machine.parameters.name,
            "ok": found.ok,
            "singularities": [_plain(event) for event in found.singularities],
            "limits": [_plain(event) for event in found.limits],
        }
        typer.echo(json.dumps(answer, indent=2))
    else:
        console = Console(soft_wrap=True)
        for line in found.lines():
            console.print(line, highlight=False, markup=False)
    if not found.ok:
        raise typer.Exit(1)


def _plain(found: PathCheck | SingularityEvent | LimitEvent) -> dict[str, object]:
    """Return a named tuple as a dictionary without arrays, for JSON."""
    return {
        name: value.tolist() if isinstance(value, np.ndarray) else value
        for name, value in found._asdict().items()
    }

"""``rps-pin view``: a 3-RPS in the browser, on this machine only."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from rps_pin.cli.console import RobotOption, load_robot
from rps_pin.cli.helix_options import (
    DEFAULT_HEIGHT,
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
from rps_pin.rps.motion_run import sample_times
from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.helix import PAPER_DURATION
from rps_pin.trajectories.path import Trajectory

_SAMPLE_RATE = 100.0


def view_command(
    robot: RobotOption = "sokolov",
    pose: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            metavar="Z TILT_X TILT_Y",
            help="Show this pose (m, rad, rad) and hold it, instead of playing the helix.",
        ),
    ] = None,
    radius: RadiusOption = DEFAULT_RADIUS,
    pitch: PitchOption = DEFAULT_PITCH,
    height: HeightOption = DEFAULT_HEIGHT,
    branch: BranchOption = Branch.PLUS,
    duration: DurationOption = PAPER_DURATION,
    port: Annotated[
        int | None, typer.Option(help="Port to serve on; without it, a free one is found.")
    ] = None,
) -> None:
    """Show a 3-RPS in the browser: a pose, or the helix in a loop.

    Starts a Meshcat server that answers to this machine only, prints its address, and runs until
    Ctrl-C.

    Examples:

    - `rps-pin view` the paper's helix

    - `rps-pin view --robot micro --pose 0.22 0.1 0`
    """
    # Meshcat and its server are for this command only.
    from rps_pin.viewer import LocalViewer, Scene, play

    machine = load_robot(robot)
    if pose is None:
        path = chosen_helix(machine, radius, pitch, height, branch, duration)
        times, configurations = _motion(machine, path)
    else:
        times, configurations = np.zeros(1), machine.state(pose, np.zeros(3), np.zeros(3))[0][None]
    try:
        with LocalViewer(port, title=f"3-RPS {machine.parameters.name}") as viewer:
            scene = Scene(
                machine.mechanism.model, machine.visual_model(), viewer.window, configurations
            )
            typer.echo(f"Open {viewer.url} in a browser on this machine. Ctrl-C ends.")
            play(scene, times, configurations)
    except KeyboardInterrupt:
        typer.echo("\nended")


def _motion(robot: RPSRobot, path: Trajectory) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times (n,) and configurations (n, nq) of a trajectory."""
    times = sample_times(path.duration, _SAMPLE_RATE)
    return times, robot.state(*path.sample(times))[0]

"""``rps-pin view``: a 3-RPS or any mechanism in the browser, on this machine only."""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path
from typing import Annotated, Any

import typer

from rps_pin.cli import console as common
from rps_pin.cli import helix_options as helix
from rps_pin.cli.completion import mechanism_names, names_or_files
from rps_pin.cli.layer_options import LayersOption, SizeOption, chosen_layers, chosen_size
from rps_pin.cli.mechanism_options import (
    AccuracyOption,
    IgnoreLimitsOption,
    PackagePathOption,
    load_mechanism,
    print_notes,
    shapes_of,
)
from rps_pin.cli.outputs import OverwriteOption, check_outputs
from rps_pin.cli.printing import PlainConsole, say
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.rps.motion.trajectory_file import load_trajectory
from rps_pin.rps.robot import RPSRobot


def view_command(
    trajectory: Annotated[
        Path | None,
        typer.Argument(
            metavar="TRAJECTORY",
            help="A CSV or YAML file of poses, or of the task's coordinates of a mechanism.",
            show_default=False,
        ),
    ] = None,
    robot: common.RobotOption = "sokolov",
    pose: Annotated[
        common.Three | None,
        common.pose_option("Show this pose (m, rad, rad) instead of the helix."),
    ] = None,
    radius: helix.RadiusOption = helix.DEFAULT_RADIUS,
    pitch: helix.PitchOption = helix.DEFAULT_PITCH,
    height: helix.HeightOption = None,
    branch: helix.BranchOption = helix.Branch.PLUS,
    duration: helix.DurationOption = helix.DEFAULT_DURATION,
    layers: LayersOption = None,
    html: Annotated[Path | None, typer.Option(help="Write this page; start no server.")] = None,
    png: Annotated[
        Path | None, typer.Option(help="Write this picture (with Chromium); start no server.")
    ] = None,
    video: Annotated[
        Path | None,
        typer.Option(help="Write this film: .mp4, .gif or .webp; start no server."),
    ] = None,
    overwrite: OverwriteOption = False,
    time: Annotated[float, typer.Option(help="Time of the picture, s.")] = 0.0,
    size: SizeOption = "1000x620",
    background: Annotated[
        str | None,
        typer.Option(
            metavar="COLOUR", help="Of picture and film: white, or transparent (picture only)."
        ),
    ] = None,
    interactive: Annotated[
        bool, typer.Option("--interactive", "-i", help="A panel with sliders and values.")
    ] = False,
    mechanism: Annotated[
        Path | None,
        typer.Option(
            "--mechanism",
            "-m",
            metavar="FILE|NAME",
            help="Any mechanism instead of a 3-RPS: its home, or a trajectory of its task.",
            autocompletion=names_or_files(mechanism_names),
        ),
    ] = None,
    ignore_limits: IgnoreLimitsOption = False,
    accuracy: AccuracyOption = None,
    package_path: PackagePathOption = None,
    port: Annotated[
        int | None, typer.Option(help="Port of the server; default: a free one.")
    ] = None,
) -> None:
    """Show a 3-RPS in the browser: a pose, a trajectory, or the helix; or any mechanism.

    Starts a Meshcat server for this machine only, prints its address, and runs until Ctrl-C. With
    **--html**, **--png** or **--video** it writes files instead. With **--interactive** it serves a
    page with sliders for pose and leg lengths, or for the joints of any mechanism.

    Examples:

    - `rps-pin view` the paper's helix

    - `rps-pin view --robot micro --pose 0.22 0.1 0 --layers limits,ghosts`

    - `rps-pin view --png robot.png --time 2.6 --background white`

    - `rps-pin view --interactive --mechanism delta`

    - `rps-pin view path.csv --mechanism stewart` columns time_s, x_m, ..., rz_rad
    """
    _refuse_both(pose is not None, trajectory is not None, mechanism is not None, interactive)
    if pose is not None:
        common.doubt_pose("--pose", pose)
    if interactive:
        loaded = None if mechanism is None else load_mechanism(mechanism, ignore_limits, accuracy)
        _interact(robot, pose, loaded, package_path, port, layers)
        return
    # Meshcat and its server are for this command only.
    from rps_pin.viewer import save_html, save_png, save_video, show

    machine: RPSRobot | ClosedLoopModel
    motion: Any
    if mechanism is not None:
        loaded = load_mechanism(mechanism, ignore_limits, accuracy)
        machine, motion, drawn = _of_mechanism(loaded, package_path, trajectory)
    else:
        machine, drawn = common.load_robot(robot), {}
        curve = (radius, pitch, height, branch, duration)
        motion = pose or _of_robot(machine, trajectory, curve)
    inputs = [file for file in (trajectory, mechanism) if file is not None]
    outputs = [file for file in (html, png, video) if file is not None]
    check_outputs(outputs, overwrite, inputs=inputs)
    tree = machine.mechanism if isinstance(machine, RPSRobot) else machine
    chosen = chosen_layers(layers, tree) | drawn
    sides = chosen_size(size)
    if html is not None:
        save_html(html, machine, motion, **chosen)
        say(f"wrote {html}")
    picture: dict[str, Any] = {"size": sides, "background": background}
    picture |= drawn | {"layers": chosen["layers"]}
    if png is not None:
        save_png(png, machine, motion, time=time, **picture)
        say(f"wrote {png}")
    if video is not None:
        progress = common.progress_bar(PlainConsole(stderr=True), "drawing")
        save_video(video, machine, motion, progress=progress, **picture)
        say(f"wrote {video}")
    if html or png or video:
        return
    try:
        with show(machine, motion, port=port, **chosen) as view:
            say(f"Open {view.url} in a browser on this machine. Ctrl-C ends.")
            view.play()
    except KeyboardInterrupt:
        say("\nended")


def _refuse_both(pose: bool, trajectory: bool, mechanism: bool, interactive: bool) -> None:
    """Refuse options that do not go together, of which these are given."""
    if pose and (trajectory or mechanism):
        other = "a mechanism" if mechanism else "a trajectory"
        raise typer.BadParameter(f"it does not go with {other}", param_hint="--pose")
    if trajectory and interactive:
        raise typer.BadParameter("the panel takes no trajectory", param_hint="TRAJECTORY")


def _of_mechanism(
    loaded: tuple[ClosedLoopModel, Path], package_path: list[Path] | None, trajectory: Path | None
) -> tuple[ClosedLoopModel, Any, dict[str, Any]]:
    """Return a mechanism, a motion of its task or None for its home, and its shapes."""
    mechanism, file = loaded
    shapes, missing = shapes_of(file, mechanism, package_path)
    print_notes([*mechanism.notes, *missing])
    if trajectory is None:
        return mechanism, None, {"visual": shapes}
    from rps_pin.task.trajectory_file import load_task_trajectory

    return mechanism, load_task_trajectory(trajectory, mechanism.task), {"visual": shapes}


def _of_robot(machine: RPSRobot, trajectory: Path | None, curve: tuple[Any, ...]) -> Any:
    """Return the trajectory of a file, or a helix."""
    if trajectory is not None:
        return load_trajectory(trajectory, machine)
    return helix.chosen_helix(machine, *curve)


def _interact(
    robot: str,
    pose: common.Three | None,
    loaded: tuple[ClosedLoopModel, Path] | None,
    package_path: list[Path] | None,
    port: int | None,
    layers: str | None,
) -> None:
    """Serve a panel until Ctrl-C."""
    from rps_pin.panel import BrowserPanel, MechanismPanel, Panel, RPSPanel

    panel: Panel
    if loaded is None:
        machine = common.load_robot(robot)
        panel, title = RPSPanel(machine, pose), f"3-RPS {machine.parameters.name}"
    else:
        mechanism, file = loaded
        shapes, missing = shapes_of(file, mechanism, package_path)
        print_notes([*mechanism.notes, *missing])
        panel, title = MechanismPanel(mechanism, visual=shapes), mechanism.name
    chosen = chosen_layers(layers or "none", panel.mechanism)
    with BrowserPanel(panel, port=port, title=title, **chosen) as page:
        say(f"Open {page.url} in a browser on this machine. Ctrl-C ends.")
        with contextlib.suppress(KeyboardInterrupt):
            threading.Event().wait()
    say("\nended")

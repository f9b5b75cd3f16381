"""``rps-pin view``: a 3-RPS or any mechanism in the browser, on this machine only."""

from __future__ import annotations

import contextlib
import math
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rps_pin.cli import console as common
from rps_pin.cli import helix_options as helix
from rps_pin.cli.completion import mechanism_names, names_or_files, preset_names
from rps_pin.cli.degrees import DegreesOption
from rps_pin.cli.given_options import given, refuse
from rps_pin.cli.layer_options import LayersOption, SizeOption, chosen_layers, chosen_size
from rps_pin.cli.mechanism_options import (
    AccuracyOption,
    IgnoreLimitsOption,
    PackagePathOption,
    load_mechanism,
    print_notes,
    robot_of_parameters,
    shapes_of,
)
from rps_pin.cli.motion_options import FastestOption, fastest_of_robot, fastest_of_task
from rps_pin.cli.outputs import OverwriteOption, check_outputs
from rps_pin.cli.printing import PlainConsole, say
from rps_pin.cli.task_options import load_path
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.config import read_yaml
from rps_pin.errors import InputError, few
from rps_pin.files import is_folder, is_there
from rps_pin.rps.motion.trajectory_file import load_trajectory
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.robot_file import Kind, kind_of_file

if TYPE_CHECKING:
    from rps_pin.panel import Panel

#: Options by what they are of.
_CURVE = ("radius", "pitch", "height", "branch", "duration")
_OF_MECHANISMS = ("ignore_limits", "accuracy", "package_path")
_OF_FILES = ("html", "png", "video")


def view_command(
    context: typer.Context,
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE|NAME",
            help="A trajectory (CSV or YAML), of the poses of a 3-RPS or of a mechanism's task; or "
            "a robot, shown at its home: a 3-RPS's parameters, a mechanism's description, a URDF, "
            "a MuJoCo file, or the name of one that comes with the package.",
            show_default=False,
            autocompletion=names_or_files(lambda: [*preset_names(), *mechanism_names()]),
        ),
    ] = None,
    robot: common.RobotOption = "sokolov",
    pose: Annotated[
        common.Three | None,
        common.pose_option("Show this pose (m, rad, rad) instead of the helix."),
    ] = None,
    degrees: DegreesOption = False,
    radius: helix.RadiusOption = helix.DEFAULT_RADIUS,
    pitch: helix.PitchOption = helix.DEFAULT_PITCH,
    height: helix.HeightOption = None,
    branch: helix.BranchOption = helix.Branch.PLUS,
    duration: helix.DurationOption = helix.DEFAULT_DURATION,
    fastest: FastestOption = False,
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
        bool,
        typer.Option("--interactive", "-i", help="A panel: sliders, a handle to drag, plots."),
    ] = False,
    poses: Annotated[
        Path | None,
        typer.Option(help="YAML file of named poses, that the panel goes to and adds to."),
    ] = None,
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
    """Show a robot in the browser: its home, a pose, a trajectory, or the helix.

    Without FILE: a 3-RPS on the helix, or the home of a mechanism. Starts a Meshcat server for this
    machine only, prints its address, and runs until Ctrl-C. With **--html**, **--png** or
    **--video** it writes files instead. With **--interactive** it serves a panel: sliders of the
    pose and of the actuators, the platform to drag, a trajectory to play, and plots.

    Examples:

    - `rps-pin view` the paper's helix

    - `rps-pin view mine.yaml` your own robot, at its home

    - `rps-pin view path.csv --robot mine.yaml` on a trajectory

    - `rps-pin view --robot micro --pose 0.22 0.1 0 --layers limits,ghosts`

    - `rps-pin view --png robot.png --time 2.6 --background white`

    - `rps-pin view --interactive --mechanism delta`

    - `rps-pin view path.csv --robot mine.yaml --interactive --poses poses.yaml`

    - `rps-pin view stewart.csv --mechanism stewart` columns time_s, x_m, ..., rz_rad
    """
    kind = None if file is None else _kind(file)
    trajectory = file if kind == "trajectory" else None
    if kind == "parameters":
        refuse(context, f"{file} is a robot already", "robot", "mechanism")
        robot = str(file)
    elif kind == "mechanism":
        refuse(context, f"{file} is a robot already", "robot", "mechanism")
        mechanism = file
    _refuse_what_does_not_fit(context, trajectory, mechanism, pose is not None, interactive)
    still_robot = kind == "parameters" and not given(context, *_CURVE)
    at_home = trajectory is None and (mechanism is not None or interactive)
    if fastest and (pose is not None or still_robot or at_home):
        raise typer.BadParameter("there is no trajectory", param_hint="--fastest")
    pose = None if pose is None else _in_radians(pose, degrees)
    loaded = _loaded(context, robot, mechanism, ignore_limits, accuracy)
    if interactive:
        shown = _panel(loaded, pose, package_path, trajectory, fastest)
        _interact(*shown, port, layers, poses)
        return
    # Meshcat and its server are for this command only.
    from rps_pin.viewer import show
    from rps_pin.viewer.displayed_mechanism import motion_of, without_shapes

    machine: RPSRobot | ClosedLoopModel
    motion: Any
    if not isinstance(loaded, RPSRobot):
        machine, motion, drawn = _of_mechanism(loaded, package_path, trajectory, fastest)
    else:
        machine, drawn = loaded, {}
        curve = (radius, pitch, height, branch, duration)
        motion = pose
        if still_robot or mechanism is not None:
            motion = pose or _of_parameters(machine, trajectory, fastest)
        elif pose is None:
            motion = _of_robot(machine, trajectory, curve, fastest)
    inputs = [one for one in (file, mechanism) if one is not None]
    outputs = [one for one in (html, png, video) if one is not None]
    check_outputs(outputs, overwrite, inputs=inputs)
    with helix.telling_largest(machine, motion):
        motion = motion_of(without_shapes(machine), motion)
        chosen = chosen_layers(layers, machine, motion) | drawn
    picture = {"size": chosen_size(size), "background": background, "layers": chosen["layers"]}
    _write_files((html, png, video), machine, motion, time, chosen, picture | drawn)
    if html or png or video:
        return
    try:
        with show(machine, motion, port=port, **chosen) as view:
            say(f"Open {view.url} in a browser on this machine. Ctrl-C ends.")
            view.play()
    except KeyboardInterrupt:
        say("\nended")


def _in_radians(pose: common.Three, degrees: bool) -> common.Three:
    """Return a pose in m and rad; what looks like another unit is told."""
    common.doubt_pose("--pose", pose, degrees)
    return (pose[0], math.radians(pose[1]), math.radians(pose[2])) if degrees else pose


def _loaded(
    context: typer.Context,
    robot: str,
    mechanism: Path | None,
    ignore_limits: bool,
    accuracy: float | None,
) -> RPSRobot | tuple[ClosedLoopModel, Path]:
    """Return a 3-RPS, which may be given as a mechanism, or a mechanism and its file."""
    if mechanism is None:
        return common.load_robot(robot)
    if kind_of_file(mechanism) == "parameters":
        refuse(context, "a 3-RPS has no meshes", "package_path")
        return robot_of_parameters(mechanism, ignore_limits, accuracy)
    return load_mechanism(mechanism, ignore_limits, accuracy)


def _write_files(
    files: tuple[Path | None, Path | None, Path | None],
    machine: RPSRobot | ClosedLoopModel,
    motion: Any,
    time: float,
    page: dict[str, Any],
    picture: dict[str, Any],
) -> None:
    """Write a page, a picture and a film, those that are asked for."""
    from rps_pin.viewer import save_html, save_png, save_video

    html, png, video = files
    if html is not None:
        save_html(html, machine, motion, **page)
        say(f"wrote {html}")
    if png is not None:
        save_png(png, machine, motion, time=time, **picture)
        say(f"wrote {png}")
    if video is not None:
        progress = common.progress_bar(PlainConsole(stderr=True), "drawing")
        save_video(video, machine, motion, progress=progress, **picture)
        say(f"wrote {video}")


def _kind(file: Path) -> Kind:
    """Return what a file or a name shows: a trajectory, a mechanism, or parameters of a 3-RPS."""
    if is_folder(file):
        return "mechanism"
    if not is_there(file) and not file.suffix:
        if str(file) in preset_names():
            return "parameters"
        if str(file) in mechanism_names():
            return "mechanism"
        names = ", ".join([*preset_names(), *mechanism_names()])
        raise InputError(
            f"{str(file)!r} is not a file or a robot of the package; those are: {names}"
        )
    kind = kind_of_file(file)
    if kind in ("trajectory", "mechanism", "parameters"):
        return kind
    keys = read_yaml(file, "file").values  # or says what is wrong
    if kind == "scenario":
        raise InputError(
            f"{file} is a control scenario: rps-pin control {file} writes a page of its motion"
        )
    raise InputError(
        f"{file} cannot be shown: a trajectory has the key kind, a mechanism urdf or mjcf, a 3-RPS "
        f"base_radius and others; this file has: {few([*map(str, keys)])}"
    )


def _refuse_what_does_not_fit(
    context: typer.Context,
    trajectory: Path | None,
    mechanism: Path | None,
    pose: bool,
    interactive: bool,
) -> None:
    """Refuse options that do not go together."""
    if mechanism is not None:
        refuse(context, "it does not go with a mechanism", "robot", "pose", *_CURVE)
    else:
        refuse(context, "it is an option of a mechanism", *_OF_MECHANISMS)
    if trajectory is not None:
        refuse(context, "it does not go with a trajectory", "pose", *_CURVE)
    if pose:
        refuse(context, "it is of a helix, and does not go with --pose", *_CURVE)
    if interactive:
        alone = "it does not go with --interactive"
        refuse(context, alone, *_OF_FILES, "overwrite", "time", "size", "background", *_CURVE)
        return
    refuse(context, "it is of the panel: see --interactive", "poses")
    if given(context, *_OF_FILES):
        refuse(context, "a file is written, and no server started", "port")
    else:
        refuse(context, "no file is written: see --html, --png and --video", "overwrite")
    if not given(context, "png"):
        refuse(context, "it is the time of a picture: see --png", "time")
    if not given(context, "png", "video"):
        refuse(context, "it is of a picture or film: see --png, --video", "size", "background")


def _of_mechanism(
    loaded: tuple[ClosedLoopModel, Path],
    package_path: list[Path] | None,
    trajectory: Path | None,
    fastest: bool,
) -> tuple[ClosedLoopModel, Any, dict[str, Any]]:
    """Return a mechanism, a motion of its task or None for its home, and its shapes."""
    mechanism, file = loaded
    shapes, missing = shapes_of(file, mechanism, package_path)
    print_notes([*mechanism.notes, *missing])
    if trajectory is None:
        return mechanism, None, {"visual": shapes}
    motion = load_path(trajectory, mechanism.task)
    if fastest:
        motion = fastest_of_task(PlainConsole(stderr=True), mechanism.task, motion)
    return mechanism, motion, {"visual": shapes}


def _of_parameters(machine: RPSRobot, trajectory: Path | None, fastest: bool) -> Any:
    """Return the motion of a 3-RPS that is given as a mechanism, or its home."""
    if trajectory is None:
        z, tilt_x, tilt_y = machine.task.home.tolist()
        return z, tilt_x, tilt_y
    motion = load_path(trajectory, machine.task)
    return fastest_of_robot(PlainConsole(stderr=True), machine, motion) if fastest else motion


def _of_robot(
    machine: RPSRobot, trajectory: Path | None, curve: tuple[Any, ...], fastest: bool
) -> Any:
    """Return the trajectory of a file, or a helix; or the fastest along it."""
    motion = (
        helix.chosen_helix(machine, *curve)
        if trajectory is None
        else load_trajectory(trajectory, machine)
    )
    return fastest_of_robot(PlainConsole(stderr=True), machine, motion) if fastest else motion


def _panel(
    loaded: RPSRobot | tuple[ClosedLoopModel, Path],
    pose: common.Three | None,
    package_path: list[Path] | None,
    trajectory: Path | None,
    fastest: bool,
) -> tuple[Panel, str]:
    """Return a panel, with its trajectory, and its title."""
    from rps_pin.panel import MechanismPanel, RPSPanel

    panel: Panel
    console = PlainConsole(stderr=True)
    if isinstance(loaded, RPSRobot):
        panel, title = RPSPanel(loaded, pose), f"3-RPS {loaded.parameters.name}"
    else:
        mechanism, file = loaded
        shapes, missing = shapes_of(file, mechanism, package_path)
        print_notes([*mechanism.notes, *missing])
        panel, title = MechanismPanel(mechanism, visual=shapes), mechanism.name
    if trajectory is None:
        return panel, title
    motion = panel.read(trajectory)
    if fastest and isinstance(loaded, RPSRobot):
        motion = fastest_of_robot(console, loaded, motion)
    elif fastest:
        motion = fastest_of_task(console, mechanism.task, motion)
    panel.load(motion)
    return panel, title


def _interact(
    panel: Panel, title: str, port: int | None, layers: str | None, poses: Path | None
) -> None:
    """Serve a panel until Ctrl-C."""
    from rps_pin.panel import BrowserPanel, PoseFile

    robot = getattr(panel, "robot", None)
    chosen = chosen_layers(layers or "none", robot or panel.mechanism, panel.motion)
    # Further layers are left out where they have nothing to show.
    chosen["hidden"] += [one for one in ("workspace",) if one not in chosen["layers"]]
    saved = None if poses is None else PoseFile(poses, panel)
    with BrowserPanel(panel, port=port, title=title, poses=saved, **chosen) as page:
        say(f"Open {page.url} in a browser on this machine. Ctrl-C ends.")
        with contextlib.suppress(KeyboardInterrupt):
            threading.Event().wait()
    say("\nended")

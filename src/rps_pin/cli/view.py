"""``rps-pin view``: a 3-RPS in the browser, on this machine only."""

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
from rps_pin.errors import InputError


def view_command(
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
            metavar="FILE|NAME",
            help="With **--interactive**: any mechanism instead of a 3-RPS.",
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
    """Show a 3-RPS in the browser: a pose, or the helix in a loop.

    Starts a Meshcat server for this machine only, prints its address, and runs until Ctrl-C. With
    **--html**, **--png** or **--video** it writes files instead. With **--interactive** it serves a
    page with sliders for pose and leg lengths, or for the joints of any mechanism.

    Examples:

    - `rps-pin view` the paper's helix

    - `rps-pin view --robot micro --pose 0.22 0.1 0 --layers limits,ghosts`

    - `rps-pin view --png robot.png --time 2.6 --background white`

    - `rps-pin view --interactive --mechanism delta`
    """
    if pose is not None:
        common.doubt_pose("--pose", pose)
    if interactive:
        loaded = None if mechanism is None else load_mechanism(mechanism, ignore_limits, accuracy)
        _interact(robot, pose, loaded, package_path, port, layers)
        return
    if mechanism is not None:
        raise InputError("--mechanism goes with --interactive; see rps-pin simulate for its motion")
    # Meshcat and its server are for this command only.
    from rps_pin.viewer import save_html, save_png, save_video, show

    machine = common.load_robot(robot)
    check_outputs([file for file in (html, png, video) if file is not None], overwrite)
    chosen = chosen_layers(layers, machine.mechanism)
    sides = chosen_size(size)
    motion: Any = pose
    if pose is None:
        motion = helix.chosen_helix(machine, radius, pitch, height, branch, duration)
    if html is not None:
        save_html(html, machine, motion, **chosen)
        say(f"wrote {html}")
    picture: dict[str, Any] = {"size": sides, "background": background}
    picture["layers"] = chosen["layers"]
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

"""``rps-pin view``: a 3-RPS in the browser, on this machine only."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import track

from rps_pin.cli.completion import mechanism_names, names_or_files
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
from rps_pin.cli.layer_options import LayersOption, SizeOption, chosen_layers, chosen_size
from rps_pin.cli.mechanism_options import load_mechanism, mechanism_file
from rps_pin.errors import InputError
from rps_pin.trajectories.helix import PAPER_DURATION


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
    height: HeightOption = None,
    branch: BranchOption = Branch.PLUS,
    duration: DurationOption = PAPER_DURATION,
    layers: LayersOption = None,
    html: Annotated[Path | None, typer.Option(help="Write this page, and start no server.")] = None,
    png: Annotated[
        Path | None, typer.Option(help="Write this picture (by a Chromium), and start no server.")
    ] = None,
    video: Annotated[
        Path | None,
        typer.Option(help="Write this film: .mp4, .gif or .webp; and start no server."),
    ] = None,
    time: Annotated[float, typer.Option(help="Moment of the picture, s.")] = 0.0,
    size: SizeOption = "1000x620",
    background: Annotated[
        str | None,
        typer.Option(
            metavar="COLOUR", help="Of picture and film: white, or transparent (picture only)."
        ),
    ] = None,
    interactive: Annotated[
        bool, typer.Option("--interactive", "-i", help="Sliders and readings beside the robot.")
    ] = False,
    mechanism: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE|NAME",
            help="With **--interactive**: any mechanism instead of a 3-RPS.",
            autocompletion=names_or_files(mechanism_names),
        ),
    ] = None,
    port: Annotated[
        int | None, typer.Option(help="Port to serve on; without it, a free one is found.")
    ] = None,
) -> None:
    """Show a 3-RPS in the browser: a pose, or the helix in a loop.

    Starts a Meshcat server that answers to this machine only, prints its address, and runs until
    Ctrl-C. Or writes files: a page, a picture, a film. Or, with **--interactive**, serves a page
    with sliders for pose and leg lengths, or for any mechanism's joints.

    Examples:

    - `rps-pin view` the paper's helix

    - `rps-pin view --robot micro --pose 0.22 0.1 0 --layers limits,ghosts`

    - `rps-pin view --png robot.png --time 2.6 --background white`

    - `rps-pin view --interactive --mechanism delta`
    """
    if interactive:
        _interact(robot, pose, mechanism, port, layers)
        return
    if mechanism is not None:
        raise InputError("--mechanism goes with --interactive; see rps-pin simulate for its motion")
    # Meshcat and its server are for this command only.
    from rps_pin.viewer import fitting_layers, save_html, save_png, save_video, show

    machine = load_robot(robot)
    shown, at_hand = chosen_layers(layers, fitting_layers(machine.mechanism))
    sides = chosen_size(size)
    motion: Any = pose
    if pose is None:
        motion = chosen_helix(machine, radius, pitch, height, branch, duration)
    if html is not None:
        save_html(html, machine, motion, layers=shown, hidden=at_hand)
        typer.echo(f"wrote {html}")
    picture: dict[str, Any] = {"layers": shown, "size": sides, "background": background}
    if png is not None:
        save_png(png, machine, motion, time=time, **picture)
        typer.echo(f"wrote {png}")
    if video is not None:
        save_video(video, machine, motion, progress=_progress, **picture)
        typer.echo(f"wrote {video}")
    if html or png or video:
        return
    try:
        with show(machine, motion, layers=shown, hidden=at_hand, port=port) as view:
            typer.echo(f"Open {view.url} in a browser on this machine. Ctrl-C ends.")
            view.play()
    except KeyboardInterrupt:
        typer.echo("\nended")


def _interact(
    robot: str,
    pose: tuple[float, float, float] | None,
    mechanism: Path | None,
    port: int | None,
    layers: str | None,
) -> None:
    """Serve a panel until Ctrl-C."""
    from rps_pin.closed_loop.visuals import visual_model
    from rps_pin.panel import BrowserPanel, MechanismPanel, Panel, RPSPanel
    from rps_pin.viewer import fitting_layers

    panel: Panel
    if mechanism is None:
        machine = load_robot(robot)
        panel, title = RPSPanel(machine, pose), f"3-RPS {machine.parameters.name}"
    else:
        file = mechanism_file(mechanism)
        loaded = load_mechanism(file)
        shapes = visual_model(file, loaded.model) if file.suffix != ".xml" else None
        panel, title = MechanismPanel(loaded, visual=shapes), loaded.name
    shown, at_hand = chosen_layers(layers or "none", fitting_layers(panel.mechanism))
    with BrowserPanel(panel, port=port, title=title, layers=shown, hidden=at_hand) as page:
        typer.echo(f"Open {page.url} in a browser on this machine. Ctrl-C ends.")
        with contextlib.suppress(KeyboardInterrupt):
            threading.Event().wait()
    typer.echo("\nended")


def _progress(times: Iterable[float]) -> Iterable[float]:
    console = Console(stderr=True)
    return track(
        times,
        "drawing",
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )

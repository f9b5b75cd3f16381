"""Options of the viewer's layers and of the size of pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import pinocchio as pin
import typer

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError
from rps_pin.rps.robot import RPSRobot

LayersOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME,...",
        help="Layers shown at first: trail, forces, reactions, limits, singularity, frames, "
        "closures, ghosts (all assembly modes), workspace; or none. The page can switch each.",
    ),
]
SizeOption = Annotated[
    str, typer.Option(metavar="WIDTHxHEIGHT", help="Of a picture or film, pixels.")
]


def chosen_layers(
    text: str | None, what: RPSRobot | ClosedLoopModel, motion: Any = None
) -> dict[str, Any]:
    """Return the layers that are shown at first, and the hidden ones, which the page can show.

    Parameters
    ----------
    text
        The option's value; None for the trail and the forces, where they have something to show.
    what, motion
        The robot and its motion; the page has the layers that have something to show.
    """
    from rps_pin.viewer import fitting_layers
    from rps_pin.viewer.layers import layers_of

    fitting = fitting_layers(what, motion)
    if text is None:
        shown: list[str] = [name for name in fitting if name in ("trail", "forces")]
    else:
        shown = [name.strip() for name in text.split(",") if name.strip() not in ("", "none")]
        layers_of(shown)  # says which there are
    return {"layers": shown, "hidden": [name for name in fitting if name not in shown]}


def write_page(
    folder: Path,
    subject: RPSRobot | ClosedLoopModel,
    motion: Any,
    title: str,
    layers: str | None = None,
    visual: pin.GeometryModel | None = None,
) -> Path:
    """Write ``viewer.html``, a motion in 3D with its layers, into a folder; return the file."""
    from rps_pin.viewer import save_html
    from rps_pin.viewer.displayed_mechanism import motion_of, without_shapes

    page, motion = folder / "viewer.html", motion_of(without_shapes(subject), motion)
    chosen = chosen_layers(layers, subject, motion)
    save_html(page, subject, motion, visual=visual, title=title, **chosen)
    return page


def chosen_size(text: str) -> tuple[int, int]:
    """Return width and height from ``1000x620``."""
    sides = text.lower().split("x")
    if len(sides) != 2 or not all(side.strip().isdigit() for side in sides):
        raise InputError(f"--size {text}: it must be a width and a height, such as 1000x620")
    return int(sides[0]), int(sides[1])

"""Options of the viewer's layers and of the size of pictures."""

from __future__ import annotations

from typing import Annotated

import typer

from rps_pin.errors import InputError

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


def chosen_layers(text: str | None, fitting: list[str]) -> tuple[list[str], list[str]]:
    """Return the layers that are shown at first, and the other ones of the page.

    Parameters
    ----------
    text
        The option's value; None for the trail and the forces.
    fitting
        Layers that fit the subject.
    """
    from rps_pin.viewer.layers import layers_of

    if text is None:
        shown: list[str] = [name for name in fitting if name in ("trail", "forces")]
    else:
        shown = [name.strip() for name in text.split(",") if name.strip() not in ("", "none")]
        layers_of(shown)  # says which there are
    return shown, [name for name in fitting if name not in shown]


def chosen_size(text: str) -> tuple[int, int]:
    """Return width and height from ``1000x620``."""
    sides = text.lower().split("x")
    if len(sides) != 2 or not all(side.strip().isdigit() for side in sides):
        raise InputError(f"--size {text}: it must be a width and a height, such as 1000x620")
    return int(sides[0]), int(sides[1])

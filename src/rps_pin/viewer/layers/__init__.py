"""What can be shown besides the robot: each layer a node below ``/world/layers``.

A layer is named, or given as an object where it has options::

    save_html("a.html", robot, path, layers=["forces", Trail(factor=200)])
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rps_pin.closed_loop import ClosedLoopModel, LoopClosure
from rps_pin.errors import InputError, shown
from rps_pin.viewer.layers.base import Context, Drawing, Layer, Look, Part
from rps_pin.viewer.layers.closures import Closures
from rps_pin.viewer.layers.forces import Forces
from rps_pin.viewer.layers.frames import Frames
from rps_pin.viewer.layers.ghosts import Ghosts
from rps_pin.viewer.layers.limits import Limits
from rps_pin.viewer.layers.reactions import Reactions
from rps_pin.viewer.layers.singularity import Singularity
from rps_pin.viewer.layers.trail import Trail
from rps_pin.viewer.layers.workspace import WorkspaceSurface

LAYERS: dict[str, Callable[[], Layer]] = {
    "frames": Frames,
    "trail": Trail,
    "forces": Forces,
    "reactions": Reactions,
    "limits": Limits,
    "singularity": Singularity,
    "workspace": WorkspaceSurface,
    "ghosts": Ghosts,
    "closures": Closures,
}
"""Every layer by name, with its ordinary options."""


def layers_of(given: Sequence[str | Layer]) -> list[Layer]:
    """Return layers that are named, or given, as objects.

    Raises
    ------
    InputError
        If there is no such layer; says which there are.
    """
    found: list[Layer] = []
    for one in [given] if isinstance(given, str) else given:
        if isinstance(one, str):
            if one not in LAYERS:
                raise InputError(f"no layer {shown(one)}; there are: {', '.join(LAYERS)}")
            found.append(LAYERS[one]())
        elif hasattr(one, "draw") and not isinstance(one, type):
            found.append(one)
        else:
            raise InputError(f"{shown(one)} is no layer: a name, or an object such as Trail()")
    return found


def fitting_layers(mechanism: ClosedLoopModel) -> list[str]:
    """Return the names of the layers that any motion of a mechanism can have, at little cost."""
    closed = any(isinstance(one, LoopClosure) for one in mechanism.closures)
    of_closures = ["trail", "reactions"] if closed else []
    held = ["closures"] if mechanism.closures else []
    names = ["forces", "limits", "singularity", "frames", *of_closures, *held]
    return [name for name in LAYERS if name in names]


__all__ = [
    "LAYERS",
    "Closures",
    "Context",
    "Drawing",
    "Forces",
    "Frames",
    "Ghosts",
    "Layer",
    "Limits",
    "Look",
    "Part",
    "Reactions",
    "Singularity",
    "Trail",
    "WorkspaceSurface",
    "fitting_layers",
    "layers_of",
]

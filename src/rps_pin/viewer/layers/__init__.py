"""Layers: what is drawn besides the robot, each in a node below ``/world/layers``.

A layer is given by its name, or as an object with its options::

    save_html("a.html", robot, path, layers=["forces", Trail(factor=200)])
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError, shown
from rps_pin.rps.robot import RPSRobot
from rps_pin.viewer.displayed_mechanism import motion_of, without_shapes
from rps_pin.viewer.layers.base import Layer, what_is_missing
from rps_pin.viewer.layers.closures import Closures
from rps_pin.viewer.layers.forces import Forces, Reactions
from rps_pin.viewer.layers.frames import Frames
from rps_pin.viewer.layers.ghosts import Ghosts
from rps_pin.viewer.layers.limits import Limits
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
"""Every layer by name, with its default options."""


def layers_of(given: Sequence[str | Layer]) -> list[Layer]:
    """Return layers that are given by name, or as objects, as objects.

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
            raise InputError(
                f"{shown(one)} is not a layer: give a name, or an object such as Trail()"
            )
    return found


def layer_name(layer: Layer) -> str:
    """Return the name that a layer goes by."""
    kinds = (name for name, kind in LAYERS.items() if type(layer) is kind)
    return next(kinds, type(layer).__name__)


def fitting_layers(what: RPSRobot | ClosedLoopModel, motion: Any = None) -> list[str]:
    """Return the layers that have something to show and are cheap to draw, by name.

    Parameters
    ----------
    what, motion
        A robot or mechanism and its motion or pose, as for `View`. Without a motion the mechanism
        is at rest.

    Raises
    ------
    InputError
        If the motion does not fit.
    """
    subject = without_shapes(what)
    if motion is None and subject.robot is not None:
        motion = subject.robot.task.home
    moved = motion_of(subject, motion)
    cheap = [name for name in LAYERS if name not in ("workspace", "ghosts")]
    return [name for name in cheap if not what_is_missing(LAYERS[name](), subject, moved)]

"""Objects that are the same every time they are made."""

from __future__ import annotations

from typing import Any

import meshcat

from rps_pin.viewer.server.window import Window


def put_object(window: Window, path: str, drawn: Any) -> None:
    """Put a Meshcat object at a place in the scene tree.

    Meshcat names objects after the time and this machine's network address. Named after their
    place instead, the same scene gives the same file, and the file tells nothing of its maker.

    Parameters
    ----------
    window
        Where the command goes.
    path
        The place, for instance ``/world/grid``.
    drawn
        A ``meshcat.geometry.Object``: a geometry with its material. Its identifiers are changed.
    """
    drawn.uuid = path
    drawn.geometry.uuid = f"{path}:geometry"
    drawn.material.uuid = f"{path}:material"
    meshcat.Visualizer(window=window)[path].set_object(drawn)

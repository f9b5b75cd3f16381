"""Handle in viser's scene that drags a task's frame: arrows and rings of its coordinates."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.panel.frame_handle import FrameHandle

_PATH = "/handle"
_ALL = (True, True, True)


class Gizmo:
    """viser's transform controls at a frame: arrows along, and rings about, what are coordinates.

    A single control of viser has arrows and rings of the same axes. So the arrows are one control,
    and the rings, unless there are all three, one each.

    Parameters
    ----------
    scene
        viser's.
    handle
        The frame.
    size
        Length of the arrows, m.
    dragged
        Called with the frame's placement (4, 4), while it is dragged, and whether the drag ended.
    """

    def __init__(
        self,
        scene: Any,
        handle: FrameHandle,
        size: float,
        dragged: Callable[[Array, bool], None],
    ) -> None:
        self._handle, self._dragged = handle, dragged
        self._moving: Any = None
        self._turning: list[Any] = []
        self._held: Any = None
        common = {"depth_test": False, "scale": size, "line_width": 3.0}
        if any(handle.moves):
            self._moving = scene.add_transform_controls(
                f"{_PATH}/move",
                active_axes=handle.moves,
                disable_rotations=True,
                disable_sliders=sum(handle.moves) < 2,
                **common,
            )
        for k, axes in enumerate(_rings(handle.turns)):
            ring = scene.add_transform_controls(
                f"{_PATH}/turn_{k}", active_axes=axes, disable_axes=True, disable_sliders=True,
                **common,
            )  # fmt: skip
            self._turning.append(ring)
        for one in self.controls:
            one.on_update(self._follow)

    @property
    def controls(self) -> list[Any]:
        """Viser's handles of the controls."""
        return [one for one in (self._moving, *self._turning) if one is not None]

    def place(self, q: Array) -> None:
        """Go to the frame at a configuration, except for the control that is dragged now."""
        here = self._handle.placement(q)
        for one in self.controls:
            if one is self._held:
                continue
            turned = self._handle.axes(q) if one is self._moving else here[:3, :3]
            x, y, z, w = pin.Quaternion(turned).coeffs()
            one.wxyz, one.position = (w, x, y, z), tuple(here[:3, 3])
        self._here = here

    def set_visible(self, visible: bool) -> None:
        """Show or hide it."""
        for one in self.controls:
            one.visible = visible

    async def _follow(self, event: Any) -> None:
        """Tell where the frame is dragged to; no thread runs it, so that viser keeps the order."""
        one = event.target
        self._held = None if event.phase == "end" else one
        wanted = self._here.copy()
        if one is self._moving:
            wanted[:3, 3] = np.asarray(one.position)
        else:
            w, x, y, z = one.wxyz
            wanted[:3, :3] = pin.Quaternion(w, x, y, z).normalized().matrix()
        self._dragged(wanted, event.phase == "end")


def _rings(turns: tuple[bool, ...]) -> list[tuple[bool, bool, bool]]:
    """Return the active axes of viser's controls that have these rings.

    The ring about an axis is there where the two others are active.
    """
    if all(turns):
        return [_ALL]
    others = {0: (False, True, True), 1: (True, False, True), 2: (True, True, False)}
    return [others[k] for k in itertools.compress(range(3), turns)]

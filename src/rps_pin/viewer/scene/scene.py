"""A robot on its stage, in any Meshcat window."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import meshcat
import meshcat.geometry as mg
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.viewer.motion import FRAME_RATE, Motion, checked_configurations
from rps_pin.viewer.scene.animation import Clip, animation_command, link_clips
from rps_pin.viewer.scene.bounds import bounding_box
from rps_pin.viewer.scene.links import Link, links_of, node_name
from rps_pin.viewer.scene.objects import put_object
from rps_pin.viewer.scene.shapes import material_of, parts_of
from rps_pin.viewer.scene.stage import WORLD, grid_spacing, set_stage
from rps_pin.viewer.server.window import Window

ROBOT = f"{WORLD}/robot"
"""Path of the node that holds the robot: one child for each link, by the link's name."""
_MOST_FRAMED = 200
"""How many of the configurations are looked at to frame the picture."""


class Scene:
    """Load a robot into a window, frame it, and show it at the first configuration.

    Parameters
    ----------
    model
        The robot.
    visual
        What to draw; see `rps_pin.viewer.scene.shapes.parts_of` for the shapes that can be.
    window
        Where the commands go: a `Recorder`, a `LocalViewer.window`, or Meshcat's own.
    configurations : array_like, shape (nq,) or (n, nq)
        What shall fit into the picture: one configuration, or those of a whole motion. A robot
        with closed loops has no neutral configuration worth showing, so one must be given.

    Attributes
    ----------
    paths : dict of str to str
        The scene-tree path of every link that has something to draw, by the link's name there.
    box : Box
        What the robot fills at these configurations.
    grid_spacing : float
        Distance between the lines of the floor's grid, in metres.

    Raises
    ------
    InputError
        If there is nothing to draw, a shape cannot be drawn, or a configuration does not fit.
    """

    def __init__(
        self,
        model: pin.Model,
        visual: pin.GeometryModel,
        window: Window,
        configurations: ArrayLike,
    ) -> None:
        self.model = model
        self.window = window
        self._data = model.createData()
        self._links = links_of(model, visual)
        self._view = meshcat.Visualizer(window=window)
        self.paths = {link.name: f"{ROBOT}/{link.name}" for link in self._links}

        shown = checked_configurations(model, configurations)
        pieces = {self.paths[link.name]: _pieces(link) for link in self._links}
        stride = -(-len(shown) // _MOST_FRAMED)
        self.box = bounding_box(model, self._links, shown[::stride])
        self.grid_spacing = grid_spacing(self.box.radius)
        set_stage(window, self.box)
        for path, carried in pieces.items():
            for piece in carried:
                place = f"{path}/{piece.name}"
                put_object(window, place, piece.drawn)
                self._view[place].set_transform(piece.placement)
        self._place(shown[0], self._links)

    def display(self, q: ArrayLike) -> None:
        """Show the robot at a configuration.

        Parameters
        ----------
        q : array_like, shape (nq,)
            The configuration.

        Raises
        ------
        InputError
            If it has the wrong shape, is not finite, or holds a quaternion not of unit length.
        """
        rows = checked_configurations(self.model, q)
        if len(rows) != 1:
            raise InputError(f"display shows one configuration; {len(rows)} were given")
        self._place(rows[0], [link for link in self._links if link.moves])

    def animate(
        self, motion: Motion, *, frame_rate: float = FRAME_RATE, more: Sequence[Clip] = ()
    ) -> None:
        """Let the window play a motion by itself, in a loop, with Meshcat's playback controls.

        Parameters
        ----------
        motion
            The motion; it must be one of this scene's model and last longer than zero seconds.
        frame_rate
            Keyframes per second; between them the browser interpolates.
        more
            What else moves, with keyframes at the same times.

        Raises
        ------
        InputError
            If the motion has no duration or the frame rate is not positive.
        """
        if motion.duration <= 0.0:
            raise InputError("a single configuration cannot be animated")
        elapsed, configurations = motion.sampled(frame_rate)
        clips = link_clips(self.model, self._links, self.paths, configurations)
        self.window.send(animation_command(elapsed, [*clips, *more]))

    def _place(self, q: ArrayLike, links: list[Link]) -> None:
        pin.forwardKinematics(self.model, self._data, q)
        for link in links:
            self._view[self.paths[link.name]].set_transform(link.pose(self._data).homogeneous)


class _Piece(NamedTuple):
    """One Meshcat object, fixed to a link."""

    name: str
    """Its name in the scene tree, below the link."""
    drawn: Any
    """A ``meshcat.geometry.Mesh``."""
    placement: Array
    """Homogeneous 4 x 4 placement in the link's frame."""


def _pieces(link: Link) -> list[_Piece]:
    """Return what draws a link's geometries."""
    pieces: list[_Piece] = []
    taken: set[str] = set()
    for item in link.geometries:
        in_link = link.placement.actInv(item.placement).homogeneous
        for part in parts_of(item):
            name = node_name(item.name, taken)
            taken.add(name)
            drawn = mg.Mesh(part.geometry, material_of(item))
            pieces.append(_Piece(name, drawn, in_link @ part.placement))
    return pieces

"""Scene of a robot: its links on a stage, drawn by a front end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.viewer.motion import FRAME_RATE, Motion, checked_configurations
from rps_pin.viewer.scene.bounds import bounding_box
from rps_pin.viewer.scene.keyframes import NodeKeyframes
from rps_pin.viewer.scene.links import Link, link_poses, links_of
from rps_pin.viewer.scene.stage import WORLD, grid_spacing, stage_around
from rps_pin.viewer.writers.meshcat_writer import MeshcatWriter
from rps_pin.viewer.writers.scene_writer import SceneWriter
from rps_pin.viewer.writers.window import Window

ROBOT = f"{WORLD}/robot"
"""Path of the node that holds the robot: one child for each link, by the link's name."""


class Scene:
    """A robot on its stage, shown at the first of the given configurations.

    Parameters
    ----------
    model
        The robot.
    visual
        Its geometry; see `rps_pin.viewer.scene.shapes.drawn_shapes` for the kinds of shapes.
    window
        Meshcat's window: a `Recorder`, a `LocalViewer.window`, or Meshcat's own; or another front
        end, a `SceneWriter`.
    configurations : array_like, shape (nq,) or (n, nq)
        The configurations that the picture is framed for: one, or those of a whole motion. There
        is no default: the neutral configuration of a robot with closed loops is open.
    around : ndarray, shape (k, 3)
        Points in the world that the picture holds besides. Default: none.

    Attributes
    ----------
    paths : dict of str to str
        The scene-tree path of every link that has something to draw, by the link's name there.
    writer : SceneWriter
        The front end.
    box : BoundingBox
        The box that the robot fills at these configurations.
    frame : BoundingBox
        The box that the picture holds: this one, and the points `around` it.
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
        window: Window | SceneWriter,
        configurations: ArrayLike,
        around: Array | None = None,
    ) -> None:
        self.model = model
        self.window = window
        self._data = model.createData()
        self._links = links_of(model, visual)
        self.writer: SceneWriter = MeshcatWriter(window) if isinstance(window, Window) else window
        self.paths = {link.name: f"{ROBOT}/{link.name}" for link in self._links}

        shown = checked_configurations(model, configurations)
        parts = [part for link in self._links for part in link.parts()]
        self.box = bounding_box(model, self._links, shown)
        self.frame = self.box if around is None else self.box.with_points(around)
        self.grid_spacing = grid_spacing(self.frame.radius)
        self.writer.set_stage(stage_around(self.frame, floor=float(self.box.lower[2])))
        for part in parts:
            self.writer.add_part(f"{ROBOT}/{part.node}/{part.name}", part)
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
        self,
        motion: Motion,
        *,
        frame_rate: float = FRAME_RATE,
        more: Sequence[NodeKeyframes] = (),
        readings: Mapping[str, Sequence[str]] | None = None,
    ) -> None:
        """Let the window play a motion in a loop, with Meshcat's playback controls.

        Parameters
        ----------
        motion
            The motion; it must be one of this scene's model and last longer than zero seconds.
        frame_rate
            Keyframes per second; between them the browser interpolates.
        more
            Keyframes of other nodes, at the same times.
        readings
            Texts of the layers at these times, by the layer's name.

        Raises
        ------
        InputError
            If the motion has no duration or the frame rate is not positive.
        """
        if motion.duration <= 0.0:
            raise InputError("a single configuration cannot be animated")
        elapsed, configurations = motion.sampled(frame_rate)
        moving = [link for link in self._links if link.moves]
        poses = link_poses(self.model, moving, configurations)
        keyframes = [
            NodeKeyframes(self.paths[link.name], poses[:, k]) for k, link in enumerate(moving)
        ]
        self.writer.animate(elapsed, [*keyframes, *more], readings or {})

    def set_joint_colour(self, joint: str, colour: Sequence[float] | None) -> None:
        """Colour all links that a joint carries (red, green, blue, 0 to 1); None: as they were."""
        index = self.model.getJointId(joint)
        for part in (part for link in self._links if link.joint == index for part in link.parts()):
            path, own = f"{ROBOT}/{part.node}/{part.name}", part.material
            shares = colour or [((own.colour >> shift) & 0xFF) / 255 for shift in (16, 8, 0)]
            if getattr(part.shape, "colours", None) is None:
                self.writer.set_colour(path, shares, own.opacity)
            elif colour is None:
                self.writer.add_part(path, part)
            else:  # of its vertices, which have colours of their own
                red, green, blue = (round(255 * share) for share in shares)
                plain = own._replace(colour=red << 16 | green << 8 | blue)
                shape = part.shape._replace(colours=None)  # type: ignore[call-arg]
                self.writer.add_part(path, part._replace(shape=shape, material=plain))

    def _place(self, q: Array, links: Sequence[Link]) -> None:
        pin.forwardKinematics(self.model, self._data, q)
        for link in links:
            self.writer.place(self.paths[link.name], link.pose(self._data).homogeneous)

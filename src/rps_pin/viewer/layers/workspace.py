"""Layer ``workspace``: the positions that the platform's centre can reach, as a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rps_pin.rps.workspace import Workspace, boundary, leg_grid, workspace
from rps_pin.rps.workspace.geometry import boundary_conditioning
from rps_pin.viewer.displayed_mechanism import DisplayedMechanism
from rps_pin.viewer.layers import base
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, RobotSizedLayer
from rps_pin.viewer.layers.colours import FIELD, colour_bar
from rps_pin.viewer.motion import Motion
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.shapes import Material, Part, TriangleMesh
from rps_pin.viewer.scene.stage import round_number

_WIDTH = 0.7
"""Width that the surface is magnified to, at most, in radii of the picture."""


@dataclass(frozen=True)
class WorkspaceSurface(RobotSizedLayer):
    """The boundary of a 3-RPS's workspace in positions, coloured by conditioning.

    x and y are magnified about the robot's axis; z is not. The surface passes through itself where
    opposite tilts bring the centre to the same place.

    Parameters
    ----------
    workspace
        A computed workspace. Default: one on a grid of 25 leg lengths each over the stroke.
    factor
        Magnification of x and y, at least 1. Default: a round number.
    """

    workspace: Workspace | None = None
    factor: float | None = None

    def missing(self, subject: DisplayedMechanism, motion: Motion) -> str:
        """Return whether it is no 3-RPS, or one without limits; see `Layer`."""
        other = "only a 3-RPS has one; that of another mechanism's task is a figure of workspace()"
        if subject.robot is None:
            return other
        endless = not np.isfinite(subject.robot.parameters.leg_length_limits[1])
        return "the stroke has no limits" if endless and self.workspace is None else ""

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the surface; see `Layer`."""
        robot = context.subject.robot
        assert robot is not None  # as `missing` has made sure
        base.check_magnification(self.factor, "workspace")
        found = self.workspace
        if found is None:
            found = workspace(robot, leg_grid(robot.parameters, 25))
        surface = boundary(found, "position")
        value = boundary_conditioning(found)
        low, high = float(value.min()), float(value.max())
        colour = np.asarray(FIELD((value - low) / max(high - low, 1e-12)))[:, :3]
        points = np.array(surface.vertices)
        width = float(np.linalg.norm(np.ptp(points[:, :2], axis=0)))
        factor = self.factor or max(1.0, round_number(_WIDTH * context.radius / width))
        mesh = TriangleMesh(points * [factor, factor, 1.0], np.array(surface.faces), colour)
        # On top: it lies about the platform, which would hide it.
        material = Material(0xFFFFFF, opacity=0.55, on_top=True)
        text = f"workspace of the centre, x and y magnified {factor:g} times: conditioning"
        bar = colour_bar(FIELD, f"{low:.2g}", f"{high:.2g}")
        part = Part("surface", "boundary", mesh, material, np.eye(4))
        return DrawnLayer(LegendEntry("workspace", text, bar.colours[3], bar), [part])

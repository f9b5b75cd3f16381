"""Layer ``limits``: the share of its range that each limited joint uses, as a colour."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.rps.kinematics.legs import cone_angles
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.urdf import LEGS
from rps_pin.viewer.layers.base import (
    DrawnLayer,
    LayerContext,
    NodeState,
    RobotSizedLayer,
)
from rps_pin.viewer.layers.colours import BLUE, WARNING, colour_bar, css, warning
from rps_pin.viewer.layers.parts import ball
from rps_pin.viewer.motion import MotionState
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.links import node_name
from rps_pin.viewer.scene.shapes import Material, translated

_WIDEST, _TURN = 1e3, 2.0 * np.pi
"""Ranges above this (m, rad), and whole turns, do not count as limits."""
Share = Callable[[MotionState, pin.Data], tuple[Array, float]]
"""Returns a mark's position and the share of the range in use: 0 in its middle, 1 at an end."""


@dataclass(frozen=True)
class Limits(RobotSizedLayer):
    """A ball at every joint with limits; of a 3-RPS, at the spherical joints too.

    Parameters
    ----------
    size
        Radius of a ball, m. Default: a sixteenth of the picture's.
    """

    size: float | None = None

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the balls; see `Layer`."""
        model, data = context.subject.model, context.subject.model.createData()
        shares: dict[str, Share] = dict(_of_joints(model, context.subject.robot))
        if context.subject.robot is not None:
            shares |= _of_spherical_joints(context.subject.robot)
        size = context.radius / 16.0 if self.size is None else self.size
        parts = [ball(node, size, Material(0xFFFFFF, 0.6)) for node in shares]

        def update(state: MotionState) -> dict[str, NodeState]:
            pin.framesForwardKinematics(model, data, state.q)
            states = {}
            for node, share in shares.items():
                point, used = share(state, data)
                states[node] = NodeState(translated(point), warning(used))
            return states

        text = "range of the joints in use" if shares else "no joint has limits"
        bar = colour_bar(WARNING, "middle", "at a limit") if shares else None
        return DrawnLayer(LegendEntry("limits", text, css(BLUE), bar), parts, update)


def _of_joints(model: pin.Model, robot: RPSRobot | None) -> Mapping[str, Share]:
    """Return the shares of the joints of one coordinate with two limits."""
    unlimited = set()
    if robot is not None and not np.isfinite(robot.parameters.leg_length_limits[1]):
        unlimited = {f"leg_{leg}_prismatic" for leg in LEGS}  # the URDF has a stand-in
    found: dict[str, Share] = {}
    for joint, name in enumerate(model.names):
        if joint == 0 or not model.joints[joint].nq == model.joints[joint].nv == 1:
            continue
        index = model.joints[joint].idx_q
        lower, upper = model.lowerPositionLimit[index], model.upperPositionLimit[index]
        turns = model.joints[joint].shortname().startswith("JointModelR")
        widest = _TURN - 1e-9 if turns else _WIDEST
        if 0.0 < upper - lower < widest and name not in unlimited:
            found[node_name(name)] = _of_joint(model, joint, index, (lower, upper))
    return found


def _of_joint(model: pin.Model, joint: int, index: int, limits: tuple[float, float]) -> Share:
    parent, before = model.parents[joint], model.jointPlacements[joint]
    lower, upper = limits

    def share(state: MotionState, data: pin.Data) -> tuple[Array, float]:
        used = abs(2.0 * (state.q[index] - lower) / (upper - lower) - 1.0)
        # Half way along a sliding joint; where a turning one is.
        rest = (data.oMi[parent] * before).translation
        return (rest + data.oMi[joint].translation) / 2.0, float(used)

    return share


def _of_spherical_joints(robot: RPSRobot) -> Mapping[str, Share]:
    """Return the shares of a 3-RPS's spherical joints, if their cones have a limit."""
    p, model = robot.parameters, robot.mechanism.model
    if p.spherical_cone_limit >= np.pi:
        return {}
    angles = [model.joints[model.getJointId(f"leg_{leg}_revolute")].idx_q for leg in LEGS]
    platform = model.getJointId("platform_free")

    def of_leg(leg: int) -> Share:
        frame = model.getFrameId(f"platform_ball_{leg}")

        def share(state: MotionState, data: pin.Data) -> tuple[Array, float]:
            turn = np.array(data.oMi[platform].rotation)
            cone = cone_angles(state.q[angles], turn, p.spherical_rest_angle)
            used = float(cone[leg - 1] / p.spherical_cone_limit)
            return np.array(data.oMf[frame].translation), used

        return share

    return {f"ball_{leg}": of_leg(leg) for leg in LEGS}

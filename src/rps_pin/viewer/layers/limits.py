"""Layer ``limits``: the share of its range that each limited joint uses, as a colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.rps.kinematics.legs import cone_angles
from rps_pin.rps.leg_frames import LEGS
from rps_pin.rps.robot import RPSRobot
from rps_pin.viewer.displayed_mechanism import DisplayedMechanism
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, NodeState, RobotSizedLayer
from rps_pin.viewer.layers.colours import BLUE, WARNING, colour_bar, css, warning
from rps_pin.viewer.layers.parts import ball
from rps_pin.viewer.motion import Motion, MotionState
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.links import node_name
from rps_pin.viewer.scene.shapes import Material, translated

_WIDEST, _TURN = 1e3, 2.0 * np.pi
"""Ranges above this (m, rad), and whole turns, do not count as limits."""
Use = tuple[Array, float]
"""Position of a mark, and the share of the range in use: 0 in its middle, 1 at an end."""


@dataclass(frozen=True)
class Limits(RobotSizedLayer):
    """A ball at every joint with limits; of a 3-RPS, at the spherical joints too.

    Parameters
    ----------
    size
        Radius of a ball, m. Default: a sixteenth of the picture's.
    """

    size: float | None = None

    def missing(self, subject: DisplayedMechanism, motion: Motion) -> str:
        """Return whether no joint has limits; see `Layer`."""
        robot = subject.robot
        ball_limits = robot is not None and robot.parameters.spherical_cone_limit < np.pi
        limited = _limited_joints(subject.model, robot) or ball_limits
        return "" if limited else "no joint has position limits"

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the balls; see `Layer`."""
        model, data = context.subject.model, context.subject.model.createData()
        robot = context.subject.robot
        joints = _limited_joints(model, robot)

        def uses(q: Array) -> dict[str, Use]:
            pin.framesForwardKinematics(model, data, q)
            found = {node: _joint_use(model, data, joint, q) for node, joint in joints.items()}
            return found if robot is None else found | _spherical_uses(robot, data, q)

        def update(state: MotionState) -> dict[str, NodeState]:
            return {
                node: NodeState(translated(point), warning(share))
                for node, (point, share) in uses(state.q).items()
            }

        def reading(state: MotionState) -> str:
            shares = {node: share for node, (_, share) in uses(state.q).items()}
            most = max(shares, key=shares.__getitem__)
            return f"most: {100 * shares[most]:.0f} % ({most})"

        size = context.radius / 16.0 if self.size is None else self.size
        parts = [ball(node, size, Material(0xFFFFFF, 0.6)) for node in uses(context.motion.at(0.0))]
        bar = colour_bar(WARNING, "middle", "at a limit")
        legend = LegendEntry("limits", "range of the joints in use", css(BLUE), bar)
        return DrawnLayer(legend, parts, update, reading)


def _limited_joints(model: pin.Model, robot: RPSRobot | None) -> dict[str, int]:
    """Return the joints of one coordinate with two limits, by node."""
    unlimited = set()
    if robot is not None and not np.isfinite(robot.parameters.leg_length_limits[1]):
        unlimited = {f"leg_{leg}_prismatic" for leg in LEGS}  # the URDF has a stand-in
    found: dict[str, int] = {}
    for joint, name in enumerate(model.names):
        if joint == 0 or not model.joints[joint].nq == model.joints[joint].nv == 1:
            continue
        index = model.joints[joint].idx_q
        turns = model.joints[joint].shortname().startswith("JointModelR")
        widest = _TURN - 1e-9 if turns else _WIDEST
        width = model.upperPositionLimit[index] - model.lowerPositionLimit[index]
        if 0.0 < width < widest and name not in unlimited:
            found[node_name(name)] = joint
    return found


def _joint_use(model: pin.Model, data: pin.Data, joint: int, q: Array) -> Use:
    index = model.joints[joint].idx_q
    lower, upper = model.lowerPositionLimit[index], model.upperPositionLimit[index]
    # The mark is half way along a sliding joint, and at a turning one.
    rest = (data.oMi[model.parents[joint]] * model.jointPlacements[joint]).translation
    share = abs(2.0 * (q[index] - lower) / (upper - lower) - 1.0)
    return (rest + data.oMi[joint].translation) / 2.0, float(share)


def _spherical_uses(robot: RPSRobot, data: pin.Data, q: Array) -> dict[str, Use]:
    """Return the use of a 3-RPS's spherical joints, if their cones have a limit."""
    p, model = robot.parameters, robot.mechanism.model
    if p.spherical_cone_limit >= np.pi:
        return {}
    rotation = np.array(data.oMi[model.getJointId("platform_free")].rotation)
    shares = cone_angles(q[0:6:2], rotation, p.spherical_rest_angle) / p.spherical_cone_limit
    frames = [model.getFrameId(f"platform_ball_{leg}") for leg in LEGS]
    return {
        f"ball_{leg}": (np.array(data.oMf[frame].translation), float(share))
        for leg, frame, share in zip(LEGS, frames, shares, strict=True)
    }

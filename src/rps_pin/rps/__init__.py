"""The 3-RPS parallel robot: parameters, URDF, closed-form kinematics, a motion's dynamics."""

from rps_pin.rps.conversions import (
    angles_from_pose,
    parasitic_motion,
    pose_from_angles,
    pose_from_position,
    position_from_pose,
)
from rps_pin.rps.legs import LegMotion, Legs
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.placement import constraint_residuals, pose_from_placement
from rps_pin.rps.pose import PlatformMotion
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.three_quantities import poses_from
from rps_pin.rps.urdf import build_urdf

__all__ = [
    "LegMotion",
    "Legs",
    "PlatformMotion",
    "RPSParameters",
    "RPSRobot",
    "angles_from_pose",
    "build_urdf",
    "constraint_residuals",
    "parasitic_motion",
    "pose_from_angles",
    "pose_from_placement",
    "pose_from_position",
    "poses_from",
    "position_from_pose",
]

"""The 3-RPS parallel robot: parameters, URDF, closed-form kinematics."""

from rps_pin.rps.legs import LegMotion, Legs
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.pose import PlatformMotion, pose_from_angles
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.urdf import build_urdf

__all__ = [
    "LegMotion",
    "Legs",
    "PlatformMotion",
    "RPSParameters",
    "RPSRobot",
    "build_urdf",
    "pose_from_angles",
]

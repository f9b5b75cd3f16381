"""The 3-RPS parallel robot: parameters, URDF, closed-form kinematics, a motion's dynamics.

`RPSRobot` is where to begin. What holds for this robot only stands here: poses, assembly modes,
singularities, the workspace (`rps_pin.rps.workspace`), forces three ways, loads, sizing, shortest
times. Its loops and its constrained dynamics are those of `rps_pin.closed_loop`; motions in time
are `rps_pin.trajectories`, the paper's own numbers `rps_pin.reproduction`.
"""

from rps_pin.rps.assembly import AssemblyModes
from rps_pin.rps.conversions import (
    angles_from_pose,
    parasitic_motion,
    pose_from_angles,
    pose_from_position,
    position_from_pose,
)
from rps_pin.rps.force_causes import ForceCauses, force_causes
from rps_pin.rps.forward import EncoderTracker, ForwardKinematics
from rps_pin.rps.lagrange import LagrangeDynamics, lagrange_forces
from rps_pin.rps.legs import LegMotion, Legs
from rps_pin.rps.loads import Payload
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.path_check import check_path
from rps_pin.rps.path_events import LimitEvent, PathCheck, SingularityEvent
from rps_pin.rps.path_refusal import require_clear
from rps_pin.rps.placement import constraint_residuals, pose_from_placement
from rps_pin.rps.pose import PlatformMotion
from rps_pin.rps.rates import (
    leg_jacobian_rates,
    leg_jacobians,
    platform_twist,
    pose_acceleration,
    pose_rate,
)
from rps_pin.rps.reactions import JointReactions, joint_reactions
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity import SingularityMeasures, singular_surface, singularity_measures
from rps_pin.rps.sizing import size_motion, size_trajectory
from rps_pin.rps.sizing_sheet import ActuatorLimits, SizingSheet
from rps_pin.rps.three_quantities import poses_from
from rps_pin.rps.time_optimal import time_optimal
from rps_pin.rps.urdf import build_urdf
from rps_pin.rps.virtual_work import virtual_work_forces

__all__ = [
    "ActuatorLimits",
    "AssemblyModes",
    "EncoderTracker",
    "ForceCauses",
    "ForwardKinematics",
    "JointReactions",
    "LagrangeDynamics",
    "LegMotion",
    "Legs",
    "LimitEvent",
    "PathCheck",
    "Payload",
    "PlatformMotion",
    "RPSParameters",
    "RPSRobot",
    "SingularityEvent",
    "SingularityMeasures",
    "SizingSheet",
    "angles_from_pose",
    "build_urdf",
    "check_path",
    "constraint_residuals",
    "force_causes",
    "joint_reactions",
    "lagrange_forces",
    "leg_jacobian_rates",
    "leg_jacobians",
    "parasitic_motion",
    "platform_twist",
    "pose_acceleration",
    "pose_from_angles",
    "pose_from_placement",
    "pose_from_position",
    "pose_rate",
    "poses_from",
    "position_from_pose",
    "require_clear",
    "singular_surface",
    "singularity_measures",
    "size_motion",
    "size_trajectory",
    "time_optimal",
    "virtual_work_forces",
]

"""The 3-RPS parallel robot: parameters, URDF, closed-form kinematics, a motion's dynamics.

`RPSRobot` is where to begin. What holds for this robot only stands here: poses, assembly modes,
singularities, the workspace (`rps_pin.rps.workspace`), forces, loads, sizing, shortest
times. Its loops and its constrained dynamics are those of `rps_pin.closed_loop`; motions in time
are `rps_pin.trajectories`, the paper's own numbers `rps_pin.paper`.
"""

from rps_pin.moved import moved_names
from rps_pin.rps.dynamics.force_causes import ForceCauses, force_causes
from rps_pin.rps.dynamics.joint_reactions import JointReactions, joint_reactions
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.dynamics.sizing import size_motion, size_trajectory
from rps_pin.rps.kinematics.assembly_modes import AssemblyModes
from rps_pin.rps.kinematics.conversions import (
    angles_from_pose,
    parasitic_motion,
    pose_from_angles,
    pose_from_position,
    position_from_pose,
)
from rps_pin.rps.kinematics.forward_kinematics import EncoderTracker, ForwardKinematics
from rps_pin.rps.kinematics.legs import LegMotion, Legs
from rps_pin.rps.kinematics.placement import constraint_residuals, pose_from_placement
from rps_pin.rps.kinematics.pose import PlatformMotion
from rps_pin.rps.kinematics.rates import (
    leg_jacobian_rates,
    leg_jacobians,
    platform_twist,
    pose_acceleration,
    pose_rate,
)
from rps_pin.rps.kinematics.three_quantities import poses_from
from rps_pin.rps.motion.time_optimal import time_optimal
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.measures import singularity_measures
from rps_pin.rps.singularity.path_check import check_path
from rps_pin.rps.singularity.path_refusal import require_clear
from rps_pin.rps.singularity.surface import singular_surface
from rps_pin.rps.urdf import build_urdf
from rps_pin.task import SingularityMeasures
from rps_pin.task.paths.events import LimitEvent, PathCheck, SingularityEvent
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits, SizingSheet

__getattr__ = moved_names(
    __name__,
    {
        "LagrangeDynamics": "rps_pin.paper",
        "lagrange_forces": "rps_pin.paper",
        "virtual_work_forces": "rps_pin.paper",
    },
)

__all__ = [
    "ActuatorLimits",
    "AssemblyModes",
    "EncoderTracker",
    "ForceCauses",
    "ForwardKinematics",
    "JointReactions",
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
]

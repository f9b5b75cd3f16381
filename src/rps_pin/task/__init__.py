"""A task: the coordinates that a mechanism is for, and what they have to do with its actuators.

`Task` is where to begin: the pose of an output frame, part of it, or angles of joints. It maps
positions, velocities, accelerations, forces and gains both ways between these and the actuators,
of any mechanism, single and in batches, and `Task.compile` does so in generated code.
"""

from rps_pin.numerics.boxes import CertifiedBoxes
from rps_pin.task.certified import certify
from rps_pin.task.loads import Payload
from rps_pin.task.maps import TaskState
from rps_pin.task.motion.limits import MotionLimits
from rps_pin.task.motion.time_optimal import time_optimal
from rps_pin.task.path_check import check_path
from rps_pin.task.paths.events import (
    InterferenceEvent,
    LimitEvent,
    PathCheck,
    PathInterference,
    SingularityEvent,
)
from rps_pin.task.paths.limits import Cone
from rps_pin.task.polytope import Ball, Polytope
from rps_pin.task.singularity import SingularityMeasures
from rps_pin.task.sizing.force_causes import TaskForceCauses, force_causes
from rps_pin.task.sizing.motion_run import TaskMotion, run_motion
from rps_pin.task.sizing.sizing import JointLoad, TaskSizing, size_motion, size_trajectory
from rps_pin.task.sizing.sizing_sheet import DriveLimits
from rps_pin.task.task import Task
from rps_pin.task.trajectory_file import load_task_trajectory

__all__ = [
    "Ball",
    "CertifiedBoxes",
    "Cone",
    "DriveLimits",
    "InterferenceEvent",
    "JointLoad",
    "LimitEvent",
    "MotionLimits",
    "PathCheck",
    "PathInterference",
    "Payload",
    "Polytope",
    "SingularityEvent",
    "SingularityMeasures",
    "Task",
    "TaskForceCauses",
    "TaskMotion",
    "TaskSizing",
    "TaskState",
    "certify",
    "check_path",
    "force_causes",
    "load_task_trajectory",
    "run_motion",
    "size_motion",
    "size_trajectory",
    "time_optimal",
]

"""Closed-loop robots on Pinocchio, in Python; the 3-RPS parallel robot first and completely."""

from importlib.metadata import version

from rps_pin.closed_loop import (
    ClosedLoopModel,
    InverseDynamics,
    JointCoupling,
    JointEffects,
    LoopClosure,
)
from rps_pin.errors import (
    ClosureError,
    InputError,
    MechanismError,
    ParameterError,
    RPSPinError,
    SingularityError,
    UnreachableError,
)
from rps_pin.rps import RPSParameters, RPSRobot
from rps_pin.trajectories import helix

__version__ = version("rps-pin")

__all__ = [
    "ClosedLoopModel",
    "ClosureError",
    "InputError",
    "InverseDynamics",
    "JointCoupling",
    "JointEffects",
    "LoopClosure",
    "MechanismError",
    "ParameterError",
    "RPSParameters",
    "RPSPinError",
    "RPSRobot",
    "SingularityError",
    "UnreachableError",
    "__version__",
    "helix",
]

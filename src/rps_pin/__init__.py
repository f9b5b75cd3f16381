"""Closed-loop robots on Pinocchio, in Python; the 3-RPS parallel robot first and completely."""

from importlib.metadata import version

from rps_pin.closed_loop import (
    ClosedLoopModel,
    ForceBound,
    ForceDistribution,
    InverseDynamics,
    JointCoupling,
    JointEffects,
    LoopClosure,
)
from rps_pin.errors import (
    ClosureError,
    InfeasibleError,
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
    "ForceBound",
    "ForceDistribution",
    "InfeasibleError",
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

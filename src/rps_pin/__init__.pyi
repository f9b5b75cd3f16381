from . import (
    closed_loop,
    control,
    errors,
    panel,
    paper,
    plots,
    reproduction,
    rps,
    trajectories,
    viewer,
)
from .closed_loop import (
    ClosedLoopModel,
    ForceBound,
    ForceDistribution,
    InverseDynamics,
    JointCoupling,
    JointEffects,
    LoopClosure,
)
from .errors import (
    ClosureError,
    InfeasibleError,
    InputError,
    MechanismError,
    ParameterError,
    RPSPinError,
    SingularityError,
    UnreachableError,
)
from .rps import RPSParameters, RPSRobot
from .trajectories import helix

__version__: str

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
    "closed_loop",
    "control",
    "errors",
    "helix",
    "panel",
    "paper",
    "plots",
    "reproduction",
    "rps",
    "trajectories",
    "viewer",
]

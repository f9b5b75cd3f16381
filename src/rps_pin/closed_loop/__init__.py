"""Any mechanism: open chains and loop closures. Knows nothing of the 3-RPS."""

from rps_pin.closed_loop.closure import JointCoupling, LoopClosure
from rps_pin.closed_loop.inverse_dynamics import InverseDynamics
from rps_pin.closed_loop.joint_effects import JointEffects
from rps_pin.closed_loop.loops import LoopErrors
from rps_pin.closed_loop.model import ClosedLoopModel

__all__ = [
    "ClosedLoopModel",
    "InverseDynamics",
    "JointCoupling",
    "JointEffects",
    "LoopClosure",
    "LoopErrors",
]

"""Any mechanism: open chains and loop closures. Knows nothing of the 3-RPS."""

from rps_pin.closed_loop.closure import LoopClosure
from rps_pin.closed_loop.inverse_dynamics import InverseDynamics
from rps_pin.closed_loop.model import ClosedLoopModel, LoopErrors

__all__ = ["ClosedLoopModel", "InverseDynamics", "LoopClosure", "LoopErrors"]

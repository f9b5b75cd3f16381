"""Any mechanism: open chains and loop closures. Knows nothing of the 3-RPS.

`ClosedLoopModel` is where to begin: it reads or composes a tree, closes its loops, and computes
kinematics, dynamics both ways, derivatives and simulations. Pinocchio does the rigid-body work.
Nothing here draws, controls or plans in time: those are `rps_pin.viewer`, `rps_pin.plots`,
`rps_pin.control` and `rps_pin.trajectories`.
"""

from rps_pin.closed_loop.constraints.closures import JointCoupling, LoopClosure
from rps_pin.closed_loop.constraints.equations import LoopErrors
from rps_pin.closed_loop.describe import MechanismDescription
from rps_pin.closed_loop.dynamics.force_bounds import ForceBound, friction_pyramid
from rps_pin.closed_loop.dynamics.force_distribution import DistributedForces, ForceDistribution
from rps_pin.closed_loop.dynamics.inverse_dynamics import InverseDynamics
from rps_pin.closed_loop.dynamics.passive_joint_forces import JointEffects
from rps_pin.closed_loop.editing.compose import Part, body, compose
from rps_pin.closed_loop.editing.merge import JointMerge, merged
from rps_pin.closed_loop.editing.replace import replace_joints
from rps_pin.closed_loop.interference.at_pose import Interference
from rps_pin.closed_loop.interference.distances import LinkDistance, LinkDistances
from rps_pin.closed_loop.interference.shapes import CollisionShapes, composed_shapes
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.closed_loop.simulation.result import JointLimitPassed, Simulation
from rps_pin.closed_loop.simulation.simulate import simulate
from rps_pin.closed_loop.simulation.stepper import Stepper

__all__ = [
    "ClosedLoopModel",
    "CollisionShapes",
    "DistributedForces",
    "ForceBound",
    "ForceDistribution",
    "Interference",
    "InverseDynamics",
    "JointCoupling",
    "JointEffects",
    "JointLimitPassed",
    "JointMerge",
    "LinkDistance",
    "LinkDistances",
    "LoopClosure",
    "LoopErrors",
    "MechanismDescription",
    "Part",
    "Simulation",
    "Stepper",
    "body",
    "compose",
    "composed_shapes",
    "friction_pyramid",
    "merged",
    "replace_joints",
    "simulate",
]

"""Words of a mechanism's functions and their arguments, for headers and pages."""

from __future__ import annotations

from collections.abc import Mapping

from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.codegen.export.names import quoted

#: What arguments and results are, by their names, unless a function says otherwise.
ARGUMENTS: Mapping[str, str] = {
    "q": "configuration",
    "v": "velocities",
    "a": "accelerations",
    "u": "velocities of the independent joints",
    "w": "accelerations of the independent joints",
    "tau": "actuator forces, N and N m",
    "h": "the time, s",
    "wrenches": "forces, N, and moments, N m, in world axes at the origins of the wrench frames",
    "parameters": "the parameters",
    "multipliers": "forces of the closures, in their rows, N and N m",
    "gaps": "gaps of the closures, in their rows, m and rad",
    "jacobian": "J: the gaps' rates are J v",
    "basis": "T: v = T u",
    "residual": "norm of the error of the equations on the joints without actuators, N and N m",
    "unproduced": "forces that the actuators cannot produce, on each joint, N and N m",
    "missing": "their squared size, relative to all that is asked for",
    "force": "forces on the independent joints, N and N m",
    "bias": "forces on the independent joints, N and N m",
    "mass": "mass matrix of the independent joints, kg, kg m and kg m^2",
    "energy": "kinetic and potential energy, J",
    "q_closed": "closed configuration",
    "first": "squared gap of q, over the squared characteristic length",
    "q_next": "configuration after the step",
    "v_next": "velocities after the step",
    "work": "work of actuators, wrenches, damping and friction in the step, J",
    "by_q": "by configurations, along the velocities",
    "by_v": "by velocities",
    "by_a": "by accelerations",
    "by_tau": "by actuator forces",
    "by_position": "along closed motions, by the independent joints' positions",
    "by_velocity": "along closed motions, by the independent joints' velocities",
    "by_acceleration": "along closed motions, by the independent joints' accelerations",
    "by_actuation": "by actuator forces",
}

#: What functions compute, and what some of their arguments are there.
FUNCTIONS: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "gaps": ("Gaps of the closures.", {}),
    "jacobian": ("Jacobian of the closures.", {}),
    "closed": (
        "Closed configuration by Newton's method: the independent joints stay as they are in q, "
        "the others move.",
        {"q": "guess; its quaternions, and its cosines and sines, of length 1"},
    ),
    "motion_basis": ("Velocities of all joints by those of the independent ones.", {}),
    "velocity": ("Velocities that keep the loops closed.", {}),
    "acceleration": (
        "Accelerations that keep the loops closed.",
        {"v": "velocities that keep the loops closed"},
    ),
    "inverse_dynamics": (
        "Actuator forces and closure forces of a motion.",
        {"a": "accelerations that keep the loops closed"},
    ),
    "forward_dynamics": ("Accelerations under actuator forces.", {}),
    "constraint_forces": ("Closure forces of a motion under actuator forces.", {}),
    "generalised_force": (
        "Forces that a motion needs on each joint of the open tree.",
        {"force": "forces on each joint, N and N m"},
    ),
    "mass_matrix": ("Mass matrix of the independent joints: T' M T.", {}),
    "bias": (
        "Forces on the independent joints that keep their velocities: weight, Coriolis and "
        "centrifugal forces, damping, friction, springs.",
        {},
    ),
    "gravity_forces": ("Forces on the independent joints that carry the weight.", {}),
    "energy": ("Kinetic and potential energy.", {}),
    "step": (
        "State after a time under constant actuator forces, by the Runge-Kutta method of order 4, "
        "closed to rounding.",
        {},
    ),
    "inverse_dynamics_derivatives": ("Derivatives of the actuator forces.", {}),
    "forward_dynamics_derivatives": (
        "Derivatives of the accelerations of all joints (by_q, by_v, by_tau) and of the "
        "independent ones (by_position, by_velocity, by_actuation).",
        {},
    ),
}

#: Functions that are exported unless others are asked for.
USUAL = tuple(name for name in FUNCTIONS if not name.endswith("derivatives"))


_FRAME: Mapping[str, str] = {
    "placement": "homogeneous matrix, m",
    "jacobian": "takes u to linear and angular velocity at the frame's origin, in world axes",
}


def of(source: str, mechanism: ClosedLoopModel) -> tuple[str, Mapping[str, str]]:
    """Return a function's sentence, and what some of its arguments are."""
    if not source.startswith("frame_jacobian_"):
        return FUNCTIONS[source]
    frame = mechanism.model.frames[int(source.rpartition("_")[2])].name
    return f"Placement of frame {quoted(frame)} in the world, and its Jacobian.", _FRAME

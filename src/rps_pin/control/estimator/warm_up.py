"""First calls of compiled functions, which compile them, outside the control loop."""

from __future__ import annotations

from rps_pin.control.estimator.leg_geometry import closure_determinant, leg_geometry
from rps_pin.control.estimator.leg_jacobian import (
    force_of_wrench,
    leg_jacobian,
    leg_speed,
    pose_rate,
    wrench_of_force,
)
from rps_pin.control.estimator.robot_state import leg_motion, robot_state
from rps_pin.control.estimator.state_estimate import StateEstimate
from rps_pin.rps.kinematics.tracking import follow

_ZERO = (0.0, 0.0, 0.0)


def warm_up(state: StateEstimate, g: float, h: float) -> None:
    """Call what a loop calls with arguments of the same types; see `rps_pin.numerics.compiled`."""
    geometry = state.geometry
    follow(geometry.length, geometry.direction, geometry.length, g, h, 1.0, 1)
    leg_geometry(geometry.pose, g, h)
    closure_determinant(geometry, g, h)
    robot_state(geometry, _ZERO, _ZERO, h)
    leg_motion(geometry, _ZERO, _ZERO, h)
    jacobian = leg_jacobian(geometry, h)
    for transform in (pose_rate, leg_speed, force_of_wrench, wrench_of_force):
        transform(jacobian, _ZERO)

"""State estimate of a control loop from leg lengths, directions and speeds.

Compositions of `rps_pin.rps.kernels` on floats, compiled as a whole.
"""

from __future__ import annotations

from typing import NamedTuple

from rps_pin.control.estimator.leg_geometry import LegGeometry
from rps_pin.control.estimator.leg_jacobian import LegJacobian, leg_jacobian, pose_rate
from rps_pin.numerics.elementary import Number, atan2, greatest
from rps_pin.rps.kernels.placement import pose_of_legs
from rps_pin.rps.kernels.platform import angular_velocity
from rps_pin.rps.kernels.tilt_functions import tilt_functions
from rps_pin.rps.kernels.tips import tip_rates, tip_slopes
from rps_pin.rps.kinematics.tracking import LegDirections, Triple

#: Velocity of the platform's centre and angular velocity, base axes.
Twist = tuple[float, float, float, float, float, float]


class StateEstimate(NamedTuple):
    """The motion of the robot by its last good reading."""

    geometry: LegGeometry
    rate: Triple
    """Of the pose, m/s, rad/s."""
    speed: Triple
    """Of the legs, m/s."""
    jacobian: LegJacobian


def platform_twist(geometry: LegGeometry, rate: Triple, h: Number) -> Twist:
    """Return the platform's twist."""
    (_, x, y), (dz, dx, dy) = geometry.pose, rate
    (_, vx, vy), _ = tip_rates(tip_slopes(x, y, geometry.tilt), dz, h * dx, h * dy)
    w_x, w_y, w_z = angular_velocity(x, y, dx, dy, geometry.tilt)
    # The centre is half of the tips' horizontal vector; base axes turn the sign of w_z.
    return 0.5 * vx, 0.5 * vy, dz, w_x, w_y, -w_z


def state_estimate(
    d: Triple, direction: LegDirections, speed: Triple, g: float, h: float
) -> tuple[StateEstimate, Twist] | None:
    """Return the state and the platform's twist; None where speeds give no rate (type II)."""
    geometry = geometry_of_legs(d, direction, g, h)
    jacobian = leg_jacobian(geometry, h)
    return None if jacobian.determinant == 0.0 else moving(geometry, jacobian, speed, h)


def geometry_of_legs(d: Triple, direction: LegDirections, g: Number, h: Number) -> LegGeometry:
    """Return the geometry of legs that close the robot."""
    pose = pose_of_legs(d, direction, g, h)
    _, x, y = pose
    c1, c2, c3, s1, s2, s3 = direction
    angle = (atan2(s1, c1), atan2(s2, c2), atan2(s3, c3))
    return LegGeometry(pose, d, angle, direction, tilt_functions(x * x + y * y))


def moving(
    geometry: LegGeometry, jacobian: LegJacobian, speed: Triple, h: Number
) -> tuple[StateEstimate, Twist]:
    """Return the state with leg speeds, and the platform's twist."""
    rate = pose_rate(jacobian, speed)
    return StateEstimate(geometry, rate, speed, jacobian), platform_twist(geometry, rate, h)


def departure(d: Triple, last: Triple, speed: Triple, elapsed: Number) -> Number:
    """Return the largest difference of lengths from the last ones, moved at their speed, m."""
    return greatest(
        abs(d[0] - last[0] - speed[0] * elapsed),
        abs(d[1] - last[1] - speed[1] * elapsed),
        abs(d[2] - last[2] - speed[2] * elapsed),
    )

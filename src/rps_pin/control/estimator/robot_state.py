"""Pinocchio state of a motion of the platform: q, v and a, as `RPSRobot.state` returns them.

Compositions of `rps_pin.rps.kernels` on floats, compiled as a whole.
"""

from __future__ import annotations

from rps_pin.control.estimator.leg_geometry import LegGeometry
from rps_pin.numerics.elementary import Number
from rps_pin.rps.kernels import legs, platform
from rps_pin.rps.kernels import tips as ring
from rps_pin.rps.kinematics.tracking import Triple

#: q (13), v (12), a (12): of legs 1, 2, 3 revolute and prismatic joint, then of the platform
#: (placement with quaternion; velocity and spatial acceleration in platform axes).
RobotState = tuple[float, ...]
#: Of rho and z_i; see `rps_pin.rps.kernels.tips`.
_Rings = tuple[ring.Ring, ring.Ring]


def robot_state(geometry: LegGeometry, rate: Triple, acceleration: Triple, h: Number) -> RobotState:
    """Return the state, 37 numbers, of a pose and its first and second time derivatives."""
    (z, x, y), (d1, d2, d3), (phi1, phi2, phi3), _, tilt = geometry
    _, dx, dy = rate
    _, ddx, ddy = acceleration
    centre, _ = ring.tips(z, x, y, tilt, h)
    rates, accelerations = _tip_motion(geometry, rate, acceleration, h)
    (w1, w2, w3), (s1, s2, s3), (dw1, dw2, dw3), (ds1, ds2, ds3) = _leg_motions(
        geometry, rates, accelerations
    )
    # The platform's centre is half of the tips' horizontal vector.
    (_, dp_x, dp_y), (dp_z, _, _) = rates
    (_, ddp_x, ddp_y), (ddp_z, _, _) = accelerations
    omega = platform.angular_velocity(x, y, dx, dy, tilt)
    alpha = platform.angular_acceleration(x, y, dx, dy, ddx, ddy, tilt)
    v = platform.to_platform(x, y, tilt, (0.5 * dp_x, 0.5 * dp_y, dp_z))
    # Spatial acceleration R' p'' - w x v.
    a = platform.to_platform(x, y, tilt, (0.5 * ddp_x, 0.5 * ddp_y, ddp_z))
    a = platform.total(a, platform.cross(v, omega))
    q_x, q_y, q_w = platform.quaternion(x, y)
    return (
        *(phi1, d1, phi2, d2, phi3, d3, 0.5 * centre[1], 0.5 * centre[2], z, q_x, q_y, 0.0, q_w),
        *(w1, s1, w2, s2, w3, s3, v[0], v[1], v[2], omega[0], omega[1], omega[2]),
        *(dw1, ds1, dw2, ds2, dw3, ds3, a[0], a[1], a[2], alpha[0], alpha[1], alpha[2]),
    )


def leg_motion(
    geometry: LegGeometry, rate: Triple, acceleration: Triple, h: Number
) -> tuple[Triple, Triple]:
    """Return the legs' speeds and accelerations: those of `robot_state`, in less time."""
    rates, accelerations = _tip_motion(geometry, rate, acceleration, h)
    _, speeds, _, changes = _leg_motions(geometry, rates, accelerations)
    return speeds, changes


def _tip_motion(
    geometry: LegGeometry, rate: Triple, acceleration: Triple, h: Number
) -> tuple[_Rings, _Rings]:
    """Return the rates and accelerations of the tips, radial and up."""
    _, x, y = geometry.pose
    dz, dx, dy = rate
    ddz, ddx, ddy = acceleration
    slopes = ring.tip_slopes(x, y, geometry.tilt)
    motion = (x, y, dx, dy, ddx, ddy)
    return ring.tip_rates(slopes, dz, h * dx, h * dy), ring.tip_accelerations(
        motion, ddz, geometry.tilt, h
    )


def _leg_motions(
    geometry: LegGeometry, rates: _Rings, accelerations: _Rings
) -> tuple[Triple, Triple, Triple, Triple]:
    """Return phi', d', phi'' and d''."""
    (d1, d2, d3), (c1, c2, c3, sine_1, sine_2, sine_3) = geometry.length, geometry.direction
    (r1, r2, r3), (z1, z2, z3) = ring.at_legs(rates[0]), ring.at_legs(rates[1])
    (a1, a2, a3), (b1, b2, b3) = ring.at_legs(accelerations[0]), ring.at_legs(accelerations[1])
    s1, w1, ds1, dw1 = legs.leg_motion(c1, sine_1, d1, (r1, z1), (a1, b1))
    s2, w2, ds2, dw2 = legs.leg_motion(c2, sine_2, d2, (r2, z2), (a2, b2))
    s3, w3, ds3, dw3 = legs.leg_motion(c3, sine_3, d3, (r3, z3), (a3, b3))
    return (w1, w2, w3), (s1, s2, s3), (dw1, dw2, dw3), (ds1, ds2, ds3)

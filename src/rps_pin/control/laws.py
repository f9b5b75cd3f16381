"""Control laws as functions of numbers: floats in a loop, CasADi expressions in generated code.

The formulas are explained in `rps_pin.control.loop.computed_torque` and `pd_control`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

from rps_pin.control.estimator.leg_geometry import LegGeometry
from rps_pin.control.estimator.leg_jacobian import force_of_wrench, pose_rate
from rps_pin.control.estimator.robot_state import leg_motion
from rps_pin.control.estimator.state_estimate import StateEstimate
from rps_pin.control.loop.setpoints import Setpoint, difference
from rps_pin.numerics.elementary import Number
from rps_pin.rps.kinematics.tracking import Triple

Compensation = Literal["gravity", "feed_forward", "none"]
#: Kp, Kd, Ki, each for three errors.
GainRows = tuple[Triple, Triple, Triple]
#: What a law calls once with the error, the wanted rate and the rate: `pid` with its memory.
Feedback: TypeAlias = Callable[[Triple, Triple, Triple], Triple]
#: What a law calls with leg geometry, rate and acceleration of the pose: the actuator forces.
Dynamics: TypeAlias = Callable[[LegGeometry, Triple, Triple], Triple | None]

_ZERO = (0.0, 0.0, 0.0)


def pid(
    error: Triple, error_rate: Triple, integral: Triple, gains: GainRows, elapsed: Number
) -> tuple[Triple, Triple]:
    """Return Kd e' + Kp e + I after the step I += Ki e elapsed, and I."""
    (p1, p2, p3), (d1, d2, d3), (k1, k2, k3) = gains
    (e1, e2, e3), (v1, v2, v3), (i1, i2, i3) = error, error_rate, integral
    i1, i2, i3 = i1 + elapsed * k1 * e1, i2 + elapsed * k2 * e2, i3 + elapsed * k3 * e3
    return (
        p1 * e1 + d1 * v1 + i1,
        p2 * e2 + d2 * v2 + i2,
        p3 * e3 + d3 * v3 + i3,
    ), (i1, i2, i3)


def computed_torque(
    in_task_space: bool,
    state: StateEstimate,
    setpoint: Setpoint,
    h: Number,
    feedback: Feedback,
    dynamics: Dynamics,
) -> Triple | None:
    """Return the law's forces; see the module's text."""
    geometry, rate, speed, jacobian = state
    if in_task_space:
        e = difference(setpoint.geometry.pose, geometry.pose)
        c1, c2, c3 = feedback(e, setpoint.rate, rate)
        a1, a2, a3 = setpoint.acceleration
        return dynamics(geometry, rate, (a1 + c1, a2 + c2, a3 + c3))
    speed_wanted, (a1, a2, a3) = leg_motion(*setpoint, h)
    e = difference(setpoint.geometry.length, geometry.length)
    c1, c2, c3 = feedback(e, speed_wanted, speed)
    _, (b1, b2, b3) = leg_motion(geometry, rate, _ZERO, h)
    u = (a1 + c1 - b1, a2 + c2 - b2, a3 + c3 - b3)
    return dynamics(geometry, rate, pose_rate(jacobian, u))


def pd_control(
    in_task_space: bool,
    compensation: Compensation,
    state: StateEstimate,
    setpoint: Setpoint,
    h: Number,
    feedback: Feedback,
    dynamics: Dynamics,
) -> Triple | None:
    """Return the law's forces; see the module's text."""
    geometry, rate, speed, jacobian = state
    if in_task_space:
        e = difference(setpoint.geometry.pose, geometry.pose)
        c = force_of_wrench(jacobian, feedback(e, setpoint.rate, rate))
    else:
        speed_wanted, _ = leg_motion(*setpoint, h)
        e = difference(setpoint.geometry.length, geometry.length)
        c = feedback(e, speed_wanted, speed)
    base: Triple | None = _ZERO
    if compensation == "gravity":
        base = dynamics(geometry, _ZERO, _ZERO)
    elif compensation == "feed_forward":
        base = dynamics(*setpoint)
    return None if base is None else (base[0] + c[0], base[1] + c[1], base[2] + c[2])

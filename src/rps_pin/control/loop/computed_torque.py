"""Computed torque control: commanded accelerations, and their forces by inverse dynamics.

In task space, with x the pose and x_d its target,

    u = x_d'' + Kd (x_d' - x') + Kp (x_d - x) + I,    I' = Ki (x_d - x),
    f = inverse dynamics of (x, x', u).

In actuator space the same law acts on the leg lengths d. The pose's acceleration then follows from
the commanded u by

    x'' = K^-1 (u - K' x'),    K = dd/dx,

where K' x' is the legs' acceleration at x'' = 0. With an exact model each error obeys
e'' + Kd e' + Kp e + integral = 0 independently of the others and of the target's motion. A factor
on the model's inertia is a factor on the loop gain.

**Tuning.** Use `Gains.placed` with the highest bandwidth that `loop_margins` allows (noise and
delay limit it), damping 1, and as much integral action as the uncertainty of the weight needs.
"""

from __future__ import annotations

from rps_pin.control.estimator.leg_jacobian import leg_speed, pose_rate
from rps_pin.control.estimator.robot_state import leg_motion
from rps_pin.control.estimator.state_estimate import StateEstimate
from rps_pin.control.loop.controller import Controller
from rps_pin.control.loop.setpoints import Setpoint, difference
from rps_pin.rps.kinematics.tracking import Triple

_ZERO = (0.0, 0.0, 0.0)


class ComputedTorque(Controller):
    """Computed torque control; gains are in 1/s^2, 1/s and 1/s^3.

    Parameters
    ----------
    robot, near, gains
        As for `Controller`.
    space
        ``"task"`` (the default): errors of the pose, one per coordinate. ``"actuator"``: errors of
        the leg lengths.
    **settings
        As for `Controller`.
    """

    _default_space = "task"

    def _law(self, state: StateEstimate, setpoint: Setpoint, elapsed: float) -> Triple | None:
        geometry, rate, speed, jacobian = state
        if self._in_task_space:
            e = difference(setpoint.geometry.pose, geometry.pose)
            c1, c2, c3 = self._pid(e, setpoint.rate, rate, elapsed)
            a1, a2, a3 = setpoint.acceleration
            return self._solve(geometry, rate, (a1 + c1, a2 + c2, a3 + c3))
        speed_wanted, (a1, a2, a3) = leg_motion(*setpoint, self._h)
        e = difference(setpoint.geometry.length, geometry.length)
        c1, c2, c3 = self._pid(e, speed_wanted, speed, elapsed)
        _, (b1, b2, b3) = leg_motion(geometry, rate, _ZERO, self._h)
        u = (a1 + c1 - b1, a2 + c2 - b2, a3 + c3 - b3)
        return self._solve(geometry, rate, pose_rate(jacobian, u))

    def _command_error(self, state: StateEstimate, force: Triple, acceleration: Triple) -> Triple:
        return acceleration if self._in_task_space else leg_speed(state.jacobian, acceleration)

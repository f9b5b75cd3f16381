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
from rps_pin.control.loop.feedback import Dynamics, Feedback
from rps_pin.control.loop.setpoints import Setpoint, difference
from rps_pin.numerics.elementary import Number
from rps_pin.rps.kinematics.tracking import Triple

_ZERO = (0.0, 0.0, 0.0)


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

    @property
    def _generated_law(self) -> str:
        return f"computed_torque_{self.space}"

    def _law(self, state: StateEstimate, setpoint: Setpoint) -> Triple | None:
        return computed_torque(
            self._in_task_space, state, setpoint, self._h, self._pid, self._solve
        )

    def _command_error(self, state: StateEstimate, force: Triple, acceleration: Triple) -> Triple:
        return acceleration if self._in_task_space else leg_speed(state.jacobian, acceleration)

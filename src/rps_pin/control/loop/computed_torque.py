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

from typing import Any

from rps_pin.control.estimator.state_estimate import StateEstimate
from rps_pin.control.laws import computed_torque
from rps_pin.control.loop.controller import Controller
from rps_pin.control.loop.setpoints import Setpoint


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
        # A class of its own may have another law.
        return f"computed_torque_{self.space}" if type(self) is ComputedTorque else ""

    def _law(self, state: StateEstimate, setpoint: Setpoint) -> Any:
        return computed_torque(
            self._in_task_space, state, setpoint, self._model, self._pid, self._solve
        )

    def _command_error(self, state: StateEstimate, force: Any, acceleration: Any) -> Any:
        return (
            acceleration
            if self._in_task_space
            else self._model.speed_of_rate(state.jacobian, acceleration)
        )

"""PD and PID control with compensation of the weight or of the target's dynamics.

In actuator space, with d the leg lengths and d_d their target, the command is a force,

    f = f_0 + Kd (d_d' - d') + Kp (d_d - d) + I,    I' = Ki (d_d - d).

In task space the same law of the pose gives a wrench, and f = f_0 + K^-T wrench, K = dd/dx. The
compensation f_0 is

- ``"gravity"``: the forces that hold the robot at rest in its pose;
- ``"feed_forward"``: the inverse dynamics of the target;
- ``"none"``: zero, for comparison.

With ``"gravity"`` and without integral the robot settles on a target at rest (Takegaki and Arimoto
1981); behind a moving target it lags by the forces of the motion divided by Kp.

**Tuning.** `Gains.placed(...).times(effective_inertia(robot, pose, space=...))` gives the stiffness
of computed torque in that pose, without the coupling between the errors.
"""

from __future__ import annotations

from typing import Any, cast, get_args

from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.control.estimator.effective_inertia import effective_inertia
from rps_pin.control.estimator.state_estimate import StateEstimate
from rps_pin.control.laws import Compensation, pd_control
from rps_pin.control.loop.controller import Controller
from rps_pin.control.loop.gains import Gains
from rps_pin.control.loop.setpoints import Setpoint
from rps_pin.control.robots import Robot
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.robot import RPSRobot
from rps_pin.task import Task
from rps_pin.validation import choice


class PDControl(Controller):
    """PD (or PID) control with compensation.

    Parameters
    ----------
    robot, near
        As for `Controller`.
    gains
        In actuator space N/m, N s/m and N/(m s). In task space likewise for z, and N m, N m s and
        N m/s (per radian) for the tilts.
    space
        ``"actuator"`` (the default): errors of the leg lengths. ``"task"``: errors of the pose.
    compensation
        f_0: ``"gravity"``, ``"feed_forward"`` or ``"none"``.
    **settings
        As for `Controller`.
    """

    @refuses_other_kinds
    def __init__(
        self,
        robot: Robot,
        near: ArrayLike,
        gains: Gains,
        *,
        compensation: Compensation = "gravity",
        **settings: Any,
    ) -> None:
        checked = choice(compensation, "compensation", get_args(Compensation))
        self.compensation = cast("Compensation", checked)
        super().__init__(robot, near, gains, **settings)

    def _like(self, robot: RPSRobot | Task, start: Array, **settings: Any) -> Controller:
        inertia = effective_inertia(robot, start, space=self.space)
        gains = Gains.placed(15.0, integral=0.2).times(inertia)
        return PDControl(robot, start, gains, compensation=self.compensation, **settings)

    @property
    def _generated_law(self) -> str:
        # A class of its own may have another law.
        return f"pd_control_{self.space}_{self.compensation}" if type(self) is PDControl else ""

    def _law(self, state: StateEstimate, setpoint: Setpoint) -> Any:
        laws = self._in_task_space, self.compensation
        return pd_control(*laws, state, setpoint, self._model, self._pid, self._solve)

    def _command_error(self, state: StateEstimate, force: Any, acceleration: Any) -> Any:
        return self._model.wrench_of_force(state.jacobian, force) if self._in_task_space else force

"""PD control, with what the robot's weight or motion takes added: the command is a force.

In actuator space, with d the leg lengths and d_d their target,

    f = f_0 + Kd (d_d' - d') + Kp (d_d - d) + I,    I' = Ki (d_d - d).

In task space the same law of the pose makes a wrench on it, and f = f_0 + K^-T wrench, K = dd/dx.
f_0 is, by choice,

- ``"gravity"``: the forces that hold the robot still where it is;
- ``"feed_forward"``: those of the target's motion, by inverse dynamics;
- ``"none"``: nothing, for comparison.

With ``"gravity"`` and without integral the robot comes to rest on its target (Takegaki and Arimoto
1981), but falls behind a moving one by what its motion takes, over Kp.

**Tuning.** `Gains.placed(...).times(effective_inertia(robot, pose, space=...))` makes it as stiff
at a pose as computed torque; elsewhere, and across its axes, it is not.
"""

from __future__ import annotations

from typing import Any, Literal

from numpy.typing import ArrayLike

from rps_pin.control.estimator.real_time_robot import Known
from rps_pin.control.estimator.scalar_rates import (
    force_of_wrench,
    leg_gains,
    leg_speed,
    wrench_of_force,
)
from rps_pin.control.estimator.scalar_state import state_at
from rps_pin.control.loop.controller import Controller, Space
from rps_pin.control.loop.gains import Gains
from rps_pin.control.loop.setpoints import Goal, difference
from rps_pin.errors import InputError
from rps_pin.rps.kinematics.tracking import Triple
from rps_pin.rps.robot import RPSRobot

Compensation = Literal["gravity", "feed_forward", "none"]

_STILL = (0.0, 0.0, 0.0)


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
        ``"actuator"``: errors of the leg lengths. ``"task"``: errors of the pose.
    compensation
        f_0: ``"gravity"``, ``"feed_forward"`` or ``"none"``.
    **settings
        As for `Controller`.
    """

    def __init__(
        self,
        robot: RPSRobot,
        near: ArrayLike,
        gains: Gains,
        *,
        space: Space = "actuator",
        compensation: Compensation = "gravity",
        **settings: Any,
    ) -> None:
        if compensation not in ("gravity", "feed_forward", "none"):
            raise InputError(
                f"compensation = {compensation!r}; it must be 'gravity', 'feed_forward' or 'none'"
            )
        self.compensation = compensation
        self._in_task_space = space == "task"
        super().__init__(robot, near, gains, space=space, **settings)

    def _law(self, known: Known, goal: Goal, elapsed: float) -> Triple | None:
        place, rate, speed, gains = known
        if self._in_task_space:
            e = difference(goal.place.pose, place.pose)
            c = force_of_wrench(gains, self._pid(e, goal.rate, rate, elapsed))
        else:
            goal_gains = leg_gains(goal.place.pose, goal.place.way, goal.place.coefficient, self._h)
            e = difference(goal.place.length, place.length)
            c = self._pid(e, leg_speed(goal_gains, goal.rate), speed, elapsed)
        base = self._compensation(known, goal)
        if base is None:
            return None
        return base[0] + c[0], base[1] + c[1], base[2] + c[2]

    def _compensation(self, known: Known, goal: Goal) -> Triple | None:
        """Return f_0."""
        if self.compensation == "gravity":
            return self._solve(state_at(known.place, _STILL, _STILL, self._h))
        if self.compensation == "feed_forward":
            return self._solve(state_at(goal.place, goal.rate, goal.acceleration, self._h))
        return _STILL

    def _missed(self, known: Known, force: Triple, acceleration: Triple) -> Triple:
        return wrench_of_force(known.gains, force) if self._in_task_space else force

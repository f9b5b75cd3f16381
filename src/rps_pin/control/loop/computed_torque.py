"""Computed torque: the command is an acceleration, and inverse dynamics its forces.

In task space, with x the pose and x_d its target,

    u = x_d'' + Kd (x_d' - x') + Kp (x_d - x) + I,    I' = Ki (x_d - x),
    f = inverse dynamics of (x, x', u).

In actuator space the same of the leg lengths d, whose accelerations then follow from u by

    x'' = K^-1 (u - K' x'),    K = dd/dx,

where K' x' is the legs' acceleration at x'' = 0. If the model is right, each error then obeys
e'' + Kd e' + Kp e + integral = 0, by itself: what the target does, and how the robot's parts move
each other, is cancelled. If the model's inertia is wrong by a factor, the loop's gain is.

**Tuning.** `Gains.placed`: as high a bandwidth as `loop_margins` allows (noise and delay set it),
damping 1, and an integral as far as the model's weight is in doubt.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from rps_pin.control.estimator.real_time_robot import Known
from rps_pin.control.estimator.scalar_rates import leg_speed, pose_rate
from rps_pin.control.estimator.scalar_state import leg_motion, state_at
from rps_pin.control.loop.controller import Controller, Space
from rps_pin.control.loop.gains import Gains
from rps_pin.control.loop.setpoints import Goal, difference
from rps_pin.rps.kinematics.tracking import Triple
from rps_pin.rps.robot import RPSRobot

_STILL = (0.0, 0.0, 0.0)


class ComputedTorque(Controller):
    """Computed torque control; gains are in 1/s^2, 1/s and 1/s^3.

    Parameters
    ----------
    robot, near, gains
        As for `Controller`.
    space
        ``"task"``: errors of the pose, each axis of it by itself. ``"actuator"``: errors of the
        leg lengths.
    **settings
        As for `Controller`.
    """

    def __init__(
        self,
        robot: RPSRobot,
        near: ArrayLike,
        gains: Gains,
        *,
        space: Space = "task",
        **settings: Any,
    ) -> None:
        self._in_task_space = space == "task"
        super().__init__(robot, near, gains, space=space, **settings)

    def _law(self, known: Known, goal: Goal, elapsed: float) -> Triple | None:
        place, rate, speed, gains = known
        if self._in_task_space:
            e = difference(goal.place.pose, place.pose)
            c1, c2, c3 = self._pid(e, goal.rate, rate, elapsed)
            a1, a2, a3 = goal.acceleration
            return self._solve(state_at(place, rate, (a1 + c1, a2 + c2, a3 + c3), self._h))
        speed_wanted, (a1, a2, a3) = leg_motion(goal.place, goal.rate, goal.acceleration, self._h)
        e = difference(goal.place.length, place.length)
        c1, c2, c3 = self._pid(e, speed_wanted, speed, elapsed)
        _, (b1, b2, b3) = leg_motion(place, rate, _STILL, self._h)
        u = (a1 + c1 - b1, a2 + c2 - b2, a3 + c3 - b3)
        return self._solve(state_at(place, rate, pose_rate(gains, u), self._h))

    def _missed(self, known: Known, force: Triple, acceleration: Triple) -> Triple:
        return acceleration if self._in_task_space else leg_speed(known.gains, acceleration)

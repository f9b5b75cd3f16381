"""Trajectories traversed at a variable pace.

With s the time along the trajectory and s' the pace, the target's derivatives are

    x' = x_s s',    x'' = x_ss s'^2 + x_s s''.
"""

from __future__ import annotations

import numpy as np

from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.trajectories.path import PathSample, Trajectory
from rps_pin.validation import non_negative_number, positive_number


@refuses_other_kinds
class PacedTrajectory:
    """The targets of a control loop, one per tick.

    Parameters
    ----------
    trajectory
        The trajectory to follow.
    period
        Time between two ticks, s.
    settle
        Time for which the first pose is held at rest before the start, s.

    """

    def __init__(self, trajectory: Trajectory, period: float, *, settle: float = 0.0) -> None:
        self._trajectory = trajectory
        self._period = positive_number(period, "period", "s")
        # Compensated summation (Neumaier): no drift over hours of ticks.
        self._sum, self._lost = -non_negative_number(settle, "settle", "s"), 0.0
        self._pace, self._pace_rate = 1.0, 0.0

    @property
    def time(self) -> float:
        """Time along the trajectory, s; negative before its start."""
        return self._sum + self._lost

    @property
    def done(self) -> bool:
        """Whether the end has been reached."""
        return self.time >= self._trajectory.duration

    def target(self) -> PathSample:
        """Return pose, rate and acceleration now, shape (m,) each; at rest before and after."""
        path = self._trajectory
        # The first and last moment belong to the trajectory in spite of rounding.
        tolerance = 1e-9 * self._period
        outside = self.time < -tolerance or self.time > path.duration + tolerance
        pose, rate, acceleration = path.sample(min(max(self.time, 0.0), path.duration))
        if outside:
            return PathSample(pose, np.zeros_like(pose), np.zeros_like(pose))
        pace = self._pace
        return PathSample(pose, rate * pace, acceleration * pace**2 + rate * self._pace_rate)

    def advance(self, pace: float = 1.0) -> None:
        """Advance by one tick.

        Parameters
        ----------
        pace
            s' at the next tick: `Controller.pace`, or 1 for the trajectory's own.
        """
        self._pace_rate = (pace - self._pace) / self._period
        step = self._period * (self._pace + pace) / 2  # the pace changes linearly in the tick
        total = self._sum + step
        larger, smaller = (self._sum, step) if abs(self._sum) >= abs(step) else (step, self._sum)
        self._lost += larger - total + smaller
        self._sum, self._pace = total, pace

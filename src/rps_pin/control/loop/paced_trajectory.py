"""A trajectory at a pace: its time goes on as fast as the robot can follow.

With s the time along the trajectory and s' the pace, the target's derivatives are

    x' = x_s s',    x'' = x_ss s'^2 + x_s s''.
"""

from __future__ import annotations

import numpy as np

from rps_pin.errors import InputError
from rps_pin.rps.kinematics.leg_equations import checked_positive
from rps_pin.trajectories.path import PathSample, Trajectory


class PacedTrajectory:
    """The targets of a loop, tick by tick.

    Parameters
    ----------
    trajectory
        What to follow.
    period
        Time between two ticks, s.
    settle
        For how long its start is held, at rest, before it begins, s.

    """

    def __init__(self, trajectory: Trajectory, period: float, *, settle: float = 0.0) -> None:
        if not 0.0 <= settle < np.inf:
            raise InputError(f"settle = {settle}: it must be a time, zero or more")
        self._trajectory = trajectory
        self._period = checked_positive(period, "period")
        # A sum and what it has lost to rounding (Neumaier): it must not drift over hours of ticks.
        self._sum, self._lost = -float(settle), 0.0
        self._pace, self._change = 1.0, 0.0

    @property
    def time(self) -> float:
        """Along the trajectory, s; negative before it begins."""
        return self._sum + self._lost

    @property
    def done(self) -> bool:
        """Whether the end has been reached."""
        return self.time >= self._trajectory.duration

    def target(self) -> PathSample:
        """Return pose, rate and acceleration now, shape (3,) each; at rest before and after."""
        path = self._trajectory
        # Rounding makes no rest of the trajectory's own first and last moment.
        tolerance = 1e-9 * self._period
        outside = self.time < -tolerance or self.time > path.duration + tolerance
        pose, slope, bend = path.sample(min(max(self.time, 0.0), path.duration))
        if outside:
            return PathSample(pose, np.zeros(3), np.zeros(3))
        return PathSample(pose, slope * self._pace, bend * self._pace**2 + slope * self._change)

    def advance(self, pace: float = 1.0) -> None:
        """Go on by a tick.

        Parameters
        ----------
        pace
            `Controller.pace`; 1 for the trajectory's own.
        """
        self._change = (pace - self._pace) / self._period
        # On the way from one pace to the other.
        step = self._period * (self._pace + pace) / 2
        total = self._sum + step
        larger, smaller = (self._sum, step) if abs(self._sum) >= abs(step) else (step, self._sum)
        self._lost += larger - total + smaller
        self._sum = total
        self._pace = pace

"""A trajectory as it is played in a panel: samples for its plots, and a clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0)
"""That a trajectory can be played at, of its own."""


class Recording(NamedTuple):
    """What is plotted of a trajectory."""

    time: Array
    """Shape (k,), s."""
    position: Array
    """Of the actuators, shape (k, na), m or rad."""
    force: Array
    """Of the actuators, shape (k, na), N or N m; NaN where they are not determined."""
    conditioning: Array
    """Shape (k,): see `Panel.conditioning`."""
    sample_time: Array
    """Shape (n,), s."""
    configuration: Array
    """At each of these times, shape (n, nq)."""
    rates: tuple[Array, Array]
    """Velocities and accelerations then, shape (n, nv) each."""

    @property
    def duration(self) -> float:
        """S."""
        return float(self.sample_time[-1])

    def near(self, elapsed: float) -> Array:
        """Return the configuration next to a time, shape (nq,)."""
        index = int(np.argmin(np.abs(self.sample_time - elapsed)))
        return np.asarray(self.configuration[index])


class Player:
    """A clock that plays a duration in a loop, with pause, speed and a time that can be set.

    Parameters
    ----------
    duration
        s.
    clock
        Returns the time that passes, s.
    """

    def __init__(self, duration: float, clock: Callable[[], float] = time.monotonic) -> None:
        self.duration, self._clock = duration, clock
        self.playing = False
        self._speed, self._time, self._since = 1.0, 0.0, clock()

    @property
    def time(self) -> float:
        """Time in the trajectory, s; set it to go there."""
        if not self.playing:
            return self._time
        elapsed = self._time + self._speed * (self._clock() - self._since)
        return elapsed % self.duration if elapsed > self.duration else elapsed

    @time.setter
    def time(self, elapsed: float) -> None:
        self._time, self._since = min(max(elapsed, 0.0), self.duration), self._clock()

    @property
    def speed(self) -> float:
        """Of its own speed, positive."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        self.time = self.time
        self._speed = speed

    def play(self, playing: bool = True) -> None:
        """Play on, from the beginning if it is at its end; or pause."""
        now = self.time
        self.playing = playing
        self.time = 0.0 if playing and now >= self.duration else now

"""Circles and Lissajous figures that the platform's tilt describes, the angle u growing by a law.

circle:     tilt = beta (cos(start + u), sin(start + u)),  z = height
Lissajous:  tilt = (a_x sin(m u + p_x), a_y sin(n u + p_y)),  z = height + a_z sin(k u)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Integral, Real

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.errors import InputError, shown
from rps_pin.trajectories.curve import CurveSample, TimedCurve
from rps_pin.trajectories.path import Array, checked_parameters
from rps_pin.trajectories.time_laws import Profile, positive, time_law


class HarmonicCurve:
    """Each coordinate of the pose swings: x_i(u) = middle_i + size_i sin(frequency_i u + phase_i).

    Parameters
    ----------
    middle, size
        Of (z, tilt_x, tilt_y), shape (3,), m and rad.
    frequency, phase
        Swings per turn of u, and where they begin (rad), shape (3,).
    length
        Where u ends, rad.
    """

    def __init__(
        self, middle: ArrayLike, size: ArrayLike, frequency: ArrayLike, phase: ArrayLike,
        length: float,
    ) -> None:  # fmt: skip
        self._middle, self._size, self._frequency, self._phase = (
            np.asarray(value, dtype=np.float64) for value in (middle, size, frequency, phase)
        )
        self.length = length

    def __repr__(self) -> str:
        return (
            f"HarmonicCurve(middle={self._middle.tolist()}, size={self._size.tolist()}, "
            f"frequency={self._frequency.tolist()}, phase={self._phase.tolist()}, "
            f"length={self.length:.6g})"
        )

    def at(self, u: ArrayLike) -> CurveSample:
        """Return pose and derivatives at u of shape (...), rad."""
        along = checked_parameters(u, self.length)
        angle = self._frequency * along[..., None] + self._phase
        swing: Array = self._size * np.sin(angle)
        return CurveSample(
            self._middle + swing,
            self._size * self._frequency * np.cos(angle),
            -swing * self._frequency**2,
        )


def circle(
    *,
    height: float,
    tilt: float,
    turns: float = 1.0,
    start: float = 0.0,
    duration: float,
    profile: Profile = "s-curve",
) -> TimedCurve:
    """Return a motion in which a tilt of constant size turns about, from rest to rest.

    Parameters
    ----------
    height
        z, m.
    tilt
        Size of the tilt, rad; positive.
    turns
        How often it turns about; positive.
    start
        Where its rotation vector points at first, rad from the x axis.
    duration
        In s.
    profile
        The law of time; see `time_laws`.

    Raises
    ------
    InputError
        If a number is not finite, or not positive where it must be.
    """
    quarter = math.pi / 2  # cos(start + u) = sin(u + start + pi/2)
    first = _finite(start, "start")
    size = positive(tilt, "tilt")
    curve = HarmonicCurve(
        [_finite(height, "height"), 0.0, 0.0],
        [0.0, size, size],
        [0.0, 1.0, 1.0],
        [0.0, first + quarter, first],
        2 * math.pi * positive(turns, "turns"),
    )
    return TimedCurve(curve, time_law(curve.length, profile, duration=duration))


def lissajous(
    *,
    height: float,
    amplitude: Sequence[float],
    frequency: Sequence[int],
    phase: Sequence[float] = (0.0, 0.0),
    lift: tuple[float, int] = (0.0, 1),
    turns: float = 1.0,
    duration: float,
    profile: Profile = "s-curve",
) -> TimedCurve:
    """Return a motion in which the tilts swing at whole multiples of one angle, from rest to rest.

    Parameters
    ----------
    height
        Middle height, m.
    amplitude
        Of tilt_x and tilt_y, rad; at least one is not zero, unless the platform is lifted.
    frequency
        Swings of tilt_x and of tilt_y in a turn; whole numbers of 1 or more.
    phase
        Where they begin, rad.
    lift
        Amplitude (m) and frequency of the height.
    turns
        How often the figure is drawn; positive.
    duration, profile
        As for `circle`.

    Raises
    ------
    InputError
        If a number is not finite, or not what it must be; or if nothing moves.
    """
    sizes, frequencies, phases = (
        _pair(value, name)
        for name, value in (("amplitude", amplitude), ("frequency", frequency), ("phase", phase))
    )
    lifted, lift_frequency = _pair(lift, "lift")
    size = [_finite(lifted, "lift"), *(_finite(one, "amplitude") for one in sizes)]
    if not any(size):
        raise InputError("amplitude and lift are zero: nothing moves")
    curve = HarmonicCurve(
        [_finite(height, "height"), 0.0, 0.0],
        size,
        [_whole(one, "frequency") for one in (lift_frequency, *frequencies)],
        [0.0, *(_finite(one, "phase") for one in phases)],
        2 * math.pi * positive(turns, "turns"),
    )
    return TimedCurve(curve, time_law(curve.length, profile, duration=duration))


def _pair(value: Sequence[float], name: str) -> tuple[float, float]:
    if not isinstance(value, (Sequence, np.ndarray)) or isinstance(value, str) or len(value) != 2:
        raise InputError(f"{name} = {shown(value)}: it must be two numbers")
    return value[0], value[1]


def _whole(value: float, name: str) -> int:
    if not isinstance(value, Integral) or isinstance(value, bool) or value < 1:
        raise InputError(f"{name} = {shown(value)}: it must be a whole number of 1 or more")
    return int(value)


def _finite(value: float, name: str) -> float:
    if not isinstance(value, Real) or isinstance(value, bool) or not math.isfinite(value):
        raise InputError(f"{name} = {shown(value)}: it must be a finite number")
    return float(value)

"""Circles and Lissajous figures that the platform's tilt describes, the angle u growing by a law.

circle:     tilt = beta (cos(start + u), sin(start + u)),  z = height
Lissajous:  tilt = (a_x sin(m u + p_x), a_y sin(n u + p_y)),  z = height + a_z sin(k u)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.trajectories.curve import CurveSample, TimedCurve
from rps_pin.trajectories.path import checked_parameters
from rps_pin.trajectories.poses import finite_array, finite_number
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
        Where u ends, rad; positive.

    Raises
    ------
    InputError
        If a number is not finite, or an array of another shape.
    """

    def __init__(
        self, middle: ArrayLike, size: ArrayLike, frequency: ArrayLike, phase: ArrayLike,
        length: float,
    ) -> None:  # fmt: skip
        self._middle = _three(middle, "middle")
        self._size = _three(size, "size")
        self._frequency = _three(frequency, "frequency")
        self._phase = _three(phase, "phase")
        self.length = positive(length, "length")

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
    first = finite_number(start, "start")
    size = positive(tilt, "tilt")
    curve = HarmonicCurve(
        [finite_number(height, "height"), 0.0, 0.0],
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
    size = [
        finite_number(lifted, "lift's amplitude"),
        *(finite_number(one, "amplitude") for one in sizes),
    ]
    swings = [_whole(one, "frequency") for one in frequencies]
    if not any(size):
        raise InputError("amplitude and lift are zero: nothing moves")
    curve = HarmonicCurve(
        [finite_number(height, "height"), 0.0, 0.0],
        size,
        [_whole(lift_frequency, "lift's frequency"), *swings],
        [0.0, *(finite_number(one, "phase") for one in phases)],
        2 * math.pi * positive(turns, "turns"),
    )
    return TimedCurve(curve, time_law(curve.length, profile, duration=duration))


def _pair(value: Sequence[float], name: str) -> tuple[float, float]:
    numbers = value.tolist() if isinstance(value, np.ndarray) else value
    if not isinstance(numbers, Sequence) or isinstance(numbers, str) or len(numbers) != 2:
        raise InputError(f"{name} = {shown(value)}: it must be two numbers")
    return numbers[0], numbers[1]


def _three(value: ArrayLike, name: str) -> Array:
    array = finite_array(value, 1, name)
    if array.shape != (3,):
        raise InputError(f"{name} has shape {array.shape}; it must be (3,): of z, tilt_x, tilt_y")
    return array


def _whole(value: float, name: str) -> int:
    if not isinstance(value, Integral) or isinstance(value, bool) or value < 1:
        raise InputError(f"{name} = {shown(value)}: it must be a whole number of 1 or more")
    return int(value)

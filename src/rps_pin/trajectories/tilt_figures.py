"""Circles and Lissajous figures of the platform's tilt, over an angle u that follows a law of time.

circle:     tilt = beta (cos(start + u), sin(start + u)),  z = height
Lissajous:  tilt = (a_x sin(m u + p_x), a_y sin(n u + p_y)),  z = height + a_z sin(k u)
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.trajectories.curve import CurveSample, TimedCurve
from rps_pin.trajectories.path import POSE, checked_parameters
from rps_pin.trajectories.time_laws import Profile, time_law
from rps_pin.validation import finite_number, fixed_array, positive_number, whole_number


@refuses_other_kinds
class HarmonicCurve:
    """Harmonic coordinates: x_i(u) = middle_i + size_i sin(frequency_i u + phase_i).

    Parameters
    ----------
    middle, size
        Of (z, tilt_x, tilt_y), or a task's coordinates, shape (m,), m and rad.
    frequency, phase
        Periods in a turn of u, and angles at u = 0 (rad), shape (m,).
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
        self._middle = fixed_array(middle, "middle", (None,), POSE)
        shape = self._middle.shape
        self._size = fixed_array(size, "size", shape, POSE)
        self._frequency = fixed_array(frequency, "frequency", shape, POSE)
        self._phase = fixed_array(phase, "phase", shape, POSE)
        self.length = positive_number(length, "length")

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
        sines: Array = self._size * np.sin(angle)
        return CurveSample(
            self._middle + sines,
            self._size * self._frequency * np.cos(angle),
            -sines * self._frequency**2,
        )


@refuses_other_kinds
def circle(
    *,
    height: float,
    tilt: float,
    turns: float = 1.0,
    start: float = 0.0,
    duration: float,
    profile: Profile = "s-curve",
) -> TimedCurve:
    """Return a motion whose tilt has a constant size and turns, from rest to rest.

    Parameters
    ----------
    height
        z, m.
    tilt
        Size of the tilt, rad; positive.
    turns
        Number of turns; positive.
    start
        Direction of the rotation vector at first, rad from the x axis.
    duration
        In s.
    profile
        The law of time; see `time_laws`.

    Raises
    ------
    InputError
        If a number is not finite, or not positive where it must be.
    """
    size, first = positive_number(tilt, "tilt"), finite_number(start, "start")
    return lissajous(
        height=height,
        amplitude=(size, size),
        frequency=(1, 1),
        phase=(first + math.pi / 2, first),  # cos(start + u) = sin(u + start + pi/2)
        turns=turns,
        duration=duration,
        profile=profile,
    )


@refuses_other_kinds
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
    """Return a motion whose tilts are sines of multiples of one angle, from rest to rest.

    Parameters
    ----------
    height
        Middle height, m.
    amplitude
        Of tilt_x and tilt_y, rad; both may be zero only with a lift.
    frequency
        Periods of tilt_x and of tilt_y in a turn; whole numbers of 1 or more.
    phase
        At the start, rad.
    lift
        Amplitude (m) and frequency of the height.
    turns
        Number of turns; positive.
    duration, profile
        As for `circle`.

    Raises
    ------
    InputError
        If a number is not finite, or not what it must be; or if nothing moves.
    """
    lifted, lift_frequency = _pair(lift, "lift")
    size = [finite_number(lifted, "lift's amplitude")]
    size += [finite_number(one, "amplitude") for one in _pair(amplitude, "amplitude")]
    swings = [whole_number(one, "frequency") for one in _pair(frequency, "frequency")]
    phases = [finite_number(one, "phase") for one in _pair(phase, "phase")]
    if not any(size):
        raise InputError("amplitude and lift are zero: nothing moves")
    curve = HarmonicCurve(
        [finite_number(height, "height"), 0.0, 0.0],
        size,
        [whole_number(lift_frequency, "lift's frequency"), *swings],
        [0.0, *phases],
        2 * math.pi * positive_number(turns, "turns"),
    )
    return TimedCurve(curve, time_law(curve.length, profile, duration=duration))


def _pair(value: Sequence[float], name: str) -> tuple[float, float]:
    numbers = value.tolist() if isinstance(value, np.ndarray) else value
    if not isinstance(numbers, Sequence) or isinstance(numbers, str) or len(numbers) != 2:
        raise InputError(f"{name} = {shown(value)}: it must be two numbers")
    return numbers[0], numbers[1]

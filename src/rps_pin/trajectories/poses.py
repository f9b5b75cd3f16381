"""Numbers and poses given to a trajectory: finite, of the right shape, kept where nobody writes."""

from __future__ import annotations

import math
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown

#: No number given to a trajectory is larger (m, rad, s): what is reckoned from them stays finite.
_LARGEST = 1e50


def real(value: object) -> float:
    """Return a single real number as a float; NaN for all else, such as True."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return math.nan
    try:
        return float(value)
    except OverflowError:  # a whole number of hundreds of digits
        return math.nan


def finite_number(value: float, name: str, unit: str = "") -> float:
    """Return a number that is finite, and not absurdly large; `unit` is named in the error.

    Raises
    ------
    InputError
        If it is none.
    """
    number = real(value)
    if not abs(number) <= _LARGEST:
        wanted = f"a finite number{unit and f' of {unit}'}"
        raise InputError(f"{name} = {shown(value)}: it must be {wanted}, at most {_LARGEST}")
    return number


def finite_array(value: ArrayLike, ndim: int, name: str) -> Array:
    """Return finite numbers, shape (3,) or (n, 3) or whatever its `ndim`, as a read-only copy.

    Raises
    ------
    InputError
        If they are no finite numbers, absurdly large, or of another dimension.
    """
    try:
        given = np.asarray(value)
    except ValueError:  # ragged
        given = np.asarray("ragged")
    if given.dtype.kind not in "iuf" or given.ndim != ndim:
        raise InputError(f"{name} = {shown(value)}: it must be an array of {ndim} dimension(s)")
    array = given.astype(np.float64)
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{name} is not finite: entry {where} is {array[where]}")
    if (np.abs(array) > _LARGEST).any():
        raise InputError(f"{name} = {shown(value)}: no entry may be beyond {_LARGEST}")
    array.setflags(write=False)
    return array


def checked_pose(value: ArrayLike, name: str) -> Array:
    """Return one pose (z, tilt_x, tilt_y), shape (3,), m and rad."""
    pose = finite_array(value, 1, name)
    if pose.shape != (3,):
        raise InputError(f"{name} has shape {pose.shape}; a pose is (z, tilt_x, tilt_y)")
    return pose


def checked_poses(value: ArrayLike, name: str) -> Array:
    """Return two or more poses, shape (n, 3), m and rad."""
    poses = finite_array(value, 2, name)
    if poses.shape[1] != 3 or len(poses) < 2:
        raise InputError(
            f"{name} has shape {poses.shape}; it must be (n, 3) with n of 2 or more: "
            "(z, tilt_x, tilt_y) each"
        )
    return poses


def times_from_zero(value: ArrayLike, count: int) -> Array:
    """Return increasing times of so many poses, shifted to begin at 0, shape (count,), s."""
    given = finite_array(value, 1, "times")
    if given.shape != (count,):
        raise InputError(f"{len(given)} times for {count} poses: one each is needed")
    times: Array = given - given[0]
    rising = np.diff(times) > 0
    if not rising.all():
        i = int(np.argmin(rising))
        raise InputError(f"times must increase: {given[i]:.9g} s, then {given[i + 1]:.9g} s")
    times.setflags(write=False)
    return times

"""Checks of arguments: numbers, arrays, shapes and choices.

Each function returns its argument as a float or a float64 array, or raises `InputError` with the
argument's name, its value, and what is possible.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Integral, Real

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.blas import dasum

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown

#: Positive numbers lie between these, others below the larger: what is computed from them stays
#: finite.
SMALLEST, LARGEST = 1e-50, 1e50

#: Of this machine's byte order. NumPy has one object of it, so that ``is`` tells it fastest; where
#: an array has another one (after pickling, say), `numbers` tells that it is the same.
FLOAT64 = np.dtype(np.float64)


# Single numbers -----------------------------------------------------------------------------------


def real(value: object) -> float:
    """Return a single real number as a float; NaN for anything else, such as True."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return math.nan
    try:
        return float(value)
    except OverflowError:  # an integer of hundreds of digits
        return math.nan


def finite_number(value: object, name: str, unit: str = "") -> float:
    """Return a finite number of at most `LARGEST`; `unit` is named in the error."""
    number = real(value)
    if not abs(number) <= LARGEST:
        wanted = f"a finite number{unit and f' of {unit}'}"
        raise InputError(f"{name} = {shown(value)}: it must be {wanted}, at most {LARGEST}")
    return number


def positive_number(value: object, name: str, unit: str = "", *, infinite: bool = False) -> float:
    """Return a number from `SMALLEST` to `LARGEST`, or infinity if that is allowed.

    `unit` is named in the error.
    """
    number = real(value)
    if not SMALLEST <= number <= LARGEST and not (infinite and number == math.inf):
        wanted = f"a positive number{unit and f' of {unit}'}"
        kind = "or infinite" if infinite else "finite"
        raise InputError(
            f"{name} = {shown(value)}: it must be {wanted}, {kind}, from {SMALLEST} to {LARGEST}"
        )
    return number


def non_negative_number(value: object, name: str, unit: str = "") -> float:
    """Return a finite number of zero or more; `unit` is named in the error."""
    number = real(value)
    if not 0 <= number < math.inf:
        wanted = f"a number{unit and f' of {unit}'}"
        raise InputError(f"{name} = {shown(value)}: it must be {wanted}, zero or more, finite")
    return number


def whole_number(value: object, name: str, least: int = 1) -> int:
    """Return an integer of at least `least`."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise InputError(f"{name} = {shown(value)}: it must be a whole number, at least {least}")
    return int(value)


def choice(value: object, name: str, options: Sequence[str]) -> str:
    """Return a value that is one of the options."""
    if not isinstance(value, str) or value not in options:
        listed = " or ".join(repr(option) for option in options)
        raise InputError(f"{name} = {shown(value)}: it must be {listed}")
    return str(value)


# Arrays -------------------------------------------------------------------------------------------


def real_array(
    value: ArrayLike, name: str, ending: tuple[int, ...] = (), meaning: str = ""
) -> Array:
    """Return finite real numbers of shape (..., *ending).

    Parameters
    ----------
    value
        Numbers; not copied where they are float64 already.
    name, meaning
        Of the argument, for the error: ``"pose"``, ``"height, tilt_x, tilt_y"``.
    ending
        The last dimensions.
    """
    wanted = f"(..., {', '.join(map(str, ending))})" if ending else "(...)"
    wanted += meaning and f": {meaning}"
    array = numbers(value, name, f"numbers of shape {wanted}")
    if array.ndim < len(ending) or array.shape[array.ndim - len(ending) :] != ending:
        raise InputError(f"{name} has shape {array.shape}; it must be {wanted}")
    refuse_not_finite(array, name)
    return array


def real_vector(value: ArrayLike, size: int, name: str) -> Array:
    """Return finite real numbers of shape (size,); fast, for control loops."""
    if (
        type(value) is np.ndarray  # no subclass: it may mean something else by its numbers
        and value.dtype is FLOAT64
        and value.shape == (size,)
        and (not size or dasum(value) <= LARGEST)
    ):
        return value
    array = numbers(value, name, f"{size} numbers")
    if array.shape != (size,):
        raise InputError(f"{name} has shape {array.shape}; it must be ({size},)")
    refuse_not_finite(array, name)
    return array


def numbers(value: ArrayLike, name: str, wanted: str) -> Array:
    """Return a value as a plain array of float64, in this machine's byte order.

    Refuses ragged, complex, truth, text, time and other values, and arrays of `numpy.ma` with
    masked entries. `wanted` is what it must be, for the error: ``"3 numbers"``.
    """
    if np.ma.is_masked(value):
        raise InputError(f"{name} has masked entries; it must be {wanted}")
    try:
        given = np.asarray(value)
    except Exception:  # ragged; or whatever the value's own conversion raises
        given = np.asarray("none")
    if given.dtype.kind not in "iuf":
        raise InputError(f"{name} = {shown(value)}: it must be {wanted}")
    return given.astype(np.float64, copy=False)


def fixed_array(
    value: ArrayLike, name: str, shape: tuple[int | None, ...], meaning: str = ""
) -> Array:
    """Return a read-only copy of finite real numbers, none beyond `LARGEST`, of one shape.

    Parameters
    ----------
    value
        Numbers.
    name, meaning
        Of the argument, for the error.
    shape
        Its dimensions; None where any length will do.
    """
    sizes = ", ".join("nmkl"[i] if size is None else str(size) for i, size in enumerate(shape))
    wanted = f"({sizes}{',' if len(shape) == 1 else ''}){meaning and f': {meaning}'}"
    array = numbers(value, name, f"numbers of shape {wanted}")
    parts = () if isinstance(value, np.ndarray) else np.asarray(value, dtype=object).ravel()
    if any(isinstance(part, (bool, np.bool_)) for part in parts):  # NumPy makes [True, 0.5] floats
        raise InputError(f"{name} = {shown(value)}: it must be numbers of shape {wanted}")
    if array.ndim != len(shape) or any(
        size not in (None, given) for size, given in zip(shape, array.shape, strict=True)
    ):
        raise InputError(f"{name} has shape {array.shape}; it must be {wanted}")
    refuse_not_finite(array, name)
    return read_only(array)


def refuse_not_finite(array: Array, name: str) -> None:
    """Raise `InputError` at the first entry that is not finite, or beyond `LARGEST`."""
    good = np.abs(array) <= LARGEST
    if not good.all():
        where = tuple(int(i) for i in np.argwhere(~good)[0])
        entry = f"entry {where[0] if len(where) == 1 else where} is " if where else "it is "
        what = f"beyond {LARGEST:g}" if np.isfinite(array[where]) else "not finite"
        raise InputError(f"{name} is {what}: {entry}{array[where]}")


def one_shape(**arrays: Array) -> tuple[Array, ...]:
    """Return named arrays broadcast to one shape."""
    try:
        return tuple(np.broadcast_arrays(*arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise InputError(f"the shapes do not go together: {shapes}") from None


def read_only(array: Array) -> Array:
    """Return a read-only copy."""
    copy = array.copy()
    copy.setflags(write=False)
    return copy


def inertia_fault(inertia: Array, rounding: float = 1e-9) -> str:
    """Return why a matrix (3, 3) is not a rigid body's moment of inertia; empty if it is one.

    `rounding` is the share of the largest principal moment by which it may exceed the others' sum.
    """
    scale = float(np.abs(inertia).max())
    if np.abs(inertia - inertia.T).max() > 1e-9 * scale:
        return "must be symmetric"
    smallest, middle, largest = np.linalg.eigvalsh(inertia)
    if smallest < -1e-9 * scale or largest - smallest - middle > rounding * largest:
        return (
            f"no rigid body has it: its principal moments are {smallest:.6g}, {middle:.6g} and "
            f"{largest:.6g} kg m^2; none may be negative, or exceed the sum of the others by more "
            f"than {rounding:g} of it"
        )
    return ""

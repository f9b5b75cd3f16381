"""Numbers from outside: finite, real, of shapes that go together, or refused by name."""

from __future__ import annotations

import math
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, SingularityError, shown


def positive_length(value: float, name: str) -> float:
    """Return a finite length above zero, m."""
    number = isinstance(value, Real) and not isinstance(value, bool)
    if not number or not np.isfinite(value) or value <= 0:
        raise InputError(f"{name} = {shown(value)}: it must be a positive number of metres")
    return float(value)


def checked_radius(value: float) -> float:
    """Return the platform's radius h, m."""
    return positive_length(value, "platform_radius")


def finite_entries(value: ArrayLike, ending: tuple[int, ...], name: str) -> Array:
    """Return finite numbers as a float array whose shape ends as told."""
    wanted = f"(..., {', '.join(map(str, ending))})" if ending else "(...)"
    try:
        given = np.asarray(value)
    except ValueError:
        raise InputError(f"{name} must be numbers of shape {wanted}") from None
    if given.dtype.kind not in "iuf":
        raise InputError(f"{name} = {shown(value)}: it must be numbers of shape {wanted}")
    if given.ndim < len(ending) or given.shape[given.ndim - len(ending) :] != ending:
        raise InputError(f"{name} has shape {given.shape}; it must be {wanted}")
    array = given.astype(np.float64)
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        entry = f"entry {where} is " if where else "it is "
        raise InputError(f"{name} is not finite: {entry}{array[where]}")
    return array


def finite_numbers(**values: ArrayLike) -> dict[str, Array]:
    """Return named quantities as finite float arrays of one shape."""
    arrays = {name: finite_entries(value, (), name) for name, value in values.items()}
    try:
        together = np.broadcast_arrays(*arrays.values())
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise InputError(f"the shapes do not go together: {shapes}") from None
    return dict(zip(arrays, together, strict=True))


def refuse_large_gain(matrices: Array, limit: float, message: str) -> None:
    """Raise `SingularityError` at the first matrix whose inverse is larger than a limit.

    Parameters
    ----------
    matrices
        Shape (..., n, n), in one unit.
    limit
        Largest norm of the inverse, the gain, that is accepted; positive.
    message
        With the fields ``{where}``, ``{gain}`` and ``{limit}``.
    """
    if not limit > 0:
        raise InputError(f"max_gain = {limit}: it must be positive")
    smallest = np.linalg.svd(matrices, compute_uv=False)[..., -1]
    singular = ~(smallest * limit >= 1)
    if not singular.any():
        return
    first = tuple(int(i) for i in np.argwhere(singular)[0])
    where = f" (entry {first} of {singular.size})" if first else ""
    gain = 1 / float(smallest[first]) if smallest[first] > 0 else math.inf
    raise SingularityError(message.format(where=where, gain=gain, limit=limit), gain, limit)

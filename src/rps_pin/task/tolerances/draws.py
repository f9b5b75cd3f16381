"""Errors of numbers at random, by their distributions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
from scipy.special import ndtri

from rps_pin.arrays import Array, Bools
from rps_pin.bounds import check_size
from rps_pin.task.tolerances.model import Nominal, ToleranceModel
from rps_pin.task.tolerances.specification import Chosen

Progress = Callable[[Iterable[int]], Iterable[int]]

#: Poses of machines that are closed at once.
_AT_ONCE = 20_000
#: Coordinates that are kept, 400 MB.
_MOST = 50_000_000


def errors_of(chosen: Chosen, uniform: Array) -> Array:
    """Return errors of numbers, shape (s, p), from numbers between 0 and 1 of that shape.

    Those of normal ones are not cut off at the tolerance.
    """
    inside = np.clip(uniform, 2.0**-54, 1 - 2.0**-53)  # random numbers may be 0
    normal = ndtri(inside) * chosen.deviations
    return np.where(chosen.normal, normal, (2 * uniform - 1) * chosen.limits)


def poses_of_machines(
    model: ToleranceModel, at: Nominal, errors: Array, progress: Progress
) -> tuple[Array, Bools]:
    """Return coordinates (s, n, m) of machines with errors (s, p), and whether they reach poses.

    Raises
    ------
    InputError
        If the answer would be too large.
    """
    shape = (len(errors), *at.x.shape)
    check_size(math.prod(shape), _MOST, f"{shape[0]} machines at {shape[1]} poses: the coordinates")
    x, reached = np.empty(shape), np.empty(shape[:2], dtype=bool)
    for part in _parts(len(errors), max(1, _AT_ONCE // shape[1]), progress):
        x[part], reached[part] = model.poses(at, errors[part])
    return x, reached


def _parts(count: int, most: int, progress: Progress) -> Iterator[Any]:
    for first in progress(range(0, count, most)):
        yield slice(first, first + most)

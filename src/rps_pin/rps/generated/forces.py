"""Actuator forces of a motion as expressions: `rps_pin.rps.dynamics.force_equations`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from rps_pin.numerics.elementary import Number
from rps_pin.rps.dynamics.force_equations import ForceTerms, forces_of_motion, legs_of_tilt
from rps_pin.rps.generated.layout import Layout
from rps_pin.rps.kernels.tips import tip_slopes

_SIZES = {"platform_moment": 3, "platform_inertia": 6, "gravity": 3}
#: The numbers of `ForceTerms`.
TERMS = Layout({one.name: _SIZES.get(one.name, 1) for one in fields(ForceTerms)})


def terms_of(groups: dict[str, Any]) -> ForceTerms:
    """Return the terms of expressions, or of numbers, by name."""
    terms: dict[str, Any] = {}
    for name in TERMS.sizes:
        group = groups[name]
        terms[name] = tuple(map(_one, group)) if isinstance(group, tuple) else _one(group)
    return ForceTerms(**terms)


def actuator_forces(
    terms: ForceTerms,
    tilt: tuple[Number, Number, tuple[Number, ...]],
    length: Sequence[Number],
    direction: Sequence[Number],
    rate: Sequence[Number],
    acceleration: Sequence[Number],
) -> tuple[Number, Number, Number]:
    """Return the forces of the actuators, N.

    Parameters
    ----------
    terms
        Of `terms_of`.
    tilt
        tilt_x, tilt_y and `tilt_functions`.
    length, direction
        Of the legs: d (3), m; cosines and sines of phi (6).
    rate, acceleration
        Of the pose (3).
    """
    x, y, functions = tilt
    coefficients: Any = tuple(map(_one, functions))
    legs = legs_of_tilt(
        *(_one(x), _one(y), coefficients, tip_slopes(_one(x), _one(y), coefficients)),
        *(_three(length), _three(direction[:3]), _three(direction[3:])),
    )
    forces = forces_of_motion(terms, legs, _three(rate), _three(acceleration), None)
    one, two, three = forces.axial[:, 0]
    return one, two, three


def _objects(numbers: Sequence[Number]) -> Any:
    """Return an array of expressions; NumPy itself would take one for a matrix."""
    array = np.empty(len(numbers), dtype=object)
    for i, number in enumerate(numbers):
        array[i] = number
    return array


def _one(number: Number) -> Any:
    return _objects([number])


def _three(numbers: Sequence[Number]) -> Any:
    return _objects(numbers)[:, None]

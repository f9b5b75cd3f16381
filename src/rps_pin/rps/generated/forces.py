"""Forces of a motion as expressions: `rps_pin.rps.dynamics.force_equations`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from rps_pin.numerics.elementary import Number, least
from rps_pin.rps.dynamics.force_equations import (
    CLOSE,
    ForceTerms,
    LegBlock,
    forces_of_motion,
    legs_of_tilt,
)
from rps_pin.rps.generated.layout import Layout
from rps_pin.rps.kernels import forces
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


#: tilt_x, tilt_y and `tilt_functions`.
Tilt = tuple[Number, Number, tuple[Number, ...]]


def leg_block(tilt: Tilt, length: Sequence[Number], direction: Sequence[Number]) -> LegBlock:
    """Return what solves for the forces of legs: d (3), m; cosines and sines of phi (6)."""
    x, y, *coefficients = map(_one, (*tilt[:2], *tilt[2]))
    functions: Any = tuple(coefficients)
    return legs_of_tilt(
        *(x, y, functions, tip_slopes(x, y, functions)),
        *(column(length), column(direction[:3]), column(direction[3:])),
    )


def is_regular(block: LegBlock, platform_radius: Number) -> Number:
    """Return whether the legs hold the platform by far: `force_equations.may_be_singular`."""
    cofactors = [[of[0] for of in row] for row in block.cofactors]
    shortest = least(*block.length[:, 0]) / platform_radius
    over, cosine = block.over_determinant[0], block.tilt[2][0]
    return forces.is_regular(cofactors, over, shortest, cosine, CLOSE)


def actuator_forces(
    terms: ForceTerms,
    block: LegBlock,
    rate: Sequence[Number],
    acceleration: Sequence[Number],
    wrench: Sequence[Number],
) -> tuple[Number, Number, Number]:
    """Return the forces of the actuators, N.

    Parameters
    ----------
    terms
        Of `terms_of`.
    block
        Of `leg_block`.
    rate, acceleration
        Of the pose (3).
    wrench
        On the platform (6).
    """
    load: Any = _objects(wrench)[:, None]
    found = forces_of_motion(terms, block, column(rate), column(acceleration), load)
    one, two, three = found.axial[:, 0]
    return one, two, three


def _objects(numbers: Sequence[Number]) -> Any:
    """Return an array of expressions; NumPy itself would take one for a matrix."""
    array = np.empty(len(numbers), dtype=object)
    for i, number in enumerate(numbers):
        array[i] = number
    return array


def _one(number: Number) -> Any:
    return _objects([number])


def column(numbers: Sequence[Number]) -> Any:
    """Return a number of each leg, or of each component, as an array (3, 1) of expressions."""
    return _objects(numbers)[:, None]

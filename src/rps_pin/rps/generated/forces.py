"""Forces of a motion as expressions: `rps_pin.rps.dynamics.force_equations`, `joint_reactions`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from rps_pin.numerics.elementary import Number
from rps_pin.rps.dynamics.force_equations import ForceTerms, forces_of_motion, legs_of_tilt
from rps_pin.rps.dynamics.joint_reactions import in_balance, leg_axes
from rps_pin.rps.generated.layout import Layout
from rps_pin.rps.kernels import platform
from rps_pin.rps.kernels.tips import tip_slopes
from rps_pin.rps.kinematics.legs import RADIAL

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


def forces_and_reactions(
    terms: ForceTerms,
    tilt: tuple[Number, Number, tuple[Number, ...]],
    length: Sequence[Number],
    direction: Sequence[Number],
    rate: Sequence[Number],
    acceleration: Sequence[Number],
) -> tuple[tuple[Number, Number, Number], tuple[Number, ...]]:
    """Return the forces of the actuators, N; and of each leg on the platform, base axes, 9.

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
    x, y, *coefficients = map(_one, (*tilt[:2], *tilt[2]))
    functions: Any = tuple(coefficients)
    cosine, sine = _three(direction[:3]), _three(direction[3:])
    slopes = tip_slopes(x, y, functions)
    legs = legs_of_tilt(x, y, functions, slopes, _three(length), cosine, sine)
    found = forces_of_motion(terms, legs, _three(rate), _three(acceleration), None)
    one, two, three = found.axial[:, 0]

    axes = leg_axes(cosine.T, sine.T)
    rows = [np.concatenate(row) for row in platform.rotation(x, y, functions)]
    arms = (RADIAL @ np.stack(rows).T) * terms.platform_radius
    tip = np.zeros((1, 3, 3), dtype=object)
    tip[..., 0], tip[..., 2] = found.push.T, -found.across.T
    force = np.concatenate(found.force)
    couple = np.concatenate(platform.to_base(x, y, functions, found.moment))
    reactions = in_balance(axes, arms[None], tip, force[None], couple[None])
    return (one, two, three), tuple(reactions.ravel())


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

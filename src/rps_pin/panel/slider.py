"""Sliders of numbers, in the units that are shown."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.validation import real_vector

MM, DEGREE = 1e3, 180.0 / math.pi
"""Shown units per SI unit."""


class Slider(NamedTuple):
    """A slider of one number."""

    name: str
    """With the unit shown: ``"height (mm)"``."""
    low: float
    high: float
    step: float
    scale: float
    """Shown units per SI unit."""
    limits: tuple[float, float] = (-math.inf, math.inf)
    """Beyond which the robot must not be, in the unit shown."""

    @property
    def label(self) -> str:
        """The name without the unit."""
        return self.name.rpartition(" (")[0]

    @property
    def unit(self) -> str:
        """The unit that is shown."""
        return self.name.rpartition(" (")[2].rstrip(")")


def slider(
    name: str, turns: bool, low: float, high: float, limits: tuple[float, float] | None = None
) -> Slider:
    """Return a slider from `low` to `high`, SI units, widened to round numbers.

    Parameters
    ----------
    name
        Without the unit.
    turns
        Whether it is of an angle, shown in degrees; else of a length, shown in mm.
    low, high, limits
        In SI units.
    """
    scale, unit = (DEGREE, "degrees") if turns else (MM, "mm")
    low, high = scale * low, scale * high
    spacing = 10.0 ** math.floor(math.log10((high - low) / 10.0))
    digits = max(0, -round(math.log10(spacing)))
    step = round(spacing / 1000.0, digits + 3)
    ends = (
        round(spacing * math.floor(low / spacing + 1e-9), digits),
        round(spacing * math.ceil(high / spacing - 1e-9), digits),
    )
    shown = (-math.inf, math.inf) if limits is None else (scale * limits[0], scale * limits[1])
    return Slider(f"{name} ({unit})", *ends, step, scale, shown)


def slider_values(groups: dict[str, tuple[Slider, ...]], group: str, values: Any) -> Array:
    """Return values that a group's sliders can take.

    Raises
    ------
    InputError
        If there is no such group, or the values are not numbers within its sliders.
    """
    if group not in groups:
        raise InputError(f"no sliders {group!r}; there are: {', '.join(groups)}")
    sliders = groups[group]
    asked = real_vector(values, len(sliders), group)
    for one, value in zip(sliders, asked.tolist(), strict=True):
        shown = one.scale * value
        if not one.low - one.step <= shown <= one.high + one.step:
            raise InputError(beyond(one, shown))
    return asked


def beyond(one: Slider, shown: float) -> str:
    """Return a sentence: a number, in the unit shown, is beyond its slider."""
    return f"{one.name}: {shown:.6g} is beyond its slider, {one.low:.6g} to {one.high:.6g}"


def quantity(values: Any, scale: float, unit: str, digits: int = 3) -> str:
    """Return numbers as text: ``(1.000, 2.000) mm``."""
    rounded = np.round(scale * np.atleast_1d(values), digits) + 0.0  # no -0
    shown = [f"{value:.{digits}f}" for value in rounded.tolist()]
    return (shown[0] if len(shown) == 1 else f"({', '.join(shown)})") + f" {unit}"

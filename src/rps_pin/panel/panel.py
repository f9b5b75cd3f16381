"""Interface of a panel: sliders and readings, without a front end."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError
from rps_pin.validation import real_vector


class Slider(NamedTuple):
    """A slider of one number."""

    name: str
    """With the unit shown: ``"height (mm)"``."""
    low: float
    high: float
    step: float
    scale: float
    """Shown units per SI unit."""


class Panel(Protocol):
    """Sliders and readings of a mechanism, in SI units; moving a slider raises nothing."""

    groups: dict[str, tuple[Slider, ...]]
    """Sliders that are moved together, by the group's name."""
    mechanism: ClosedLoopModel
    """The mechanism."""
    trouble: list[str]
    """Sentences: each limit that is broken, and why a move was not followed."""

    def values(self, group: str) -> Array:
        """Return the values of a group's sliders, SI units."""

    def move(self, group: str, values: Any) -> bool:
        """Move a group's sliders; return whether the robot could follow."""

    def readings(self) -> list[tuple[str, str]]:
        """Return the readings: names and values with units."""

    @property
    def configuration(self) -> Array:
        """Configuration of the mechanism, shape (nq,)."""

    def visual_model(self) -> pin.GeometryModel | None:
        """Return its visual geometry; None for bars between its joints."""


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
    for slider, value in zip(sliders, asked.tolist(), strict=True):
        shown = slider.scale * value
        if not slider.low - slider.step <= shown <= slider.high + slider.step:
            raise InputError(
                f"{slider.name}: {shown:.6g} is beyond its slider, {slider.low:.6g} to "
                f"{slider.high:.6g}"
            )
    return asked


def quantity(values: Any, scale: float, unit: str, digits: int = 3) -> str:
    """Return numbers as text: ``(1.000, 2.000) mm``."""
    rounded = np.round(scale * np.atleast_1d(values), digits) + 0.0  # no -0
    shown = [f"{value:.{digits}f}" for value in rounded.tolist()]
    return (shown[0] if len(shown) == 1 else f"({', '.join(shown)})") + f" {unit}"

"""What a panel is, whatever shows it."""

from __future__ import annotations

import html
from typing import Any, NamedTuple, Protocol

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError
from rps_pin.rps.checks import finite_entries


class Slider(NamedTuple):
    """One number to move."""

    name: str
    """With its unit as shown: ``"height (mm)"``."""
    low: float
    high: float
    step: float
    scale: float
    """Shown units in one SI unit."""


class Panel(Protocol):
    """Sliders, and what follows from them. Numbers are SI units; nothing raises when they move."""

    groups: dict[str, tuple[Slider, ...]]
    """Sliders that are moved together, by the group's name."""
    mechanism: ClosedLoopModel
    """What is shown."""
    trouble: list[str]
    """What is wrong where the sliders are, in words: limits, or why they were not followed."""

    def values(self, group: str) -> Array:
        """Return where a group's sliders stand, SI units."""

    def move(self, group: str, values: Any) -> bool:
        """Move a group's sliders; return whether the robot could follow."""

    def readings(self) -> list[tuple[str, str]]:
        """Return names and values to read out."""

    @property
    def configuration(self) -> Array:
        """Where the mechanism stands, shape (nq,)."""

    def visual_model(self) -> pin.GeometryModel:
        """Return its shapes."""


def asked_of(groups: dict[str, tuple[Slider, ...]], group: str, values: Any) -> Array:
    """Return values that a group's sliders can take.

    Raises
    ------
    InputError
        If there is no such group, or these are not its numbers, or beyond its sliders.
    """
    if group not in groups:
        raise InputError(f"no sliders {group!r}; there are: {', '.join(groups)}")
    sliders = groups[group]
    asked = finite_entries(values, (), group)
    if asked.shape != (len(sliders),):
        raise InputError(f"{group} has shape {asked.shape}; it must be ({len(sliders)},)")
    for slider, value in zip(sliders, asked.tolist(), strict=True):
        shown = slider.scale * value
        if not slider.low - slider.step <= shown <= slider.high + slider.step:
            raise InputError(
                f"{slider.name}: {shown:.6g} is beyond its slider, {slider.low:.6g} to "
                f"{slider.high:.6g}"
            )
    return asked


def asked_by(panel: Panel, group: str, handles: list[Any]) -> list[float]:
    """Return what the handles of a group ask for, SI units."""
    sliders = panel.groups[group]
    return [handle.value / one.scale for handle, one in zip(handles, sliders, strict=True)]


def show_values(panel: Panel, handles: dict[str, list[Any]], moved: str | None) -> None:
    """Put the handles of all groups but the moved one where the panel is, or at their ends."""
    for group, own in handles.items():
        if group != moved:
            sliders, values = panel.groups[group], panel.values(group).tolist()
            for handle, slider, value in zip(own, sliders, values, strict=True):
                handle.value = min(max(slider.scale * value, handle.min), handle.max)


def as_html(panel: Panel) -> str:
    """Return what is read out, what is wrong first: a line, and a table of the readings."""
    words = "<br>".join(map(html.escape, panel.trouble))
    colour = "#b00000" if words else "#006000"
    rows = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>"
        for name, value in panel.readings()
    )
    said = f'<p style="color:{colour}; margin: 0.5em 0">{words or "within all limits"}</p>'
    return f"{said}<table>{rows}</table>"


def told(values: Any, scale: float, unit: str, digits: int = 3) -> str:
    """Return numbers as read out: ``(1.000, 2.000) mm``."""
    rounded = np.round(scale * np.atleast_1d(values), digits) + 0.0  # no -0
    shown = [f"{value:.{digits}f}" for value in rounded.tolist()]
    return (shown[0] if len(shown) == 1 else f"({', '.join(shown)})") + f" {unit}"

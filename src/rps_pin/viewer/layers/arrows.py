"""Arrows in a scale of their own: what forces and reactions share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.viewer.layers.base import UNSEEN, Context, Drawing, Look, Part
from rps_pin.viewer.layers.shapes import at, css, length_text, pointing, round_number
from rps_pin.viewer.motion import State
from rps_pin.viewer.scene.legend import Key

Vectors = Mapping[str, tuple[Array, Array]]
"""By node: where an arrow begins, m, and the force or moment that it shows."""

_LONGEST = 0.7
"""Length of the longest arrow, at most, in radii of the picture."""
_MOST_STATES = 50


class Sized(NamedTuple):
    """What an arrow looks like, and its unit."""

    shape: Callable[[str, int], list[Part]]
    """Makes the parts of a node in a colour."""
    unit: str
    """``N`` or ``N m``."""


def arrows_drawing(
    name: str,
    title: str,
    colour: int,
    context: Context,
    sized: Mapping[str, Sized],
    vectors: Callable[[State], Vectors],
    given: Mapping[str, float | None],
) -> Drawing:
    """Return a layer of arrows, as long as forces and moments in one scale for each unit.

    Parameters
    ----------
    name, title, colour
        Of the layer; the title begins its key.
    context
        What it is drawn for.
    sized
        The arrows, by node.
    vectors
        Where they begin and what they show in a state; those left out are not seen.
    given
        By unit, what an arrow of 1 m stands for; None for the best round number.
    """
    motion = context.motion
    times = np.linspace(0.0, motion.duration, min(_MOST_STATES, len(motion.times)))
    greatest = dict.fromkeys(given, 0.0)
    for elapsed in times:
        for node, (_, vector) in vectors(motion.state_at(float(elapsed))).items():
            unit = sized[node].unit
            greatest[unit] = max(greatest[unit], float(np.linalg.norm(vector)))
    units = [unit for unit in given if any(one.unit == unit for one in sized.values())]
    scales = {unit: _scale(name, given[unit], greatest[unit], context.radius) for unit in units}
    hidden = at(context.box.centre)
    hidden[:3, :3] *= UNSEEN

    def follow(state: State) -> dict[str, Look]:
        found = vectors(state)
        return {
            node: Look(
                pointing(found[node][0], found[node][1] / scales[one.unit])
                if node in found
                else hidden
            )
            for node, one in sized.items()
        }

    parts = [part for node, one in sized.items() for part in one.shape(node, colour)]
    lengths = ", ".join(_said(unit, scales[unit], context.radius) for unit in units)
    still = ", at rest" if motion.at_rest else ""
    most = ", ".join(f"at most {greatest[unit]:.3g} {unit}" for unit in units)
    return Drawing(Key(name, f"{title}{still}: {lengths}; {most}", css(colour)), parts, follow)


def _scale(layer: str, given: float | None, greatest: float, radius: float) -> float:
    """Return what an arrow of one metre stands for."""
    if given is not None:
        if not 0.0 < given < np.inf:
            raise InputError(f"layer {layer!r}: a scale of {given}; it must be positive")
        return given
    if greatest <= 0.0:
        return 1.0 / radius
    return 1.0 / round_number(_LONGEST * radius / greatest)


def _said(unit: str, scale: float, radius: float) -> str:
    """Return a scale in words: how long a round force is drawn."""
    force = round_number(0.5 * radius * scale)
    return f"{length_text(force / scale)} for {force:g} {unit}"

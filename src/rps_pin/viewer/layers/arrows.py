"""Arrows of forces and moments, in one scale for each unit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import ClosureError, InfeasibleError, InputError, SingularityError
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, NodeState
from rps_pin.viewer.layers.colours import css
from rps_pin.viewer.layers.parts import SMALLEST, pointing
from rps_pin.viewer.motion import MotionState
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.shapes import Part, translated
from rps_pin.viewer.scene.stage import length_text, round_number

Vectors = Mapping[str, tuple[Array, Array]]
"""Origin of each arrow, m, and the force or moment that it shows, by node."""
NO_FORCES = (ClosureError, InfeasibleError, SingularityError)
"""Errors of states without determined forces: their arrows are not drawn."""
_UNSEEN_GAP = 1e-2
"""Gap of the closures between samples of a motion that is closed here, in radii of the picture."""

_LONGEST = 0.7
"""Length of the longest arrow, at most, in radii of the picture."""
_MOST_STATES = 50


class ArrowKind(NamedTuple):
    """Shape of an arrow, and the unit of the vector that it shows."""

    parts: Callable[[str, int], list[Part]]
    """Returns the parts of a node, in a colour."""
    unit: str
    """``N`` or ``N m``."""


def draw_arrows(
    name: str,
    title: str,
    colour: int,
    context: LayerContext,
    kinds: Mapping[str, ArrowKind],
    vectors: Callable[[MotionState], Vectors],
    scales: Mapping[str, float | None],
) -> DrawnLayer:
    """Return a layer of arrows.

    Parameters
    ----------
    name, title, colour
        Of the layer; its entry in the legend begins with the title.
    context
        The mechanism and motion.
    kinds
        The arrows, by node.
    vectors
        Returns the vectors in a state. Arrows without one are not seen.
    scales
        By unit, the force or moment of an arrow of 1 m; None for a round number.
    """
    motion = context.motion
    times = np.linspace(0.0, motion.duration, min(_MOST_STATES, len(motion.times)))
    greatest = dict.fromkeys(scales, 0.0)
    for elapsed in times:
        for node, (_, vector) in vectors(motion.state_at(float(elapsed))).items():
            unit = kinds[node].unit
            greatest[unit] = max(greatest[unit], float(np.linalg.norm(vector)))
    used = {kind.unit for kind in kinds.values()}
    per_metre = {
        unit: _scale(name, given, greatest[unit], context.radius)
        for unit, given in scales.items()
        if unit in used
    }
    hidden = translated(context.box.centre)
    hidden[:3, :3] *= SMALLEST

    def update(state: MotionState) -> dict[str, NodeState]:
        found = vectors(state)
        return {
            node: NodeState(
                pointing(found[node][0], found[node][1] / per_metre[kind.unit])
                if node in found
                else hidden
            )
            for node, kind in kinds.items()
        }

    parts = [part for node, kind in kinds.items() for part in kind.parts(node, colour)]
    lengths = ", ".join(_scale_text(unit, one, context.radius) for unit, one in per_metre.items())
    at_rest = ", at rest" if motion.at_rest else ""
    most = ", ".join(f"at most {greatest[unit]:.3g} {unit}" for unit in per_metre)
    entry = LegendEntry(name, f"{title}{at_rest}: {lengths}; {most}", css(colour))
    return DrawnLayer(entry, parts, update)


def closed_state(context: LayerContext, state: MotionState) -> MotionState:
    """Return a state with closed loops: interpolation between samples opens them a little.

    A state with a gap that can be seen is returned as it is.
    """
    mechanism = context.subject.mechanism
    if mechanism.loop_gap(state.q) > _UNSEEN_GAP * context.radius:
        return state
    return state._replace(q=mechanism.close(state.q, within_limits=False, restarts=0))


def _scale(layer: str, given: float | None, greatest: float, radius: float) -> float:
    """Return the force or moment of an arrow of one metre."""
    if given is not None:
        if not 0.0 < given < np.inf:
            raise InputError(f"layer {layer!r}: a scale of {given}; it must be positive")
        return given
    if greatest <= 0.0:
        return 1.0 / radius
    return 1.0 / round_number(_LONGEST * radius / greatest)


def _scale_text(unit: str, scale: float, radius: float) -> str:
    """Return a scale in words: the length of the arrow of a round force."""
    force = round_number(0.5 * radius * scale)
    return f"{length_text(force / scale)} for {force:g} {unit}"

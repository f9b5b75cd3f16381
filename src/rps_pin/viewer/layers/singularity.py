"""Layer ``singularity``: a ring on the floor, coloured by the conditioning of passive joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rps_pin.viewer.displayed_mechanism import DisplayedMechanism
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, NodeState, RobotSizedLayer
from rps_pin.viewer.layers.colours import BLUE, WARNING, colour_bar, css, warning
from rps_pin.viewer.layers.parts import flat_ring
from rps_pin.viewer.motion import Motion, MotionState
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.shapes import Material, Part, translated

_BESIDE = np.radians(-15.0)
"""Direction from the ring's centre, about z, to where its number stands: seen on the right."""


@dataclass(frozen=True)
class Singularity(RobotSizedLayer):
    """A ring around the robot: blue when well conditioned, vermillion at a type II singularity.

    The measure is 1 / `ClosedLoopModel.condition`, 1 at best, 0 at a singularity, on a scale of
    logarithms.

    Parameters
    ----------
    worst
        The measure at which the colour is vermillion.
    """

    worst: float = 1e-3

    def missing(self, subject: DisplayedMechanism, motion: Motion) -> str:
        """Return whether there are no closures, or too few actuators; see `Layer`."""
        mechanism = subject.mechanism
        if not mechanism.closures:
            return "the mechanism has no closures"
        found = mechanism.describe(motion.configurations[0])
        motions = found.mobility - sum(one.size for one in found.idle)
        if found.actuated_velocities < motions:
            driven = found.actuated_velocities
            return f"the conditioning needs an actuator for each motion: {driven} of {motions}"
        return ""

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the ring; see `Layer`."""
        mechanism, box = context.subject.mechanism, context.box
        reach = 1.12 * float((box.upper - box.lower)[:2].max()) / 2.0
        place = translated([*box.centre[:2], box.lower[2]])
        ring = flat_ring(0.94 * reach, reach)
        parts = [Part("ring", "annulus", ring, Material(0xFFFFFF, flat=True), np.eye(4))]

        def update(state: MotionState) -> dict[str, NodeState]:
            share = np.log(max(measure(state), self.worst)) / np.log(self.worst)
            return {"ring": NodeState(place, warning(float(share)))}

        def measure(state: MotionState) -> float:
            return 1.0 / max(mechanism.condition(state.q), 1.0)

        def reading(state: MotionState) -> str:
            return f"1 / cond(J_p) = {measure(state):.2g}"

        text = "conditioning of the passive joints, 1 / cond(J_p), without unit"
        bar = colour_bar(WARNING, "1: best", f"{self.worst:g}: singular")
        beside = reach * np.array([np.cos(_BESIDE), np.sin(_BESIDE)]) + box.centre[:2]
        at = (float(beside[0]), float(beside[1]), float(box.lower[2]))
        legend = LegendEntry("singularity", text, css(BLUE), bar, at)
        return DrawnLayer(legend, parts, update, reading)

"""Layer ``singularity``: a ring on the floor, coloured by the distance to a singularity."""

from __future__ import annotations

from dataclasses import dataclass

import meshcat.geometry as mg
import numpy as np
import trimesh

from rps_pin.viewer.layers.base import Context, Drawing, Framed, Look, Part
from rps_pin.viewer.layers.colours import warning, warning_bar
from rps_pin.viewer.layers.shapes import at, css, paint
from rps_pin.viewer.motion import State
from rps_pin.viewer.scene.legend import Key


@dataclass(frozen=True)
class Singularity(Framed):
    """A ring around the robot: blue where all is well, vermillion at a parallel singularity.

    The measure is 1 / `ClosedLoopModel.condition`, 1 at best, 0 at a singularity, on a scale of
    logarithms.

    Parameters
    ----------
    worst
        The measure at which the colour is vermillion.
    """

    worst: float = 1e-3

    def draw(self, context: Context) -> Drawing:
        """Return the ring; see `Layer`."""
        mechanism, box = context.subject.mechanism, context.box
        reach = 1.25 * float((box.upper - box.lower)[:2].max()) / 2.0
        ring = trimesh.creation.annulus(0.94 * reach, reach, 0.004 * box.radius, sections=72)
        geometry = mg.TriangularMeshGeometry(ring.vertices, ring.faces)
        place = at(np.array([*box.centre[:2], box.lower[2]]))
        parts = [Part("ring", "annulus", geometry, paint(0xFFFFFF), np.eye(4))]

        def follow(state: State) -> dict[str, Look]:
            measure = 1.0 / max(mechanism.condition(state.q), 1.0)
            share = np.log(max(measure, self.worst)) / np.log(self.worst)
            return {"ring": Look(place, warning(float(share)))}

        text = "distance to a singularity, 1 / condition number"
        bar = warning_bar("1: best", f"{self.worst:g}: singular")
        return Drawing(Key("singularity", text, css(0x0072B2), bar), parts, follow)

"""How far an output frame can be from its reference frame within the limits of the joints.

Each joint carries its child no further from its parent than its placement and its travel say, and a
closure of one point brings two frames together, or to a rod's length. The shortest way over these
from one frame to the other is a bound of their distance: where coordinates of the output frame ask
for more, no configuration within limits has them.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.closures import LoopClosure
from rps_pin.closed_loop.constraints.frame_coordinates import FrameCoordinates
from rps_pin.closed_loop.constraints.system import ConstraintSystem

#: Joints that turn about their origin, and those that slide, by Pinocchio's names.
_TURNS = ("JointModelR", "JointModelSpherical", "JointModelUniversal")
_SLIDES = ("JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismaticUnaligned")
#: Closures that bring two points together, or to a distance.
_OF_POINTS = ("spherical", "revolute", "universal", "rigid", "distance")


class FarFrame(NamedTuple):
    """An output frame that is asked to be farther away than joints within limits let it."""

    at: Indices
    """Its linear coordinates in q."""
    reach: float
    """Bound of their length, m."""

    def beyond(self, q: Array) -> float:
        """Return by how much a configuration's coordinates are beyond the reach, m."""
        return float(np.linalg.norm(q[self.at])) - self.reach


def far_frame(system: ConstraintSystem, target: Array) -> FarFrame | None:
    """Return the output frame whose coordinates in a configuration are beyond its reach, if any."""
    for closure in system.equations.closures:
        if isinstance(closure, FrameCoordinates):
            held = system.velocity_indices(closure.joints[: len(closure.linear)], "to hold")
            far = FarFrame(system.coordinates_of(held), _reach(system, closure))
            if far.beyond(target) > 0:
                return far
    return None


def _reach(system: ConstraintSystem, between: FrameCoordinates) -> float:
    """Return the bound of the distance of a closure's two frames, m; infinite if there is none."""
    ways: dict[int, list[tuple[int, float]]] = defaultdict(list)

    def add(a: int, b: int, length: float) -> None:
        ways[a].append((b, length))
        ways[b].append((a, length))

    for joint in range(1, system.model.njoints):
        add(int(system.model.parents[joint]), joint, _span(system.model, joint))
    for closure in system.equations.closures:
        if isinstance(closure, LoopClosure) and closure.kind in _OF_POINTS:
            (a, at_a), (b, at_b) = _ends(system, closure)
            add(a, b, at_a + at_b + (closure.distance or 0.0))
    (begin, at_begin), (end, at_end) = _ends(system, between)
    least, open_ = {begin: 0.0}, [(0.0, begin)]
    while open_:
        length, body = heapq.heappop(open_)
        if body == end:
            return length + at_begin + at_end
        for other, more in ways[body]:
            if length + more < least.get(other, np.inf):
                least[other] = length + more
                heapq.heappush(open_, (length + more, other))
    return np.inf


def _ends(system: ConstraintSystem, closure: LoopClosure) -> list[tuple[int, float]]:
    """Return the joints that carry a closure's points, and the points' distances from these."""
    return [
        (end.joint, float(np.linalg.norm(end.placement.translation)))
        for end in closure.closed_frames(system.model)
    ]


def _span(model: pin.Model, index: int) -> float:
    """Return how far a joint can carry its child's origin from its parent's, m."""
    joint = model.joints[index]
    name, placed = (
        joint.shortname(),
        float(np.linalg.norm(model.jointPlacements[index].translation)),
    )
    if name.startswith(_TURNS):
        return placed
    if name in _SLIDES:
        ends = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
        return placed + float(np.abs(ends).max())
    return np.inf

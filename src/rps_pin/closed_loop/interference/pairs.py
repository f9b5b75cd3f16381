"""Which pairs of links are checked: those that nothing joins.

Links of one body, and of bodies that a rigid closure joins, do not move against each other. Links
that a joint or a closure connects touch there. So do links that are connected through one point of
bodies without shapes, in turns and at most one slide: the cross of a universal joint, the turns of
a ball, a slider on its guide. A free-flyer, a joint of three translations and a closure of kind
``distance`` keep nothing together, so that their links are checked.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import KINDS, Closure, LoopClosure
from rps_pin.errors import MechanismError, did_you_mean, few
from rps_pin.numerics.linear_algebra import rank, singular_values

#: Points of a body that are nearer than this, in characteristic lengths, are one.
_SAME = 1e-6


#: Translations that a closure leaves; a distance closure leaves links apart.
_SLIDES = dict.fromkeys(KINDS, 0) | {
    "prismatic": 1,
    "cylindrical": 1,
    "point_on_line": 1,
    "planar": 2,
    "point_on_plane": 2,
    "distance": 3,
}
_Node = tuple[str, int]


class _End(NamedTuple):
    """Where a joint or a closure holds a body."""

    body: int
    at: Array


class _Connection(NamedTuple):
    """A joint or a closure, with as many translations as it leaves."""

    one: _End
    other: _End
    slides: int


def pairs_of_links(
    model: pin.Model,
    closures: Iterable[Closure],
    links: dict[str, int],
    ignored: Collection[tuple[str, str]],
    length: float,
) -> list[tuple[str, str]]:
    """Return the pairs of links that are checked.

    Parameters
    ----------
    links
        Index of the joint that carries each link with shapes, by name.
    ignored
        Pairs of links that may overlap.
    length
        Characteristic length, m.

    Raises
    ------
    MechanismError
        If a link that is to be ignored is not in the model.
    """
    left_out = {frozenset(pair) for pair in ignored}
    check_links(model, ignored, links)
    rigid, connections = _connections(model, closures)
    body = _joined(model.njoints, rigid)
    shaped = {body[joint] for joint in links.values()}
    beside = _adjacent(connections, body, shaped, _SAME * length)
    return [
        (a, b)
        for a, b in combinations(links, 2)
        if body[links[a]] != body[links[b]]
        and frozenset((body[links[a]], body[links[b]])) not in beside
        and frozenset((a, b)) not in left_out
    ]


def check_links(model: pin.Model, pairs: Iterable[Sequence[str]], more: Iterable[str] = ()) -> None:
    """Refuse names that no link has, and none of some more frames."""
    known = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY]
    known += [name for name in more if name not in known]
    for name in (name for pair in pairs for name in pair):
        if name not in known:
            raise MechanismError(
                f"ignore: no link {name!r}{did_you_mean(name, known)}; there are: {few(known)}"
            )


def _connections(
    model: pin.Model, closures: Iterable[Closure]
) -> tuple[list[tuple[int, int]], list[_Connection]]:
    """Return the bodies that closures hold rigidly, and where bodies are connected."""
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    rigid: list[tuple[int, int]] = []
    found = []
    for joint in range(1, model.njoints):
        parent = _End(int(model.parents[joint]), np.array(model.jointPlacements[joint].translation))
        moves = np.asarray(data.joints[joint].S).reshape(6, -1)[:3]
        slides = rank(singular_values(moves))
        found.append(_Connection(parent, _End(joint, np.zeros(3)), slides))
    for closure in closures:
        if isinstance(closure, LoopClosure):
            a, b = (
                _End(frame.joint, np.array(frame.placement.translation))
                for frame in closure.closed_frames(model)
            )
            found.append(_Connection(a, b, _SLIDES[closure.kind]))
            if closure.kind == "rigid":
                rigid.append((a.body, b.body))
    return rigid, [one for one in found if one.slides < 3]


def _joined(count: int, pairs: Iterable[tuple[int, int]]) -> list[int]:
    """Return of each body the first of those that are one rigid body with it."""
    first = list(range(count))
    for a, b in pairs:
        one, other = sorted((first[a], first[b]))
        first = [one if body == other else body for body in first]
    return first


def _adjacent(
    connections: Iterable[_Connection], body: list[int], shaped: Collection[int], near: float
) -> set[frozenset[int]]:
    """Return the pairs of bodies with shapes that touch by construction."""
    points: list[_End] = []  # of bodies without shapes

    def node(end: _End) -> _Node:
        if body[end.body] in shaped:
            return "body", body[end.body]
        for number, point in enumerate(points):
            if point.body == end.body and np.linalg.norm(point.at - end.at) <= near:
                return "point", number
        points.append(end)
        return "point", len(points) - 1

    beside: dict[_Node, list[tuple[_Node, int]]] = {}
    for one, other, slides in connections:
        a, b = node(one), node(other)
        beside.setdefault(a, []).append((b, slides))
        beside.setdefault(b, []).append((a, slides))
    found: set[frozenset[int]] = set()
    for start in [key for key in beside if key[0] == "body"]:
        found |= {
            frozenset((start[1], other[1])) for other, _ in beside[start] if other[0] == "body"
        }
        fewest = {start: 0}
        waiting = [start]
        while waiting:
            here = waiting.pop()
            for reached, more in beside[here]:
                slides = fewest[here] + more
                if slides >= fewest.get(reached, 2):  # two slides, or another way with fewer
                    continue
                fewest[reached] = slides
                if reached[0] == "body":
                    found.add(frozenset((start[1], reached[1])))
                else:
                    waiting.append(reached)
    return found

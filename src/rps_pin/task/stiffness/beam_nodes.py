"""Nodes of the beams in a link, and the parts of the link's inertia that they carry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel, LoopClosure
from rps_pin.errors import MechanismError
from rps_pin.task.stiffness.beams import Beam

#: Ends of beams nearer than this part of their length are one node.
_SAME = 1e-6
#: Share of a link's mass and inertia up to which its beams may exceed it, by rounding.
_ROUNDING = 1e-6


class Node(NamedTuple):
    """A piece of a link that stays rigid, with a place of its own."""

    name: str
    placement: pin.SE3
    """Of the springs before it in the link, at rest, x along the beam; the link's own frame for the
    piece without springs."""
    at: Array
    """Its place in the link, shape (3,), m."""
    before: int
    """The node on the springs' other side; -1: none."""
    compliances: Array | None
    """Of the springs, shape (6,); None: the piece that the link's joint carries."""
    inertias: list[pin.Inertia]
    """What it carries of beams, in the link's frame."""


def nodes_of(mechanism: ClosedLoopModel, link: int, beams: Mapping[str, Beam]) -> list[Node]:
    """Return the nodes of a link's beams, each after the one before it; none without beams.

    Raises
    ------
    MechanismError
        If an end is unknown, a beam has no length, or beams make a loop within the link.
    """
    nodes: list[Node] = []
    for name, beam in beams.items():
        start, end = (_place(mechanism, link, one, name) for one in (beam.start, beam.end))
        length = float(np.linalg.norm(end - start))
        if length == 0:
            raise MechanismError(f"beam {name!r}: {beam.start!r} and {beam.end!r} are at one place")
        near = _at(nodes, start, length)
        if near is None:
            own = pin.SE3.Identity()
            nodes.append(Node(f"{name}[0]", own, start, -1, None, []))
            near = len(nodes) - 1
        if _at(nodes, end, length) is not None:
            raise MechanismError(
                f"beam {name!r}: another beam of the link is at its end {beam.end!r} already; give "
                "beams from the link's joint outwards, without loops in a link"
            )
        axes = _axes(beam, (end - start) / length, name)
        nodes += _segments(name, beam, start, axes, length, near, len(nodes))
        _share(nodes, beam, start, axes, length, near)
    return nodes


def _segments(
    name: str, beam: Beam, start: Array, axes: Array, length: float, near: int, first: int
) -> list[Node]:
    """Return the nodes behind the springs of a beam's segments."""
    h, along = length / beam.segments, axes[:, 0]
    found = []
    for k in range(beam.segments):
        middle = pin.SE3(axes, start + (k + 0.5) * h * along)
        before = near if k == 0 else first + k - 1
        at = start + (k + 1) * h * along
        found.append(Node(f"{name}[{k + 1}]", middle, at, before, beam.compliances(length), []))
    return found


def _share(
    nodes: list[Node], beam: Beam, start: Array, axes: Array, length: float, near: int
) -> None:
    """Give the nodes of the beam that was added last its inertia: each half a segment on a side."""
    mass, rotary = beam.inertia_per_length()
    if not mass:
        return
    n, h = beam.segments, length / beam.segments
    chain = [nodes[near], *nodes[-n:]]
    for k, node in enumerate(chain):
        first, last = max(k - 0.5, 0.0) * h, min(k + 0.5, n) * h
        size = last - first
        middle = start + (first + last) / 2 * axes[:, 0]
        across = mass * size**3 / 12
        about = rotary * size + np.array([0.0, across, across])
        node.inertias.append(pin.Inertia(mass * size, middle, axes @ np.diag(about) @ axes.T))


def inertias_of(inertia: pin.Inertia, nodes: Sequence[Node]) -> list[pin.Inertia]:
    """Return what each node carries, in the frame of its springs.

    What is left of the link's inertia without its beams is fixed to the node nearest to its centre.

    Raises
    ------
    MechanismError
        If the beams are heavier than the link.
    """
    parts = [list(node.inertias) for node in nodes]
    rest = _rest(inertia, [one for part in parts for one in part], nodes[0].name)
    if rest is not None:
        away = [float(np.linalg.norm(node.at - rest.lever)) for node in nodes]
        parts[int(np.argmin(np.round(away, 12)))].append(rest)
    found = []
    for node, part in zip(nodes, parts, strict=True):
        whole = pin.Inertia.Zero()
        for one in part:
            local = node.placement.actInv(one)
            whole = whole + local if whole.mass else local
        found.append(whole)
    return found


def _rest(whole: pin.Inertia, beams: Sequence[pin.Inertia], name: str) -> pin.Inertia | None:
    """Return an inertia less those of beams; None if nothing is left."""
    if not beams:
        return whole
    total = beams[0]
    for one in beams[1:]:
        total = total + one
    mass = whole.mass - total.mass
    left = whole.matrix() - total.matrix()
    values = np.linalg.eigvalsh(left)
    if abs(mass) <= _ROUNDING * whole.mass and abs(values).max() <= _ROUNDING * whole.mass:
        return None
    if mass <= 0 or values[0] < -_ROUNDING * whole.mass:
        raise MechanismError(
            f"beam {name.partition('[')[0]!r} and those beside it weigh {total.mass:.6g} kg, or "
            f"have moments of inertia that their link of {whole.mass:.6g} kg has not: leave out "
            "the density, and the link's mass stays in one piece"
        )
    skew = left[3:, :3] / mass
    centre = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    lever = pin.skew(centre)
    return pin.Inertia(mass, centre, left[3:, 3:] + mass * lever @ lever)


def _place(mechanism: ClosedLoopModel, link: int, name: str, beam: str) -> Array:
    """Return the place of a named end in a link, shape (3,)."""
    model = mechanism.model
    for closure in mechanism.closures:
        if isinstance(closure, LoopClosure) and closure.name == name:
            for frame in closure.closed_frames(model):
                if frame.joint == link:
                    return np.array(frame.placement.translation)
    known = {model.names[link]: np.zeros(3)} if link else {}
    for index in range(1, model.njoints):
        if model.parents[index] == link:
            known[model.names[index]] = np.array(model.jointPlacements[index].translation)
    for frame in model.frames:
        if frame.parentJoint == link:
            known.setdefault(frame.name, np.array(frame.placement.translation))
    if name not in known:
        raise MechanismError(
            f"beam {beam!r}: no place {name!r} on its link; there are: {', '.join(known)}"
        )
    return known[name]


def _at(nodes: Sequence[Node], place: Array, length: float) -> int | None:
    """Return the node at a place, None if there is none."""
    for index, node in enumerate(nodes):
        if np.linalg.norm(node.at - place) <= _SAME * length:
            return index
    return None


def _axes(beam: Beam, along: Array, name: str) -> Array:
    """Return the section's axes in the link, x along the beam, shape (3, 3)."""
    up = np.eye(3)[np.argmin(abs(along))] if beam.up is None else np.asarray(beam.up, float)
    across = up - (up @ along) * along
    size = float(np.linalg.norm(across))
    if size <= _SAME * float(np.linalg.norm(up)):
        raise MechanismError(f"beam {name!r}: 'up' is along the beam")
    z = across / size
    return np.column_stack([along, np.cross(z, along), z])

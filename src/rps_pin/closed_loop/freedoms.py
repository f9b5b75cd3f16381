"""Motions that given velocities leave open: idle freedoms, and freedoms that lack an actuator.

Given the velocities of some joints, the allowed motions n with J n = 0 and S n = 0 are left open.
One of them is *idle* if it only turns links on the spot, so that nothing drives it and nothing
needs it: a rod that spins about the line of its two balls, a balanced wheel. In numbers, for each
link that it moves, with w its angular velocity,

    |velocity of p| <= `ON_THE_SPOT` |w| size

for each point p of the link: the origin of its joint, its centre of mass, the origins of the joints
and closed frames that it carries. The size is the largest distance of these points from that
origin, or the largest radius of gyration if that is more. So a rod whose centre of mass is off its
line by up to a twentieth of its length is idle, and a pendulum of any length is not. Nor is a
motion that stretches a spring. Armature, damping and friction do not matter.

All other motions lack an actuator.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.sparse.csgraph import connected_components

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.errors import few
from rps_pin.numerics.linear_algebra import Decomposition

#: Speed of a point of a link that turns on the spot, over that of its tip.
ON_THE_SPOT = 0.05
#: What moves less than this, in the unit of the motions, stands.
_STANDS = 1e-6
#: A message names so many joints, or links.
NAMED = 6


class Freedom(NamedTuple):
    """Motions that are left open, of joints and links that have nothing to do with others."""

    size: int
    """How many independent motions."""
    joints: tuple[str, ...]
    """Joints that move in them."""
    links: tuple[str, ...]
    """Links that move in them: a link is named by its frame, or else by the joint before it."""


class OpenMotions(NamedTuple):
    """Motions that given velocities leave open; columns are orthonormal in one unit."""

    idle: Array
    """Shape (nv, number of idle motions)."""
    lacking: Array
    """The others, orthogonal to them, shape (nv, number of others)."""


def open_motions(system: ConstraintSystem, q: Array, motions: Array) -> OpenMotions:
    """Sort motions into idle ones and others.

    Parameters
    ----------
    system
        The mechanism.
    q
        Configuration, shape (nq,).
    motions
        Basis X of the motions that are left open, orthonormal in one unit, shape (nv, k).
    """
    if not motions.shape[1]:
        return OpenMotions(motions, motions)
    links = _links(system, q)
    found = [_sorted(system, links, part) for part in _separate(system, motions)]
    return OpenMotions(*(np.concatenate(parts, axis=1) for parts in zip(*found, strict=True)))


class Rest(NamedTuple):
    """The velocities that are not given, and their columns of J."""

    size: int
    """How many velocities there are, nv."""
    indices: Indices
    """Those that are not given, in rising order."""
    factors: Decomposition
    """Of their columns J_r, all entries in one unit."""

    def left_open(self) -> Array:
        """Return the motions with J n = 0 that leave the given velocities zero, (nv, k)."""
        motions = self.factors.null_space()
        whole = np.zeros((self.size, motions.shape[1]))
        whole[self.indices] = motions
        return whole


def rest_of(system: ConstraintSystem, jacobian: Array, given: Indices) -> Rest:
    """Return the velocities that are not given, and the factors of their columns of J."""
    indices = np.setdiff1d(np.arange(system.model.nv), given)
    columns = system.scaled(jacobian)[:, indices]
    factors = Decomposition(columns, system.rule.tolerance)
    return Rest(system.model.nv, indices, factors)


def of_actuators(system: ConstraintSystem, q: Array, jacobian: Array) -> OpenMotions:
    """Return the motions that the actuated joints leave open."""
    return open_motions(system, q, rest_of(system, jacobian, system.actuated).left_open())


def freedoms(system: ConstraintSystem, q: Array, motions: Array) -> tuple[Freedom, ...]:
    """Return the freedoms that motions (as those of `OpenMotions`) belong to, by joint."""
    if not motions.shape[1]:
        return ()
    links = _links(system, q)
    return tuple(_freedom(system, links, part) for part in _separate(system, motions))


def in_words(system: ConstraintSystem, motions: Array) -> str:
    """Return the joints that motions move, for a message, those that move most first."""
    size = np.linalg.norm(motions, axis=1)
    names, joints = list(system.model.names)[1:], list(system.model.joints)[1:]
    most = [float(size[j.idx_v : j.idx_v + j.nv].max(initial=0.0)) for j in joints]
    moving = [i for i in np.argsort(-np.array(most), kind="stable") if most[i] > _STANDS]
    quoted = few([repr(names[i]) for i in moving], NAMED)
    return f"joint {quoted}" if len(moving) == 1 else f"joints {quoted}"


# Links --------------------------------------------------------------------------------------------


class _Link(NamedTuple):
    """A link: all bodies after one joint."""

    points: Array
    """Jacobian of its points' velocities in one unit, shape (p, 3, nv)."""
    turn: Array
    """Jacobian of its angular velocity in one unit, shape (3, nv)."""
    size: float


def _links(system: ConstraintSystem, q: Array) -> list[_Link]:
    """Return the links that joints 1, 2, ... move."""
    model, data = system.model, system.data
    carried: list[list[Array]] = [[] for _ in range(model.njoints)]
    for index in range(1, model.njoints):
        carried[model.parents[index]].append(model.jointPlacements[index].translation)
    for closed in system.equations.closed_frames:
        for frame in (closed.a, closed.b):
            carried[frame.joint].append(frame.placement.translation)
    pin.computeJointJacobians(model, data, q)
    return [_link(system, index, carried[index]) for index in range(1, model.njoints)]


def _link(system: ConstraintSystem, index: int, carried: list[Array]) -> _Link:
    model, data, local = system.model, system.data, pin.ReferenceFrame.LOCAL
    jacobian = pin.getJointJacobian(model, data, index, local).reshape(6, model.nv)
    move, turn = np.vsplit(jacobian * system.column_scale, 2)
    inertia, points, size = model.inertias[index], [np.zeros(3), *carried], 0.0
    if inertia.mass > 0:
        points.append(inertia.lever)
        size = float(np.sqrt(np.linalg.eigvalsh(inertia.inertia)[-1].clip(0.0) / inertia.mass))
    size = max(size, *(float(np.linalg.norm(point)) for point in points))
    return _Link(np.array([move - pin.skew(point) @ turn for point in points]), turn, size)


# Motions ------------------------------------------------------------------------------------------


def _separate(system: ConstraintSystem, motions: Array) -> Iterator[Array]:
    """Return bases of the parts of a space of motions that move different joints, (nv, k) each."""
    joints = [joint for joint in list(system.model.joints)[1:] if joint.nv]
    first, sizes = [joint.idx_v for joint in joints], [joint.nv for joint in joints]
    together = np.abs(motions @ motions.T)
    largest = np.maximum.reduceat(np.maximum.reduceat(together, first, axis=0), first, axis=1)
    _, labels = connected_components(largest > _STANDS, directed=False)
    of_velocity = np.repeat(labels, sizes)
    for label in dict.fromkeys(labels.tolist()):
        rows = of_velocity == label
        left, values, _ = np.linalg.svd(motions[rows], full_matrices=False)
        if count := int((values > 0.5).sum()):  # each value is 0 or 1
            part = np.zeros((system.model.nv, count))
            part[rows] = left[:, :count]
            yield part


def _sorted(system: ConstraintSystem, links: list[_Link], motions: Array) -> OpenMotions:
    """Sort the motions of joints that belong together."""
    length = system.equations.length
    if motions.shape[1] > 1:  # those that move points least, their links' sizes considered, first
        rows = [
            link.points.reshape(-1, link.turn.shape[1])
            * max(length / max(link.size, _STANDS * length), 1.0)
            for link in links
        ]
        motions = motions @ np.linalg.svd(np.concatenate(rows) @ motions)[2].T[:, ::-1]
    idle = np.array([_is_idle(system, links, motion) for motion in motions.T])
    return OpenMotions(motions[:, idle], motions[:, ~idle])


def _is_idle(system: ConstraintSystem, links: list[_Link], motion: Array) -> bool:
    if system.effects is not None:
        stretched = np.abs(motion[system.effects.stiffness != 0])
        if stretched.max(initial=0.0) > _STANDS:
            return False
    for link in links:
        speed = float(np.linalg.norm(link.points @ motion, axis=1).max())
        tip = float(np.linalg.norm(link.turn @ motion)) * link.size
        if speed > ON_THE_SPOT * tip + _STANDS:
            return False
    return True


def _freedom(system: ConstraintSystem, links: list[_Link], motions: Array) -> Freedom:
    """Return a freedom of motions."""
    names, joints = list(system.model.names)[1:], list(system.model.joints)[1:]
    length = system.equations.length
    turning = [
        name
        for name, joint in zip(names, joints, strict=True)
        if np.abs(motions[joint.idx_v : joint.idx_v + joint.nv]).max() > _STANDS
    ]
    moving = [
        _name(system.model, index)
        for index, link in enumerate(links, start=1)
        if max(length * np.abs(link.turn @ motions).max(), np.abs(link.points @ motions).max())
        > _STANDS
    ]
    return Freedom(motions.shape[1], tuple(turning), tuple(moving))


def _name(model: pin.Model, joint: int) -> str:
    """Return the name of the link after a joint: that of its first body, or the joint's."""
    for frame in model.frames:
        if frame.parentJoint == joint and frame.type == pin.FrameType.BODY:
            return str(frame.name)
    return str(model.names[joint])

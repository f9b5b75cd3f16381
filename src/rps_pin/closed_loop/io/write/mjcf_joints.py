"""Joints of a tree as MuJoCo's hinges, slides, balls and free joints.

====================  ==============================  =============================================
joint                 in MuJoCo                       velocities
====================  ==============================  =============================================
revolute, prismatic   hinge, slide                    the same
turn without bounds   hinge                           the same
spherical             ball                            the same (in axes of the body)
free-flyer            free, at the root               linear ones in world axes
free-flyer            three slides and a ball         linear ones in axes of the body before
planar                two slides and a hinge          linear ones in axes of the body before
helical               hinge and slide, and their      one more
                      coupling
====================  ==============================  =============================================

Several joints of one body act one after the other, from the parent on, as rows of joints do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.io.write.numbers import quaternion
from rps_pin.closed_loop.io.write.source import (
    Names,
    Source,
    axis_of,
    coordinates,
    kind_of,
    pitch_of,
    velocities,
)
from rps_pin.errors import MechanismError, shown

_X, _Y, _Z = np.eye(3)


class MujocoJoint(NamedTuple):
    """A joint of MuJoCo's.

    Attributes
    ----------
    name, kind
        ``"hinge"``, ``"slide"``, ``"ball"`` or ``"free"``.
    axis
        In the frame of the tree's joint; None for balls and free joints.
    coordinates
        At the home configuration, as in ``qpos``.
    idx_q
        Where its limits stand in the tree's vectors, or None if it has none.
    idx_v
        Where its damping, friction, armature, effort limit (and its spring) stand, or None.
    """

    name: str
    kind: str
    axis: Array | None
    coordinates: Array
    idx_q: int | None = None
    idx_v: int | None = None


class Screw(NamedTuple):
    """A slide that follows a hinge: slide = pitch * hinge."""

    hinge: str
    slide: str
    pitch: float


def mujoco_joints(
    source: Source, joint: int, q: Array, names: Names
) -> tuple[list[MujocoJoint], list[Screw]]:
    """Return the joints that stand for one of a tree without rows, and the screws among them.

    Parameters
    ----------
    source
        The mechanism.
    joint
        The joint's index.
    q
        The home configuration, shape (nq,).
    names
        The names of joints that are taken.

    Raises
    ------
    MechanismError
        If its damping, friction or armature is not one that MuJoCo has; names it.
    """
    model = source.model
    one, name = model.joints[joint], model.names[joint]
    kind, own = kind_of(one), coordinates(model, joint, q)
    at = (one.idx_q, one.idx_v)
    if kind in ("revolute", "prismatic", "continuous", "helical"):
        axis = axis_of(one, model.nq)
        turns = "slide" if kind == "prismatic" else "hinge"
        if kind == "continuous":
            angle = np.array([math.atan2(own[1], own[0])])
            return [MujocoJoint(name, turns, axis, angle, None, one.idx_v)], []
        found, screws = [MujocoJoint(name, turns, axis, own, *at)], []
        if kind == "helical":
            screw = Screw(name, names.fresh(f"{name}_slide"), pitch_of(one, model.nq))
            found.append(MujocoJoint(screw.slide, "slide", axis, screw.pitch * own))
            screws.append(screw)
        return found, screws
    if kind == "ball":
        _refuse_uneven(source, joint, slice(0, 3), "")
        _refuse_rest(source, joint, slice(0, 3))
        return [MujocoJoint(name, "ball", None, np.roll(own, 1), None, one.idx_v)], []
    if kind == "planar":
        angle = np.array([math.atan2(own[3], own[2])])
        return [
            *_slides(source, joint, own[:2], names),
            MujocoJoint(name, "hinge", _Z, angle, None, one.idx_v + 2),
        ], []
    if kind == "free":
        _refuse_uneven(source, joint, slice(3, 6), "turns of ")
        if model.parents[joint] == 0 and _is_even(source, joint):
            placed = model.jointPlacements[joint] * pin.XYZQUATToSE3(own)
            pose = np.concatenate([placed.translation, quaternion(placed.rotation)])
            _refuse_uneven(source, joint, slice(0, 3), "translations of ", moving_axes=True)
            _refuse_rest(source, joint, slice(0, 6))
            return [MujocoJoint(name, "free", None, pose, None, one.idx_v)], []
        _refuse_rest(source, joint, slice(3, 6))
        return [
            *_slides(source, joint, own[:3], names),
            MujocoJoint(name, "ball", None, np.roll(own[3:], 1), None, one.idx_v + 3),
        ], []
    raise MechanismError(f"joint {name!r} ({kind}) cannot be written: MuJoCo has none")


def _slides(source: Source, joint: int, own: Array, names: Names) -> list[MujocoJoint]:
    """Return slides along x, y, ... for translations in axes of the moving body."""
    model = source.model
    start = model.joints[joint].idx_v
    _refuse_uneven(source, joint, slice(0, own.size), "translations of ", moving_axes=True)
    axes = zip("xyz", (_X, _Y, _Z), own, strict=False)
    return [
        MujocoJoint(
            names.fresh(f"{model.names[joint]}_{letter}"),
            "slide",
            axis,
            np.array([value]),
            None,
            start + k,
        )
        for k, (letter, axis, value) in enumerate(axes)
    ]


def _losses(source: Source, joint: int, part: slice) -> dict[str, Array]:
    effects = source.effects
    arrays = {
        "damping": effects.damping,
        "friction": effects.friction,
        "armature": source.model.armature,
    }
    return {what: velocities(source.model, joint, a)[part] for what, a in arrays.items()}


def _is_even(source: Source, joint: int) -> bool:
    """Return whether a joint's effects are MuJoCo's of free joints: one number for all velocities.

    Springs of free joints are at rest in the pose of the file's body.
    """
    stiffness, rest = _spring(source, joint, slice(None))
    even = [*_losses(source, joint, slice(None)).values(), stiffness]
    shifted = stiffness.any() and rest[:3].any()
    return not shifted and all(np.ptp(values) == 0 for values in even)


def _spring(source: Source, joint: int, part: slice) -> tuple[Array, Array]:
    """Return stiffness and rest of some of a joint's velocities."""
    stiffness, rest = (
        velocities(source.model, joint, array)[part]
        for array in (source.effects.stiffness, source.effects.rest)
    )
    return stiffness, rest


def _refuse_rest(source: Source, joint: int, part: slice) -> None:
    """Refuse a spring of a ball that is not at rest at the neutral coordinates."""
    stiffness, rest = _spring(source, joint, part)
    if stiffness.any() and rest.any():
        raise MechanismError(
            f"joint {source.model.names[joint]!r}: its spring is at rest where it is turned by "
            f"{shown(rest[-3:].tolist())} rad; MuJoCo has springs of turns that are at rest at the "
            "neutral coordinates only"
        )


def _refuse_uneven(
    source: Source, joint: int, part: slice, which: str, *, moving_axes: bool = False
) -> None:
    """Refuse effects that differ among velocities which MuJoCo gives one number.

    With `moving_axes` MuJoCo's velocities are in other axes than the tree's: damping is the same in
    all, friction and armature are not.
    """
    name = source.model.names[joint]
    for what, values in _losses(source, joint, part).items():
        if moving_axes and what != "damping" and values.any():
            raise MechanismError(
                f"joint {name!r}: {what} = {values} of the {which}joint acts along axes of the "
                "moving body; MuJoCo has it along fixed axes only"
            )
        if np.ptp(values) > 0:
            raise MechanismError(
                f"joint {name!r}: {what} = {values} of the {which}joint; MuJoCo has one number for "
                "all"
            )

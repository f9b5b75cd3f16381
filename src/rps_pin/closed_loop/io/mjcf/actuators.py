"""Actuators of an MJCF: the joints that they act on, their rotors, damping and greatest forces.

The actuated joints are those, and the tendons, that actuators act on; of ball and free joints, the
velocities that alone have a gear (``ball.x``). `tau` is the whole force there (N or N m): gears,
gains, servos (kp, kv), muscles and the back-EMF of motors make that force, as they make MuJoCo's
``qfrc_actuator``. The armature and damping of an actuator act without any control; they are added
to those of its joint or tendon, times the square of its gear.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.io.mjcf.source import MjcfSource
from rps_pin.closed_loop.io.mjcf.tree import BALL, FREE, axes_of_world

_TRANSMISSIONS = ("joint", "joint", "slider-crank", "tendon", "site", "body", "ball joint or site")
_JOINTS, _IN_PARENT, _TENDON = (0, 1), 1, 3


class Actuator(NamedTuple):
    """An actuator on a coordinate of a joint, or on a fixed tendon."""

    number: int
    kind: str
    """``"joints"`` or ``"tendons"``."""
    target: int
    """MuJoCo's number of the joint or tendon."""
    gear: float
    active: bool
    """Whether it is not disabled."""
    place: int = 0
    """Of the coordinate among the joint's velocities."""


def read_actuators(source: MjcfSource) -> list[Actuator]:
    """Return the actuators on one coordinate or one fixed tendon; the others are told.

    Raises
    ------
    MechanismError
        If another one has armature or damping; with its line.
    """
    m, found, off = source.model, [], source.disabled("actuation")
    if off and len(m.actuator_trntype):
        where = source.setting("flag", attribute="actuation")
        source.told["actuation is disabled, so no joint is actuated"] = [where]
    for number, transmission in enumerate(m.actuator_trntype):
        target = int(m.actuator_trnid[number, 0])
        what = _TRANSMISSIONS[transmission]
        place: int | None = 0
        gears = m.actuator_gear[source.read("actuator_outadr", number) or number]
        if transmission in _JOINTS and m.jnt_type[target] in (FREE, BALL):
            what = "joint of several coordinates"
            place = _coordinate(source, number, target, gears)
        elif transmission not in _JOINTS:
            place = 0 if transmission == _TENDON and source.is_fixed(target) else None
        if place is not None:
            kind = "tendons" if transmission == _TENDON else "joints"
            gear = float(gears[place])
            active = not m.opt.disableactuator >> int(m.actuator_group[number]) & 1
            if not active:
                source.tell("actuators", number, "its group is disabled, so it does not act")
            found.append(Actuator(number, kind, target, gear, active and not off, place))
            continue
        what = "spatial tendon" if transmission == _TENDON else what
        if effect := _effect(source, number):
            source.refuse("actuators", number, f"has {effect} on a {what}, which is not read")
        source.tell("actuators", number, f"on a {what}, so not an actuated joint of the mechanism")
    return found


def _effect(source: MjcfSource, number: int) -> str:
    """Return what an actuator adds to its joint, or nothing."""
    names = ("armature", "damping", "dampingpoly")
    return next((n for n in names if np.any(source.read(f"actuator_{n}", number))), "")


def _coordinate(source: MjcfSource, number: int, joint: int, gears: Array) -> int | None:
    """Return the place of the one velocity of a ball or free joint that an actuator acts on.

    None if there are several, or it is about an axis that is not that of a velocity here.
    """
    m = source.model
    free, kind = m.jnt_type[joint] == FREE, int(m.actuator_trntype[number])
    places = np.flatnonzero(gears[: 6 if free else 3])
    if places.size != 1 or _effect(source, number):
        return None
    place = int(places[0])
    if free and place < 3:
        return place if axes_of_world(m, joint) else None
    return None if kind == _IN_PARENT else place


def force_range(source: MjcfSource, actuators: Iterable[Actuator]) -> tuple[float, float]:
    """Return the least and greatest force of a joint's actuators together."""
    ranges = [_force_range(source, one) for one in actuators if one.active]
    if not ranges:
        return -np.inf, np.inf
    lower, upper = zip(*ranges, strict=True)
    return sum(lower), sum(upper)


def _force_range(source: MjcfSource, actuator: Actuator) -> tuple[float, float]:
    """Return the range of an actuator's force at its joint: forcerange, and a motor's ctrlrange."""
    m, number = source.model, actuator.number
    low, high = -np.inf, np.inf
    if m.actuator_forcelimited[number]:
        low, high = m.actuator_forcerange[number]
    types = (m.actuator_gaintype, m.actuator_biastype, m.actuator_dyntype)
    control = source.read("actuator_ctrladr", number) or number
    if m.actuator_ctrllimited[control] and not (
        any(kind[number] for kind in types) or source.disabled("clampctrl")
    ):
        ends = sorted(m.actuator_gainprm[number, 0] * m.actuator_ctrlrange[control])
        low, high = max(low, ends[0]), min(high, ends[1])
    if not actuator.gear:
        return 0.0, 0.0
    lower, upper = sorted((float(low * actuator.gear), float(high * actuator.gear)))
    return lower, upper

"""Legs between two points: of a 6-UPS platform, recognised in a mechanism.

A leg is a universal joint at a fixed point b, a prismatic joint along the line from b, and a ball
at a point a of the platform. Its length is then |p + R a - b|. With x the first axis of the
universal joint, y its second axis where the first angle is zero, and z across both, the leg's
direction is

    u = (sin(t), -cos(t) sin(s), cos(t) cos(s)),

s the first angle and t the second plus a constant.
"""

from __future__ import annotations

import math
from typing import NamedTuple, NoReturn

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel, LoopClosure
from rps_pin.errors import MechanismError
from rps_pin.task.task import Task

#: Distances below this part of the characteristic length are none: files are rounded.
_NONE = 1e-9


class PointLegs(NamedTuple):
    """Legs between points, in the order of the actuators."""

    base: Array
    """b, in the axes of the task's reference frame, shape (legs, 3), m."""
    platform: Array
    """a, in the axes of the task's frame, shape (legs, 3), m."""
    offset: Array
    """A leg's length less the coordinate of its actuator, shape (legs,), m."""
    axes: Array
    """x, y and z of the universal joints in world axes, shape (legs, 3, 3), rows."""
    angles: Array
    """Least and largest s, then t, shape (legs, 2, 2), rad; infinite where there is no limit."""
    links: tuple[dict[int, Array], ...]
    """Of each leg, by joint of the model: the rotation from the link's axes to the leg's.

    The rows are the first axis, the second, and the one across both (first link), or the one across
    the second axis and u, the second axis, and u (second link, and the slide).
    """


def point_legs(task: Task) -> PointLegs:
    """Return the legs of a task whose mechanism is a 6-UPS platform.

    Raises
    ------
    MechanismError
        If it is another mechanism; says what is different.
    """
    mechanism = task.mechanism
    if task.coordinates != ("x", "y", "z", "rx", "ry", "rz"):
        _refuse(task, f"its coordinates are {', '.join(task.coordinates)}, not x to rz of a frame")
    name, placement = task.output_frame
    model = mechanism.model
    frame = model.frames[model.getFrameId(name)]
    if task.extension.reference != "universe":
        _refuse(task, f"its coordinates refer to {task.extension.reference!r}, not to the world")
    of_platform, to_frame = frame.parentJoint, (frame.placement * placement).inverse()
    legs = {}
    for closure in mechanism.closures:
        if not isinstance(closure, LoopClosure) or closure.kind != "spherical":
            _refuse(task, f"closure {closure.name!r} is not spherical")
        ends = closure.closed_frames(model)
        joints = [one.joint for one in ends]
        if joints.count(of_platform) != 1:
            _refuse(task, f"closure {closure.name!r} does not join a leg to frame {name!r}")
        at = joints.index(of_platform)
        tip = ends[1 - at]
        actuator, *leg = _leg(task, mechanism, tip.joint, tip.placement.translation)
        legs[actuator] = to_frame.act(ends[at].placement.translation), *leg
    if set(legs) != set(mechanism.actuated) or len(legs) != 6:
        _refuse(task, f"it has {len(legs)} legs with actuators, not six")
    ordered = [legs[one] for one in mechanism.actuated]
    platform, base, offset, axes, angles = (np.array([one[i] for one in ordered]) for i in range(5))
    return PointLegs(base, platform, offset, axes, angles, tuple(one[5] for one in ordered))


def _leg(
    task: Task, mechanism: ClosedLoopModel, last: int, tip: Array
) -> tuple[str, Array, float, Array, Array, dict[int, Array]]:
    """Return the actuator of a leg, and its fixed point, offset, axes, limits and links.

    See `PointLegs`.
    """
    model, none = mechanism.model, _NONE * mechanism.characteristic_length
    middle = model.parents[last]
    first = model.parents[middle] if middle else 0
    name = model.names[last]
    if not middle or not first or model.parents[first]:
        _refuse(task, f"the leg that ends in {name!r} has not three joints")
    one, two, slide = (_axis(model, joint) for joint in (first, middle, last))
    if one is None or two is None or slide is None or one[:3].any() or two[:3].any():
        _refuse(task, f"the leg that ends in {name!r} is no universal and prismatic joint")
    if slide[3:].any():
        _refuse(task, f"joint {name!r} turns")
    between, along = model.jointPlacements[middle], model.jointPlacements[last]
    x, y = one[3:], between.rotation @ two[3:]
    z, origin = np.cross(x, y), between.translation
    d = between.rotation @ along.rotation @ slide[:3]
    if max(abs(x @ y), abs(d @ y)) > _NONE:
        _refuse(task, f"the axes of the leg that ends in {name!r} are not across each other")
    if abs(origin @ z) > none:
        _refuse(task, f"the axes of {model.names[first]!r} and {model.names[middle]!r} do not meet")
    t = -(origin @ y)  # origin + t y is on both axes
    fixed = model.jointPlacements[first].act(origin + t * y)
    start = along.translation - t * two[3:]  # from the fixed point, in axes of the second link
    slide_ = along.rotation @ slide[:3]
    offsets = start @ slide_, tip @ slide[:3]
    across = [start - offsets[0] * slide_, tip - offsets[1] * slide[:3]]
    if max(np.linalg.norm(part) for part in across) > none:
        _refuse(task, f"the line of {name!r} does not lead from the universal joint to the ball")
    axes = np.array([x, y, z]) @ model.jointPlacements[first].rotation.T
    limits = np.array([_limits(model, first), _limits(model, middle)])
    shift = math.atan2(d @ x, d @ z)
    if not math.cos(mechanism.home[model.joints[middle].idx_q] + shift) > _NONE:
        _refuse(task, f"at home, joint {model.names[middle]!r} turns the leg beyond a right angle")
    limits[1] += shift
    on_first, on_second = np.array([x, y, z]), np.array([np.cross(y, d), y, d]) @ between.rotation
    links = {first: on_first, middle: on_second, last: on_second @ along.rotation}
    return name, np.asarray(fixed), float(sum(offsets)), axes, limits, links


def _limits(model: pin.Model, joint: int) -> tuple[float, float]:
    k = model.joints[joint].idx_q
    return float(model.lowerPositionLimit[k]), float(model.upperPositionLimit[k])


def _axis(model: pin.Model, joint: int) -> Array | None:
    """Return the motion of a joint of one velocity, shape (6,); none of others."""
    description = model.joints[joint]
    if description.nq != 1 or description.nv != 1:
        return None
    data = description.createData()
    description.calc(data, np.zeros(model.nq))
    return np.asarray(data.S).reshape(6)


def _refuse(task: Task, why: str) -> NoReturn:
    raise MechanismError(
        f"{task.mechanism.name or 'this mechanism'!r} is no platform on six legs with universal "
        f"joints, prismatic actuators and balls: {why}"
    )

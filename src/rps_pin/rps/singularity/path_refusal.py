"""Refuse a trajectory that the robot cannot follow, before any force is computed: when, and why."""

from __future__ import annotations

import math

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import LimitViolation, SingularityError, UnreachableError
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.path_check import check_path
from rps_pin.rps.singularity.path_events import LimitEvent, PathCheck, SingularityEvent
from rps_pin.trajectories.path import Trajectory

#: At how many times between leaving a limit and coming back the worst is looked for.
_LOOKS = 101


def require_clear(robot: RPSRobot, trajectory: Trajectory) -> PathCheck:
    """Return what `check_path` found of a trajectory that the robot can follow.

    A trajectory that only grazes a singularity passes: it has forces, however large.

    Raises
    ------
    UnreachableError
        If it leaves a limit of a leg: says when, which, and by how much at worst.
    SingularityError
        If it crosses a singularity, or stays in one: says when, where, and which.
    """
    found = check_path(robot, trajectory)
    outside = [event for event in found.limits if event.kind != "returns"]
    if outside:
        raise _unreachable(robot, trajectory, found, outside[0])
    singular = [event for event in found.singularities if event.kind != "grazes"]
    if singular:
        raise _singular(robot, found, singular)
    return found


def _unreachable(
    robot: RPSRobot, trajectory: Trajectory, found: PathCheck, event: LimitEvent
) -> UnreachableError:
    """Return the error of the first limit left, with the worst of it until it is kept again."""

    def same(other: LimitEvent) -> bool:
        return (other.leg, other.quantity, other.side) == (event.leg, event.quantity, event.side)

    back = (e.time for e in found.limits if e.kind == "returns" and same(e) and e.time > event.time)
    times = np.linspace(event.time, next(back, found.duration), _LOOKS)
    poses = trajectory.sample(times).pose
    looks = [_violations(robot, pose) for pose in poses]
    worst = max(range(len(looks)), key=lambda i: _excess(looks[i], event))
    number = sum(other.kind != "returns" for other in found.limits)
    more = f"; limits are left {number} times in all" if number > 1 else ""
    return UnreachableError(
        f"at t = {event.time:.6g} s of {found.duration:.6g} s the trajectory leaves the workspace; "
        f"at worst, at t = {times[worst]:.6g} s, {'; '.join(map(str, looks[worst]))}{more}",
        looks[worst],
    )


def _violations(robot: RPSRobot, pose: Array) -> tuple[LimitViolation, ...]:
    try:
        robot.inverse_kinematics(pose)
    except UnreachableError as error:
        return error.violations
    return ()


def _excess(violations: tuple[LimitViolation, ...], event: LimitEvent) -> float:
    """Return how far beyond the event's limit a pose is, m or rad; 0 if it keeps it."""
    mine = (v for v in violations if (v.leg, v.quantity) == (event.leg, event.quantity))
    return max((max(v.lower - v.value, v.value - v.upper) for v in mine), default=0.0)


def _singular(
    robot: RPSRobot, found: PathCheck, events: list[SingularityEvent]
) -> SingularityError:
    first = events[0]
    z, tilt_x, tilt_y = first.pose
    which = f"{first.singularity} singularity" + (f" of leg {first.leg}" if first.leg else "")
    does = "crosses" if first.kind == "crosses" else f"stays for {first.width:.6g} s in"
    times = ", ".join(f"{event.time:.6g} s" for event in events[1:])
    return SingularityError(
        f"at t = {first.time:.10g} s of {found.duration:.6g} s the trajectory {does} a {which}, at "
        f"z = {z:.6g} m, tilt = ({tilt_x:.6g}, {tilt_y:.6g}) rad: no actuator forces carry the "
        f"robot through it{f'; again at {times}' if times else ''}",
        math.inf,
        robot.mechanism.max_condition,
    )

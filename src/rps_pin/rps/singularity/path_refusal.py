"""Errors of paths that the 3-RPS cannot follow: raised before any force is computed, say where."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rps_pin.errors import SingularityError, UnreachableError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics.legs import cone_angles, violations
from rps_pin.rps.kinematics.pose import rotation
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.path_check import check_path
from rps_pin.task.paths.events import LimitEvent, PathCheck, pose_of_robot_in_words
from rps_pin.trajectories.path import Trajectory

#: At how many times between leaving a limit and coming back the worst is looked for.
_LOOKS = 101


class PathWords(NamedTuple):
    """How an error calls a path and its parameter; digits to which a singularity is located."""

    path: str = "trajectory"
    parameter: str = "t"
    unit: str = " s"
    digits: int = 10

    def at(self, value: float, digits: int = 6) -> str:
        """Return ``t = 1.5 s``."""
        return f"{self.parameter} = {value:.{digits}g}{self.unit}"


OF_TRAJECTORIES = PathWords()


@refuses_other_kinds
def require_clear(
    robot: RPSRobot,
    trajectory: Trajectory,
    *,
    tolerance: float | None = None,
    words: PathWords = OF_TRAJECTORIES,
) -> PathCheck:
    """Return what `check_path` found of a trajectory that the robot can follow.

    A trajectory that only grazes a singularity passes: it has forces, however large.

    Parameters
    ----------
    robot, trajectory, tolerance
        As for `check_path`.
    words
        For the errors.

    Raises
    ------
    UnreachableError
        If it leaves a limit of a leg: says when, which, and by how much at worst.
    SingularityError
        If it crosses a singularity, or stays in one: says when, where, and which.
    """
    found = check_path(robot, trajectory, tolerance=tolerance)
    outside = [event for event in found.limits if event.kind != "returns"]
    if outside:
        raise _unreachable(robot, trajectory, found, outside, words)
    singular = [event for event in found.singularities if event.kind != "grazes"]
    if singular:
        first = singular[0]
        stays = f"stays for {first.width:.6g}{words.unit} in"
        times = ", ".join(f"{event.time:.6g}{words.unit}" for event in singular[1:])
        raise SingularityError(
            f"at {words.at(first.time, words.digits)} of {found.duration:.6g}{words.unit} "
            f"the {words.path} {'crosses' if first.kind == 'crosses' else stays} a {first.which}, "
            f"at {pose_of_robot_in_words(first.pose)}: no actuator forces carry the robot through "
            f"it"
            f"{f'; again at {times}' if times else ''}",
            math.inf,
            robot.mechanism.max_condition,
        )
    return found


def _unreachable(
    robot: RPSRobot,
    trajectory: Trajectory,
    found: PathCheck,
    events: list[LimitEvent],
    words: PathWords,
) -> UnreachableError:
    """Return the error of the first limit left, with the worst of it until it is kept again."""
    event = events[0]

    def same(other: LimitEvent) -> bool:
        return (other.leg, other.quantity, other.side) == (event.leg, event.quantity, event.side)

    back = (e.time for e in found.limits if e.kind == "returns" and same(e) and e.time > event.time)
    times = np.linspace(event.time, next(back, found.duration), _LOOKS)
    poses = trajectory.sample(times).pose
    p, legs = robot.parameters, robot.inverse_kinematics(poses, errors="mask")
    cone = cone_angles(legs.angle, rotation(poses), p.spherical_rest_angle)
    quantity = {"length": legs.length, "angle": legs.angle, "spherical joint": cone}[event.quantity]
    beyond = (quantity[:, event.leg - 1] - event.limit) * (1 if event.side == "upper" else -1)
    worst = int(beyond.argmax())
    broken = violations(p, legs.length[worst], legs.angle[worst], cone[worst])
    more = f"; limits are left {len(events)} times in all" if len(events) > 1 else ""
    return UnreachableError(
        f"at {words.at(event.time)} of {found.duration:.6g}{words.unit} the {words.path} leaves "
        f"the workspace; at worst, at {words.at(times[worst])}, "
        f"{'; '.join(map(str, broken))}{more}",
        broken,
    )

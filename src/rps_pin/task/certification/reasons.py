"""Reasons why boxes are outside: a workspace's words for limits, cones and singularities.

Boxes over which nothing closes have reasons of their own, which name the joints of a leg.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from rps_pin.task.paths.limits import Cone, ConeRooms, JointRooms
from rps_pin.task.task import Task
from rps_pin.task.workspace.reasons import limit_names

#: Limits and cones that are told apart, at most: other reasons need bits too.
_MOST_TOLD = 40


class LimitWords(NamedTuple):
    """Limits in words, as in `rps_pin.task.workspace`."""

    joints: dict[tuple[int, str], str]
    """Of joints: by coordinate of q, and ``"lower"`` or ``"upper"``; of limits that are finite."""
    cones: tuple[str, ...]

    def of(self, coordinate: int, side: str) -> str:
        """Return that of a joint; what has no such limit has no word."""
        return self.joints.get((coordinate, side), "")


def limit_words(task: Task, cones: Sequence[Cone]) -> LimitWords:
    """Return the limits of a task's joints and cones in words.

    Where there are too many to tell them apart, both limits of a joint have one word, or else those
    of all joints.

    Raises
    ------
    MechanismError
        If a cone's frame is unknown.
    """
    joints, of_cones = JointRooms(task.mechanism), ConeRooms(task.mechanism, cones)
    names = limit_names([*joints.signals, *of_cones.signals])
    count = len(joints.signals)
    if len(names) > _MOST_TOLD:
        names[:count] = [f"{one.joint} beyond a limit" for one in joints.signals]
    if len(set(names)) > _MOST_TOLD:
        names[:count] = ["a joint beyond a limit"] * count
    keys = [(int(q), one.side) for q, one in zip(joints.q, joints.signals, strict=True)]
    return LimitWords(dict(zip(keys, names, strict=False)), tuple(names[count:]))


def out_of_reach(joints: Sequence[str]) -> str:
    """Return the reason where a leg of these joints closes by no motion of them."""
    return f"out of reach of {', '.join(joints)}"


def closed_beyond_limits(joints: Sequence[str]) -> str:
    """Return the reason where a leg closes nowhere within the limits of its joints."""
    return f"no closure within the limits of {', '.join(joints)}"

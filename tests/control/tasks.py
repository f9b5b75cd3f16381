"""Robots with a task that control is tested on, poses within their reach, and their models."""

from __future__ import annotations

from functools import cache

import numpy as np

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.arrays import Array
from rps_pin.task import Task

#: The 3-RPS the generic way too: its mechanism with the task of its pose, without closed forms.
NAMES = ("rps", "delta", "stewart", "ankle")
ROBOT = RPSRobot.from_preset("micro")


@cache
def plain(name: str) -> Task:
    """The task, by the Pinocchio engine."""
    if name == "rps":
        return Task(ROBOT.mechanism, "platform", ["z", "rx", "ry"])
    return ClosedLoopModel.load(f"urdf/{name}.yaml").task


@cache
def task(name: str) -> Task:
    """The task in generated code, with its dynamics."""
    return plain(name).compile(functions=("kinematics", "closing", "dynamics"))


def start(name: str) -> Array:
    """Coordinates near home, in no symmetric place."""
    one = plain(name)
    away = np.array([0.03, -0.02, 0.015, 0.02, -0.03, 0.025])[: one.size]
    if name == "rps":
        return np.array([0.223, 0.05, -0.03])
    return one.home + away * np.where(one.angular, 1.0, one.characteristic_length)

"""All mechanisms of urdf/ that have a task, and random poses of theirs."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, RPSPinError, RPSRobot
from rps_pin.arrays import Array
from rps_pin.task import Task

NAMES = (
    *("ankle", "cassie_leg", "delta", "delta_rods", "differential", "five_bar", "four_bar"),
    *("linear_delta", "minitaur_leg", "planar_rrr", "rotary_stewart", "rps", "rrs"),
    *("slider_crank", "stewart", "sokolov", "micro"),
)

#: Those whose generated code the tests build.
GENERATED = ("ankle", "delta", "five_bar", "rrs", "stewart", "sokolov")


#: Robots with closed forms behind the same names.
ROBOTS = ("sokolov", "micro")


@cache
def task(name: str) -> Task:
    if name in ROBOTS:
        return RPSRobot.from_preset(name).task
    return ClosedLoopModel.load(f"urdf/{name}.yaml").task


@cache
def compiled(name: str) -> Task:
    return task(name).compile()


@cache
def poses(name: str, count: int = 8) -> tuple[Array, Array]:
    """Random coordinates that can be reached, (count, m), and their configurations."""
    one, rng = task(name), np.random.default_rng(5)
    x: list[Array] = []
    q: list[Array] = []
    size = np.where(one.angular, 0.15, 0.15 * one.characteristic_length)
    size = size * (0.2 if name in ROBOTS else 1.0)  # whose limits are near
    for _ in range(10 * count):
        wanted = one.home + size * rng.uniform(-1, 1, size=one.size)
        try:
            found = one.configuration(wanted)
        except RPSPinError:
            continue
        if one.singularities(found).distance > 0.02:
            x.append(wanted)
            q.append(found)
        if len(x) == count:
            return np.array(x), np.array(q)
    raise AssertionError(f"only {len(x)} of {count} poses of {name} are reached")


#: Engines and mechanisms.
EACH = [pytest.param(task, name, id=name) for name in NAMES]
EACH += [pytest.param(compiled, name, id=f"generated {name}") for name in GENERATED]


def slope(f, x: Array, h: float = 3e-5) -> Array:
    """Derivative of f (any shape) by x (m,), to order 4; the last axis is that of x."""
    steps = h * np.eye(x.size)
    parts = [(8 * (f(x + s) - f(x - s)) - (f(x + 2 * s) - f(x - 2 * s))) / (12 * h) for s in steps]
    return np.stack(parts, axis=-1)

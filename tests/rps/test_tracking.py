"""One reading at a time against many at once, and what the guarantee rests on."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin.rps.kinematics import leg_equations as eq
from rps_pin.rps.kinematics.forward_kinematics import forward_kinematics
from rps_pin.rps.kinematics.legs import leg_angles_and_lengths, tips
from rps_pin.rps.kinematics.pose import position, rotation
from rps_pin.rps.kinematics.tracking import (
    LegDirections,
    Lengths,
    condition_of,
    follow,
    pose_of,
)

Array = NDArray[np.float64]
G, H = 0.4, 0.3


def start(pose: Array) -> tuple[Lengths, LegDirections]:
    length, angle = leg_angles_and_lengths(tips(position(pose, H), rotation(pose), H), G)
    d1, d2, d3 = length.tolist()
    c1, c2, c3, s1, s2, s3 = [*np.cos(angle).tolist(), *np.sin(angle).tolist()]
    return (d1, d2, d3), (c1, c2, c3, s1, s2, s3)


def test_ways_of_every_length_end_as_those_followed_in_arrays() -> None:
    """Steps differ, the theorem is the same: both reach the end, and the same one, or neither."""
    rng = np.random.default_rng(0)
    count = 400
    poses = rng.uniform([0.25, -1.0, -1.0], [0.8, 1.0, 1.0], (count, 3))
    begin = leg_angles_and_lengths(tips(position(poses, H), rotation(poses), H), G)[0]
    size = 10.0 ** rng.uniform(-7, -0.3, (count, 1))
    wanted = begin * (1 + size * rng.uniform(-1, 1, (count, 3)))
    expected = forward_kinematics(wanted, poses, G, H, errors="mask")
    assert 250 < expected.reached.sum() < count
    for i in range(count):
        d1, d2, d3 = wanted[i].tolist()
        found = follow(*start(poses[i]), (d1, d2, d3), G, H, 1e6, 1000)
        assert (found.fraction == 1.0) == bool(expected.reached[i])
        if found.fraction < 1.0:
            continue
        condition = float(expected.condition[i])
        rounding = 1e-14 * max(condition, 100.0)
        directions = [*np.cos(expected.angle[i]), *np.sin(expected.angle[i])]
        np.testing.assert_allclose(found.directions, directions, rtol=0, atol=rounding)
        assert found.condition == pytest.approx(condition, rel=1e-5)
        pose = pose_of((d1, d2, d3), found.directions, G, H)
        np.testing.assert_allclose(pose, expected.pose[i], rtol=0, atol=rounding)


def test_number_of_steps_is_kept() -> None:
    d, direction = start(np.array([0.4, 0.1, 0.0]))
    goal = (d[0] * 1.5, d[1] * 0.8, d[2] * 1.3)
    assert 0.0 <= follow(d, direction, goal, G, H, 1e6, 2).fraction < 1.0
    assert follow(d, direction, goal, G, H, 1e6, 1000).fraction == 1.0


def test_condition_is_that_of_the_jacobian_and_infinite_where_it_is_singular() -> None:
    d, direction = start(np.array([0.4, 0.1, -0.3]))
    angle = np.arctan2(direction[3:], direction[:3])
    expected = np.linalg.cond(eq.jacobian(d, angle, G, H), np.inf)
    assert condition_of(d, direction, G, H) == pytest.approx(float(expected), rel=1e-12)
    level, flat = start(np.zeros(3))
    assert condition_of(level, flat, G, H) == math.inf

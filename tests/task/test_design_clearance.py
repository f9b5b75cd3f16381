"""Rods that must not collide: the distance of segments, of candidates, and of a front."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import lsq_linear

from rps_pin import ClosedLoopModel
from rps_pin.arrays import Array
from rps_pin.errors import InputError, MechanismError
from rps_pin.numerics.segments import segment_distance
from rps_pin.task.design import (
    DesignSpace,
    Dimension,
    Objective,
    Region,
    Requirements,
    Rod,
    RoundPart,
    design,
    load_design,
)
from rps_pin.task.design.measures import Measuring
from tests.worst import worst

RADIUS = 0.02
LEGS = range(1, 7)
RODS = {f"leg_{k}": Rod((f"leg_{k}_cross_joint", f"ball_{k}.a"), RADIUS) for k in LEGS}
REGION = Region(
    box={"x": (-0.06, 0.06), "y": (-0.06, 0.06), "z": (0.54, 0.66)},
    round=[RoundPart(["rx", "ry", "rz"], [0, 0, 0], 0.3)],
    points=3,
)


@cache
def space() -> DesignSpace:
    task = ClosedLoopModel.load("urdf/stewart.yaml").task
    dimensions = [
        Dimension("base", 0.35, 0.7, radius=[f"leg_{k}_cross_joint" for k in LEGS]),
        Dimension("platform", 0.15, 0.4, radius=[f"ball_{k}.a" for k in LEGS]),
    ]
    return DesignSpace(task, dimensions)


def by_least_squares(a: Array, b: Array, c: Array, d: Array) -> float:
    """Return the distance of two segments as the least |a - c + s (b - a) - t (d - c)|."""
    found = lsq_linear(np.stack([b - a, c - d], axis=1), c - a, bounds=(0.0, 1.0), tol=1e-14)
    return float(np.linalg.norm(found.fun))


def test_the_distance_of_segments_is_the_least_of_their_points() -> None:
    rng = np.random.default_rng(1)
    ends = rng.normal(size=(400, 4, 3))
    ends[:100, 3] = ends[:100, 2] + (ends[:100, 1] - ends[:100, 0]) * rng.normal(size=(100, 1))
    ends[100:150, 1] = ends[100:150, 0]  # a point
    ends[150:200, :, 2] = 0.0  # in a plane: many cross
    found = segment_distance(*np.moveaxis(ends, 1, 0))
    wanted = [by_least_squares(*one) for one in ends]
    assert (np.array(wanted)[150:200] < 1e-7).any()
    assert worst(found - wanted) < 1e-7


def clearance(robot: ClosedLoopModel, points: Array) -> float:
    """Return the least clearance of the legs at platform poses, by the ends of the closures."""
    at_home = robot.model.createData()
    pin.framesForwardKinematics(robot.model, at_home, robot.home)
    base = [at_home.oMi[robot.model.getJointId(f"leg_{k}_cross_joint")].translation for k in LEGS]
    balls = []
    for closed in robot.system.equations.closed_frames:
        carrier = at_home.oMi[closed.a.joint]
        balls.append((carrier * closed.a.placement).translation)
    frame = at_home.oMf[robot.model.getFrameId(robot.task.frame)]
    balls = [frame.actInv(ball) for ball in balls]
    least = np.inf
    for x in points:
        pose = pin.SE3(pin.exp3(x[3:]), x[:3])
        top = [pose.act(ball) for ball in balls]
        for i in range(6):
            for j in range(i):
                one = by_least_squares(base[i], top[i], base[j], top[j]) - 2 * RADIUS
                least = min(least, one)
    return least


def test_the_clearance_of_candidates_is_that_of_their_robots() -> None:
    measuring = Measuring(space(), Requirements(REGION, rods=RODS))
    values = np.random.default_rng(2).uniform([0.4, 0.18], [0.6, 0.35], (3, 2))
    found = measuring(values)
    some = np.random.default_rng(3).permutation(len(measuring.points))[:8]
    few = Measuring(space(), Requirements(REGION, rods=RODS))
    few.points = np.vstack([few.points[:1], few.points[some]])
    part = few(values)
    for k, row in enumerate(values):
        assert found.unreached[k] == 0
        robot = space().robot(row)
        assert abs(part.clearance[k] - clearance(robot, few.points)) < 1e-7
        assert found.clearance[k] <= part.clearance[k]


def test_a_front_keeps_the_clearance_and_says_that_it_binds() -> None:
    asked = Requirements(REGION, rods=RODS, min_clearance=0.06)
    free = design(space(), Requirements(REGION, rods=RODS), "size", candidates=200, population=40)
    found = design(space(), asked, "size", candidates=200, population=40)
    # The smallest robot whose legs may touch has less clearance than asked for.
    assert free.measures.clearance[free.front[0]] < 0.06
    assert found.measures.clearance[found.front[0]] >= 0.06 - 1e-12
    assert "clearance" in found.sheet(found.chosen())
    assert Objective("clearance").maximised


def test_wrong_rods_are_refused() -> None:
    with pytest.raises(InputError, match="two ends"):
        Rod(("ball_1.a", "ball_1.a"))
    with pytest.raises(InputError, match="radius"):
        Rod(("ball_1.a", "ball_2.a"), -1.0)
    with pytest.raises(InputError, match="needs rods"):
        Requirements(REGION, min_clearance=0.1)
    with pytest.raises(MechanismError, match=r"no point 'ball_9\.a'"):
        Measuring(space(), Requirements(REGION, rods={"one": Rod(("ball_1.a", "ball_9.a"))}))
    with pytest.raises(InputError, match="no two rods are apart"):
        Measuring(space(), Requirements(REGION, rods={"leg_1": RODS["leg_1"]}))
    with pytest.raises(InputError, match="'clearance' needs rods"):
        design(space(), Requirements(REGION), "clearance", candidates=40, population=20)


def test_a_file_names_rods(tmp_path: Path) -> None:
    text = """robot: stewart
dimensions:
  base: {range: [0.35, 0.7], radius: [leg_1_cross_joint]}
requirements:
  region: {box: {z: [0.54, 0.66]}}
  rods:
    one: {ends: [leg_1_cross_joint, ball_1.a], radius: 0.01}
    two: {ends: [leg_2_cross_joint, ball_2.a]}
  min_clearance: 0.005
objectives: [clearance]
"""
    path = tmp_path / "design.yaml"
    path.write_text(text, encoding="utf-8")
    asked = load_design(path).requirements
    rods = {name: Rod((f"leg_{k}_cross_joint", f"ball_{k}.a"), r) for name, k, r in NAMED}
    assert (asked.rods, asked.min_clearance) == (rods, 0.005)
    path.write_text(text.replace("ball_2.a", "ball_9.a"), encoding="utf-8")
    with pytest.raises(MechanismError, match=r"line 8.*no point 'ball_9\.a'"):
        load_design(path)


NAMED = (("one", 1, 0.01), ("two", 2, 0.0))

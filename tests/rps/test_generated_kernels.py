"""Generated code of the 3-RPS against the functions that it is made from."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import RPSRobot
from rps_pin.codegen.build import Library, Source, build
from rps_pin.codegen.calls import Argument, CompiledFunction, Entry
from rps_pin.codegen.units import Unit
from rps_pin.control.estimator.leg_geometry import legs_to, platform_tips
from rps_pin.rps import Payload
from rps_pin.rps.dynamics.joint_reactions import joint_reactions
from rps_pin.rps.generated.follow import FOLLOW, follow_kernels, symbols
from rps_pin.rps.generated.forces import TERMS, terms_of
from rps_pin.rps.generated.layout import Layout
from rps_pin.rps.generated.reactions import forces_and_reactions
from rps_pin.rps.kinematics.tracking import follow
from tests import strategies
from tests.rps.test_tracking import G, H, start
from tests.worst import worst

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def followed() -> CompiledFunction:
    """The routine, in machine code."""
    unit = Unit("follow_unit", follow_kernels(), (FOLLOW,), ("follow",))
    names = ("follow_call", "follow_many")
    source = Source("test of following", names, unit.library(), vectors=True)
    library: Library = build(source, lambda _: {}, "gcc")
    entry = Entry.of(library, "follow")
    arguments = [
        [Argument(name, (size,)) for name, size in part] for part in (FOLLOW.inputs, FOLLOW.outputs)
    ]
    return CompiledFunction("follow", *arguments, entry)


def lines(count: int) -> tuple[Array, Array, Array]:
    """Return lengths, directions, and lengths to be followed to: near, far and out of reach."""
    rng = np.random.default_rng(0)
    poses = rng.uniform([0.25, -1.0, -1.0], [0.8, 1.0, 1.0], (count, 3))
    begin, direction = (np.array(part) for part in zip(*map(start, poses), strict=True))
    size = 10.0 ** rng.uniform(-7, -0.3, (count, 1))
    return begin, direction, begin * (1 + size * rng.uniform(-1, 1, (count, 3)))


def tuples(*rows: Array) -> list[Any]:
    return [tuple(row.tolist()) for row in rows]


@pytest.mark.parametrize("most", [2, 1000])
def test_following_in_c_is_that_in_python(followed: CompiledFunction, most: int) -> None:
    begin, direction, goal = lines(400)
    fixed = [np.array([G, H]), np.array([1e6]), np.array([float(most)])]
    many, went, _ = followed(begin, direction, goal, *fixed)
    reached = 0
    for i in range(len(begin)):
        expected = follow(*tuples(begin[i], direction[i], goal[i]), G, H, 1e6, most)
        one, progress, _ = followed(begin[i], direction[i], goal[i], *fixed)
        for found, part in ((one, progress), (many[i], went[i])):
            assert part[0] == pytest.approx(expected.fraction, abs=1e-9)
            rounding = 1e-15 * max(expected.condition, 100.0)
            assert worst(found - np.array(expected.directions)) < rounding
        if expected.fraction == 1.0:
            reached += 1
            assert progress[2] == pytest.approx(expected.condition, rel=1e-9)
    assert reached > 200


def test_numbers_that_are_none_are_not_followed(followed: CompiledFunction) -> None:
    begin, direction, goal = lines(16)
    for spoilt in (np.nan, np.inf, -1.0, 0.0):
        wrong = goal.copy()
        wrong[::2, 1] = spoilt
        fixed = [np.array([G, H]), np.array([1e6]), np.array([20.0])]
        found, progress, _ = followed(begin, direction, wrong, *fixed)
        right, _, _ = followed(begin, direction, goal, *fixed)
        assert not (progress[::2, 0] == 1.0).any()
        np.testing.assert_array_equal(found[1::2], right[1::2])  # its neighbours are as they were


def test_forces_and_reactions_are_those_of_arrays() -> None:
    rng = np.random.default_rng(2)
    numbers, motion = symbols("n", TERMS.size), symbols("m", 9)
    terms = terms_of(TERMS.split(numbers))
    geometry = legs_to(platform_tips(motion[:3], numbers[1]), numbers[0])
    (_, x, y), length, _, direction, tilt = geometry
    forces, reactions = forces_and_reactions(
        *(terms, (x, y, tilt), length, direction, motion[3:6], motion[6:])
    )
    function = ca.Function(
        "f", [ca.vertcat(*numbers), ca.vertcat(*motion)], [ca.vertcat(*forces, *reactions)]
    )
    for k in range(6):
        p = strategies.random_parameters(rng, tilted_gravity=True, heavy_rods=bool(k % 2))
        p = p.without_limits()
        if k % 3:
            p = p.replace(prismatic_friction=3.0, prismatic_damping=1.0, revolute_damping=0.3)
        load = Payload(2.0, [0.1, -0.05, 0.2], np.diag([0.02, 0.03, 0.04])) if k % 2 else None
        robot = RPSRobot(p, load)
        values = TERMS.join({name: getattr(robot.force_terms, name) for name in TERMS.sizes})
        for _ in range(10):
            pose = np.array([1.2 * p.base_radius, *rng.uniform(-0.5, 0.5, 2)])
            rate, acceleration = rng.normal(size=(2, 3))
            found = np.array(function(values, [*pose, *rate, *acceleration])).ravel()
            expected = joint_reactions(robot, pose, rate, acceleration)
            both = np.concatenate([expected.actuator, expected.spherical.ravel()])
            assert worst(found - both) < 1e-10 * np.abs(both).max()


def test_layouts_join_what_they_split() -> None:
    layout = Layout({"one": 1, "three": 3, "two": 2})
    numbers = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    groups = layout.split(numbers)
    assert groups == {"one": 1.0, "three": (2.0, 3.0, 4.0), "two": (5.0, 6.0)}
    assert layout.join(groups) == numbers
    with pytest.raises(ValueError, match="differ"):
        layout.join({"one": 1.0})
    with pytest.raises(ValueError, match="two has 3 numbers; it must have 2"):
        layout.join(groups | {"two": (1.0, 2.0, 3.0)})

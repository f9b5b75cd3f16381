"""Polytopes of forces and speeds: against linear programs, corners and random samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from rps_pin import InputError, SingularityError
from rps_pin.task import polytope
from tests.task.robots import poses, task
from tests.worst import worst

SIZES = [(1, 1), (2, 2), (3, 3), (6, 6), (2, 1), (3, 2), (4, 2), (5, 3), (8, 6)]


def support(K, lower, upper, direction, *, speeds: bool) -> float:
    """The largest direction . x of the set, by a linear program."""
    if speeds:
        bounds = np.concatenate([upper, -lower])
        found = linprog(-direction, A_ub=np.vstack([K, -K]), b_ub=bounds, bounds=(None, None))
    else:
        found = linprog(-K @ direction, bounds=np.column_stack([lower, upper]))
    assert found.success
    return -found.fun


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("speeds", [False, True], ids=["forces", "speeds"])
def test_facets_and_corners_are_those_of_linear_programs(size, speeds) -> None:
    rng = np.random.default_rng(sum(size))
    K = rng.normal(size=size)
    lower, upper = -rng.uniform(0.5, 2, size[0]), rng.uniform(0.5, 2, size[0])
    units = rng.uniform(0.2, 3, size[1])
    found = (polytope.of_speeds if speeds else polytope.of_forces)(K, lower, upper, units)
    for direction in rng.normal(size=(10, size[1])):
        wanted = support(K, lower, upper, direction, speeds=speeds)
        assert worst((found.vertices @ direction).max() - wanted) < 1e-9 * wanted
    for normal, offset in zip(found.normals, found.offsets, strict=True):
        wanted = support(K, lower, upper, normal, speeds=speeds)
        assert wanted < offset + 1e-9  # of speeds, a slab may not touch
    assert all(found.contains(corner) for corner in found.vertices)
    assert not any(found.contains(1.01 * corner) for corner in found.vertices)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("speeds", [False, True], ids=["forces", "speeds"])
def test_the_inscribed_ball_is_inside_and_touches(size, speeds) -> None:
    rng = np.random.default_rng(10 + sum(size))
    K, units = rng.normal(size=size), rng.uniform(0.2, 3, size[1])
    lower, upper = -rng.uniform(0.5, 2, size[0]), rng.uniform(0.5, 2, size[0])
    found = (polytope.of_speeds if speeds else polytope.of_forces)(K, lower, upper, units)
    ball = found.inscribed_ball()
    assert ball.radius >= found.ball().radius > 0
    for direction in rng.normal(size=(30, size[1])):
        step = direction / np.linalg.norm(direction) * units
        assert found.contains(ball.center + 0.9999 * ball.radius * step)
    touching = found.normals * units  # of unit length
    reached = [found.contains(ball.center + 1.001 * ball.radius * n * units) for n in touching]
    assert not all(reached)


def test_units_make_moments_forces_by_the_characteristic_length() -> None:
    one, (_, q) = task("stewart"), poses("stewart")
    limits = -100.0 * np.ones(6), 100.0 * np.ones(6)
    found = one.force_polytope(q[0], limits)
    length, radius = one.characteristic_length, found.ball().radius
    rng = np.random.default_rng(0)
    for direction in rng.normal(size=(50, 6)):
        f = 0.999 * radius * direction / np.linalg.norm(direction)
        f[3:] *= length
        assert worst(one.forces_to_actuators(q[0], f)) <= 100.0
    directions = found.normals / np.linalg.norm(found.normals * found.units, axis=1)[:, None]
    at = (directions * found.units**2)[int(np.argmin(found.offsets))] * radius * 1.001
    assert worst(one.forces_to_actuators(q[0], at)) > 100.0


def test_what_actuators_exert_already_is_taken_off() -> None:
    one, (_, q) = task("delta"), poses("delta")
    limits, used = (-10.0 * np.ones(3), 10.0 * np.ones(3)), np.array([9.0, 0.0, 0.0])
    more = one.forces_to_task(q[0], np.array([2.0, 0.0, 0.0]))
    assert one.force_polytope(q[0], limits).contains(more)
    assert not one.force_polytope(q[0], limits, used=used).contains(more)


def test_speeds_of_the_actuators_bound_those_of_the_task() -> None:
    one, (_, q) = task("delta"), poses("delta")
    found = one.speed_polytope(q[0], (-2.0 * np.ones(3), 3.0 * np.ones(3)))
    a = np.array([found.vertices @ row for row in one.jacobian(q[0])]).T
    at_limit = np.isclose(a, -2.0) | np.isclose(a, 3.0)
    assert at_limit.all()
    assert len(found.vertices) == 8


def test_actuators_without_limits_and_flat_polytopes_are_refused() -> None:
    one, (_, q) = task("delta"), poses("delta")
    with pytest.raises(InputError, match="'arm_1_joint' has no force limit"):
        one.force_polytope(q[0], (np.full(3, -np.inf), np.full(3, np.inf)))
    with pytest.raises(InputError, match="the least must be below the largest"):
        one.force_polytope(q[0], (np.ones(3), np.ones(3)))
    with pytest.raises(InputError, match="the least must be negative"):
        one.speed_polytope(q[0], (np.ones(3), 2 * np.ones(3)))
    with pytest.raises(SingularityError, match="do not determine the task"):
        polytope.of_forces(np.ones((2, 2)), -np.ones(2), np.ones(2), np.ones(2))

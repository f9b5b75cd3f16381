"""The rows of closures against joints of the same kinds, and central differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import LoopClosure
from rps_pin.closed_loop.constraints.closures import KINDS
from rps_pin.closed_loop.constraints.rows import ParallelRows, across, rows_of
from tests.closed_loop.random_mechanisms import (
    allowed_placement,
    joint_of,
    moved,
    random_closure,
    random_placement,
    slopes,
    unit,
)

Array = NDArray[np.float64]

SEEDS = range(8)
#: How many ways to move the joint of a kind leaves open: 6 less the rows it must have.
FREEDOM = {
    "spherical": 3,
    "rigid": 0,
    "revolute": 1,
    "prismatic": 1,
    "cylindrical": 2,
    "universal": 2,
    "planar": 3,
    "point_on_line": 4,
    "point_on_plane": 5,
    "distance": 5,
}
every_kind = pytest.mark.parametrize("kind", KINDS)
every_seed = pytest.mark.parametrize("seed", SEEDS)


def drawn(kind: str, seed: int) -> tuple[LoopClosure, np.random.Generator]:
    rng = np.random.default_rng(seed)
    return random_closure(rng, kind, "x"), rng


def displaced(placement: pin.SE3, twist: Array) -> pin.SE3:
    """M moved by a twist in a's axes at a's origin: exp(twist) M."""
    return pin.exp6(np.asarray(twist, dtype=float)) * placement


def joint_twists(closure: LoopClosure, rng: np.random.Generator) -> tuple[pin.SE3, Array]:
    """A placement of the joint's, and the twists it can move with there, (6, nv)."""
    model, end = joint_of(closure)
    data = model.createData()
    q = moved(rng, model, 0.7)
    pin.forwardKinematics(model, data, q)
    last = model.njoints - 1
    if model.nv == 0:
        return end, np.zeros((6, 0))
    pin.computeJointJacobians(model, data, q)
    twists = pin.getJointJacobian(model, data, last, pin.ReferenceFrame.WORLD)
    return data.oMi[last] * end, np.array(twists).reshape(6, model.nv)


@every_kind
@every_seed
def test_gaps_vanish_wherever_the_joint_goes(kind: str, seed: int) -> None:
    closure, rng = drawn(kind, seed)
    rows = rows_of(closure)
    for _ in range(10):
        gap = rows.gap(allowed_placement(closure, rng))
        assert gap.shape == (closure.size,) == (6 - FREEDOM[kind],)
        np.testing.assert_allclose(gap, 0, rtol=0, atol=2e-15)


@every_kind
@every_seed
def test_no_other_placement_is_closed(kind: str, seed: int) -> None:
    """Away from the joint's motions by a twist across them, near and far, some gap is open."""
    closure, rng = drawn(kind, seed)
    rows = rows_of(closure)
    placement, twists = joint_twists(closure, rng)
    left, values, _ = np.linalg.svd(twists, full_matrices=True)
    out = left[:, int(np.count_nonzero(values > 1e-9)) :]
    assert out.shape[1] == closure.size
    for size in (1e-6, 1e-3, 0.1):
        gap = rows.gap(displaced(placement, size * out @ unit_vector(rng, out.shape[1])))
        assert np.linalg.norm(gap) > 0.05 * size
    assert np.linalg.norm(rows.gap(random_placement(rng))) > 1e-3


def unit_vector(rng: np.random.Generator, size: int) -> Array:
    vector = rng.normal(size=size)
    return np.asarray(vector / np.linalg.norm(vector))


@every_kind
@every_seed
def test_wrenches_do_no_work_in_the_joint_and_stop_all_else(kind: str, seed: int) -> None:
    closure, rng = drawn(kind, seed)
    placement, twists = joint_twists(closure, rng)
    wrenches = rows_of(closure).wrenches(placement)
    np.testing.assert_allclose(wrenches @ twists, 0, rtol=0, atol=3e-15)
    assert wrenches.shape == (closure.size, 6)
    assert np.linalg.matrix_rank(wrenches, tol=1e-3) == closure.size
    assert np.linalg.matrix_rank(twists, tol=1e-3) == 6 - closure.size


@every_kind
@every_seed
def test_wrenches_are_the_gap_s_slope_where_it_is_closed(kind: str, seed: int) -> None:
    """The gap's rate is w . X, X the twist of a relative to b: less that of b relative to a."""
    closure, rng = drawn(kind, seed)
    rows = rows_of(closure)
    placement = allowed_placement(closure, rng)
    slope = slopes(lambda step: rows.gap(displaced(placement, step)), 6)
    np.testing.assert_allclose(rows.wrenches(placement), -slope, rtol=0, atol=1e-10)


@pytest.mark.parametrize("kind", ["spherical", "point_on_line", "point_on_plane", "distance"])
@every_seed
def test_rows_of_points_are_the_gap_s_slope_everywhere(kind: str, seed: int) -> None:
    closure, rng = drawn(kind, seed)
    rows = rows_of(closure)
    placement = random_placement(rng)
    slope = slopes(lambda step: rows.gap(displaced(placement, step)), 6, h=1e-4)
    np.testing.assert_allclose(rows.wrenches(placement), -slope, rtol=0, atol=1e-8)


@every_kind
@every_seed
def test_slopes_are_those_of_the_wrenches(kind: str, seed: int) -> None:
    """Anywhere, closed or open."""
    closure, rng = drawn(kind, seed)
    rows = rows_of(closure)
    placement = random_placement(rng)
    expected = slopes(lambda step: rows.wrenches(displaced(placement, step)), 6, h=1e-4)
    found = rows.slope(placement)
    assert found.shape == (closure.size, 6, 6)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * max(1, np.abs(found).max()))


@every_kind
@every_seed
def test_slope_rates_are_those_of_the_slopes(kind: str, seed: int) -> None:
    """Along eta, the twist held; so D is that of W along any motion, not only from rest."""
    closure, rng = drawn(kind, seed)
    rows = rows_of(closure)
    placement, twist = random_placement(rng), rng.normal(size=6)
    expected = slopes(lambda step: rows.slope(displaced(placement, step)) @ twist, 6, h=1e-4)
    found = rows.slope_rate(placement, twist)
    assert found.shape == (closure.size, 6, 6)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * max(1, np.abs(found).max()))


@every_kind
def test_forces_come_before_moments_and_moments_are_angular(kind: str) -> None:
    closure, rng = drawn(kind, 0)
    rows = rows_of(closure)
    wrenches = rows.wrenches(allowed_placement(closure, rng))
    pushing = np.linalg.norm(wrenches[:, :3], axis=1) > 1e-9
    np.testing.assert_array_equal(rows.angular, ~pushing)
    assert (np.diff(rows.angular.astype(int)) >= 0).all()


# Directions ---------------------------------------------------------------------------------------


@every_seed
def test_parallel_directions_must_point_the_same_way(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_a, n_b = unit(rng), unit(rng)
    rows = ParallelRows(n_a, n_b)
    onto = pin.Quaternion.FromTwoVectors(n_b, n_a).matrix()
    there = pin.SE3(onto, rng.normal(size=3))
    np.testing.assert_allclose(rows.gap(there), 0, rtol=0, atol=1e-15)
    for angle in (1e-9, 1e-3, 1.0, 3.1):  # about any axis across, the gap is the angle
        way = unit_vector(rng, 2) @ across(n_a)
        turned = pin.SE3(pin.exp3(angle * way) @ onto, np.zeros(3))
        gap = rows.gap(turned)
        assert np.linalg.norm(gap) == pytest.approx(angle, rel=1e-6)
        np.testing.assert_allclose(gap @ across(n_a), -angle * way, rtol=0, atol=1e-12)


def test_opposite_directions_are_half_a_turn_open() -> None:
    """Also where rounding errors decide about which axis the half turn is."""
    rows = ParallelRows(np.array([0.0, 0, 1]), np.array([0.0, 0, -1]))
    assert np.linalg.norm(rows.gap(pin.SE3.Identity())) == pytest.approx(np.pi, rel=1e-15)
    rng = np.random.default_rng(0)
    for _ in range(500):
        axis = unit(rng)
        half_turn = pin.exp3(np.pi * across(axis)[0]) @ pin.exp3(rng.normal() * axis)
        gap = ParallelRows(axis, axis).gap(pin.SE3(half_turn, np.zeros(3)))
        assert np.linalg.norm(gap) == pytest.approx(np.pi, rel=1e-9)


@every_seed
def test_directions_across_make_a_right_handed_frame(seed: int) -> None:
    axis = unit(np.random.default_rng(seed))
    frame = np.vstack([across(axis), axis])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), rtol=0, atol=1e-15)
    assert np.linalg.det(frame) == pytest.approx(1, rel=1e-14)


@pytest.mark.parametrize("index", range(3))
def test_directions_across_a_coordinate_axis_are_the_next_two(index: int) -> None:
    axes = np.roll(np.eye(3), -index, axis=0)
    np.testing.assert_array_equal(across(axes[0]), axes[1:])


def test_rods_of_no_length_still_pull_somewhere() -> None:
    """Both ends at one place: the direction is any, and finite."""
    rows = rows_of(LoopClosure("a", "b", "distance", distance=0.5))
    here = pin.SE3.Identity()
    assert rows.gap(here) == pytest.approx([0.5], rel=1e-15)
    assert np.linalg.norm(rows.wrenches(here)) == pytest.approx(1, rel=1e-15)
    assert np.isfinite(rows.slope(here)).all()

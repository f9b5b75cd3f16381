"""The workspace on leg lengths and on poses: the two agree, and with inverse kinematics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rps_pin import RPSParameters, RPSRobot
from rps_pin.arrays import Array
from rps_pin.errors import InputError, SingularityError, UnreachableError
from rps_pin.rps.kinematics.legs import cone_angles, leg_motion
from rps_pin.rps.kinematics.rates import leg_jacobians
from rps_pin.rps.workspace import Reason, Workspace, leg_grid, pose_grid, workspace
from rps_pin.rps.workspace.evaluate import evaluate
from rps_pin.rps.workspace.measures import measures
from tests.strategies import random_motions, random_parameters

NAMES = {
    "length": ("SHORT", "LONG"),
    "angle": ("ANGLE",) * 2,
    "spherical joint": ("SPHERICAL",) * 2,
}


@pytest.fixture(scope="module")
def micro() -> RPSParameters:
    return RPSParameters.from_preset("micro")


@pytest.fixture(scope="module")
def narrow(micro: RPSParameters) -> RPSParameters:
    """Every kind of limit cuts something off."""
    return micro.replace(base_radius=0.15, leg_angle_limits=(1.25, 1.6), spherical_cone_limit=0.32)


@pytest.fixture(scope="module")
def by_lengths(micro: RPSParameters) -> Workspace:
    return workspace(micro, leg_grid(micro, 21))


# The Jacobian and its measures --------------------------------------------------------------------


def scaled_jacobian(p: RPSParameters, pose: Array) -> Array:
    """d(length)/d(z, h tilt_x, h tilt_y), shape (..., 3 legs, 3)."""
    h = p.platform_radius
    return leg_jacobians(p, pose).length_jacobian / [1.0, h, h]


@pytest.mark.parametrize("rest_angle", [0.0, 0.2])
def test_fields_are_those_of_the_kinematics_and_of_linear_algebra(rest_angle: float) -> None:
    rng = np.random.default_rng(1)
    p = random_parameters(rng).replace(spherical_cone_limit=0.6, spherical_rest_angle=rest_angle)
    pose, _, _ = random_motions(rng, p, 300, largest_tilt=3.0)
    pose[0, 1:], pose[1, 1:] = 0.0, [0.0, 1e-9]
    found = evaluate(p, pose.reshape(20, 15, 3), 1.0)
    legs = leg_motion(pose, 0 * pose, 0 * pose, p.platform_radius, p.base_radius)
    place, rotation = RPSRobot(p).platform_placement(pose)
    K = scaled_jacobian(p, pose)
    for field, expected, tolerance in (
        (found.length, legs.length, (1e-14, 0)),
        (found.angle, legs.angle, (0, 1e-13)),
        (found.position, place, (0, 1e-13)),
        (found.determinant, np.linalg.det(K), (0, 1e-13)),
    ):
        rtol, atol = tolerance
        assert np.allclose(field.reshape(expected.shape), expected, rtol=rtol, atol=atol)
    conditioning = 1 / np.linalg.cond(K)  # in closed form, equal singular values lose digits
    assert np.allclose(found.conditioning.ravel(), conditioning, rtol=1e-6, atol=1e-8)
    cone = cone_angles(legs.angle, rotation, rest_angle)
    beyond = (found.reason.reshape(-1, 1) >> np.array([9, 10, 11])) & 1
    assert np.array_equal(beyond, cone > 0.6)
    assert 0 < beyond.sum() < beyond.size


def test_the_measures_are_those_of_linear_algebra() -> None:
    K = np.random.default_rng(2).normal(size=(500, 3, 3))
    K[0] = np.eye(3)
    K[1, 2] = K[1, 0] + 1e-9 * K[1, 1]  # all but singular
    found = measures(np.moveaxis(K, 0, -1))
    assert np.allclose(found.determinant, np.linalg.det(K), rtol=0, atol=1e-13)
    assert np.allclose(found.conditioning, 1 / np.linalg.cond(K), rtol=1e-6)
    assert np.allclose(found.conditioning, 1 / np.linalg.cond(K), rtol=0, atol=1e-8)
    largest = np.linalg.norm(np.linalg.inv(K), axis=-2).max(axis=-1)
    assert np.allclose(found.transmission, 1 / largest, rtol=1e-6)


def test_a_singular_jacobian_measures_zero_and_not_nan() -> None:
    K = np.stack([np.zeros((3, 3)), np.ones((3, 3)), np.diag([1.0, 1.0, 0.0])])
    found = measures(np.moveaxis(K, 0, -1))
    for values in found:
        assert np.allclose(values, 0.0, rtol=0, atol=1e-12)


def test_no_unit_load_asks_more_force_than_the_transmission_says(by_lengths: Workspace) -> None:
    p = by_lengths.parameters
    rng = np.random.default_rng(3)
    load = rng.normal(size=(4000, 3))
    load /= np.linalg.norm(load, axis=1, keepdims=True)
    for index in [(0, 0, 20), (10, 10, 10), (3, 17, 8)]:
        K = scaled_jacobian(p, by_lengths.pose[index])
        force = np.linalg.solve(K.T, load.T)
        bound = 1 / by_lengths.transmission[index]
        assert 0.98 * bound < np.abs(force).max() <= bound * (1 + 1e-12)


# Leg lengths --------------------------------------------------------------------------------------


def test_inverse_kinematics_of_each_point_gives_its_lengths() -> None:
    rng = np.random.default_rng(4)
    for _ in range(6):
        p = random_parameters(rng).replace()
        d = p.base_radius * rng.uniform(1.2, 2.0)
        limits = (0.93 * d, 1.07 * d)
        p = p.replace(leg_length_limits=limits)
        space = workspace(p, leg_grid(p, 19))  # finer than the coarse map
        found = ~space.mask(Reason.UNREACHABLE)
        assert found.mean() > 0.5
        legs = RPSRobot(p).inverse_kinematics(space.pose[found], errors="mask")
        asked = space.grid.points()[found]
        assert np.allclose(legs.length, asked, rtol=0, atol=1e-10 * d)
        assert np.allclose(space.angle[found], legs.angle, rtol=0, atol=1e-12)


def test_the_mode_continues_the_start_pose(micro: RPSParameters) -> None:
    """A walk over the grid from its middle, by tiny steps of its own, ends at the same poses."""
    p = micro.replace(base_radius=0.18)
    space = workspace(p, leg_grid(p, 19))
    position = space.position
    for axis in range(3):
        assert np.abs(np.diff(position, axis=axis)).max() < 3e-3  # no jump between neighbours
    assert (space.pose[..., 0] > 0).all()
    below = workspace(p, leg_grid(p, 19), start=[-0.2, 0.0, 0.0])
    assert np.allclose(below.pose, space.pose * [-1, -1, -1], rtol=0, atol=1e-12)


def test_the_mode_is_the_one_a_straight_walk_reaches() -> None:
    """An independent walk: 600 steps dpose = K^-1 dlength, corrected; far beyond singularities."""
    p = RPSParameters.from_preset("micro").replace(base_radius=0.2)
    h = p.platform_radius
    space = workspace(p, leg_grid(p, 6, limits=(0.09, 0.5)), start=[0.2, 0.0, 0.0])
    goal = space.grid.points().reshape(-1, 3)
    pose = np.tile(space.start, (len(goal), 1))
    begin = leg_jacobians(p, pose)
    side = np.linalg.det(begin.length_jacobian)
    clear = np.ones(len(goal), dtype=bool)
    for step in np.linspace(0, 1, 601)[1:]:
        target = begin.length + step * (goal - begin.length)
        for _ in range(2):
            legs = leg_jacobians(p, pose)
            safe = np.where(clear[:, None, None], scaled_jacobian(p, pose), np.eye(3))
            move = np.linalg.solve(safe, (target - legs.length)[..., None])[..., 0]
            pose = np.where(clear[:, None], pose + move / [1, h, h], pose)
        K = scaled_jacobian(p, pose)
        with np.errstate(divide="ignore"):
            clear &= (np.linalg.det(K) * side > 0) & (1 / np.linalg.cond(K) > 0.01)
        clear &= np.abs(pose[:, 1:]).max(axis=-1) < 3
    found = ~space.mask(Reason.UNREACHABLE).ravel()
    assert 0.1 < clear.mean() < 0.9
    assert (clear & ~found).sum() == 0
    apart = np.abs(space.pose.reshape(-1, 3)[clear] - pose[clear]).max(axis=-1)
    assert apart.max() < 1e-6  # the walk corrects itself twice a step only
    assert (found & ~clear).mean() < 0.03  # closer to a singularity than the walk goes


def test_a_third_of_a_turn_and_the_mirror_map_the_workspace_onto_itself(
    by_lengths: Workspace,
) -> None:
    turn = 2 * math.pi / 3
    R = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    # Leg k's lengths go to leg k + 1: what was at (d1, d2, d3) is turned at (d3, d1, d2).
    position = by_lengths.position
    turned = position.transpose(1, 2, 0, 3)
    assert np.allclose(turned[..., :2], position[..., :2] @ R.T, rtol=0, atol=1e-12)
    assert np.allclose(turned[..., 2], position[..., 2], rtol=0, atol=1e-12)
    tilts = by_lengths.pose.transpose(1, 2, 0, 3)[..., 1:]
    assert np.allclose(tilts, by_lengths.pose[..., 1:] @ R.T, rtol=0, atol=1e-12)
    # The mirror in leg 1's plane swaps legs 2 and 3; the tilt about x, a pseudovector's, changes.
    mirrored = position.transpose(0, 2, 1, 3)
    assert np.allclose(mirrored, position * [1, -1, 1], rtol=0, atol=1e-12)
    for field in (by_lengths.conditioning, by_lengths.transmission):
        assert np.allclose(field, field.transpose(1, 2, 0), rtol=1e-9)
        assert np.allclose(field, field.transpose(0, 2, 1), rtol=1e-9)


@given(st.floats(0.1, 20.0))
@settings(max_examples=15)
def test_the_workspace_scales_with_the_robot(scale: float) -> None:
    p = RPSParameters.from_preset("micro")
    shortest, longest = p.leg_length_limits
    q = p.replace(
        base_radius=scale * p.base_radius,
        platform_radius=scale * p.platform_radius,
        leg_length_limits=(scale * shortest, scale * longest),
    )
    small, large = workspace(p, leg_grid(p, 3)), workspace(q, leg_grid(q, 3))
    assert np.allclose(large.position, scale * small.position, rtol=0, atol=1e-10 * scale)
    assert np.allclose(large.conditioning, small.conditioning, rtol=1e-9)


def test_lengths_that_cannot_close_are_unreachable_and_hold_no_nan(micro: RPSParameters) -> None:
    space = workspace(micro, leg_grid(micro, 9, limits=(0.02, 1.2)))
    lost = space.mask(Reason.UNREACHABLE)
    assert lost[0, 0, -1]  # no platform of 0.12 m spans legs of 0.02 and 1.2 m
    assert 0 < lost.mean() < 1
    for field in space.fields:
        assert np.isfinite(field).all()
    assert (space.pose[lost] == 0).all()
    found = ~lost
    asked = space.grid.points()[found]
    assert np.allclose(space.length[found], asked, rtol=0, atol=1e-9)
    beyond = (asked < 0.2 - 1e-9) | (asked > 0.25 + 1e-9)
    bits = [Reason.LEG_1_SHORT | Reason.LEG_1_LONG, Reason.LEG_2_SHORT | Reason.LEG_2_LONG]
    for leg, reasons in enumerate(bits):
        assert np.array_equal(space.mask(reasons)[found], beyond[:, leg])


# Poses --------------------------------------------------------------------------------------------


def test_reasons_are_the_violations_of_inverse_kinematics(narrow: RPSParameters) -> None:
    robot = RPSRobot(narrow)
    space = workspace(robot, pose_grid(np.linspace(0.19, 0.26, 8), np.linspace(-0.5, 0.52, 9)))
    seen = Reason.INSIDE
    for index in np.ndindex(space.grid.shape):
        expected = Reason.INSIDE
        try:
            robot.inverse_kinematics(space.pose[index])
        except UnreachableError as error:
            for broken in error.violations:
                below, above = NAMES[broken.quantity]
                name = below if broken.value < broken.lower else above
                expected |= Reason[f"LEG_{broken.leg}_{name}"]
        found = Reason(int(space.reason[index]))
        assert found & ~Reason.SINGULAR == expected
        seen |= found
    every_leg = [f"LEG_{leg}_{name}" for leg in (1, 2, 3) for name in ("SHORT", "LONG", "ANGLE")]
    assert all(Reason[name] in seen for name in every_leg)
    assert Reason.LEG_1_SPHERICAL in seen


def test_inside_on_lengths_is_inside_on_poses_and_back(narrow: RPSParameters) -> None:
    robot = RPSRobot(narrow)
    by_lengths = workspace(narrow, leg_grid(narrow, 13))
    assert 0.05 < by_lengths.inside.mean() < 0.95
    reach = robot.inverse_kinematics(by_lengths.pose, errors="mask").reachable
    edge = np.abs(by_lengths.length - [0.2]) < 1e-9, np.abs(by_lengths.length - [0.25]) < 1e-9
    clear = ~(edge[0] | edge[1]).any(axis=-1)  # on the limit itself rounding decides
    assert np.array_equal(reach[clear], by_lengths.inside[clear])

    poses = workspace(narrow, pose_grid(np.linspace(0.19, 0.26, 15), np.linspace(-0.3, 0.3, 15)))
    inside = poses.inside
    assert inside.sum() > 50
    # Direct kinematics of each inside pose's lengths, one triple at a time, is that pose.
    for pose, length in list(zip(poses.pose[inside], poses.length[inside], strict=True))[::7]:
        grid = leg_grid(narrow, 2)._replace(axes=tuple(np.array([d]) for d in length))
        single = workspace(narrow, grid, start=[0.22, 0.0, 0.0])
        assert single.inside.all()
        assert np.allclose(single.pose[0, 0, 0], pose, rtol=0, atol=1e-10)


def test_beyond_a_singularity_is_singular(micro: RPSParameters) -> None:
    free = micro.replace(
        base_radius=0.24,
        leg_length_limits=(0.0, math.inf),
        leg_angle_limits=(-math.pi, math.pi),
        spherical_cone_limit=math.pi,
    )
    # Level: K's rows are (sin phi, -+ sin phi e), singular in the base plane and nowhere else.
    space = workspace(
        free, pose_grid([-0.1, 0.0, 0.1], [0.0]), start=[0.1, 0.0, 0.0], min_conditioning=1e-6
    )
    assert space.inside[:, 0, 0].tolist() == [False, False, True]
    assert (space.reason[:2] == Reason.SINGULAR).all()
    assert space.conditioning[1, 0, 0] == 0.0
    expected = space.pose[2, 0, 0, 0] / math.hypot(0.1, 0.12)  # sin phi, (1, sqrt 1/2) below
    K = scaled_jacobian(free, space.pose[2, 0, 0])
    assert np.allclose(K[:, 0], expected)


def test_a_slice_is_the_nearest_plane(micro: RPSParameters, by_lengths: Workspace) -> None:
    part = by_lengths.plane(0, 0.2124)
    assert part.grid.shape == (1, 21, 21)
    assert part.grid.axes[0][0] == by_lengths.grid.axes[0][5]
    assert np.array_equal(part.position[0], by_lengths.position[5])
    with pytest.raises(InputError, match=r"0\.2 to 0\.25"):
        by_lengths.plane(0, 0.3)
    with pytest.raises(InputError, match="axis"):
        by_lengths.plane(3, 0.2)


def test_stroke_used_goes_from_nought_to_one(by_lengths: Workspace) -> None:
    used = by_lengths.stroke_used()
    assert np.allclose(used[:, 3, 4, 0], np.linspace(0, 1, 21), rtol=0, atol=1e-9)
    with pytest.raises(InputError, match="no upper end"):
        free = by_lengths.parameters.replace(leg_length_limits=(0.0, math.inf))
        workspace(free, pose_grid([0.2], [0.0])).stroke_used()


def test_counts_add_up(by_lengths: Workspace) -> None:
    counts = by_lengths.counts()
    assert counts[Reason.INSIDE] == by_lengths.inside.sum() == 21**3
    assert set(counts) == {Reason.INSIDE, *Reason}


# Bad input ----------------------------------------------------------------------------------------


def test_bad_grids_are_refused_with_numbers(micro: RPSParameters) -> None:
    free = micro.replace(leg_length_limits=(0.0, math.inf))
    for bad, message in [
        (lambda: leg_grid(micro, 0), "at least 2"),
        (lambda: leg_grid(micro, (5, 5)), "three"),
        (lambda: leg_grid(micro, 2.5), "whole number"),  # type: ignore[arg-type]
        (lambda: leg_grid(micro, step=0.0), "positive"),
        (lambda: leg_grid(micro, step=math.nan), "positive"),
        (lambda: leg_grid(free), "inf m make no grid"),
        (lambda: leg_grid(micro, limits=(0.25, 0.2)), "in order"),
        (lambda: pose_grid([], [0.0]), "at least 1"),
        (lambda: pose_grid([0.2, 0.2], [0.0]), "increase"),
        (lambda: pose_grid([0.2, math.nan], [0.0]), "finite"),
        (lambda: pose_grid("high", [0.0]), "numbers"),
        (lambda: workspace(micro, "grid"), "leg_grid"),  # type: ignore[arg-type]
        (lambda: workspace("micro"), "RPSRobot|robot"),  # type: ignore[arg-type]
        (lambda: workspace(micro, start=[0.2, 0.0]), r"\(2,\)|3"),
        (lambda: workspace(micro, start=[[0.2, 0.0, 0.0]]), r"\(3,\)"),
        (lambda: workspace(micro, leg_grid(micro, 400)), "workspace_to_file"),
        (lambda: workspace(micro, min_conditioning=2.0), "from 0 to 1"),
    ]:
        with pytest.raises(InputError, match=message):
            bad()


def test_steps_of_a_millimetre_are_51_lengths(micro: RPSParameters) -> None:
    grid = leg_grid(micro, step=1e-3)
    assert grid.shape == (51, 51, 51)
    assert np.allclose(np.diff(grid.axes[0]), 1e-3, rtol=1e-9)
    assert leg_grid(micro, step=0.015).shape == (5, 5, 5)  # shrunk to 12.5 mm


def test_no_level_start_and_singular_start_are_refused(micro: RPSParameters) -> None:
    wide = micro.replace(base_radius=0.5)
    with pytest.raises(UnreachableError, match=r"0\.38"):
        workspace(wide, leg_grid(wide, 3))
    with pytest.raises(SingularityError):
        workspace(micro.replace(base_radius=0.3), leg_grid(micro, 3), start=[0.0, 0.0, 0.0])


def test_progress_wraps_the_blocks(micro: RPSParameters) -> None:
    seen: list[int] = []

    def progress(blocks: object) -> object:
        for i in blocks:  # type: ignore[attr-defined]
            seen.append(i)
            yield i

    workspace(micro, leg_grid(micro, 40), progress=progress)  # type: ignore[arg-type]
    assert seen == list(range(len(leg_grid(micro, 40).blocks(16_384))))
    assert len(seen) > 1

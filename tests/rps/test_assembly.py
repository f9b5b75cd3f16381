"""All assembly modes: against a dense search that shares nothing with the elimination; by axioms.

Run this file as a script to check many more random robots: ``python -m tests.rps.test_assembly``.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.optimize import brentq

from rps_pin import InputError
from rps_pin.rps.kinematics import assembly_modes as assembly
from rps_pin.rps.kinematics import leg_equations as eq
from rps_pin.rps.kinematics.assembly_modes import assembly_modes
from rps_pin.rps.kinematics.legs import leg_angles_and_lengths, tips
from rps_pin.rps.kinematics.pose import position, rotation
from tests.strategies import LEG_ANGLES
from tests.worst import worst

Array = NDArray[np.float64]

RADIAL = np.stack([np.cos(LEG_ANGLES), np.sin(LEG_ANGLES), np.zeros(3)], axis=-1)
TANGENT = np.array([0.0, 0.0, 1.0])


# The independent search: Newton's method in the three angles, on tips as points in space ----------


def tip_points(length: Array, angle: Array, g: float) -> tuple[Array, Array]:
    """Tips (n, 3 legs, 3) of legs of one length triple, and their derivatives by the angles."""
    cosine, sine = length * np.cos(angle), length * np.sin(angle)
    point = (g - cosine)[..., None] * RADIAL + sine[..., None] * TANGENT
    slope = sine[..., None] * RADIAL + cosine[..., None] * TANGENT
    return point, slope


def search(length: Array, g: float, h: float, starts: Array) -> Array:
    """Solutions (k, 3) that Newton's method finds from many starts (n, 3)."""
    following = [1, 2, 0]
    angle, going = starts.copy(), np.arange(len(starts))
    for _ in range(40):
        point, slope = tip_points(length, angle[going], g)
        edge = point - point[:, following]
        left = np.einsum("nij,nij->ni", edge, edge) - 3 * h * h
        a = 2 * np.einsum("nij,nij->ni", edge, slope)
        b = -2 * np.einsum("nij,nij->ni", edge, slope[:, following])
        jacobian = np.zeros((len(going), 3, 3))
        for i, j in enumerate(following):
            jacobian[:, i, i], jacobian[:, i, j] = a[:, i], b[:, i]
        jacobian += 1e-14 * h * h * np.eye(3)
        step = np.linalg.solve(jacobian, left[..., None])[..., 0]
        angle[going] -= np.clip(step, -0.5, 0.5)
        going = going[np.abs(step).max(axis=-1) > 1e-12]
        if not len(going):
            break
    point, _ = tip_points(length, angle, g)
    gap = np.linalg.norm(point - point[:, following], axis=-1) - np.sqrt(3) * h
    angle = angle[np.abs(gap).max(axis=-1) < 1e-12]
    found: list[Array] = []
    while len(angle):
        found.append(angle[0])
        angle = angle[chord(angle, angle[0]) > 1e-6]
    return np.array(found).reshape(-1, 3)


def chord(a: Array, b: Array) -> Array:
    """Largest distance of leg directions, (...), of angles (..., 3)."""
    return np.asarray(2 * np.abs(np.sin((a - b) / 2)).max(axis=-1))


class Counts(NamedTuple):
    """What a comparison with the search found."""

    triples: int
    solutions: int
    missed_by_search: int
    near_double: int
    largest_residual: float


def random_case(rng: np.random.Generator) -> tuple[Array, float, float]:
    """A robot and leg lengths: half of them of a pose, half with nothing known."""
    g = rng.uniform(0.2, 0.8)
    h = g * rng.uniform(0.3, 1.5)
    if rng.random() < 0.5:
        pose = np.append(rng.uniform(-2, 2) * g, rng.uniform(-2.2, 2.2, 2))
        tip = tips(position(pose, h), rotation(pose), h)
        return leg_angles_and_lengths(tip, g)[0], g, h
    return rng.uniform(0.1, 2.5, 3) * g, g, h


def long_legs(rng: np.random.Generator) -> tuple[Array, float, float]:
    """The same with legs of 2 to 60 times the radii, which closed are all but parallel."""
    g = rng.uniform(0.2, 0.8)
    h = g * rng.uniform(0.3, 1.5)
    far = (g + h) * 10 ** rng.uniform(0.3, 1.8)
    if rng.random() < 0.5:
        return inverse(np.append(far, rng.uniform(-1.2, 1.2, 2)), g, h)[0], g, h
    return far + rng.uniform(-0.5, 0.5, 3) * h, g, h


def check(
    count: int,
    seed: int = 0,
    starts: int = 400,
    case_of: Callable[[np.random.Generator], tuple[Array, float, float]] = random_case,
    *,
    progress: bool = False,
) -> Counts:
    """Compare all modes with the search's on random robots; fails where one is missing.

    A solution the search found must be among the modes. A mode the search did not find is proved by
    its residual and by its distance from the others. Where solutions (nearly) coincide, and only
    there, the search may have found one twice or a point between two: those must be flagged.
    """
    rng = np.random.default_rng(seed)
    solutions = missed = near_double = 0
    residuals: list[Array] = []
    for case in range(count):
        length, g, h = case_of(rng)
        modes = assembly_modes(length, g, h)
        k = len(modes.angle)
        solutions += k
        residuals.append(modes.residual)
        for i in range(k):
            others = np.delete(modes.angle, i, axis=0)
            assert (chord(others, modes.angle[i]) > 1e-8).all(), (case, "listed twice", i)
        # A tip is within 2 h of the axis, or it is too far from the other legs' planes.
        within = (g + rng.uniform(-2 * h, 2 * h, (starts, 3))) / length
        start = np.arccos(np.clip(within, -1, 1)) * rng.choice([-1, 1], (starts, 3))
        start[: starts // 2] = rng.uniform(-np.pi, np.pi, (starts // 2, 3))
        start[:, 0] = np.abs(start[:, 0])  # the other half is mirrored
        seen = np.zeros(k, dtype=bool)
        for angle in search(length, g, h, start):
            for image in (angle, -angle):
                assert k, (case, "search found a solution, the elimination none", angle)
                apart = chord(modes.angle, image)
                near = int(np.argmin(apart))
                if apart[near] > 1e-8:
                    det = abs(float(eq.determinant(length, image, g, h)))
                    assert apart[near] < 1e-4, (case, "missing", image, det)
                    assert modes.double[near], (case, "not flagged", image, det)
                    near_double += 1
                seen[near] = True
        missed += int((~seen).sum())
        if progress and (case + 1) % 500 == 0:
            print(case + 1, solutions, missed, near_double, worst(*residuals), flush=True)
    return Counts(count, solutions, missed, near_double, worst(*residuals))


def test_modes_are_those_of_a_dense_search_on_random_robots() -> None:
    counts = check(40)
    assert counts.solutions > 130
    assert counts.largest_residual < 1e-12
    assert counts.missed_by_search <= 0.01 * counts.solutions  # or the search proves little


def test_so_are_those_of_legs_much_longer_than_the_radii() -> None:
    counts = check(30, starts=800, case_of=long_legs)
    assert counts.solutions > 150
    assert counts.missed_by_search <= 0.01 * counts.solutions


@pytest.mark.parametrize("far", [3.0, 10.0, 30.0, 95.0])
def test_long_legs_of_a_pose_have_that_pose(far: float) -> None:
    g, h = 0.12, 0.12
    rng = np.random.default_rng(3)
    pose = np.column_stack([np.full(300, far * (g + h)), rng.uniform(-1.2, 1.2, (300, 2))])
    modes = assembly_modes(inverse(pose, g, h)[0], g, h)
    apart = np.abs(modes.pose - pose[:, None]).max(axis=-1)
    assert (np.nanmin(apart, axis=1) < 1e-9 * far).all()


def test_legs_too_long_to_tell_are_refused() -> None:
    with pytest.raises(InputError, match=r"a leg is 223 m long; .* up to 24 m"):
        assembly_modes([[0.2, 0.2, 0.2], [0.2, 223.0, 0.2]], 0.12, 0.12)


# Axioms -------------------------------------------------------------------------------------------


def inverse(pose: Array, g: float, h: float) -> tuple[Array, Array]:
    return leg_angles_and_lengths(tips(position(pose, h), rotation(pose), h), g)


def test_eliminant_has_degree_eight() -> None:
    x = np.cos(np.pi * (np.arange(14) + 0.5) / 14)
    values = assembly.eliminant(np.array([0.21, 0.23, 0.25]), x, 0.12, 0.13)
    series = np.linalg.solve(chebyshev.chebvander(x, 13), values / np.abs(values).max())
    assert np.abs(series[9:]).max() < 1e-14
    assert abs(series[8]) > 1e-5


def test_equal_legs_of_figure_2_give_eight() -> None:
    modes = assembly_modes([0.22] * 3, 0.12, 0.12)
    assert len(modes.angle) == 8
    assert modes.above.tolist() == [True] * 4 + [False] * 4
    assert modes.mirror.tolist() == [7, 6, 5, 4, 3, 2, 1, 0]
    assert modes.has_pose.all()
    assert not modes.double.any()
    assert modes.exists.all()
    np.testing.assert_allclose(modes.pose[0], [0.22, 0, 0], rtol=0, atol=1e-15)


def test_inverse_kinematics_of_every_mode_gives_the_lengths() -> None:
    """Poses by their inverse kinematics, the half turns by their tips."""
    rng = np.random.default_rng(1)
    g, h = 0.5, 0.45
    length = rng.uniform(0.3, 1.0, (400, 3))
    modes = assembly_modes(length, g, h)
    wanted = np.broadcast_to(length[:, None], modes.angle.shape)
    found, angle = inverse(modes.pose[modes.has_pose], g, h)
    np.testing.assert_allclose(found, wanted[modes.has_pose], rtol=0, atol=2e-12)
    tip = tips(modes.position[modes.exists], modes.rotation[modes.exists], h)
    found, angle = leg_angles_and_lengths(tip, g)
    np.testing.assert_allclose(found, wanted[modes.exists], rtol=0, atol=1e-13)
    assert chord(angle, modes.angle[modes.exists]).max() < 1e-12
    assert (modes.exists & ~modes.has_pose).any()
    assert modes.residual[modes.exists].max() < 1e-12
    unit = modes.rotation @ np.swapaxes(modes.rotation, -1, -2)
    np.testing.assert_allclose(unit[modes.exists] - np.eye(3), 0, atol=1e-13)


def test_mirrored_partners_are_mirrored_and_sides_told() -> None:
    rng = np.random.default_rng(2)
    modes = assembly_modes(rng.uniform(0.3, 1.0, (300, 3)), 0.5, 0.45)
    for i in range(300):
        there = modes.exists[i]
        mirror = modes.mirror[i][there]
        np.testing.assert_array_equal(mirror[mirror], np.arange(there.sum()))
        np.testing.assert_array_equal(modes.angle[i][mirror], -modes.angle[i][there])
        height = modes.position[i, there, 2]
        np.testing.assert_array_equal(modes.above[i][there], height > 0)
        assert (np.diff(height) <= 1e-15).all()
    assert (modes.mirror[~modes.exists] == -1).all()


def test_turning_by_120_degrees_renames_the_legs() -> None:
    rng = np.random.default_rng(3)
    length = rng.uniform(0.3, 1.0, (300, 3))
    modes = assembly_modes(length, 0.5, 0.45)
    turned = assembly_modes(length[:, [2, 0, 1]], 0.5, 0.45)
    np.testing.assert_array_equal(modes.exists, turned.exists)
    apart = chord(modes.angle[..., [2, 0, 1]], turned.angle)[modes.exists]
    assert apart.max() < 1e-9


@pytest.mark.parametrize("scale", [1e-4, 30.0])
def test_scaling_all_lengths_scales_the_answer(scale: float) -> None:
    rng = np.random.default_rng(4)
    length = rng.uniform(0.3, 1.0, (300, 3))
    modes = assembly_modes(length, 0.5, 0.45)
    scaled = assembly_modes(scale * length, scale * 0.5, scale * 0.45)
    np.testing.assert_array_equal(modes.exists, scaled.exists)
    assert chord(modes.angle, scaled.angle)[modes.exists].max() < 1e-9


def test_batch_is_the_single_ones() -> None:
    rng = np.random.default_rng(5)
    length = rng.uniform(0.3, 1.0, (4, 5, 3))
    modes = assembly_modes(length, 0.5, 0.45)
    assert modes.rotation.shape == (4, 5, 16, 3, 3)
    for where in np.ndindex(4, 5):
        alone = assembly_modes(length[where], 0.5, 0.45)
        k = int(modes.exists[where].sum())
        for whole, single in zip(modes, alone, strict=True):
            np.testing.assert_allclose(whole[where][:k], single, rtol=0, atol=1e-11, equal_nan=True)
    assert assembly_modes(np.empty((0, 3)), 0.5, 0.45).angle.shape == (0, 16, 3)


# Degenerate cases ---------------------------------------------------------------------------------


def test_lengths_that_cannot_close_have_no_modes() -> None:
    modes = assembly_modes([0.01, 0.01, 3.0], 0.4, 0.3)
    assert modes.angle.shape == (0, 3)
    assert modes.rotation.shape == (0, 3, 3)


def test_flat_robot_is_found_once_and_flagged() -> None:
    """At the least lengths the platform lies in the base plane."""
    modes = assembly_modes([0.1] * 3, 0.4, 0.3)
    flat = np.abs(np.sin(modes.angle)).max(axis=-1) < 1e-9
    assert flat.sum() == 1
    assert modes.double[flat].all()
    assert modes.mirror[flat] == np.flatnonzero(flat)


@pytest.mark.parametrize("apart", [0.0, 1e-15, 1e-10, 1e-8, 1e-4])
def test_fold_has_two_solutions_on_one_side_none_on_the_other(apart: float) -> None:
    """Poses of a tilting platform that pass a singularity, and lengths beside those there."""
    g, h = 0.5, 0.4
    low, high = np.array([0.45, 0.0, 0.1]), np.array([0.45, 0.0, 1.6])

    def det(part: float) -> float:
        length, angle = inverse(low + part * (high - low), g, h)
        return float(eq.determinant(length, angle, g, h))

    part = float(brentq(det, 0.0, 1.0, xtol=1e-16))
    length, angle = inverse(low + part * (high - low), g, h)
    close = max(1e-5, 30 * math.sqrt(apart))
    counts = []
    for side in (1, -1):
        modes = assembly_modes(length + np.array([side * apart, 0, 0]), g, h)
        near = chord(modes.angle, angle) < close
        counts.append(int(near.sum()))
        if apart <= 1e-15:
            assert modes.double[near].all()
        else:
            assert not modes.double[near].any()
    assert sorted(counts) == ([1, 1] if apart <= 1e-15 else [0, 2])


def test_leg_as_long_as_three_base_radii_hides_nothing() -> None:
    """There leg 1's own elimination degenerates; this one was found by the search."""
    length = [1.842812418321, 0.771197637594, 0.708769325565]
    modes = assembly_modes(length, 0.6340444808593534, 0.7391470094624452)
    assert len(modes.angle) == 8


@pytest.mark.parametrize(
    ("length", "message"),
    [([1.0, 2.0], "shape"), ([1.0, math.nan, 1.0], "finite"), ([0.0, 1.0, 1.0], "leg 1 is 0 m")],
)
def test_bad_input_is_named(length: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        assembly_modes(length, 1.0, 1.0)


if __name__ == "__main__":
    print(check(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000, progress=True))

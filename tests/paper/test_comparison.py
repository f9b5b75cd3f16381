"""Distances, labels, and what paths meet, against axioms and other root finders."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from rps_pin import RPSRobot
from rps_pin.paper.comparison import (
    OUT_OF_REACH,
    SINGULAR,
    closest_labels,
    compare,
    dense_times,
    distance,
    force_range,
    path_result,
    relabelled,
)
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.force_parts import combined
from rps_pin.paper.interpretations import PathInterpretation
from rps_pin.paper.paper_data import THIS_STUDY, ForceRange
from rps_pin.paper.paper_helix import PaperHelix

numbers = st.lists(st.floats(-1e4, 1e4), min_size=6, max_size=6)


def ranges(six: list[float]) -> ForceRange:
    return ForceRange((six[0], six[1], six[2]), (six[3], six[4], six[5]))


@given(numbers, numbers)
def test_distance_is_a_metric_in_units_of_the_printed_numbers(
    one: list[float], two: list[float]
) -> None:
    size = float(np.linalg.norm([-305, 6, -382, 438, 78, 369]))
    a, b, table = np.array(one), np.array(two), THIS_STUDY.numbers()
    assert distance(ranges(one)) >= 0
    assert distance(ranges(one)) == pytest.approx(np.linalg.norm(a - table) / size)
    apart = float(np.linalg.norm(a - b)) / size
    assert abs(distance(ranges(one)) - distance(ranges(two))) <= apart + 1e-9


def test_distance_is_zero_for_agreement_and_one_for_no_forces() -> None:
    assert distance(THIS_STUDY) == 0
    assert distance(ranges([0.0] * 6)) == 1


@given(numbers)
def test_labels_only_rename(six: list[float]) -> None:
    given_ = ranges([*np.minimum(six[:3], six[3:]), *np.maximum(six[:3], six[3:])])
    legs = sorted(zip(*given_, strict=True))
    flipped = sorted((-high, -low) for low, high in legs)
    all_of_them = list(relabelled(given_))
    assert len({labels for labels, _ in all_of_them}) == 12
    for labels, renamed in all_of_them:
        assert sorted(zip(*renamed, strict=True)) == (legs if labels.sign == 1 else flipped)
    best = closest_labels(given_)
    assert best[2] == min(distance(renamed) for _, renamed in all_of_them)
    assert best[2] <= distance(given_)


def test_a_renamed_table_is_recognised() -> None:
    for order in itertools.permutations(range(3)):
        least = [0.0] * 3
        greatest = [0.0] * 3
        for table_leg, ours in enumerate(order):
            least[ours], greatest[ours] = (
                THIS_STUDY.least[table_leg],
                THIS_STUDY.greatest[table_leg],
            )
        labels, renamed, gap = closest_labels(ranges([*least, *greatest]))
        assert (labels.order, labels.sign, gap) == (order, 1, 0)
        assert renamed == THIS_STUDY


def test_table_2_s_legs_are_the_path_turned_by_a_third_of_a_turn() -> None:
    """Our legs 3, 1, 2 on branch - are legs 1, 2, 3 on a branch + that begins at phi = 120°."""
    robot = RPSRobot.from_preset("sokolov")
    pose = PaperHelix(0.23, 0.075, 0.05, 0.4, branch="-").sample(np.linspace(0, 5, 30)).pose
    phi = 2 * np.pi * (pose[:, 0] - 0.4) / 0.05
    beta = 2 * np.arcsin(np.sqrt(0.075 / 0.23))
    alpha = np.pi / 2 - (phi + 2 * np.pi / 3) / 2
    turned = np.stack([pose[:, 0], -beta * np.sin(alpha), beta * np.cos(alpha)], axis=1)
    ours, theirs = robot.inverse_kinematics(pose).length, robot.inverse_kinematics(turned).length
    assert_allclose(theirs, ours[:, [2, 0, 1]], atol=1e-12)


def test_dense_times_are_ordered_within_the_path_and_dense_near_the_peak() -> None:
    times = dense_times(5.0, 1.234, 11)
    assert (times[0], times[-1]) == (0, 5)
    assert (np.diff(times) > 0).all()
    assert 1.234 in times
    assert np.sort(np.abs(times - 1.234))[1] < 1e-6
    assert (dense_times(5.0, 0.0, 3) >= 0).all()
    for jump in (0.5 - 0.4, 4.7388 - 0.4):  # of the acceleration, in a path that begins at 0.4 s
        assert np.abs(dense_times(5.0, 3.0, 3, start=0.4) - jump).min() < 1e-4


# Crossings ----------------------------------------------------------------------------------------


def determinant(robot: RPSRobot, pose: np.ndarray) -> float:
    """Return det d(length)/d(pose) by central differences: its zeros are type II singularities."""
    step = 1e-6
    columns = []
    for i in range(3):
        move = np.zeros(3)
        move[i] = step
        up, down = (robot.inverse_kinematics(pose + s * move).length for s in (1, -1))
        columns.append((up - down) / (2 * step))
    return float(np.linalg.det(np.array(columns)))


@pytest.mark.parametrize(
    ("height", "helix_unit", "branch", "count"),
    [("mm", "mm", "+", 4), ("mm", "mm", "-", 2), ("m", "dm", "+", 2)],
)
def test_crossings_are_zeros_of_the_determinant(
    height: str, helix_unit: str, branch: str, count: int
) -> None:
    meant = PathInterpretation(height, helix_unit, "radii", branch, "corrected", "corrected")  # type: ignore[arg-type]
    result = path_result(meant, 100)
    assert result.refused == SINGULAR
    assert result.parts is None
    assert result.nearest == 0
    robot, path = RPSRobot.from_preset("sokolov"), meant.path()

    def at(t: float) -> float:
        return determinant(robot, path.sample(t).pose)

    times = np.linspace(0, path.duration, 400)
    signs = np.sign([at(t) for t in times])
    found = [brentq(at, times[i], times[i + 1]) for i in np.flatnonzero(np.diff(signs))]
    assert len(found) == count
    assert_allclose(result.crossings, found, atol=1e-5)


def test_what_is_out_of_reach_is_refused() -> None:
    result = path_result(PathInterpretation("m", "m", "radii", "+", "corrected", "corrected"), 100)
    assert result.refused == OUT_OF_REACH
    assert result.parts is None


def test_ranges_do_not_depend_on_the_sampling(found: Reproduction) -> None:
    for result in found.paths:
        if result.parts is None:
            continue
        finer = path_result(result.interpretation, 2000)
        assert finer.parts is not None
        for coarse, fine in zip(result.parts, finer.parts, strict=True):
            one, other = force_range(coarse).numbers(), force_range(fine).numbers()
            assert_allclose(one, other, atol=0.01 * np.abs(other).max() + 1e-12)


def test_comparisons_are_sorted_and_their_forces_can_be_had(found: Reproduction) -> None:
    rows = compare(found.paths)
    regular = [result for result in found.paths if not result.refused]
    assert len(rows) == 24 * len(regular)
    assert (np.diff([row.distance for row in rows]) >= -1e-9).all()
    for row in rows[::40]:
        result = next(one for one in regular if one.interpretation == row.path)
        assert result.parts is not None
        force = combined(result.parts, row.body)
        assert force.shape == (result.times.size, 3)
        assert force_range(force) == row.forces
        assert row.distance == distance(row.forces)
        assert row.distance_relabelled == distance(row.relabelled)

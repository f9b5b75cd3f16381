"""Paths against singularities and limits: known times, independent searches, bad input."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from rps_pin import InputError, RPSParameters, RPSRobot, helix
from rps_pin.rps.kinematics.legs import cone_angles
from rps_pin.rps.singularity.path_check import PathCheck, check_path
from rps_pin.trajectories.path import PathSample, Trajectory
from tests.strategies import random_parameters

Array = NDArray[np.float64]

TOLERANCE = 1e-9
#: Half a bracket, and rounding.
IN_TIME = 0.5e-9 + 1e-12


class Functions:
    """A trajectory made of functions of time and their derivatives."""

    def __init__(
        self, duration: float, *parts: tuple[Callable[[Array], Array], Callable[[Array], Array]]
    ) -> None:
        self.duration = duration
        self.parts = parts

    def sample(self, t: ArrayLike) -> PathSample:
        times = np.asarray(t, dtype=float)
        pose, rate = (
            np.stack([part[k](times) + 0 * times for part in self.parts], axis=-1) for k in (0, 1)
        )
        return PathSample(pose, rate, np.full_like(pose, np.nan))  # accelerations are not used


def polynomial_path(duration: float, *parts: Polynomial) -> Functions:
    return Functions(duration, *((p, p.deriv()) for p in parts))


def constant(value: float) -> Polynomial:
    return Polynomial([value])


def climb(duration: float, height: Polynomial) -> Functions:
    """A level platform; the robot is flat, and singular, where the height is zero."""
    return polynomial_path(duration, height, constant(0.0), constant(0.0))


def with_roots(*roots: float, factor: float = 0.1) -> Polynomial:
    return factor * Polynomial.fromroots(roots)


def sokolov(**changes: object) -> RPSRobot:
    return RPSRobot(RPSParameters.from_preset("sokolov").replace(**changes))


def kinds(check: PathCheck) -> list[tuple[str, str]]:
    return [(event.kind, event.singularity) for event in check.singularities]


# An independent detection: the sign of det d(length)/d(pose), by differences ----------------------


def determinant(robot: RPSRobot, pose: Array) -> Array:
    """Of fourth-order differences of inverse kinematics, shape (...)."""
    columns = []
    for step in 1e-3 * np.diag([robot.parameters.platform_radius, 1.0, 1.0]):
        one, two, back, far = (
            robot.inverse_kinematics(pose + k * step, errors="mask").length for k in (1, 2, -1, -2)
        )
        columns.append((8 * (one - back) - two + far) / (12 * step.max()))
    return np.linalg.det(np.stack(columns, axis=-1))


def crossings(robot: RPSRobot, path: Trajectory, count: int = 4001) -> list[float]:
    times = np.linspace(0, path.duration, count)
    negative = determinant(robot, path.sample(times).pose) < 0

    def at(time: float) -> float:
        return float(determinant(robot, path.sample(np.array([time])).pose)[0])

    return [
        brentq(at, times[k], times[k + 1], xtol=1e-14)
        for k in np.flatnonzero(negative[1:] != negative[:-1])
    ]


# The paper's helix --------------------------------------------------------------------------------

LARGE = {"radius": 75e-3, "pitch": 50e-3, "height": 0.4}
FLAT = {"radius": 0.75e-3, "pitch": 0.5e-3, "height": 0.4e-3}
DEFAULT = {"radius": 0.75e-3, "pitch": 0.5e-3, "height": 0.4}


@pytest.mark.parametrize(
    ("size", "branch", "expected"),
    [
        (LARGE, "+", [4.075203070, 4.335903148]),
        (LARGE, "-", []),
        (FLAT, "+", [0.129273954, 1.806142922, 3.439873317, 5.045736445]),
        (DEFAULT, "+", []),
        (DEFAULT, "-", []),
    ],
)
def test_readings_of_table_1(size: dict[str, float], branch: str, expected: list[float]) -> None:
    robot = sokolov()
    path = helix(robot, **size, branch=branch)  # type: ignore[arg-type]
    check = check_path(robot, path)
    found = [event.time for event in check.singularities]
    assert kinds(check) == [("crosses", "type II")] * len(expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found, crossings(robot, path), rtol=0, atol=5e-9)
    assert check.ok == (not expected)
    for event in check.singularities:
        assert 0 < event.width <= TOLERANCE
        assert abs(event.distance) < 1e-9
        np.testing.assert_array_equal(event.pose, path.sample(np.array([event.time])).pose[0])
        before, after = (
            determinant(robot, path.sample(np.array([event.time + d])).pose)[0]
            for d in (-1e-6, 1e-6)
        )
        assert before * after < 0


def test_other_branch_s_nearest_approach() -> None:
    """The issue's path does not meet a singularity there; how near it comes, on a dense grid."""
    robot = sokolov()
    check = check_path(robot, helix(robot, **LARGE, branch="-"))
    assert check.minimum_singularity == "type II"
    assert check.minimum_distance == pytest.approx(0.0041189, abs=1e-7)
    assert check.minimum_time == pytest.approx(2.6259, abs=1e-3)
    grazing = check_path(robot, helix(robot, **LARGE, branch="-"), threshold=5e-3)
    assert set(kinds(grazing)) == {("grazes", "type II")}
    assert min(abs(e.distance) for e in grazing.singularities) == check.minimum_distance


@pytest.mark.parametrize("seed", range(8))
def test_random_paths_cross_where_an_independent_search_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = RPSRobot(random_parameters(rng))
    g = robot.parameters.base_radius
    a, w, s = rng.uniform(0.3, 1.0, 3), rng.uniform(2, 6, 3), rng.uniform(0, 6, 3)
    size, middle = a * [0.4 * g, 1.1, 1.1], [g, 0.0, 0.0]

    def part(i: int) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
        return (
            lambda t: middle[i] + size[i] * np.sin(w[i] * t + s[i]),
            lambda t: w[i] * size[i] * np.cos(w[i] * t + s[i]),
        )

    path = Functions(4.0, part(0), part(1), part(2))
    check = check_path(robot, path)
    found = [e.time for e in check.singularities if e.kind == "crosses"]
    np.testing.assert_allclose(found, crossings(robot, path), rtol=0, atol=2e-8)


# Times known beforehand ---------------------------------------------------------------------------


@pytest.mark.parametrize("roots", [[0.3], [0.25, 0.5, 0.75], [1 / 3, 0.9], [0.7, 0.7 + 2e-3]])
def test_crossings_are_found_when_they_happen(roots: list[float]) -> None:
    check = check_path(sokolov(), climb(1.0, with_roots(*roots)))
    assert kinds(check) == [("crosses", "type II")] * len(roots)
    found = [event.time for event in check.singularities]
    np.testing.assert_allclose(found, roots, rtol=0, atol=IN_TIME)


@pytest.mark.parametrize("apart", [1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("middle", [0.4567, 0.5])
def test_two_crossings_within_one_step_are_told_apart(apart: float, middle: float) -> None:
    roots = [middle - apart / 2, middle + apart / 2]
    check = check_path(sokolov(), climb(1.0, with_roots(*roots, factor=10.0)), least_steps=50)
    assert kinds(check) == [("crosses", "type II")] * 2
    found = [event.time for event in check.singularities]
    np.testing.assert_allclose(found, roots, rtol=0, atol=IN_TIME)


@pytest.mark.parametrize("when", [0.4567, 0.5, 1 / 3])
def test_touching_is_one_graze(when: float) -> None:
    check = check_path(sokolov(), climb(1.0, with_roots(when, when)))
    assert kinds(check) == [("grazes", "type II")]
    (event,) = check.singularities
    assert event.time == pytest.approx(when, abs=2e-9)
    assert abs(event.distance) < 1e-15
    assert check.minimum_distance < 1e-15


def test_touching_stays_one_graze_in_spite_of_rounding() -> None:
    """The expanded polynomial leaves 1e-17 m of either sign where it should be zero."""
    roots = [0.15, 0.35, 0.55, 0.85]
    check = check_path(sokolov(), climb(1.0, with_roots(*roots, *roots)))
    assert kinds(check) == [("grazes", "type II")] * 4
    found = [event.time for event in check.singularities]
    np.testing.assert_allclose(found, roots, rtol=0, atol=2e-9)


def test_jump_across_a_singularity_is_a_crossing() -> None:
    path = Functions(
        1.0,
        (lambda t: np.where(t < 0.4567, 0.3, -0.3), lambda t: 0 * t),
        (constant(0.0), constant(0.0)),
        (constant(0.0), constant(0.0)),
    )
    (event,) = check_path(sokolov(), path).singularities
    assert event.kind == "crosses"
    assert event.time == pytest.approx(0.4567, abs=IN_TIME)


@pytest.mark.parametrize("above", [1e-4, 1e-7, 1e-12])
def test_near_misses_are_grazes_below_the_threshold(above: float) -> None:
    robot = sokolov()
    path = climb(1.0, with_roots(0.4567, 0.4567) + above)
    (event,) = check_path(robot, path).singularities
    assert event.kind == "grazes"
    assert event.time == pytest.approx(0.4567, abs=IN_TIME)
    assert event.width <= TOLERANCE
    higher = check_path(robot, path, threshold=abs(event.distance) / 2)
    assert higher.ok
    assert higher.minimum_distance == abs(event.distance)
    assert higher.minimum_time == event.time


def test_crossing_at_a_sample_is_one_crossing() -> None:
    check = check_path(sokolov(), climb(1.0, Polynomial([-0.05, 0.1])), least_steps=10)
    assert kinds(check) == [("crosses", "type II")]
    assert check.singularities[0].time == pytest.approx(0.5, abs=IN_TIME)


def test_half_a_turn_is_a_constraint_singularity() -> None:
    path = polynomial_path(4.0, constant(0.4), Polynomial([0.0, 0.8]), Polynomial([0.0, 0.6]))
    check = check_path(sokolov(), path)
    (event,) = (e for e in check.singularities if e.singularity == "constraint")
    assert event.kind == "crosses"
    assert event.time == pytest.approx(math.pi, abs=IN_TIME)


def test_passing_a_leg_without_length_is_type_i_and_nothing_else() -> None:
    """g = h, level: all three legs vanish at once, and the determinant's sign jumps."""
    robot = sokolov(platform_radius=0.46)
    for when in (0.5, 0.4567):
        check = check_path(robot, climb(1.0, Polynomial([-when, 1.0]) * 0.1))
        assert kinds(check) == [("grazes", "type I")] * 3
        assert [event.leg for event in check.singularities] == [1, 2, 3]
        for event in check.singularities:
            assert event.time == pytest.approx(when, abs=1e-8)


def test_short_leg_is_a_graze() -> None:
    robot = sokolov(platform_radius=0.46)
    path = climb(1.0, with_roots(0.4567, 0.4567) + 1e-4)
    check = check_path(robot, path)
    assert {("grazes", "type I")} == set(kinds(check))
    assert check.singularities[0].distance == pytest.approx(1e-4 / 0.46, rel=1e-9)


def test_standing_in_a_singularity_is_a_stay() -> None:
    check = check_path(sokolov(), climb(2.0, constant(0.0)))
    (event,) = check.singularities
    assert (event.kind, event.time, event.width) == ("stays", 0.0, 2.0)
    assert "stays in a type II singularity for 2 s" in str(check)


def test_standing_near_a_singularity_is_one_graze() -> None:
    check = check_path(sokolov(), climb(2.0, constant(1e-6)))
    assert kinds(check) == [("grazes", "type II")]


def test_beginning_and_ending_in_a_singularity_are_grazes() -> None:
    check = check_path(sokolov(), climb(1.0, Polynomial([0.0, 0.1])))
    assert [(e.kind, e.time) for e in check.singularities] == [("grazes", 0.0)]
    check = check_path(sokolov(), climb(1.0, Polynomial([0.1, -0.1])))
    assert [(e.kind, e.time) for e in check.singularities] == [("grazes", 1.0)]


def test_speeds_may_jump() -> None:
    path = Functions(
        1.0,
        (lambda t: 0.1 * np.abs(t - 0.4567) - 0.01, lambda t: 0.1 * np.sign(t - 0.4567)),
        (constant(0.0), constant(0.0)),
        (constant(0.0), constant(0.0)),
    )
    check = check_path(sokolov(), path)
    found = [event.time for event in check.singularities]
    np.testing.assert_allclose(found, [0.3567, 0.5567], rtol=0, atol=IN_TIME)


def test_fast_parts_are_sampled_more_densely() -> None:
    """A whole swing through the singularity and back in 1e-3 of the duration."""
    swing = Functions(
        10.0,
        (
            lambda t: 0.3 - 0.4 * np.exp(-(((t - 5.0) / 0.01) ** 2)),
            lambda t: 0.8e4 * (t - 5.0) * np.exp(-(((t - 5.0) / 0.01) ** 2)),
        ),
        (constant(0.0), constant(0.0)),
        (constant(0.0), constant(0.0)),
    )
    check = check_path(sokolov(), swing)
    width = 0.01 * math.sqrt(math.log(4 / 3))
    found = [event.time for event in check.singularities]
    np.testing.assert_allclose(found, [5 - width, 5 + width], rtol=0, atol=IN_TIME)
    assert check.samples > 1001


# Limits -------------------------------------------------------------------------------------------


def limit_times(
    path: Trajectory, room: Callable[[Array], Array], count: int = 2001
) -> list[tuple[float, int, bool]]:
    """When each leg's room changes sign, by brentq: time, leg, whether it leaves."""
    times = np.linspace(0, path.duration, count)
    signs = room(path.sample(times).pose) < 0
    found = []
    for leg in range(3):
        for k in np.flatnonzero(signs[1:, leg] != signs[:-1, leg]):
            when = brentq(
                lambda t, leg=leg: room(path.sample(np.array([t])).pose)[0, leg],
                times[k],
                times[k + 1],
                xtol=1e-14,
            )
            found.append((when, leg + 1, bool(signs[k + 1, leg])))
    return sorted(found)


REST = 0.3
LIMITS = {
    ("length", "lower"): {"leg_length_limits": (0.42, math.inf)},
    ("length", "upper"): {"leg_length_limits": (0.0, 0.47)},
    ("angle", "lower"): {"leg_angle_limits": (1.0, math.pi)},
    ("angle", "upper"): {"leg_angle_limits": (-math.pi, 1.1)},
    ("spherical joint", "upper"): {"spherical_cone_limit": 1.1},
    ("spherical joint", "rest"): {"spherical_cone_limit": 0.8, "spherical_rest_angle": REST},
}


@pytest.mark.parametrize("which", LIMITS)
def test_limits_are_left_and_entered_when_they_are(which: tuple[str, str]) -> None:
    quantity, side = which
    robot = sokolov(**LIMITS[which])
    path = helix(robot, radius=20e-3, pitch=30e-3, height=0.4)
    parameters = robot.parameters

    def room(pose: Array) -> Array:
        legs = robot.inverse_kinematics(pose, errors="mask")
        if quantity == "spherical joint":
            turn = robot.platform_placement(pose)[1]
            rest = parameters.spherical_rest_angle
            return parameters.spherical_cone_limit - cone_angles(legs.angle, turn, rest)
        value = getattr(legs, quantity)
        lower, upper = getattr(parameters, f"leg_{quantity}_limits")
        return value - lower if side == "lower" else upper - value

    check = check_path(robot, path)
    expected = limit_times(path, room)
    moving = [event for event in check.limits if event.kind != "starts outside"]
    assert len(expected) > 1
    assert len(moving) == len(expected)
    for event, (when, leg, leaves) in zip(moving, expected, strict=True):
        assert event.time == pytest.approx(when, abs=2e-9)
        assert event.width <= TOLERANCE
        assert (event.leg, event.kind) == (leg, "leaves" if leaves else "returns")
        assert (event.quantity, event.side) == (quantity, side.replace("rest", "upper"))
    outside = np.flatnonzero(room(path.sample(np.zeros(1)).pose)[0] < 0) + 1
    starts = [event.leg for event in check.limits if event.kind == "starts outside"]
    np.testing.assert_array_equal(starts, outside)
    assert not check.singularities


def test_a_short_trip_beyond_a_limit_is_found() -> None:
    """Level platform: d^2 = (g - h)^2 + z^2. Beyond for 2e-3 s within one step of 0.02 s."""
    robot = sokolov(leg_length_limits=(0.0, math.hypot(0.23, 0.4)))
    path = climb(1.0, 0.4 - with_roots(0.4557, 0.4577, factor=0.5))
    check = check_path(robot, path, least_steps=50)
    assert [event.kind for event in check.limits] == ["leaves"] * 3 + ["returns"] * 3
    found = [event.time for event in check.limits]
    # The limit is kept to 1e-12 m of rounding, which is 1.2e-9 s of so flat a path.
    np.testing.assert_allclose(found, [0.4557] * 3 + [0.4577] * 3, rtol=0, atol=2e-9)


def test_touching_a_limit_is_within_it() -> None:
    robot = sokolov(leg_length_limits=(0.0, math.hypot(0.23, 0.4)))
    assert check_path(robot, climb(1.0, 0.4 - with_roots(0.4567, 0.4567))).ok


# What is said, and what is refused ----------------------------------------------------------------


def test_summary_reads_well() -> None:
    robot = sokolov(leg_length_limits=(0.2, 0.5))
    check = check_path(robot, helix(robot, **LARGE))
    first, second, *events = check.lines()
    assert "crosses singularities 2 times" in first
    assert "smallest distance to a singularity: " in second
    assert len(events) == len(check.singularities) + len(check.limits)
    assert events == sorted(events)
    assert any("4.075203070 s: crosses a type II singularity" in line for line in events)
    assert any("of length, 0.5 m" in line for line in events)
    assert str(check) == "\n".join(check.lines())
    fine = check_path(robot, climb(1.0, constant(0.4)))
    assert "meets no singularity and keeps every limit" in str(fine)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerance": 0.0}, "tolerance = 0"),
        ({"tolerance": 1e-18}, "can be told apart"),
        ({"tolerance": "1e-9"}, "tolerance = '1e-9'"),
        ({"threshold": math.nan}, "threshold = nan"),
        ({"threshold": True}, "threshold = True"),
        ({"max_step": -1}, "max_step = -1"),
        ({"max_step": 1e-9}, "samples of this path"),
        ({"least_steps": 0}, "least_steps = 0"),
        ({"least_steps": 10.5}, "least_steps = 10.5"),
    ],
)
def test_bad_options_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        check_path(sokolov(), helix(sokolov(), **LARGE), **options)  # type: ignore[arg-type]


class Broken(Functions):
    """A path whose samples are whatever is given."""

    def __init__(self, pose: object, rate: object, duration: float = 1.0) -> None:
        self.duration = duration
        self.pose, self.rate = pose, rate

    def sample(self, t: ArrayLike) -> PathSample:
        n = np.size(t)

        def filled(value: object) -> object:
            return np.tile(value, (n, 1)) if isinstance(value, list) else value  # type: ignore[arg-type]

        return PathSample(filled(self.pose), filled(self.rate), None)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (Broken([0.4, 0.0], [0.0] * 3), r"pose at 1001 times has shape \(1001, 2\)"),
        (Broken([0.4, 0.0, np.nan], [0.0] * 3), "pose is not finite at 0 s"),
        (Broken([0.4, 0.0, 0.0], [np.inf] * 3), "rate is not finite"),
        (Broken("no", [0.0] * 3), r"pose at 1001 times has shape \(\)"),
        (Broken([0.4, 0.0, 7.0], [0.0] * 3), "tilted by 7 rad"),
        (Broken([0.4, 0.0, 0.0], [0.0] * 3, duration=0.0), "duration = 0"),
        (Broken([0.4, 0.0, 0.0], [0.0] * 3, duration=math.inf), "duration = inf"),
    ],
)
def test_bad_trajectories_are_refused(path: Trajectory, message: str) -> None:
    with pytest.raises(InputError, match=message):
        check_path(sokolov(), path)

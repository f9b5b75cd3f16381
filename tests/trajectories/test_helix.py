"""The helix: the paper's curve, its law of time, and exact derivatives."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, RPSRobot, helix
from rps_pin.rps.kinematics.pose import rotation
from rps_pin.trajectories import HelixPath
from rps_pin.trajectories.helix import PAPER_DURATION
from tests.each import each

Array = NDArray[np.float64]

PLATFORM_RADIUS = 0.23
ROBOT = SimpleNamespace(parameters=SimpleNamespace(platform_radius=PLATFORM_RADIUS))
T_A = 0.5
T_T = 0.5 + np.sqrt(1 + 9 * np.pi**2) / 2
T_B = T_T - T_A
CORNERS = [T_A, T_B]
#: Times away from the corners, where the acceleration jumps.
SMOOTH = np.concatenate(
    [
        np.linspace(0.01, 0.49, 9),
        np.linspace(0.51, T_B - 0.01, 30),
        np.linspace(T_B + 0.01, 5.23, 9),
    ]
)


def path(radius: float = 0.03, pitch: float = 0.02, branch: str = "+", **more: float) -> HelixPath:
    return helix(ROBOT, radius=radius, pitch=pitch, height=0.4, branch=branch, **more)


def equation_29(t: Array) -> Array:
    """phi in three pieces: the third with 4 (1 + sqrt(1 + 9 pi^2)) t, where t^2 is printed."""
    root = np.sqrt(1 + 9 * np.pi**2)
    middle = (4 * t - 1) * np.pi / root
    falling = np.pi * (-2 - 9 * np.pi**2 + 4 * (1 + root) * t - 4 * t**2) / root
    return np.select([t < T_A, t < T_B], [4 * np.pi / root * t**2, middle], falling)


def test_duration_is_table_1_s_before_rounding() -> None:
    assert path().duration == pytest.approx(5.2388, abs=5e-5)
    assert path().duration == PAPER_DURATION == pytest.approx(T_T, rel=1e-15)


def test_phi_is_the_corrected_equation_29() -> None:
    t = np.linspace(0, T_T, 2001)
    found = path().turn(t)[0]
    np.testing.assert_allclose(found, equation_29(t), rtol=0, atol=1e-13)


def test_phi_makes_one_full_turn_from_rest_to_rest() -> None:
    phi, rate, _ = path().turn([0.0, T_T])
    np.testing.assert_allclose(phi, [0, 2 * np.pi], rtol=1e-15)
    np.testing.assert_allclose(rate, [0, 0], atol=1e-15)


@pytest.mark.parametrize("corner", CORNERS)
def test_phi_and_its_rate_are_continuous_at_the_joints(corner: float) -> None:
    (before, after), (slow, fast), _ = path().turn([corner - 1e-12, corner + 1e-12])
    assert after - before == pytest.approx(2e-12 * slow, rel=1e-3)
    assert fast == pytest.approx(slow, rel=1e-11)


def test_derivatives_of_phi_are_its_derivatives() -> None:
    h = 1e-3
    phi, rate, acceleration = path().turn(SMOOTH)
    (ahead, rate_ahead, _), (behind, rate_behind, _) = (
        path().turn(SMOOTH + h),
        path().turn(SMOOTH - h),
    )
    # Every piece is of second degree: central differences are exact.
    np.testing.assert_allclose(rate, (ahead - behind) / (2 * h), rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        acceleration, (rate_ahead - rate_behind) / (2 * h), rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(phi, (ahead + behind - acceleration * h**2) / 2, rtol=0, atol=1e-14)


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_speed_and_ramps_of_the_paper_s_proportions_are_1_and_2_units(unit: float) -> None:
    curve = helix(
        SimpleNamespace(parameters=SimpleNamespace(platform_radius=2 * unit)),
        radius=0.75 * unit,
        pitch=0.5 * unit,
        height=0.0,
    )
    _, rate, acceleration = curve.turn(SMOOTH)
    metres = np.hypot(0.75, 0.5 / (2 * np.pi)) * unit
    middle = (SMOOTH > T_A) & (SMOOTH < T_B)
    np.testing.assert_allclose(metres * rate[middle], unit, rtol=1e-14)
    np.testing.assert_allclose(metres * np.abs(acceleration[~middle]), 2 * unit, rtol=1e-14)
    np.testing.assert_array_equal(acceleration[middle], 0)


@pytest.mark.parametrize("branch", ["+", "-"])
@pytest.mark.parametrize(("radius", "pitch"), [(0.75e-3, 0.5e-3), (0.075, 0.05), (0.23, -0.1)])
def test_centre_follows_equations_26_to_28(radius: float, pitch: float, branch: str) -> None:
    """p = (r cos(phi), r sin(phi), z_0 + p_h phi / 2 pi), through the robot's own kinematics."""
    robot = RPSRobot.from_preset("sokolov")
    curve = helix(robot, radius=radius, pitch=pitch, height=0.4, branch=branch)
    t = np.linspace(0, T_T, 500)
    phi = equation_29(t)
    centre, _ = robot.platform_placement(curve.sample(t).pose)
    circle = radius * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    # Rounding of the tilt, which is 2 asin(sqrt(r / h)), shows where r is all of h.
    np.testing.assert_allclose(centre[:, :2], circle, rtol=0, atol=2e-15)
    np.testing.assert_allclose(centre[:, 2], 0.4 + pitch * phi / (2 * np.pi), rtol=0, atol=1e-15)


def test_branches_tilt_opposite_ways_and_plus_starts_at_alpha_90_degrees() -> None:
    """alpha = pi/2 turns about -x: (-sin(alpha), cos(alpha)) = (-1, 0)."""
    plus, minus = (path(branch=branch).sample(SMOOTH) for branch in "+-")
    for one, other in zip(plus, minus, strict=True):
        np.testing.assert_array_equal(one[:, 1:], -other[:, 1:])
        np.testing.assert_array_equal(one[:, 0], other[:, 0])
    start = path().sample(0.0).pose
    np.testing.assert_allclose(start[1:], [-path().tilt, 0], rtol=0, atol=1e-16)


def test_each_branch_ends_as_the_other_begins() -> None:
    for one, other in ("+-", "-+"):
        end, start = path(branch=one).sample(T_T).pose, path(branch=other).sample(0.0).pose
        np.testing.assert_allclose(rotation(end), rotation(start), rtol=0, atol=1e-15)
        assert end[0] - start[0] == pytest.approx(path().pitch, rel=1e-12)


def test_tilt_is_constant() -> None:
    pose = path().sample(np.linspace(0, T_T, 100)).pose
    np.testing.assert_allclose(np.hypot(pose[:, 1], pose[:, 2]), path().tilt, rtol=1e-15)
    assert PLATFORM_RADIUS / 2 * (1 - np.cos(path().tilt)) == pytest.approx(0.03, rel=1e-14)


@pytest.mark.parametrize("branch", ["+", "-"])
def test_rate_and_acceleration_are_the_pose_s_derivatives(branch: str) -> None:
    curve, h = path(branch=branch), 2e-3
    found = curve.sample(SMOOTH)
    shifted = [curve.sample(SMOOTH + k * h) for k in (-2, -1, 1, 2)]
    weights = np.array([1, -8, 8, -1]) / (12 * h)
    for order, derivative in ((0, found.rate), (1, found.acceleration)):
        differences = np.tensordot(weights, np.array([x[order] for x in shifted]), 1)
        np.testing.assert_allclose(derivative, differences, rtol=0, atol=1e-10)


def test_other_durations_keep_the_shape_of_phi() -> None:
    fraction = np.linspace(0, 1, 101)
    slow = path(duration=3 * T_T).turn(3 * T_T * fraction)
    fast = path().turn(T_T * fraction)
    for order, (one, other) in enumerate(zip(slow, fast, strict=True)):
        np.testing.assert_allclose(one[1:-1] * 3**order, other[1:-1], rtol=1e-12, atol=1e-12)


def test_no_radius_means_a_level_rise() -> None:
    pose = path(radius=0.0).sample(SMOOTH).pose
    np.testing.assert_array_equal(pose[:, 1:], 0)
    assert (np.diff(pose[:, 0]) > 0).all()


def test_sample_keeps_the_shape_of_the_times() -> None:
    for t in (0.3, np.zeros((2, 3)), []):
        assert [x.shape for x in path().sample(t)] == [(*np.shape(t), 3)] * 3


@each(
    ("change", "message"),
    [
        ({"radius": 0.2301}, "radius = 0.2301 m: .* reaches 0 to 0.23 m"),
        ({"radius": -1e-9}, "radius"),
        ({"radius": np.nan}, "radius = nan"),
        ({"radius": np.inf}, "radius = inf"),
        ({"pitch": np.nan}, "pitch = nan"),
        ({"pitch": np.inf}, "pitch = inf"),
        ({"height": np.nan}, "height = nan"),
        ({"height": -np.inf}, "height = -inf"),
        ({"duration": 0.0}, "duration = 0.0"),
        ({"duration": -1.0}, "duration = -1.0"),
        ({"duration": np.nan}, "duration = nan"),
        ({"duration": np.inf}, "duration = inf"),
        ({"duration": 1e-200}, "duration = 1e-200: it must be .*from 1e-50"),
        ({"pitch": True}, "pitch = True: it must be a finite number of metres"),
        ({"branch": "*"}, r"branch = '\*': it must be '\+' or '-'"),
        ({"branch": None}, "branch = None"),
        ({"radius": "wide"}, "radius"),
        ({"pitch": None}, "pitch"),
    ],
)
def test_bad_helices_are_refused_by_name(change: dict[str, object], message: str) -> None:
    arguments = {"radius": 0.03, "pitch": 0.02, "height": 0.4} | change
    with pytest.raises(InputError, match=message):
        helix(ROBOT, **arguments)


def test_repr_shows_what_it_is() -> None:
    text = repr(path(branch="-"))
    for part in ("radius=0.03", "pitch=0.02", "height=0.4", "branch='-'", "duration=5.23884"):
        assert part in text

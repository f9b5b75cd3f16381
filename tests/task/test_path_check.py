"""Paths of tasks against singularities and limits at known times, in closed form."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq, minimize_scalar
from scipy.spatial.transform import Rotation

from rps_pin import ClosedLoopModel, ClosureError, InputError, RPSParameters, RPSRobot, helix
from rps_pin.errors import MechanismError
from rps_pin.rps import check_path as closed_check
from rps_pin.task import Cone, PathCheck, Payload, Task, check_path
from rps_pin.trajectories import pose_path
from tests.reference import five_bar, stewart
from tests.task.paths import Moving, swinging, uniform
from tests.task.robots import compiled, task
from tests.worst import worst

BOTH = pytest.mark.parametrize("make", [task, compiled], ids=["pinocchio", "generated"])


def kinds(check: PathCheck) -> list[tuple[str, str]]:
    return [(event.kind, event.singularity) for event in check.singularities]


# Five-bar: circles --------------------------------------------------------------------------------

LEFT, RIGHT = np.zeros(2), np.array([five_bar.GROUND, 0.0])
ARMS = (five_bar.LEFT.length, five_bar.LEFT_ARM.length)
OTHER = (five_bar.RIGHT.length, five_bar.RIGHT_ARM.length)


def elbow(base: Any, tip: Any, lengths: tuple[float, float], side: float) -> Any:
    """Where the bars of a lengths meet, on one side of the line from the base to the tip."""
    reach = tip - base
    square = reach @ reach
    along = (square + lengths[0] ** 2 - lengths[1] ** 2) / (2 * square)
    across = np.sqrt(lengths[0] ** 2 / square - along**2)
    return base + along * reach + side * across * np.array([-reach[1], reach[0]])


def bent(tip: Any) -> float:
    """Zero where the two arms at the tip are in one line: type II."""
    a = elbow(LEFT, tip, ARMS, 1.0) - tip
    b = elbow(RIGHT, tip, OTHER, -1.0) - tip
    return float(a[0] * b[1] - a[1] * b[0])


@BOTH
def test_a_five_bar_whose_arms_come_into_one_line(make: Any) -> None:
    """Down the middle: the output moves while both motors stand."""
    one = make("five_bar")
    start = one.home
    end = np.array([0.21, 0.1])
    path = uniform(start, end, 2.0)
    wanted = brentq(lambda t: bent(path.sample(t).pose), 0.2, 1.9, xtol=1e-14)
    found = check_path(one, path, least_steps=100)
    assert kinds(found) == [("crosses", "type II")]
    (event,) = found.singularities
    assert event.time == pytest.approx(wanted, abs=2e-10)
    assert event.width <= 2e-10
    assert not found.ok
    assert worst(event.pose - path.sample(event.time).pose) == 0
    assert "crosses a type II singularity" in str(event)
    assert f"x = {event.pose[0]:.6g} m, z = {event.pose[1]:.6g} m" in str(found)


@BOTH
def test_a_five_bar_driven_into_its_stretched_pose(make: Any) -> None:
    """The left arm is straight where the tip is l1 + l2 from the left motor."""
    one = make("five_bar")
    path = uniform(one.home, one.home + np.array([0.35, 0.25]), 1.0)

    def room(t: float) -> float:
        return sum(ARMS) - float(np.linalg.norm(path.sample(t).pose - LEFT))

    def other(t: float) -> float:
        return sum(OTHER) - float(np.linalg.norm(path.sample(t).pose - RIGHT))

    ends = [brentq(f, 0, 1, xtol=1e-14) for f in (room, other) if f(1.0) < 0]
    assert ends
    found = check_path(one, path, least_steps=60)
    assert ("ends", "type I") in kinds(found)
    event = found.singularities[-1]
    assert event.time == pytest.approx(min(ends), abs=1e-9)
    assert event.width <= 1e-10
    assert found.minimum_distance < 1e-3
    assert found.minimum_singularity == "type I"
    assert "the assembly mode ends in a type I singularity" in str(found)
    assert found.duration == 1.0
    assert [kind for kind, _ in kinds(found)].count("grazes") == 0


def test_a_path_that_comes_near_grazes_and_the_least_distance_is_found() -> None:
    """A parabola beneath the stretched pose; the least distance by its own measure, densely."""
    one = compiled("five_bar")
    axis = brentq(lambda z: bent(np.array([0.21, z])), 0.1, one.home[1] - 0.02, xtol=1e-14)
    lowest = axis + 2e-4

    def dip(t: Any) -> Any:
        return (t - 1) ** 2

    path = Moving(
        [0.21, lowest], [0, 0.1], 2.0, dip, lambda t: 2 * (t - 1), lambda t: 2.0
    )  # fmt: skip
    near = one.configuration(path.sample(0.0).pose)
    found = check_path(one, path, near=near, threshold=0.05)
    assert kinds(found) == [("grazes", "type II")]

    def distance(t: float) -> float:
        q = one.configuration(path.sample(t).pose, near)
        return float(one.singularities(q).distance)

    least = minimize_scalar(distance, bounds=(0.9, 1.1), method="bounded")
    assert found.minimum_distance == pytest.approx(least.fun, rel=1e-6)
    assert found.minimum_time == pytest.approx(1.0, abs=1e-3)
    assert not check_path(one, path, near=near, threshold=1e-5).singularities


# Stewart: the Jacobian in closed form -------------------------------------------------------------


def of_stewart(x: Any) -> float:
    """Determinant of the rows (s_i, R b_i x s_i): lengths' rates by the platform's twist."""
    turn = Rotation.from_rotvec(x[3:]).as_matrix()
    rows = []
    for anchor, ball in zip(stewart.ANCHORS, stewart.BALLS, strict=True):
        arm = turn @ ball
        s = np.asarray(x[:3]) + arm - anchor
        s = s / np.linalg.norm(s)
        rows.append(np.r_[s, np.cross(arm, s)])
    return float(np.linalg.det(rows))


def test_a_stewart_that_turns_by_a_right_angle() -> None:
    """Fichter: similar hexagons that are turned by 90 degrees about the vertical are singular."""
    one = compiled("stewart")
    place = one.home[:3]
    path = pose_path([place, place], [0, 0, 0], duration=2.0, turns=[[0, 0, np.radians(110)]])
    wanted = brentq(lambda t: of_stewart(path.sample(t).pose), 0.5, 1.9, xtol=1e-14)
    assert path.sample(wanted).pose[5] == pytest.approx(np.pi / 2, abs=1e-9)
    found = check_path(one, path, least_steps=60)
    assert kinds(found) == [("crosses", "type II")]
    assert found.singularities[0].time == pytest.approx(wanted, abs=2e-10)


def test_a_stewart_tilted_on_the_way_is_singular_where_its_determinant_says() -> None:
    one = compiled("stewart")
    place = one.home[:3]
    path = pose_path(
        [place, place + np.array([0.03, 0, 0.05]), place],
        [[0, 0, 0], [0.2, 0.1, 1.2], [0.1, -0.2, 2.0]],
        duration=3.0,
    )
    t = np.linspace(0, 3, 2001)
    signs = np.sign([of_stewart(x) for x in path.sample(t).pose])
    cuts = np.flatnonzero(signs[1:] != signs[:-1])
    wanted = [brentq(lambda u: of_stewart(path.sample(u).pose), t[k], t[k + 1]) for k in cuts]
    assert wanted
    met = check_path(one, path, least_steps=80).singularities
    found = [e.time for e in met if e.singularity == "type II"]
    assert worst(np.array(found) - wanted) < 1e-8


# Limits at known times ----------------------------------------------------------------------------

MASS, G = 3.0, 9.81


@cache
def lift(**limits: Any) -> Task:
    """A level platform on three upright legs without mass: each bears m (z'' + g) / 3."""
    robot = RPSRobot(
        RPSParameters(
            base_radius=0.2, platform_radius=0.2, platform_mass=MASS,
            platform_inertia=np.diag([0.02, 0.02, 0.04]), leg_mass=0.0, leg_com=0.0,
            leg_inertia=0.0, **limits,
        )
    )  # fmt: skip
    return Task(robot.mechanism, "platform", ["z", "rx", "ry"]).compile()


W, REACH = 4.0, 0.05
UP = swinging([0.3, 0, 0], [REACH, 0, 0], W, 2 * np.pi / W)
PERIOD = 2 * np.pi / W


def times(check: PathCheck, quantity: str, kind: str) -> list[float]:
    found = sorted(e.time for e in check.limits if e.quantity == quantity and e.kind == kind)
    assert len(found) % 3 == 0  # three legs alike
    return [float(np.mean(found[i : i + 3])) for i in range(0, len(found), 3)]


def test_strokes_that_end_at_known_times() -> None:
    one = lift(leg_length_limits=(0.28, 0.34))
    found = check_path(one, UP, least_steps=60)
    first, last = np.arcsin(0.04 / REACH) / W, np.arcsin(0.02 / REACH) / W
    half = PERIOD / 2
    leaves, returns = times(found, "position", "leaves"), times(found, "position", "returns")
    assert worst(np.array(leaves) - [first, half + last]) < 1e-9
    assert worst(np.array(returns) - [half - first, PERIOD - last]) < 1e-9
    event = found.limits[0]
    assert (event.joint, event.side, event.limit) == ("leg_1_prismatic", "upper", 0.34)
    assert "joint 'leg_1_prismatic' leaves its upper limit of position, 0.34 m" in str(event)
    assert not found.ok


def test_speeds_and_forces_that_are_too_large_at_known_times() -> None:
    speed, force = 0.15, MASS / 3 * (G + 0.5)
    one = lift(actuator_speed_limit=speed, actuator_force_limit=force)
    found = check_path(one, UP, least_steps=60)
    slow = np.arccos(speed / (REACH * W)) / W  # |z'| = reach w |cos(w t)|
    half = PERIOD / 2
    assert worst(np.array(times(found, "speed", "starts outside"))) == 0
    returns, leaves = times(found, "speed", "returns"), times(found, "speed", "leaves")
    assert worst(np.array(returns) - [slow, half + slow]) < 1e-9
    assert worst(np.array(leaves) - [half - slow, PERIOD - slow]) < 1e-9
    # z'' = -reach w^2 sin(w t) = 0.5
    early = np.arcsin(0.5 / (REACH * W**2)) / W
    leaves, returns = times(found, "force", "leaves"), times(found, "force", "returns")
    assert worst(np.array(leaves) - [half + early]) < 1e-9
    assert worst(np.array(returns) - [PERIOD - early]) < 1e-9
    units = {event.quantity: event.unit for event in found.limits}
    assert units == {"speed": "m/s", "force": "N"}


def test_payloads_and_wrenches_count() -> None:
    """Standing still the legs bear (m + load) g / 3 less what pulls up."""
    held = MASS * G / 3
    one = lift(actuator_force_limit=held + 1.0)
    still = uniform([0.3, 0, 0], [0.31, 0, 0], 1.0)
    assert check_path(one, still).ok
    assert check_path(one, still, payload=Payload(0.9 * 3.0 / G)).ok
    heavy = check_path(one, still, payload=Payload(1.1 * 3.0 / G))
    assert [e.kind for e in heavy.limits] == 3 * ["starts outside"]
    up = [0, 0, 0.4, 0, 0, 0]
    assert check_path(one, still, payload=Payload(1.1 * 3.0 / G), wrench=up).ok
    assert len(check_path(one, still, wrench=[0, 0, -3.1, 0, 0, 0]).limits) == 3
    with pytest.raises(MechanismError, match="a task of joints has no output frame"):
        check_path(task("ankle"), still, payload=Payload(1.0))


def test_cones_of_a_ball_are_left_at_a_known_time() -> None:
    """The platform tilts about x by t: its z axis makes that angle with the world's."""
    one = compiled("stewart")
    tilt = Moving(
        one.home, [0, 0, 0, 1, 0, 0], 0.4, lambda t: t, lambda t: 1.0, lambda t: 0.0
    )  # fmt: skip
    cone = Cone("universe", "platform", 0.3)
    found = check_path(one, tilt, cones=[cone])
    (event,) = [e for e in found.limits if e.quantity == "cone"]
    assert event.kind == "leaves"
    assert event.time == pytest.approx(0.3, abs=1e-10)
    # An axis aslant by 45 degrees, which the tilt brings towards the vertical.
    aslant = Cone("universe", "platform", 0.6, axis_a=(0, 0, 2.0), axis_b=(0, 1, 1), name="ball")
    first, then = (e for e in check_path(one, tilt, cones=[aslant]).limits if e.quantity == "cone")
    assert (first.kind, first.joint, then.kind) == ("starts outside", "ball", "returns")
    assert then.time == pytest.approx(np.pi / 4 - 0.6, abs=1e-10)


# The 3-RPS: the closed form -----------------------------------------------------------------------

LARGE = {"radius": 75e-3, "pitch": 50e-3, "height": 0.4}
FLAT = {"radius": 0.75e-3, "pitch": 0.5e-3, "height": 0.4e-3}
LIMITS = {
    "leg_length_limits": (0.30, 0.62),
    "leg_angle_limits": (0.5, 1.9),
    "spherical_cone_limit": 0.9,
    "spherical_rest_angle": 0.3,
}


def generic(robot: RPSRobot) -> Task:
    return Task(robot.mechanism, "platform", ["z", "rx", "ry"]).compile()


@pytest.mark.parametrize("size", [LARGE, FLAT], ids=["large", "flat"])
@pytest.mark.parametrize("branch", ["+", "-"])
def test_the_3_rps_has_the_same_events_without_closed_forms(size: Any, branch: Any) -> None:
    robot = RPSRobot.from_preset("sokolov")
    path = helix(robot, **size, branch=branch)
    near = robot.task.configuration(path.sample(0.0).pose)
    closed, found = closed_check(robot, path), check_path(generic(robot), path, near=near)
    assert kinds(found) == kinds(closed)
    for one, other in zip(found.singularities, closed.singularities, strict=True):
        assert one.time == pytest.approx(other.time, abs=1e-9)
    assert found.ok == closed.ok
    assert found.minimum_time == pytest.approx(closed.minimum_time, abs=1e-3)


def test_the_3_rps_leaves_the_same_limits() -> None:
    """The tree has those of lengths and angles; the robot's own task has the cones too."""
    robot = RPSRobot(RPSParameters.from_preset("sokolov").replace(**LIMITS))
    path = helix(robot, **LARGE)
    closed = closed_check(robot, path).limits
    assert {event.quantity for event in closed} == {"length", "angle", "spherical joint"}
    names = {"length": "leg_{}_prismatic", "angle": "leg_{}_revolute"}
    wanted = sorted(
        (names[e.quantity].format(e.leg), e.side, e.kind, e.time)
        for e in closed
        if e.quantity in names
    )
    found = sorted(
        (e.joint, e.side, e.kind, e.time) for e in check_path(generic(robot), path).limits
    )
    assert [one[:3] for one in found] == [one[:3] for one in wanted]
    assert worst(np.array([one[3] for one in found]) - [one[3] for one in wanted]) < 2e-9
    own = check_path(robot.task, path).limits
    assert [(e.leg, e.quantity, e.side, e.kind) for e in own] == [
        (e.leg, e.quantity, e.side, e.kind) for e in closed
    ]
    assert worst(np.array([e.time for e in own]) - [e.time for e in closed]) < 2e-9


# Bad input ----------------------------------------------------------------------------------------


def test_what_cannot_be_checked_is_refused() -> None:
    one = task("five_bar")
    home = one.home
    path = uniform(home, home + np.array([0.01, 0.0]))
    with pytest.raises(ClosureError, match="at t = 0 s"):
        check_path(one, uniform(home + np.array([3.0, 0]), home))
    with pytest.raises(InputError, match=r"pose at .* times has shape \(\d+, 3\)"):
        check_path(one, uniform([0, 0, 0], [1, 1, 1]))
    with pytest.raises(InputError, match="rate is not finite at"):
        check_path(one, Moving(home, [0.1, 0], 1.0, lambda t: t, lambda t: np.nan, lambda t: 0.0))
    with pytest.raises(InputError, match="tolerance = 1e-30 s: times up to 1 s can be told apart"):
        check_path(one, path, tolerance=1e-30)
    with pytest.raises(InputError, match="threshold = -1"):
        check_path(one, path, threshold=-1)
    with pytest.raises(InputError, match="least_steps"):
        check_path(one, path, least_steps=0)
    with pytest.raises(InputError, match="max_step = 1e-09 would take"):
        check_path(one, path, max_step=1e-9)
    with pytest.raises(MechanismError, match="cone: no frame 'ball'"):
        check_path(one, path, cones=[Cone("universe", "ball", 0.3)])
    for limit, axis, words in ((4.0, (0, 0, 1), "below pi"), (1.0, (0, 0, 0), "axis_b is zero")):
        with pytest.raises(InputError, match=words):
            Cone("a", "b", limit, axis_b=axis)


def test_other_models_of_the_same_joints() -> None:
    one = ClosedLoopModel.load("urdf/five_bar.yaml")
    model = pin.Model(one.model)
    model.velocityLimit[:] = 0.5
    assert worst(one.with_model(model).home - one.home) < 1e-12
    path = uniform(one.task.home, one.task.home + np.array([0.1, 0.0]), 0.05)
    slow = check_path(one.with_model(model).task, path, least_steps=20)
    assert {event.quantity for event in slow.limits} == {"speed"}
    assert {event.unit for event in slow.limits} == {"rad/s"}
    assert check_path(one.task, path, least_steps=20).ok
    with pytest.raises(MechanismError, match="other joints"):
        one.with_model(ClosedLoopModel.load("urdf/four_bar.yaml").model)

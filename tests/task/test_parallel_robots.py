"""Parallel robots of urdf/ against their closed forms: positions, speeds, forces, dynamics.

The closed forms (tests/reference/parallel) know nothing of trees and closures: inverse kinematics
leg by leg, its derivatives along a curve, and d'Alembert's principle with the bodies' motions.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from rps_pin import SingularityError
from rps_pin.codegen.build import tcc
from rps_pin.task import check_path
from rps_pin.trajectories import point_to_point
from tests.proofs import common
from tests.reference import delta, five_bar, jets
from tests.reference.newton_euler import Jet
from tests.reference.parallel import linear_delta, planar_rrr, rotary_stewart
from tests.reference.parallel.robots import ROBOTS
from tests.task.paths import uniform
from tests.task.robots import poses, task
from tests.worst import worst

EACH = pytest.mark.parametrize("name", ROBOTS)
OF_FRAMES = pytest.mark.parametrize("name", [name for name in ROBOTS if name != "ankle"])


@cache
def quick(name: str):
    """In generated code; built fast, and not made for speed."""
    return task(name).compile(compiler="tcc" if tcc.is_here() else "auto")


@pytest.mark.parametrize("make", [task, quick], ids=["pinocchio", "generated"])
@EACH
def test_positions_and_their_derivatives_are_those_of_the_closed_form(make, name) -> None:
    one, robot, (x, q) = make(name), ROBOTS[name], poses(name)
    rng = np.random.default_rng(1)
    rate = rng.normal(size=x.shape)
    a = one.to_actuators(x)
    K, bias = one.jacobian(q), one.bias(q, rate)
    for k, pose in enumerate(x):
        closed_form = robot.drives(Jet(pose, rate[k], np.zeros(pose.size)))
        gain = robot.gain(pose)
        assert worst(a[k] - closed_form.value) < 1e-12
        assert worst(K[k] - gain) < 1e-11 * worst(gain)
        size = worst(closed_form.second, 1.0)
        assert worst(bias[k] - closed_form.second) < 1e-10 * size
    assert worst(one.to_task(a) - x) < 1e-12


@EACH
def test_states_and_dynamics_are_those_of_the_bodies_motions(name) -> None:
    """All joints' motions, and the drives' forces by virtual power, at speed."""
    one, robot, (x, q) = task(name), ROBOTS[name], poses(name)
    m, rng = one.mechanism, np.random.default_rng(2)
    for pose, near in zip(x, q, strict=True):
        rate, acceleration = rng.normal(size=pose.size), 10 * rng.normal(size=pose.size)
        rate[~np.array(one.angular)] *= one.characteristic_length
        curve = Jet(pose, rate, acceleration)
        found = one.state(pose, rate, acceleration, near=near)
        free = ("platform_joint", *robot.output(curve)) if robot.free else None
        wanted = common.state(m, robot.joints(curve), free)
        for part, expected in zip(found, wanted, strict=True):
            assert worst(part - expected) < 1e-9 * worst(expected, 1.0)
        forces = robot.forces(pose, rate, acceleration)
        tau = m.inverse_dynamics(*found).tau
        assert worst(tau - forces) < 1e-9 * worst(forces)
        back = m.forward_dynamics(found.q, found.v, forces)
        assert worst(back - found.a) < 1e-7 * worst(found.a)


def test_published_formulas_of_rotary_stewart_and_linear_delta() -> None:
    """Single expressions as they are printed and as firmware has them, by SciPy's rotations.

    Cranks: asin(g / sqrt(e^2 + f^2)) - atan2(f, e) (R. Eisele, Inverse kinematics of a Stewart
    platform, 2019; F. Szufnarowski, 2013). Carriages: z + sqrt(L^2 - (X - x)^2 - (Y - y)^2), with
    the towers at the difference of the radii (Marlin, Klipper).
    """
    x, _ = poses("rotary_stewart")
    found = task("rotary_stewart").to_actuators(x)
    for pose, angles in zip(x, found, strict=True):
        turn = Rotation.from_rotvec(pose[3:])
        for k in range(6):
            side, middle = (1 if k % 2 == 0 else -1), np.deg2rad(120 * (k // 2))
            at, beta = middle + side * 0.25, middle + side * np.pi / 2
            ball = middle + side * (np.pi / 3 - 0.2)
            leg = pose[:3] + turn.apply([0.15 * np.cos(ball), 0.15 * np.sin(ball), 0])
            leg = leg - [0.2 * np.cos(at), 0.2 * np.sin(at), 0]
            e, f = 0.16 * leg[2], 0.16 * (np.cos(beta) * leg[0] + np.sin(beta) * leg[1])
            g = leg @ leg - (0.24**2 - 0.08**2)
            assert worst(angles[k] - (np.arcsin(g / np.hypot(e, f)) - np.arctan2(f, e))) < 1e-11
    x, _ = poses("linear_delta")
    towers = 0.105 * np.exp(2j * np.pi / 3 * np.arange(3))
    aside = np.abs(towers - (x[:, 0] + 1j * x[:, 1])[:, None])
    wanted = x[:, 2:] + np.sqrt(0.215**2 - aside**2)
    assert worst(task("linear_delta").to_actuators(x) - wanted) < 1e-12


@OF_FRAMES
def test_forces_do_the_work_of_a_wrench_on_the_closed_form_s_motion(name) -> None:
    one, robot, (x, q) = task(name), ROBOTS[name], poses(name)
    rng = np.random.default_rng(3)
    for pose, each in zip(x, q, strict=True):
        wrench = rng.normal(size=6)
        tau = one.wrench_to_actuators(each, wrench)
        work = robot.twists(pose).T @ wrench
        assert worst(robot.gain(pose).T @ tau - work) < 1e-10 * worst(work)


@pytest.mark.parametrize("name", ["rotary_stewart", "linear_delta", "planar_rrr"])
def test_statics_are_those_of_forces_along_the_rods(name) -> None:
    """By the balance of the platform alone: no speed appears."""
    one, (x, q) = task(name), poses(name)
    statics, kept = {
        "rotary_stewart": (rotary_stewart.static_torques, [0, 1, 2, 3, 4, 5]),
        "linear_delta": (linear_delta.static_forces, [0, 1, 2]),
        "planar_rrr": (planar_rrr.static_torques, [0, 1, 5]),
    }[name]
    rng = np.random.default_rng(4)
    for pose, each in zip(x, q, strict=True):
        wrench = np.zeros(6)
        wrench[kept] = rng.normal(size=len(kept))
        wanted = statics(pose, wrench[kept])
        assert worst(one.wrench_to_actuators(each, wrench) - wanted) < 1e-10 * worst(wanted)


DIRECT = {
    "delta": lambda a: [delta.platform_position(a)],
    "linear_delta": linear_delta.platform_positions,
    "planar_rrr": planar_rrr.poses,
    "five_bar": lambda a: [five_bar.tip(jets.constant(a)).value],
}
"""Closed forms of the direct kinematics: poses of given actuators, some or all."""


@pytest.mark.parametrize("name", DIRECT)
def test_direct_kinematics_is_that_of_the_closed_form(name) -> None:
    """From random positions of the actuators, of which the pose is one of the closed form's."""
    one, rng = task(name), np.random.default_rng(6)
    home = one.to_actuators(one.home)
    size = 0.3 if name != "linear_delta" else 0.05
    for _ in range(20):
        a = home + size * rng.uniform(-1, 1, home.size)
        apart = np.abs(one.to_task(a) - np.array(DIRECT[name](a))).max(axis=1)
        assert worst(apart.min()) < 1e-10


@EACH
def test_the_last_pose_leads_to_the_next_at_1_khz(name) -> None:
    """Positions of a fast motion's closed form, followed for a fifth of a second by the drives."""
    one, robot = quick(name), ROBOTS[name]
    centre, _ = poses(name)
    reach = (centre[0] - one.home) / 1.5
    time = np.arange(200) / 1000
    swing = np.sin(np.outer(40 * time, np.linspace(0.8, 1.2, one.size)))
    path = one.home + reach * swing
    q = one.mechanism.home
    for x in path:
        found = one.to_task(robot.drives(jets.constant(x)).value, near=q)
        assert worst(found - x) < 1e-11
        q = one.configuration(found, near=q)


def five_bar_with_its_arms_in_line() -> list[float]:
    """The tip between elbows that are as far apart as the arms are long."""
    left = 0.3 * np.array([np.cos(2.6), np.sin(2.6)])

    def right(angle: float):
        return np.array([0.4 + 0.28 * np.cos(angle), 0.28 * np.sin(angle)])

    angle = brentq(lambda t: np.linalg.norm(right(t) - left) - (0.42 + 0.45), 0.0, 1.5)
    return list(left + (right(angle) - left) * 0.42 / (0.42 + 0.45))


def planar_rrr_with_its_forearms_in_one_point() -> list[float]:
    """Turned about the centre until elbow, pin and centre are in line, by the law of cosines."""
    far = 0.1 + 0.25
    arm = np.arccos((far**2 - 0.3**2 - 0.2**2) / (2 * 0.3 * 0.2))
    return [0.0, 0.0, np.arctan2(0.2 * np.sin(arm), 0.3 + 0.2 * np.cos(arm))]


@pytest.mark.parametrize(
    ("name", "pose", "before"),
    [
        # hexagons with three axes of symmetry, one turned by 90 degrees (Fichter, 1986)
        ("stewart", [0, 0, 0.63, 0, 0, np.pi / 2], [0, 0, 0, 0, 0, -0.2]),
        ("planar_rrr", planar_rrr_with_its_forearms_in_one_point(), [0, 0, -0.2]),
        ("five_bar", five_bar_with_its_arms_in_line(), [0, 0.1]),
    ],
)
def test_singularities_are_where_geometry_has_them(name, pose, before) -> None:
    """`type_ii` is zero there and not before, and the determinant changes sign."""
    one, pose, before = task(name), np.array(pose), np.array(before)
    nearer = [one.configuration(pose + share * before) for share in (1.0, 1e-3, 0.0, -1e-3)]
    found = one.singularities(nearer)
    assert found.type_ii[0] > 0.05
    assert 1e-6 < found.type_ii[1] < 0.01
    assert found.type_ii[2] < 1e-12
    assert np.sign(found.determinant[1]) == np.sign(found.determinant[0])
    assert np.sign(found.determinant[3]) == -np.sign(found.determinant[1])
    with pytest.raises(SingularityError, match="do not determine the task"):
        one.forces_to_actuators(nearer[2], np.ones(one.size))
    across = point_to_point(pose + before, pose - 0.3 * before, duration=1.0)
    (event,) = check_path(quick(name), across, least_steps=60).singularities
    assert (event.kind, event.singularity) == ("crosses", "type II")
    assert worst(event.pose - pose) < 1e-9


#: Of each robot, ends of lines from home that lead through a singularity, and which it is.
THROUGH = [
    ("stewart", {"rx": 1.4}, "type II"),
    # cranks and rods in line
    pytest.param("rotary_stewart", {"z": 0.32}, "type I", marks=pytest.mark.slow),
    ("delta", {"x": -0.42, "y": 0.455, "z": -0.24}, "type II"),  # rods parallel to one plane
    ("delta", {"z": -0.85}, "type I"),  # arms and rods in line
    ("linear_delta", {"x": -0.12}, "type I"),  # a rod is level
    ("rrs", {"rx": 0.6}, "type II"),
    ("planar_rrr", {"x": 0.0783, "y": 0.0076, "rz": 0.75}, "type II"),
    ("five_bar", {"x": 0.163, "z": 0.15}, "type II"),
    ("ankle", {"cross_joint": 1.35}, "type II"),
    ("ankle", {"cross_joint": -0.9}, "type I"),  # a crank and its rod in line
]


def first_singular_share(robot, start, way, kind: str) -> float:
    """Of the closed form: a sign of det(d(drives)/dx), or where its square roots end."""

    def determinant(share: float) -> float:
        with np.errstate(invalid="ignore", divide="ignore"):
            return float(np.linalg.det(robot.gain(start + share * way)))

    shares = np.linspace(0, 1, 101)
    values = np.array([determinant(share) for share in shares])
    if kind == "type II":
        k = int(np.flatnonzero(values[1:] * values[:-1] < 0)[0])
        return brentq(determinant, shares[k], shares[k + 1], xtol=1e-14)
    k = int(np.flatnonzero(~np.isfinite(values))[0])
    low, high = shares[k - 1], shares[k]
    for _ in range(45):
        middle = (low + high) / 2
        low, high = (middle, high) if np.isfinite(determinant(middle)) else (low, middle)
    return float(low)


@pytest.mark.parametrize(("name", "end", "kind"), THROUGH)
def test_a_path_through_a_singularity_is_found_where_the_closed_form_has_it(
    name, end, kind
) -> None:
    one, robot = quick(name), ROBOTS[name]
    start = one.home
    goal = start.copy()
    for coordinate, value in end.items():
        goal[one.coordinates.index(coordinate)] = value
    share = first_singular_share(robot, start, goal - start, kind)
    event = check_path(one, uniform(start, goal), least_steps=60).singularities[0]
    how = "crosses" if kind == "type II" else "ends"
    assert (event.kind, event.singularity) == (how, kind)
    assert event.time == pytest.approx(share, abs=1e-9)
    assert worst(event.pose - (start + share * (goal - start))) < 1e-9


def test_reaches_end_where_bars_are_in_line() -> None:
    """Radii and lengths of the files: a Delta downwards, a linear Delta aside."""
    for name, coordinate, goal, wanted in (
        ("delta", 2, -0.85, -np.sqrt((0.25 + 0.6) ** 2 - (0.2 - 0.06) ** 2)),
        ("linear_delta", 0, -0.12, 0.105 - 0.215),
    ):
        one = quick(name)
        end = one.home
        end[coordinate] = goal
        (event,) = check_path(one, uniform(one.home, end), least_steps=60).singularities
        assert event.kind == "ends"
        assert event.pose[coordinate] == pytest.approx(wanted, abs=1e-9)


@EACH
def test_actuators_have_limits(name) -> None:
    one = task(name)
    model, at = one.mechanism.model, one.mechanism.actuated_indices
    for limit in (model.effortLimit, model.velocityLimit):
        assert (limit[at] > 0).all()
        assert (limit[at] < 1e5).all()
    q = one.mechanism.home
    for polytope in (one.force_polytope(q), one.speed_polytope(q)):
        assert polytope.contains(np.zeros(one.size))
        assert 0 < polytope.ball().radius < 1e4

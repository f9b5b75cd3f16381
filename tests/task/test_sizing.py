"""Sizing of motions of tasks: closed forms, energy, Newton's law, and the 3-RPS's own sheet."""

from __future__ import annotations

import json
import re
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import simpson

from rps_pin import (
    ClosedLoopModel,
    ClosureError,
    InputError,
    RPSRobot,
    SingularityError,
    UnreachableError,
)
from rps_pin.closed_loop import JointEffects
from rps_pin.errors import MechanismError
from rps_pin.rps import ActuatorLimits
from rps_pin.rps import force_causes as closed_causes
from rps_pin.rps import size_motion as closed_size
from rps_pin.task import (
    DriveLimits,
    Payload,
    Task,
    force_causes,
    run_motion,
    size_motion,
    size_trajectory,
)
from rps_pin.trajectories import pose_path
from tests.quick import quick
from tests.reference import stewart
from tests.strategies import random_parameters
from tests.task.paths import swinging, uniform
from tests.task.robots import compiled, task
from tests.task.test_path_check import MASS, REACH, UP, G, W, lift
from tests.worst import worst

FAST = ("ankle", "delta", "five_bar", "stewart")


def swing(one: Task, size: float = 0.05, w: float = 5.0, duration: float = 1.0) -> Any:
    """A motion of all coordinates about the home, which begins and ends in motion."""
    reach = size * np.where(one.angular, 1.0, one.characteristic_length)
    return swinging(one.home, reach * np.cos(1 + np.arange(one.size)), w, duration)


@cache
def damped(name: str) -> Task:
    """A mechanism with damping, friction and springs in all joints."""
    mechanism = ClosedLoopModel.load(f"urdf/{name}.yaml")
    rng = np.random.default_rng(1)
    damping, friction = rng.uniform(0.5, 2.0, size=(2, mechanism.model.nv))
    effects = JointEffects(damping, friction, 0 * damping + 1.3, 0 * damping)
    options = mechanism._options() | {"effects": effects}
    again = ClosedLoopModel(
        mechanism.model, mechanism.closures, mechanism.actuated, home=mechanism.home, **options
    )
    return again.task.compile(compiler="tcc")


# The sheet ----------------------------------------------------------------------------------------


def test_up_and_down_on_three_upright_legs() -> None:
    """One period: F = m/3 (g - A w^2 sin(w t)), d' = A w cos(w t); every figure in closed form."""
    one, period = lift(), 2 * np.pi / W
    sheet = size_trajectory(one, UP, 1500.0 / period, limits=DriveLimits(force=11.0, speed=0.1))
    push = REACH * W**2
    driven = MASS / 3 * G * 2 * REACH
    assert [each.name for each in sheet.actuators] == [f"leg_{i}_prismatic" for i in (1, 2, 3)]
    for each in sheet.actuators:
        assert each.force_peak == pytest.approx(MASS / 3 * (G + push), rel=1e-5)
        assert each.force_peak_time == pytest.approx(0.75 * period, abs=period / 500)
        assert each.force_rms == pytest.approx(MASS / 3 * np.sqrt(G**2 + push**2 / 2), rel=1e-5)
        assert each.speed_peak == pytest.approx(REACH * W, rel=1e-12)
        assert each.energy_driven == pytest.approx(driven, rel=1e-4)
        assert each.energy_regenerated == pytest.approx(driven, rel=1e-4)
        assert each.power_mean == pytest.approx(2 * driven / period, rel=1e-4)
        assert each.stroke == pytest.approx(2 * REACH, rel=1e-4)
        margins = {margin.quantity: margin for margin in each.margins}
        assert margins["force"].margin == pytest.approx(11.0 - MASS / 3 * (G + push), rel=1e-3)
        assert margins["force"].kept and not margins["speed"].kept
    assert not sheet.kept
    assert "BROKEN: speed" in sheet.text(140)
    assert re.search(r" stroke .*\n.* \(m\) ", sheet.text(140))
    # In the width of a terminal no digit and no column is cut off.
    for row in sheet.text(80).splitlines():
        assert len(row) <= 80, row
    for actuator in sheet.actuators:
        assert f"{actuator.force_rms:.4g}" in sheet.text(80)
        assert f"{actuator.stroke:.4g}" in sheet.text(80)
    data = json.loads(json.dumps(sheet.as_dict(), allow_nan=False))
    assert data["actuators"][1]["name"] == "leg_2_prismatic"
    assert data["actuators"][0]["margins"][3]["limit"] is None
    assert {one["name"] for one in data["joints"]} >= {"leg_1_prismatic", "leg_1"}


def test_text_is_returned_in_a_notebook_too(monkeypatch: pytest.MonkeyPatch) -> None:
    sheet = size_trajectory(lift(), UP, 20.0)
    plain = sheet.text(100)
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    assert sheet.text(100) == plain
    assert "leg_1_prismatic" in plain


@pytest.mark.parametrize("seed", quick(range(3), [0]))
def test_the_3_rps_s_sheet_and_causes_come_out_without_closed_forms(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parameters = random_parameters(rng, tilted_gravity=True).replace(
        prismatic_damping=2.0, prismatic_friction=1.0, revolute_damping=0.5, revolute_friction=0.2
    )
    payload = Payload(2.0, [0.02, -0.01, 0.1], np.diag([0.02, 0.03, 0.04]))
    bare = RPSRobot(parameters)
    robot = bare.with_payload(payload)
    one = Task(bare.mechanism, "platform", ["z", "rx", "ry"]).compile(compiler="tcc")
    height = 1.2 * parameters.base_radius
    time = np.linspace(0, 1, 41)
    path = swinging([height, 0.05, 0.1], [0.1 * height, 0.3, -0.2], 4.0, 1.0)
    motion = path.sample(time)
    near = bare.task.configuration(motion.pose[0])
    wrench = [3.0, -2.0, 5.0, 0.4, -0.3, 0.2]
    sheet = size_motion(one, time, *motion, near=near, payload=payload, wrench=wrench)
    closed = closed_size(robot, time, *motion, wrench=wrench)
    size = worst(closed.force)
    assert worst(sheet.force - closed.force) < 1e-9 * size
    assert worst(sheet.speed - closed.speed) < 1e-9
    for mine, other in zip(sheet.actuators, closed.actuators, strict=True):
        for name in ("force_rms", "duty", "energy_driven", "power_mean", "stroke", "length_min"):
            assert getattr(mine, name) == pytest.approx(getattr(other, name), rel=1e-9, abs=1e-9)
    q = sheet.motion.state.q
    parts = force_causes(one, q, *motion[1:], payload=payload, wrench=wrench)
    wanted = closed_causes(robot, *motion, wrench=wrench)
    for name, part in wanted.parts().items():
        assert worst(getattr(parts, name) - part) < 1e-9 * size
    assert worst(parts.springs) == 0
    assert worst(parts.total - sheet.force) < 1e-13 * size


# Energy and Newton's law --------------------------------------------------------------------------


@pytest.mark.parametrize("name", FAST)
def test_the_actuators_work_is_the_change_of_energy(name: str) -> None:
    one = task(name)
    if one.mechanism.effects is not None:
        one = one.mechanism.without_effects().task
    one = one.compile(compiler="tcc")
    motion = run_motion(one, swing(one), 200.0)
    work = simpson(motion.power.sum(axis=-1), x=motion.time)
    q, v, _ = motion.state
    ends = [sum(one.mechanism.energy(q[k], v[k])) for k in (0, -1)]
    size = simpson(np.abs(motion.power).sum(axis=-1), x=motion.time)
    assert work == pytest.approx(ends[1] - ends[0], abs=1e-6 * size)
    assert size > 1e-3


def test_the_balls_of_a_stewart_carry_platform_and_payload() -> None:
    """Newton's law: their forces are m (c'' - g), c and the motion in closed form."""
    one, load = compiled("stewart"), Payload(4.0, [0.1, 0.05, 0.2])
    place = one.home[:3]
    path = pose_path(
        [place, place + np.array([0.05, 0.02, 0.03])], [[0, 0, 0], [0.2, -0.1, 0.3]], duration=0.8
    )
    found = run_motion(one, path, 50.0, payload=load)
    moved = path.motion(found.time)
    w, alpha = moved.angular_velocity, moved.angular_acceleration
    total = np.zeros((len(found.time), 3))
    for mass, centre in (stewart.PLATFORM_BODY[:2], (load.mass, load.centre)):
        arm = moved.rotation @ np.asarray(centre)
        pull = moved.acceleration + np.cross(alpha, arm) + np.cross(w, np.cross(w, arm))
        total += mass * (pull - [0, 0, -9.81])
    balls = sum(found.closure_wrenches[f"ball_{i}"][:, :3] for i in range(1, 7))
    assert worst(balls - total) < 1e-9 * worst(total)
    sheet = size_trajectory(one, path, 50.0, payload=load)
    (first,) = [each for each in sheet.joints if each.name == "ball_1"]
    force = np.linalg.norm(found.closure_wrenches["ball_1"][:, :3], axis=-1)
    assert (first.force_peak, first.kind) == (force.max(), "closure")
    assert first.force_time == found.time[force.argmax()]
    assert "ball_1" in {str(cell) for cell in sheet.joint_table().columns[0].cells}


# Causes -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FAST)
def test_causes_scale_as_their_names_say(name: str) -> None:
    one = damped(name)
    motion = swing(one).sample(np.linspace(0, 1, 6))
    q = one.follow(motion.pose)
    _, rate, push = motion
    at = force_causes(one, q, rate, push)
    size = worst(at.total)
    faster, harder = force_causes(one, q, 2 * rate, push), force_causes(one, q, rate, 3 * push)
    for part, other, factor in (
        (at.coriolis, faster.coriolis, 4), (at.inertia, harder.inertia, 3),
        (at.gravity, harder.gravity, 1), (at.gravity, faster.gravity, 1),
        (at.inertia, faster.inertia, 1), (at.coriolis, harder.coriolis, 1),
        (at.friction, harder.friction, 1), (at.springs, faster.springs, 1),
    ):  # fmt: skip
        assert worst(other - factor * part) < 1e-9 * size
    loaded = [
        one.mechanism.inverse_dynamics(*each).tau
        for each in zip(*one.motion(q, rate, push), strict=True)
    ]
    assert worst(at.total - np.array(loaded)) < 1e-12 * size
    assert worst(at.payload, at.external) == 0
    # Springs are at rest at zero: the work of their torques in each direction of the task.
    for k in range(len(q)):
        moves = np.stack([one.motion(q[k], axis, 0 * axis).v for axis in np.eye(one.size)], axis=-1)
        K = one.jacobian(q[k])
        joints = one.mechanism.model.joints
        if all(joint.nq == joint.nv for joint in list(joints)[1:]):
            bent = one.mechanism.effects.stiffness * q[k]
            assert worst(K.T @ at.springs[k] - moves.T @ bent) < 1e-9 * size


def test_a_wrench_is_borne_as_the_task_says_and_counts_at_the_output_frame() -> None:
    """With an offset: the frame's origin is not the link's."""
    mechanism = ClosedLoopModel.load("urdf/stewart.yaml")
    offset = np.eye(4)
    offset[:3, 3] = [0.1, -0.2, 0.3]
    plain = Task(mechanism, "platform", ["x", "y", "z", "rx", "ry", "rz"], placement=offset)
    one = plain.compile(compiler="tcc")
    motion = swing(one).sample(np.linspace(0, 1, 5))
    q = one.follow(motion.pose)
    wrench = np.random.default_rng(0).normal(size=(5, 6))
    found = force_causes(one, q, *motion[1:], wrench=wrench)
    assert worst(found.external - one.wrench_to_actuators(q, -wrench)) < 1e-11
    point = Payload(2.0)
    held = force_causes(one, q, 0 * motion.rate, 0 * motion.rate, payload=point)
    weight = one.wrench_to_actuators(q, [0, 0, 2.0 * 9.81, 0, 0, 0])
    assert worst(held.payload - weight) < 1e-10


# Bad input ----------------------------------------------------------------------------------------


def test_motions_that_cannot_be_followed_say_when() -> None:
    one = compiled("five_bar")
    with pytest.raises(SingularityError, match=r"cannot be followed: at 1.* crosses a type II"):
        size_trajectory(one, uniform(one.home, [0.21, 0.1], 2.0), 100.0)
    with pytest.raises(SingularityError, match="assembly mode ends in a type I singularity"):
        run_motion(one, uniform(one.home, one.home + 0.3, 2.0), 100.0)
    stewart = compiled("stewart")  # singular at a quarter turn, and out of its legs' reach later
    turn = uniform(stewart.home, [0.0, 0.0, stewart.home[2], 0.0, 0.0, 1.8], 1.0)
    with pytest.raises(SingularityError, match=r"crosses a type II .* rz = 1\.5708 rad"):
        size_trajectory(stewart, turn, 100.0)
    short = lift(leg_length_limits=(0.28, 0.34))
    with pytest.raises(UnreachableError, match=r"'leg_1_prismatic' leaves its upper .* in all"):
        size_trajectory(short, UP, 100.0)
    times, motion = np.linspace(0, 1, 5), UP.sample(np.linspace(0, 1, 5))
    with pytest.raises(ClosureError, match=r"sample 1: .*limit"):
        size_motion(short, times, *motion)


def test_what_is_no_motion_is_refused() -> None:
    one = lift()
    times = np.linspace(0, 1, 5)
    motion = UP.sample(times)
    with pytest.raises(InputError, match="times must increase"):
        size_motion(one, -times, *motion)
    with pytest.raises(InputError, match=r"rate has shape \(4, 3\)"):
        size_motion(one, times, motion.pose, motion.rate[1:], motion.acceleration)
    with pytest.raises(InputError, match="threshold = 2"):
        size_motion(one, times, *motion, threshold=2)
    with pytest.raises(InputError, match="limits of 2 actuators; there are 3"):
        size_motion(one, times, *motion, limits=[DriveLimits(), DriveLimits()])
    with pytest.raises(InputError, match=r"wrench has shape \(4, 6\); it must be \(6,\) or \(5"):
        size_motion(one, times, *motion, wrench=np.zeros((4, 6)))
    with pytest.raises(InputError, match="sample rate = 0"):
        size_trajectory(one, UP, 0)
    with pytest.raises(InputError, match="10000000 are possible"):
        size_trajectory(one, UP, 1e9)
    with pytest.raises(InputError, match="q, rate and acceleration have shapes"):
        force_causes(one, one.mechanism.home, motion.rate, motion.acceleration)
    with pytest.raises(MechanismError, match="no output frame for a payload"):
        run_motion(task("ankle"), UP, payload=Payload(1.0))
    with pytest.raises(InputError, match=r"length limits = \(1, 0\): they must be shortest <"):
        DriveLimits(length=(1, 0))
    assert DriveLimits(length=(-1, 0)).length == (-1, 0)
    with pytest.raises(InputError, match="0 <= shortest"):
        ActuatorLimits(length=(-1, 0))

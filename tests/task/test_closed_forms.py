"""Tasks against the closed forms of robots that have some."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from rps_pin import RPSRobot
from rps_pin.task import Task
from tests.reference import delta, jets, stewart
from tests.reference.parallel import linear_delta, planar_rrr
from tests.task.robots import compiled, poses, task
from tests.worst import worst


def test_stewart_has_the_lengths_of_its_legs() -> None:
    """|p + R b_i - a_i|, by SciPy's rotations; the joint's coordinate is the length."""
    x, _ = poses("stewart")
    turned = Rotation.from_rotvec(x[:, 3:])
    for make in (task, compiled):
        found = make("stewart").to_actuators(x)
        for i, (anchor, ball) in enumerate(zip(stewart.ANCHORS, stewart.BALLS, strict=True)):
            reach = x[:, :3] + turned.apply(ball) - anchor
            assert worst(found[:, i] - np.linalg.norm(reach, axis=1)) < 1e-12


def test_stewart_forces_are_those_along_its_legs() -> None:
    """A wrench on the platform is the sum of forces along the legs at their balls."""
    one, (x, q) = task("stewart"), poses("stewart")
    rng = np.random.default_rng(1)
    wrench = rng.normal(size=(len(x), 6))
    tau = one.wrench_to_actuators(q, wrench)
    for pose, w, forces in zip(x, wrench, tau, strict=True):
        turn = Rotation.from_rotvec(pose[3:])
        total = np.zeros(6)
        for anchor, ball, f in zip(stewart.ANCHORS, stewart.BALLS, forces, strict=True):
            arm = turn.apply(ball)
            leg = pose[:3] + arm - anchor
            push = f * leg / np.linalg.norm(leg)
            total += np.concatenate([push, np.cross(arm, push)])
        assert worst(total - w) < 1e-11


def test_delta_has_the_angles_of_its_arms() -> None:
    x, _ = poses("delta")
    for name in ("delta", "delta_rods"):
        found = task(name).to_actuators(x)
        for pose, angles in zip(x, found, strict=True):
            assert worst(angles - np.ravel(delta.angles(jets.constant(pose)).value)) < 1e-11


def test_three_rps_has_its_closed_forms() -> None:
    """Legs, their rates, states and forces of `RPSRobot`, without the closed forms."""
    rng = np.random.default_rng(3)
    for preset in ("sokolov", "micro"):
        robot = RPSRobot.from_preset(preset)
        one = Task(robot.mechanism, "platform", ["z", "rx", "ry"])
        height = one.home[0]
        for _ in range(10):
            pose = np.array([height * rng.uniform(0.97, 1.03), *rng.uniform(-0.05, 0.05, 2)])
            rate, acceleration = rng.normal(size=(2, 3)) * [height, 1, 1]
            q = one.configuration(pose)
            assert worst(one.to_actuators(pose) - robot.inverse_kinematics(pose).length) < 1e-12
            found, wanted = one.motion(q, rate, acceleration), robot.state(pose, rate, acceleration)
            for part, expected in zip(found, wanted, strict=True):
                assert worst(part - expected) < 1e-9 * (1 + worst(expected))
            tau = robot.mechanism.inverse_dynamics(*found).tau
            closed_form = robot.actuator_forces(pose, rate, acceleration)
            assert worst(tau - closed_form) < 1e-9 * worst(closed_form)


def test_the_robot_is_a_task_whose_closed_forms_are_the_generic_numbers() -> None:
    """To 1e-9, without the closed forms; singularity measures have zeros in common only."""
    for preset in ("sokolov", "micro"):
        robot = RPSRobot.from_preset(preset)
        generic = Task(robot.mechanism, "platform", ["z", "rx", "ry"])
        x, q = poses(preset)
        motion = (x, *np.random.default_rng(2).normal(size=(2, *x.shape)))
        one, rate = robot.task, motion[1]
        assert isinstance(one, Task)
        assert one.coordinates == generic.coordinates
        pairs = [
            (one.to_actuators(x), generic.to_actuators(x)),
            (one.configuration(x), generic.configuration(x)),
            (one.to_task(one.to_actuators(x), q), x),
            (one.jacobian(q), generic.jacobian(q)),
            (one.hessian(q), generic.hessian(q)),
            *zip(one.state(*motion), generic.state(*motion), strict=True),
            (one.forces_to_actuators(q, rate), generic.forces_to_actuators(q, rate)),
            (one.mass_matrix(q), generic.mass_matrix(q)),
            [np.sign(each.singularities(q).determinant) for each in (one, generic)],
        ]
        for found, expected in pairs:
            assert worst(found - expected) < 1e-9 * worst(expected, 1)


def test_planar_three_rrr_has_its_six_assembly_modes() -> None:
    """The roots of a polynomial of degree six; some arms have six real ones, others two."""
    one = task("planar_rrr")
    for arms, count in (([-2.18, 2.93, 2.42], 6), ([-2.7, 2.1, -2.7], 6), ([1.7, 1.9, 1.8], 2)):
        exact = planar_rrr.poses(np.array(arms))
        found = one.at(one.mechanism.assembly_modes(arms).q)
        assert len(found) == len(exact) == count
        apart = np.linalg.norm(found[:, None] - exact, axis=2)
        assert worst(apart.min(axis=0), apart.min(axis=1)) < 1e-9


def test_linear_delta_has_its_two_assembly_modes() -> None:
    """Those where three spheres meet: of all that a free platform has, two are only moved."""
    one, carriages = task("linear_delta"), [0.3, 0.32, 0.29]
    modes = one.mechanism.assembly_modes(carriages).q
    turned = np.array([one.mechanism.frame_placement(q, "platform")[:3, :3] for q in modes])
    moved = np.abs(turned - np.eye(3)).max(axis=(1, 2)) < 1e-9
    found, exact = one.at(modes[moved]), linear_delta.platform_positions(np.array(carriages))
    assert len(found) == 2
    apart = np.linalg.norm(found[:, None] - exact, axis=2)
    assert worst(apart.min(axis=0), apart.min(axis=1)) < 1e-12
    assert worst(one.to_task(carriages) - exact[np.argmin(exact[:, 2])]) < 1e-12  # from home

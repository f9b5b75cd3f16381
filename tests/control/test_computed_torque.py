"""Computed torque: the robot's own forward dynamics obeys the command; errors decay as placed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import RPSParameters, RPSRobot
from rps_pin.control import ComputedTorque, Gains, Status
from rps_pin.control.loop.controller import Space
from rps_pin.rps.dynamics.loads import Payload
from tests import strategies

pytestmark = pytest.mark.usefixtures("both_engines")
Array = NDArray[np.float64]


def robots() -> list[RPSRobot]:
    rng = np.random.default_rng(1)
    found = []
    for k in range(8):
        p = strategies.random_parameters(rng, tilted_gravity=True, heavy_rods=bool(k % 2))
        p = p.replace(prismatic_damping=3.0, revolute_damping=0.2) if k % 3 == 0 else p
        load = Payload(2.0, [0.1, -0.05, 0.2], np.diag([0.02, 0.03, 0.04])) if k % 2 else None
        found.append(RPSRobot(p, load))
    return found


@pytest.mark.parametrize("space", ["task", "actuator"])
def test_forward_dynamics_obeys_the_command(space: Space) -> None:
    rng = np.random.default_rng(2)
    checked = 0
    for robot in robots():
        p = robot.parameters
        rows = list(zip(*strategies.random_motions(rng, p, 40), strict=True))
        for now, goal in zip(rows[::2], rows[1::2], strict=True):
            gains = Gains(rng.uniform(10, 90, 3), rng.uniform(1, 9, 3), rng.uniform(0, 9, 3))
            q, v, _ = robot.state(now[0], now[1], np.zeros(3))
            try:
                controller = ComputedTorque(robot, now[0], gains, space=space, near_singular=0.1)
            except ArithmeticError:  # too near a singularity
                continue
            target_q, target_v, target_a = robot.state(*goal)
            status = controller.tick(q[[1, 3, 5]], goal, v[[1, 3, 5]])
            if status & Status.TARGET_HELD:
                continue
            a = robot.mechanism.forward_dynamics(q, v, controller.forces)
            if space == "task":
                e, de, feed = goal[0] - now[0], goal[1] - now[1], goal[2]
            else:
                legs = [1, 3, 5]
                e, de, feed = (target_q - q)[legs], (target_v - v)[legs], target_a[legs]
            kp, kd, ki = (np.array(row) for row in gains.rows)
            u = feed + kd * de + kp * e + ki * e * controller.period
            if space == "task":
                wanted = robot.state(now[0], now[1], u)[2]
                np.testing.assert_allclose(a, wanted, rtol=0, atol=1e-7 * np.abs(wanted).max())
            else:
                np.testing.assert_allclose(a[legs], u, rtol=0, atol=1e-7 * np.abs(a).max())
            checked += 1
    assert checked > 60


@pytest.mark.parametrize("space", ["task", "actuator"])
def test_an_error_decays_as_its_poles_say(space: Space) -> None:
    """Critically damped: e = e_0 (1 + w t) exp(-w t), while inertia and weight are known."""
    robot = RPSRobot(RPSParameters.from_preset("micro").replace(actuator_speed_limit=math.inf))
    start, goal = np.array([0.222, 0.05, -0.03]), np.array([0.225, -0.04, 0.06])
    w, period, still = 2 * np.pi * 5.0, 1e-4, np.zeros(3)
    controller = ComputedTorque(robot, start, Gains.placed(5.0), space=space, period=period)

    def control(_: float, q: Array, v: Array) -> Array:
        controller.tick(q[[1, 3, 5]], (goal, still, still), v[[1, 3, 5]])
        return controller.forces

    q = robot.state(start, still, still)[0]
    motion = robot.mechanism.simulate(
        q, duration=0.15, step=period, controller=control, record_every=50
    )
    decay = (1 + w * motion.time) * np.exp(-w * motion.time)
    if space == "actuator":
        lengths = robot.inverse_kinematics(np.array([start, goal])).length
        expected = lengths[1] + decay[:, None] * (lengths[0] - lengths[1])
        found, size = motion.q[:, [1, 3, 5]], np.abs(lengths[1] - lengths[0]).max()
    else:
        expected = goal + decay[:, None] * (start - goal)
        found = robot.forward_kinematics(motion.q[:, [1, 3, 5]], start)
        size = np.abs(goal - start).max()
    # Forces are held for a period: the loop lags by half of one, w T / 2 = 0.0016 of its time.
    assert np.abs(found - expected).max() < 2 * w * period * size / 2


def test_a_target_s_acceleration_leaves_no_lag_of_the_filter() -> None:
    """Filtered speeds lag; the target's go through the same filter, so that the error stays."""
    robot = RPSRobot.from_preset("micro")
    w, size = 2 * np.pi * 2.0, np.array([0.004, 0.05, 0.04])
    middle, gains = np.array([0.224, 0.0, 0.0]), Gains.placed(10.0)

    def target(t: float) -> tuple[Array, Array, Array]:
        x = np.sin(w * t) ** 3
        dx = 3 * w * np.sin(w * t) ** 2 * np.cos(w * t)
        ddx = w**2 * (6 * np.sin(w * t) * np.cos(w * t) ** 2 - 3 * np.sin(w * t) ** 3)
        return middle + size * x, size * dx, size * ddx

    worst = {}
    for measured in (True, False):
        controller = ComputedTorque(robot, middle, gains, cut_off=40.0)

        def control(t: float, q: Array, v: Array) -> Array:
            speed = v[[1, 3, 5]] if measured else None  # noqa: B023
            controller.tick(q[[1, 3, 5]], target(t), speed)  # noqa: B023
            return controller.forces  # noqa: B023

        q = robot.state(middle, np.zeros(3), np.zeros(3))[0]
        motion = robot.mechanism.simulate(q, duration=1.0, step=1e-3, controller=control)
        wanted = robot.inverse_kinematics(
            np.array([target(t)[0] for t in motion.time]), errors="mask"
        ).length
        worst[measured] = np.abs(motion.q[:, [1, 3, 5]] - wanted).max()
    acceleration = (size[0] + 0.12 * 0.064) * 3 * w**2  # of a leg, at most
    lag = 1 / (2 * np.pi * 40.0)
    unmatched = gains.rows[1][0] * lag * acceleration / gains.rows[0][0]
    assert worst[False] < unmatched / 20
    assert worst[False] < 2 * worst[True] + 1e-6

"""PD control: its formula by the library's own calls, rest on the target, power in task space."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, RPSRobot
from rps_pin.control import Gains, PDControl, Status, effective_inertia
from rps_pin.control.loop.controller import Space
from rps_pin.control.loop.pd_control import Compensation
from rps_pin.rps.kinematics.rates import leg_jacobians
from tests import strategies

pytestmark = pytest.mark.usefixtures("both_engines")
Array = NDArray[np.float64]
LEGS = [1, 3, 5]


@pytest.mark.parametrize("space", ["actuator", "task"])
@pytest.mark.parametrize("compensation", ["gravity", "feed_forward", "none"])
def test_forces_are_the_formula_s(space: Space, compensation: Compensation) -> None:
    rng, still = np.random.default_rng(3), np.zeros(3)
    checked = 0
    for k in range(6):
        p = strategies.random_parameters(rng, tilted_gravity=True, heavy_rods=bool(k % 2))
        robot = RPSRobot(p.replace(prismatic_damping=2.0) if k == 0 else p)
        rows = list(zip(*strategies.random_motions(rng, p, 30), strict=True))
        for now, goal in zip(rows[::2], rows[1::2], strict=True):
            gains = Gains(rng.uniform(10, 90, 3), rng.uniform(1, 9, 3), rng.uniform(0, 9, 3))
            try:
                controller = PDControl(
                    robot,
                    now[0],
                    gains,
                    space=space,
                    compensation=compensation,
                    near_singular=0.1,
                )
            except ArithmeticError:
                continue
            q, v, _ = robot.state(now[0], now[1], still)
            if controller.tick(q[LEGS], goal, v[LEGS]) & Status.TARGET_HELD:
                continue
            target_q, target_v, target_a = robot.state(*goal)
            base = still
            if compensation == "gravity":
                base = robot.inverse_dynamics(q, 0 * v, 0 * v).tau
            elif compensation == "feed_forward":
                base = robot.inverse_dynamics(target_q, target_v, target_a).tau
            kp, kd, ki = (np.array(row) for row in gains.rows)
            if space == "actuator":
                e, de = (target_q - q)[LEGS], (target_v - v)[LEGS]
                added = kp * e + kd * de + ki * e * controller.period
            else:
                e, de = goal[0] - now[0], goal[1] - now[1]
                wrench = kp * e + kd * de + ki * e * controller.period
                by_pose = leg_jacobians(p, now[0]).length_jacobian
                added = np.linalg.solve(by_pose.T, wrench)
            size = np.abs(base).max() + np.abs(added).max()
            np.testing.assert_allclose(
                controller.forces, base + added, rtol=0, atol=1e-8 * max(size, 1.0)
            )
            checked += 1
    assert checked > 30


@pytest.mark.parametrize("space", ["actuator", "task"])
def test_it_comes_to_rest_on_its_target(space: Space) -> None:
    """With its weight known, and without integral (Takegaki and Arimoto)."""
    robot, still = RPSRobot.from_preset("micro"), np.zeros(3)
    start, goal = np.array([0.222, 0.05, -0.03]), np.array([0.224, 0.02, 0.01])
    gains = Gains.placed(8.0).times(effective_inertia(robot, start, space=space))
    controller = PDControl(robot, start, gains, space=space)

    def control(_: float, q: Array, v: Array) -> Array:
        controller.tick(q[LEGS], (goal, still, still))
        return controller.forces

    q = robot.state(start, still, still)[0]
    motion = robot.mechanism.simulate(q, duration=1.5, step=1e-3, controller=control)
    length = robot.inverse_kinematics(goal).length
    np.testing.assert_allclose(motion.q[-1, LEGS], length, rtol=0, atol=1e-9)
    assert np.abs(motion.v[-1]).max() < 1e-7


def test_unknown_compensation_is_refused() -> None:
    robot = RPSRobot.from_preset("micro")
    with pytest.raises(InputError, match="compensation = 'weight'"):
        PDControl(robot, [0.22, 0, 0], Gains(1.0, 1.0), compensation="weight")  # type: ignore[arg-type]

"""Computed torque follows the helix at least ten times better than PD of the same stiffness."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import RPSRobot, helix
from rps_pin.control import (
    ComputedTorque,
    Controller,
    Encoders,
    Gains,
    LoopRun,
    PDControl,
    Plant,
    effective_inertia,
    run_loop,
    wrong_parameters,
)
from tests.quick import quick

BANDWIDTH, SETTLE = 15.0, 0.6


def errors(run: LoopRun, h: float) -> tuple[float, float]:
    """Return the RMS errors of the centre (m) and of the orientation (rad), from rotations."""

    def placement(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y = pose[:, 1], pose[:, 2]
        size = np.maximum(np.hypot(x, y), 1e-12)
        bend = h * (1 - np.cos(size)) / (2 * size**2)
        centre = np.stack([bend * (x * x - y * y), -2 * bend * x * y, pose[:, 0]], axis=-1)
        half = np.sin(size / 2) / size
        return centre, np.stack([x * half, y * half, np.cos(size / 2)], axis=-1)

    here = run.time >= SETTLE
    (centre, turn), (wanted, other) = placement(run.pose[here]), placement(run.target[here])
    apart = np.linalg.norm(centre - wanted, axis=1)
    # The angle between two quaternions (x, y, 0, w): sine by the chord, exact where it is small.
    chord = np.linalg.norm(turn - other, axis=1)
    angle = 4 * np.arcsin(np.minimum(chord / 2, 1.0))
    return float(np.sqrt(np.mean(apart**2))), float(np.sqrt(np.mean(angle**2)))


CASES = ["as believed", "all wrong, friction known to 20 %"]


@pytest.mark.parametrize("case", quick(CASES, CASES[1:]))
def test_at_least_tenfold(case: str) -> None:
    robot = RPSRobot.from_preset("micro")
    path = helix(robot, radius=0.5e-3, pitch=0.33e-3, height=0.223, duration=1.0)
    start = path.sample(0.0).pose
    believed, machine, faults = robot, robot, {}
    if case != "as believed":
        rubs = {"prismatic_friction": 0.5, "prismatic_damping": 5.0}
        believed = RPSRobot(wrong_parameters(robot.parameters, **rubs))
        more = {name: 1.2 * value for name, value in rubs.items()}
        machine = RPSRobot(wrong_parameters(robot.parameters, masses=1.2, **more))
        faults = {"delay": 1, "encoders": Encoders(resolution=50e-9, noise=20e-9)}
    # The same stiffness at the start: the inertia there times the same acceleration per error.
    pd = Gains.placed(BANDWIDTH).times(effective_inertia(believed, start))
    laws: dict[str, Controller] = {
        "pd": PDControl(believed, start, pd),
        "ct": ComputedTorque(believed, start, Gains.placed(BANDWIDTH, integral=0.2)),
    }
    h = robot.parameters.platform_radius
    found = {
        name: errors(run_loop(law, Plant(machine, start, **faults), path, settle=SETTLE), h)
        for name, law in laws.items()
    }
    assert found["pd"][0] > 10 * found["ct"][0]
    assert found["pd"][1] > 10 * found["ct"][1]

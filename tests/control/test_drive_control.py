"""Commands of drives that take positions or speeds: closed forms, promises, scenarios."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rps_pin import RPSRobot
from rps_pin.control import (
    DriveControl,
    Encoders,
    Gains,
    Plant,
    ServoDrives,
    Status,
    load_scenario,
    run_loop,
    write_loop_csv,
)
from rps_pin.errors import InputError
from tests.control.float_ticks import SPECIAL_NUMBERS
from tests.control.tasks import ROBOT, plain, start

HERE = Path(__file__).resolve().parents[2]
BANDWIDTH, PERIOD = 20.0, 1e-3
ROBOTS = {"delta": plain("delta"), "rps": ROBOT, "ankle": plain("ankle")}


def moved(name: str, size: float) -> Any:
    return start(name) + size * np.where(
        plain(name).angular, 1.0, plain(name).characteristic_length
    )


@pytest.mark.parametrize("name", ["rps", "ankle"])
def test_positions_lag_by_the_drives_response(name: str) -> None:
    """A ramp of a drive of order 2 with damping 1 lags by 2 zeta / w times its speed."""
    robot, speed = ROBOTS[name], 0.02
    drives = ServoDrives("position", bandwidth=BANDWIDTH)
    one = DriveControl(robot, start(name), period=PERIOD, compiled=False)
    plant = Plant(robot, start(name), period=PERIOD, drives=drives)
    task, size = plain(name), plain(name).size
    by = speed * np.where(task.angular, 1.0, 0.2)
    for k in range(120):
        target = start(name) + by * k * PERIOD, by, np.zeros(size)
        assert one.tick(plant.reading(), target) == Status.OK
        np.testing.assert_allclose(one.forces, task.to_actuators(target[0]), atol=1e-9)
        plant.step(one.forces)
    q = task.configuration(target[0])
    rate = task.jacobian(q) @ by
    lag = 2 / (2 * math.pi * BANDWIDTH) * rate
    late = task.to_actuators(target[0]) - (plant.length - rate * PERIOD)
    np.testing.assert_allclose(late, lag, rtol=0.02, atol=0.02 * np.abs(lag).max())


@pytest.mark.parametrize("name", ["rps", "delta"])
def test_speeds_with_a_gain_take_errors_away(name: str) -> None:
    """e' = -Kp e of drives much faster than that; without it the error stays."""
    robot, gain = ROBOTS[name], 10.0
    drives = ServoDrives("speed", bandwidth=200.0)
    left = []
    for gains in (Gains(gain, 0.0), None):
        one = DriveControl(robot, start(name), gains, command="speed", compiled=False)
        plant = Plant(robot, start(name), drives=drives)
        still = np.zeros(plant.pose.size)
        goal = moved(name, 2e-3)
        first = np.abs(plain(name).to_actuators(goal) - plant.length)
        for _ in range(150):
            assert one.tick(plant.reading(), (goal, still, still)) == Status.OK
            plant.step(one.forces)
        left.append(np.abs(plain(name).to_actuators(goal) - plant.length) / first)
    np.testing.assert_allclose(left[0], math.exp(-gain * 0.15), rtol=0.05)
    np.testing.assert_allclose(left[1], 1.0, rtol=1e-6)


@pytest.mark.parametrize("command", ["position", "speed"])
@pytest.mark.parametrize("name", ["rps", "ankle"])
def test_commands_are_finite_and_hold_where_readings_or_targets_fail(
    name: str, command: str
) -> None:
    gains = Gains(10.0, 0.0) if command == "speed" else None
    one = DriveControl(ROBOTS[name], start(name), gains, command=command)
    reading = plain(name).to_actuators(start(name))
    rest = reading if command == "position" else 0 * reading
    still, far = np.zeros(start(name).size), start(name) + 40.0
    with np.errstate(all="raise"):
        assert one.tick(reading) == Status.OK
        assert one.tick(reading, (far, still, still)) == Status.TARGET_HELD
        np.testing.assert_allclose(one.forces, rest, atol=1e-9)
        for value in SPECIAL_NUMBERS:
            one.tick([value] * len(reading), ([value] * len(still),) * 3, [value] * len(reading))
            one.tick(reading, ([value] * len(still),) * 3, dt=value)
            assert np.isfinite(one.forces).all()
        for _ in range(4):
            status = one.tick(None)
        assert status & Status.STOPPED
        np.testing.assert_allclose(one.forces, rest, atol=1e-9)
        assert one.tick(reading) & Status.STOPPED
        np.testing.assert_allclose(one.forces, rest, atol=1e-9)


def test_what_does_not_go_together_is_refused() -> None:
    near = start("rps")
    for options, words in (
        ({"gains": Gains(1.0, 0.0)}, "gains are for drives that take speeds"),
        ({"command": "torque"}, "command"),
        ({"space": "task"}, "space is not for drives"),
        ({"force_limit": 3.0}, "force_limit is not for drives"),
    ):
        with pytest.raises(InputError, match=words):
            DriveControl(ROBOT, near, **options)


# Scenarios ----------------------------------------------------------------------------------------

RPS = """\
robot: micro
trajectory: {kind: helix, radius: 0.0005, pitch: 0.00033, height: 0.223, duration: 0.4}
controller: {law: drives}
plant: {drives: {bandwidth: 60.0, damping: 0.8, speed_limit: 0.1}}
settle: 0.01
"""
ANKLE = f"""\
mechanism: {HERE}/urdf/ankle.yaml
trajectory: {{kind: point_to_point, start: [0.0, 0.0], end: [0.05, -0.03], duration: 0.05}}
controller: {{law: drives, bandwidth: 3.0}}
plant: {{drives: {{command: speed, bandwidth: 60.0}}, encoder_resolution: 1.0e-6}}
settle: 0.01
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "scenario.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(("text", "unit"), [(RPS, "m"), (ANKLE, "rad_per_s")])
def test_a_scenario_of_drives_runs_and_is_the_loop_written_by_hand(
    tmp_path: Path, text: str, unit: str
) -> None:
    scenario = load_scenario(written(tmp_path, text))
    run = scenario.run()
    assert set(run.status.tolist()) == {0}
    path = scenario.trajectory
    if text is RPS:
        robot: Any = RPSRobot.from_preset("micro")
        plant = Plant(robot, path.sample(0.0).pose, drives=ServoDrives("position", 60.0, 0.8, 0.1))
        one = DriveControl(robot, path.sample(0.0).pose)
    else:
        robot = plain("ankle")
        drives, exact = ServoDrives("speed", 60.0), Encoders(1e-6)
        plant = Plant(robot, path.sample(0.0).pose, drives=drives, encoders=exact)
        one = DriveControl(robot, path.sample(0.0).pose, Gains(6 * math.pi, 0.0), command="speed")
    again = run_loop(one, plant, path, settle=0.01)
    np.testing.assert_allclose(again.pose, run.pose, rtol=0, atol=1e-9)
    assert np.abs(run.pose[-1] - path.sample(path.duration).pose).max() < 0.01
    assert "the loops are those of the drives" in refusal(scenario.margins)
    write_loop_csv(tmp_path / "loop.csv", run)
    with (tmp_path / "loop.csv").open() as file:
        head = next(csv.reader(file))
    commands = [name for name in head if name.startswith("command")]
    assert commands and all(name.endswith(f"_{unit}") for name in commands)


def refusal(call: Any) -> str:
    with pytest.raises(InputError) as caught:
        call()
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "old", "new", "words"),
    [
        (RPS, "law: drives", "bandwidth: 15.0", "line 4: drives take positions"),
        (RPS, "plant: {drives", "plant: {masses: 1.1} #", "line 3: law: drives is"),
        (RPS, "law: drives", "law: drives, bandwidth: 1.0", "line 3: bandwidth is for drives that"),
        (RPS, "law: drives", "law: drives, space: task", "line 3: .*space is not for law: drives"),
        (RPS, "damping: 0.8", "damping: 0.0", "line 4: plant.drives.damping = 0.0"),
        (RPS, "bandwidth: 60.0", "band: 60.0", "line 4: unknown key 'band'"),
        (RPS, "bandwidth: 60.0", "command: force", "line 4: plant.drives.command = 'force'"),
        (ANKLE, "command: speed", "command: speed, damping: 1.0", "line 4: .*damping is that of"),
        (ANKLE, "bandwidth: 3.0", "integral: 3.0", "line 3: .*integral is not for law: drives"),
        (RPS, "robot: micro", "robot: nano", "line 1: 'nano' is not a file or a preset"),
        (ANKLE, "ankle.yaml", "ankles.yaml", "line 1: mechanism = .*no such file"),
    ],
)
def test_scenarios_that_do_not_fit_are_refused_with_the_line(
    tmp_path: Path, text: str, old: str, new: str, words: str
) -> None:
    assert old in text
    path = written(tmp_path, text.replace(old, new))
    with pytest.raises(InputError, match=words):
        load_scenario(path)

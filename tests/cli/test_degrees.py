"""``--degrees`` of ``rps-pin check`` and ``dynamics``: all angles, and nothing else."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from rps_pin.task import load_task_trajectory
from tests.cli.commands import rps_pin
from tests.task import robots
from tests.worst import worst

#: A turn of a Stewart platform that breaks limits of its legs, and an arm of a Delta that turns.
STEWART = "kind: point_to_point\nend: {z: 0.7, rx: 1.2}\nduration: 0.4\n"
DELTA = "kind: point_to_point\nend: {x: 0.1, z: -0.48}\nduration: 0.5\n"
TURN = math.degrees(1.0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "turn.yaml").write_text(STEWART)
    (tmp_path / "move.yaml").write_text(DELTA)
    return tmp_path


def both(folder: Path, *words: str) -> tuple[dict, dict]:
    """What is answered without the option, and with it."""
    first, second = (
        json.loads(rps_pin(*words, *more, "--json", folder=folder).stdout)
        for more in ((), ("--degrees",))
    )
    return first, second


def test_events_of_a_check(folder: Path) -> None:
    plain, turned = both(folder, "check", "turn.yaml", "-m", "stewart")
    assert plain["units"] == {"length": "m", "angle": "rad"}
    assert turned["units"] == {"length": "m", "angle": "deg"}
    assert plain["limits"]
    factors = np.array([1, 1, 1, TURN, TURN, TURN])
    assert worst(np.array(turned["minimum_pose"]) - factors * plain["minimum_pose"]) < 1e-9
    for one, other in zip(plain["limits"], turned["limits"], strict=True):
        assert worst(np.array(other["pose"]) - factors * one["pose"]) < 1e-9
        angle = one["unit"].startswith("rad")
        assert other["unit"] == one["unit"].replace("rad", "deg")
        assert other["limit"] == pytest.approx(one["limit"] * (TURN if angle else 1.0))
        assert one["time"] == other["time"]
    told = rps_pin("check", "turn.yaml", "-m", "stewart", "--degrees", folder=folder).stdout
    assert "rad" not in told


def test_limits_of_joints_that_turn(folder: Path) -> None:
    (folder / "wide.yaml").write_text("kind: point_to_point\nend: {z: -0.75}\nduration: 0.02\n")
    plain, turned = both(folder, "check", "wide.yaml", "-m", "delta")
    speeds = [one for one in plain["limits"] if one["unit"] == "rad/s"]
    assert speeds
    other = [one for one in turned["limits"] if one["unit"] == "deg/s"]
    for one, two in zip(speeds, other, strict=True):
        assert two["limit"] == pytest.approx(TURN * one["limit"])


def test_tables_and_sheets_of_dynamics(folder: Path) -> None:
    words = "dynamics", "move.yaml", "-m", "delta", "--rate", "100", "-o", "out", "--overwrite"
    plain = json.loads(rps_pin(*words, "--json", folder=folder).stdout)
    rows = np.genfromtxt(folder / "out" / "dynamics.csv", delimiter=",", names=True)
    turned = json.loads(rps_pin(*words, "--json", "--degrees", folder=folder).stdout)
    table = np.genfromtxt(folder / "out" / "dynamics.csv", delimiter=",", names=True)
    assert (plain["units"]["angle"], turned["units"]["angle"]) == ("rad", "deg")
    changed = 0
    for name in rows.dtype.names:
        now = name.replace("_rad", "_deg")
        factor = TURN if now != name else 1.0
        changed += now != name
        assert worst(table[now] - factor * rows[name]) < 1e-9 * max(1.0, worst(table[now]))
    assert changed == 6  # positions and speeds of three arms
    for one, other in zip(plain["sizing"]["actuators"], turned["sizing"]["actuators"], strict=True):
        assert (one["angle_unit"], other["angle_unit"]) == ("rad", "deg")
        for key in ("speed_peak", "length_min", "length_max", "stroke"):
            assert other[key] == pytest.approx(TURN * one[key])
        for key in ("force_peak", "power_peak", "energy_driven", "duty"):
            assert other[key] == one[key]
        for margin, more in zip(one["margins"], other["margins"], strict=True):
            assert more["unit"] == margin["unit"].replace("rad", "deg")
            if margin["limit"] is not None and "rad" in margin["unit"]:
                assert more["margin"] == pytest.approx(TURN * margin["margin"])
    # The table is a trajectory again.
    task = robots.task("delta")
    again = load_task_trajectory(folder / "out" / "dynamics.csv", task)
    path = load_task_trajectory(folder / "move.yaml", task)
    assert worst(again.sample(0.25).pose - path.sample(0.25).pose) < 1e-9


def test_units_are_told_and_drawn(folder: Path) -> None:
    words = "dynamics", "move.yaml", "-m", "delta", "--rate", "50", "-o", "out", "--degrees"
    told = rps_pin(*words, folder=folder, COLUMNS="200").stdout
    assert re.search(r"peak force .* peak speed .*\n.*\(N m\) .* \(deg/s\) ", told)
    assert re.search(r" stroke .*\n.* \(deg\) ", told)
    assert "(rad" not in told
    assert "deg/s" in (folder / "out" / "force_over_speed.svg").read_text()


def test_coordinates_that_turn_have_it_in_the_header(folder: Path) -> None:
    (folder / "tilt.yaml").write_text("kind: point_to_point\nend: {rx: 0.1}\nduration: 1\n")
    words = "dynamics", "tilt.yaml", "-m", "stewart", "--rate", "20", "-o", "out", "--degrees"
    assert rps_pin(*words, folder=folder).returncode == 0
    table = np.genfromtxt(folder / "out" / "dynamics.csv", delimiter=",", names=True)
    for name in ("rx_deg", "rx_rate_deg_per_s", "rx_acceleration_deg_per_s2", "z_m"):
        assert name in table.dtype.names
    assert table["rx_deg"][-1] == pytest.approx(TURN * 0.1)
    again = load_task_trajectory(folder / "out" / "dynamics.csv", robots.task("stewart"))
    assert again.sample(1.0).pose[3] == pytest.approx(0.1)


@pytest.mark.parametrize("words", [("check",), ("dynamics", "move.yaml")])
def test_a_3_rps_has_radians(folder: Path, words: tuple[str, ...]) -> None:
    done = rps_pin(*words, "--degrees", folder=folder)
    assert done.returncode == 2
    assert "this option needs a --mechanism" in " ".join(done.stderr.split())

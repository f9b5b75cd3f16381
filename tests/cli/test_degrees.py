"""``--degrees`` of the commands: all angles, and nothing else."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from rps_pin import RPSRobot
from rps_pin.cli.degrees import words_in_degrees
from rps_pin.rps.motion.trajectory_file import load_trajectory
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


CIRCLE = "kind: circle\nheight: 0.223\ntilt: {}\nduration: 0.1\n"


def test_a_check_of_a_3_rps(folder: Path) -> None:
    (folder / "wide.yaml").write_text(CIRCLE.format(1.0))
    plain, turned = both(folder, "check", "wide.yaml", "-r", "micro")
    assert (plain["units"]["angle"], turned["units"]["angle"]) == ("rad", "deg")
    factors = np.array([1, TURN, TURN])
    assert worst(np.array(turned["minimum_pose"]) - factors * plain["minimum_pose"]) < 1e-9
    changed = 0
    for one, other in zip(plain["limits"], turned["limits"], strict=True):
        assert worst(np.array(other["pose"]) - factors * one["pose"]) < 1e-9
        angle = one["unit"] == "rad"
        changed += angle
        assert other["unit"] == ("deg" if angle else one["unit"])
        assert other["limit"] == pytest.approx(one["limit"] * (TURN if angle else 1.0))
    assert changed > 2
    told = rps_pin("check", "--radius", "0.075", "--pitch", "0.05", "--degrees", folder=folder)
    where = re.findall(r"crosses a type II.*tilt = \(([^,]+), ([^)]+)\) deg", told.stdout)
    plain = json.loads(
        rps_pin("check", "--radius", "0.075", "--pitch", "0.05", "--json", folder=folder).stdout
    )
    poses = [one["pose"][1:] for one in plain["singularities"] if one["kind"] == "crosses"]
    assert where and "rad" not in told.stdout
    np.testing.assert_allclose(np.array(where, float), np.degrees(poses), rtol=1e-5, atol=1e-6)


def test_the_dynamics_of_a_3_rps(folder: Path) -> None:
    (folder / "circle.yaml").write_text(CIRCLE.format(0.1))
    words = "dynamics", "circle.yaml", "-r", "micro", "--rate", "100", "-o", "out", "--overwrite"
    plain = json.loads(rps_pin(*words, "--json", folder=folder).stdout)
    rows = np.genfromtxt(folder / "out" / "dynamics.csv", delimiter=",", names=True)
    turned = json.loads(rps_pin(*words, "--json", "--degrees", folder=folder).stdout)
    table = np.genfromtxt(folder / "out" / "dynamics.csv", delimiter=",", names=True)
    z, *tilts = plain["minimum_pose"]
    np.testing.assert_allclose(turned["minimum_pose"], [z, *np.degrees(tilts)])
    names = [name.replace("_rad", "_deg") for name in rows.dtype.names]
    assert tuple(names) == table.dtype.names
    assert sum("_deg" in name for name in names) == 6  # tilts, rates, accelerations
    for old, new in zip(rows.dtype.names, names, strict=True):
        factor = TURN if old != new else 1.0
        np.testing.assert_allclose(table[new], factor * rows[old], rtol=1e-12)
    robot = RPSRobot.from_preset("micro")
    again = load_trajectory(folder / "out" / "dynamics.csv", robot)
    path = load_trajectory(folder / "circle.yaml", robot)
    assert worst(again.sample(0.05).pose - path.sample(0.05).pose) < 1e-9


ROBOTS = {
    "micro": ("robot: micro\n", "{kind: circle, height: 0.223, tilt: 0.1, duration: 0.05}"),
    "ankle": (
        f"mechanism: {Path('urdf/ankle.yaml').resolve()}\n",
        "{kind: point_to_point, end: [0.1, 0.05], duration: 0.05}",
    ),
}


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_control_loop(folder: Path, robot: str) -> None:
    machine, path = ROBOTS[robot]
    (folder / "loop.yaml").write_text(
        f"{machine}trajectory: {path}\ncontroller: {{law: computed_torque, bandwidth: 15.0}}\n"
        "plant: {masses: 1.3}\nsettle: 0.02\n"
    )
    words = "control", "loop.yaml", "-o", "out", "--overwrite"
    plain = json.loads(rps_pin(*words, "--json", folder=folder).stdout)
    rows = np.genfromtxt(folder / "out" / "loop.csv", delimiter=",", names=True)
    turned = json.loads(rps_pin(*words, "--json", "--degrees", folder=folder).stdout)
    table = np.genfromtxt(folder / "out" / "loop.csv", delimiter=",", names=True)
    for old, new in zip(rows.dtype.names, table.dtype.names, strict=True):
        assert new == old.replace("_rad", "_deg")
        factor = TURN if old != new else 1.0
        np.testing.assert_allclose(table[new], factor * rows[old], rtol=1e-9, atol=1e-12)
    if robot == "micro":
        assert (plain["turn_unit"], turned["turn_unit"]) == ("urad", "deg")
        for name in ("turn_rms", "turn_max", "turn_end"):
            assert turned[name] == pytest.approx(TURN * 1e-6 * plain[name])
        assert turned["centre_max"] == plain["centre_max"]
    else:
        assert (plain["units"], turned["units"]) == (["rad", "rad"], ["deg", "deg"])
        for name in ("rms", "largest", "at_end"):
            np.testing.assert_allclose(turned[name], TURN * np.array(plain[name]))
    assert "rad" not in (folder / "out" / "report.md").read_text().replace("[rad", "")


def test_the_pose_that_is_shown(folder: Path) -> None:
    shown = ("view", "-r", "micro", "--pose", "0.22")
    pages = []
    for pose in (("5", "-3", "--degrees"), map(repr, (math.radians(5), math.radians(-3)))):
        page = f"{len(pages)}.html"
        done = rps_pin(*shown, *pose, "--html", page, folder=folder)
        assert done.returncode == 0, done.stderr
        pages.append((folder / page).read_text())
    assert pages[0] == pages[1]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("ik", "-r", "micro", "--pose", "0.22", "80", "0"), "tilt = (80, 0) deg is out of reach"),
        (("ik", "-r", "micro", "--pose", "0.22", "80", "0"), "its limits are 0 to 45 deg"),
        (("fk", "-m", "delta", "--at", "arm_1_joint=100"), "at 100 deg (-68.755 to 85.944 deg)"),
        (("view", "-r", "micro", "--pose", "0.22", "80", "0", "--html", "a.html"), "(80, 0) deg"),
        (("ik", "-r", "micro", "--pose", "0.22", "200", "0"), "a tilt of 200 0 deg is more than"),
    ],
)
def test_errors_and_notes(folder: Path, words: tuple[str, ...], told: str) -> None:
    done = rps_pin(*words, "--degrees", folder=folder)
    assert done.returncode == 1
    assert told in done.stderr and " rad" not in done.stderr


@pytest.mark.parametrize(
    ("text", "turned"),
    [
        ("tilt = (0.1, -0.2) rad is", "tilt = (5.7296, -11.459) deg is"),
        ("(1, 0.5, -2e-3) m, rad, rad", "(1, 28.648, -0.11459) m, deg, deg"),
        ("at 1.5 rad (-1.2 to 1.5 rad)", "at 85.944 deg (-68.755 to 85.944 deg)"),
        ("3.1 rad/s, 2 rad/s^2", "177.62 deg/s, 114.59 deg/s^2"),
        ("it is 3 rad or characteristic lengths", None),
        ("leg_1.5 rad, 12 radians, 0.5 mrad, 3 N m/rad", None),
    ],
)
def test_words(text: str, turned: str | None) -> None:
    assert words_in_degrees(text) == (turned or text)

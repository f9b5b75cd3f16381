"""``rps-pin dynamics``: any trajectory file on any robot."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rps_pin import RPSParameters, RPSRobot
from rps_pin.rps import Payload
from rps_pin.trajectories import circle
from tests.cli.commands import rps_pin

CIRCLE = "kind: circle\nheight: 0.223\ntilt: 0.1\nduration: 2.0\n"
FIGURES = [
    f"{name}.{suffix}"
    for name in (
        *("path", "lengths", "forces"),
        *("forces_by_cause", "force_over_speed"),
    )
    for suffix in ("png", "svg")
]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the folder and the standard output of a run on a circle."""
    folder = tmp_path_factory.mktemp("dynamics")
    (folder / "circle.yaml").write_text(CIRCLE)
    run = rps_pin("dynamics", "circle.yaml", "-r", "micro", "--rate", "100", folder=folder)
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    return folder, run.stdout


def test_it_writes_samples_figures_sheet_and_page(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    files = {"dynamics.csv", "sizing.json", "viewer.html", *FIGURES}
    assert {path.name for path in (folder / "circle-dynamics").iterdir()} == files
    for name in files:
        assert f"circle-dynamics/{name}" in printed


def test_it_prints_the_sizing_sheet_and_how_the_motion_starts_and_ends(
    finished: tuple[Path, str],
) -> None:
    _, printed = finished
    assert re.search(r"starts, ends +│ at rest ", printed)
    for words in (
        *("peak force (N)", "RMS force (N)", "peak speed (m/s)", "mean power (W)"),
        *("energy driven (J)", "margin to 100 N", "margin to 0.2 m/s", "longest leg"),
        *("largest loop gap", "largest KKT residual", "smallest distance"),
    ):
        assert words in printed


def test_what_it_wrote_is_a_trajectory_again_with_the_same_forces(
    finished: tuple[Path, str], tmp_path: Path
) -> None:
    folder, _ = finished
    table = folder / "circle-dynamics" / "dynamics.csv"
    run = rps_pin(
        *("dynamics", str(table), "-r", "micro", "--rate", "100", "--json", "-o", "again"),
        folder=tmp_path,
    )
    assert run.returncode == 0, run.stderr
    again = json.loads(run.stdout)
    first = json.loads((folder / "circle-dynamics" / "sizing.json").read_text())
    for one, other in zip(again["sizing"]["actuators"], first["actuators"], strict=True):
        assert_allclose(one["force_peak"], other["force_peak"], rtol=1e-9)
        assert_allclose(one["energy_driven"], other["energy_driven"], rtol=1e-9)


def test_payload_gravity_and_wrench_count(tmp_path: Path) -> None:
    (tmp_path / "circle.yaml").write_text(CIRCLE)
    mine = RPSParameters.from_preset("micro").replace(name="mine", prismatic_damping=20.0)
    mine.to_yaml(tmp_path / "mine.yaml")
    run = rps_pin(
        *("dynamics", "circle.yaml", "--robot", "mine.yaml", "--rate", "50", "--json"),
        *("--payload", "0.5", "--payload-centre", "0", "0.01", "0.05"),
        *("--gravity", "9.81", "0", "0", "--wrench", "1", "2", "3", "0.1", "0.2", "0.3"),
        folder=tmp_path,
    )
    assert run.returncode == 0, run.stderr
    answer = json.loads(run.stdout)
    robot = RPSRobot(mine.replace(gravity=(9.81, 0.0, 0.0))).with_payload(
        Payload(0.5, (0.0, 0.01, 0.05))
    )
    path = circle(height=0.223, tilt=0.1, duration=2.0)
    samples = path.sample(np.linspace(0, path.duration, 101))
    force = robot.actuator_forces(*samples, wrench=(1.0, 2.0, 3.0, 0.1, 0.2, 0.3))
    found = [one["force_peak"] for one in answer["sizing"]["actuators"]]
    assert_allclose(found, np.abs(force).max(axis=0), rtol=1e-9)


def test_fastest_uses_the_actuators_to_their_limits_and_no_further(tmp_path: Path) -> None:
    (tmp_path / "circle.yaml").write_text(CIRCLE)
    run = rps_pin(
        *("dynamics", "circle.yaml", "-r", "micro", "--rate", "2000", "--json", "--fastest"),
        folder=tmp_path,
    )
    assert run.returncode == 0, run.stderr
    answer = json.loads(run.stdout)
    assert answer["duration"] < 1.0
    assert answer["exceeded"] == []
    assert answer["sizing"]["kept"]
    force = max(one["force_peak"] for one in answer["sizing"]["actuators"]) / 100.0
    speed = max(one["speed_peak"] for one in answer["sizing"]["actuators"]) / 0.2
    assert 0.99 < max(force, speed) <= 1


@pytest.mark.parametrize(
    ("text", "robot", "words"),
    [
        ("kind: circle\nheight: 0.227\ntilt: 0.2\nduration: 2\n", "micro", "length would be 0.25"),
        ("kind: helix\nradius: 0.075\npitch: 0.05\nheight: 0.4\n", "sokolov", "at t = 4.0752"),
        ("kind: spiral\n", "micro", "line 1"),
        ("kind: circle\nheight: 0.2\ntilt: nothing\nduration: 2\n", "micro", "line 3"),
    ],
)
def test_what_cannot_be_is_told_before_anything_is_written(
    tmp_path: Path, text: str, robot: str, words: str
) -> None:
    (tmp_path / "path.yaml").write_text(text)
    run = rps_pin("dynamics", "path.yaml", "--robot", robot, folder=tmp_path)
    assert run.returncode == 1
    assert run.stdout == ""
    (line,) = run.stderr.strip().splitlines()
    assert line.startswith("error: ")
    assert words in line
    assert [path.name for path in tmp_path.iterdir()] == ["path.yaml"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--payload", "-1"], "payload mass = -1"),
        (["--payload", "1e200"], "payload mass = 1e+200"),
        (["--wrench", "1e308", *"00000"], "--wrench = 1e+308"),
        (["--payload-centre", "0", "0", "0.1"], "give its mass"),
        (["--power", "0"], "power limit = 0"),
        (["--rate", "nan"], "Hz"),
        (["--gravity", "nan", "0", "0"], "gravity"),
    ],
)
def test_options_that_make_no_sense_are_told(
    tmp_path: Path, options: list[str], words: str
) -> None:
    (tmp_path / "circle.yaml").write_text(CIRCLE)
    run = rps_pin("dynamics", "circle.yaml", "--robot", "micro", *options, folder=tmp_path)
    assert run.returncode == 1
    (line,) = run.stderr.strip().splitlines()
    assert words in line


@pytest.mark.parametrize(
    ("rates", "told"),
    [
        (False, ["at rest", "at rest"]),
        (True, ["with the measured rate", "at rest, as measured"]),
    ],
)
def test_the_report_of_a_csv_says_how_it_starts_and_ends(
    tmp_path: Path, rates: bool, told: list[str]
) -> None:
    """Poses of a motion that comes in at speed and stops."""
    t = np.linspace(0.0, 1.0, 21)
    still = np.zeros_like(t)
    columns = {"time_s": t, "z_m": 0.22 + 0.005 * (2 * t - t**2), "tilt_x_rad": still}
    columns |= {"tilt_y_rad": still}
    if rates:
        columns |= {"z_rate_m_per_s": 0.01 * (1 - t)}
        columns |= {"tilt_x_rate_rad_per_s": still, "tilt_y_rate_rad_per_s": still}
    table = np.column_stack(list(columns.values()))
    file = tmp_path / "poses.csv"
    np.savetxt(file, table, delimiter=",", header=",".join(columns), comments="")
    command = ("dynamics", "poses.csv", "-r", "micro", "--rate", "50")
    printed = rps_pin(*command, folder=tmp_path)
    assert printed.returncode == 0, printed.stderr
    assert "at rest" in printed.stdout
    answer = json.loads(rps_pin(*command, "--json", folder=tmp_path).stdout)
    assert [answer["starts"], answer["ends"]] == told

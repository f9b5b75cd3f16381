"""``--fastest`` and the key ``fastest`` on the command line, for a mechanism with a task."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from rps_pin.errors import CompileError
from rps_pin.task import Task
from rps_pin.task.motion import task_dynamics
from tests.cli.commands import rps_pin

MASS, WAY, FORCE = 2.0, 0.3, 8.0
URDF = f"""<robot name="slide"><link name="base"/>
<link name="mass"><inertial><mass value="{MASS}"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="mass"/>
<axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="{FORCE}" velocity="1e3"/></joint></robot>"""
MECHANISM = """
urdf: slide.urdf
closures: []
actuated: [slide]
task: {frame: mass, coordinates: [x]}
"""
SCENARIO = """
mechanism: slide.yaml
trajectory: {kind: point_to_point, end: {x: 0.3}, duration: 1.5}
controller: {law: computed_torque, bandwidth: 15.0}
settle: 0.1
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(task_dynamics, "_FEW_TIMES", 101)
    (tmp_path / "slide.urdf").write_text(URDF)
    (tmp_path / "slide.yaml").write_text(MECHANISM)
    line = f"kind: point_to_point\nend: {{x: {WAY}}}\nduration: 1.5\n"
    (tmp_path / "line.yaml").write_text(line)
    (tmp_path / "fast.yaml").write_text(line + "fastest: {force: 2}\n")
    (tmp_path / "scenario.yaml").write_text(SCENARIO)
    return tmp_path


def shortest(mass: float = MASS, push: float = FORCE, brake: float = FORCE) -> float:
    return math.sqrt(2 * WAY * mass * (1 / push + 1 / brake))


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ((), 1.5),
        (("--fastest",), shortest()),
        (
            ("--fastest", "--payload", "1", "--wrench", "2", "0", "0", "0", "0", "0"),
            shortest(MASS + 1, FORCE + 2, FORCE - 2),
        ),
    ],
)
def test_dynamics_and_check(folder: Path, options: tuple[str, ...], expected: float) -> None:
    given = "line.yaml", "-m", "slide.yaml", *options, "--json"
    forces = json.loads(
        rps_pin("dynamics", *given, "--rate", "50", "-o", "out", folder=folder).stdout
    )
    assert forces["duration"] == pytest.approx(expected, rel=1e-4)
    (slide,) = forces["sizing"]["actuators"]
    if options:
        assert slide["force_peak"] == pytest.approx(FORCE, rel=1e-4)
    checked = rps_pin("check", *given, folder=folder)
    found = json.loads(checked.stdout)
    assert found["duration"] == pytest.approx(expected, rel=1e-4)
    assert not [one for one in found["limits"] if abs(one["limit"]) > 1.01 * FORCE]


def test_a_file_asks_for_it_under_the_loads(folder: Path) -> None:
    given = "fast.yaml", "-m", "slide.yaml", "--payload", "1", "--json"
    for command in (("dynamics", *given, "--rate", "50", "-o", "out"), ("check", *given)):
        found = json.loads(rps_pin(*command, folder=folder).stdout)
        assert found["duration"] == pytest.approx(shortest(MASS + 1, 2, 2), rel=1e-4)


def test_the_time_is_told(folder: Path) -> None:
    told = rps_pin("check", "line.yaml", "-m", "slide.yaml", "--fastest", folder=folder).stdout
    assert f"shortest time {shortest():.4f}"[:20] in told
    assert "(as given: 1.5 s), computed in generated code" in told


def test_the_engine_is_told(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise CompileError("there is no C compiler", "cc")

    monkeypatch.setattr(Task, "compile", refused)
    words = "check", "line.yaml", "-m", "slide.yaml", "--fastest"
    done = rps_pin(*words, folder=folder, COLUMNS="300")
    told = done.stdout
    assert done.returncode == 0, done.stderr
    assert f"shortest time {shortest():.4f}"[:20] in told
    assert "computed by the Pinocchio engine, ten times as long as in generated code" in told
    assert "there is no C compiler" in told
    of_file = rps_pin("check", "fast.yaml", "-m", "slide.yaml", "--json", folder=folder)
    assert json.loads(of_file.stdout)["duration"] == pytest.approx(shortest(MASS, 2, 2), rel=1e-4)
    assert "fast.yaml: its shortest time is computed by the Pinocchio engine" in of_file.stderr


def test_view_shows_it(folder: Path) -> None:
    given = "view", "line.yaml", "-m", "slide.yaml", "--html", "page.html", "--fastest"
    done = rps_pin(*given, folder=folder)
    assert done.returncode == 0, done.stderr
    assert "(as given: 1.5 s)" in done.stderr
    assert (folder / "page.html").stat().st_size > 1000


def test_control_follows_it(folder: Path) -> None:
    done = rps_pin("control", "scenario.yaml", "--fastest", "-o", "out", folder=folder)
    assert done.returncode == 0, done.stderr
    assert "(as given: 1.5 s)" in done.stdout
    time = np.genfromtxt(folder / "out" / "loop.csv", delimiter=",", names=True)["time_s"]
    assert time[-1] == pytest.approx(0.1 + shortest(), abs=2e-3)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("view", "--fastest", "-m", "slide.yaml"), "there is no trajectory"),
        (("view", "--fastest", "-i", "-m", "slide.yaml"), "there is no trajectory"),
        (("check", "--ignore-limits"), "it is an option of a mechanism"),
        (("check", "line.yaml", "-m", "slide.yaml", "--payload", "-1"), "must be positive"),
        (
            ("check", "line.yaml", "-m", "slide.yaml", "--payload-centre", "1", "0", "0"),
            "--payload-centre is the place of a payload",
        ),
    ],
)
def test_what_is_wrong_is_told(folder: Path, words: tuple[str, ...], message: str) -> None:
    done = rps_pin(*words, folder=folder)
    assert done.returncode != 0
    assert message in " ".join(done.stderr.replace("│", "").split())

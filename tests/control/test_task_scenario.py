"""Scenarios of a mechanism with a task, what they refuse, and the record, table and report."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rps_pin.cli.app import app
from rps_pin.control import ComputedTorque, Fault, Gains, Plant, Status, TaskSummary, run_loop
from rps_pin.control.simulation.loop_run import columns_of, write_loop_csv
from rps_pin.control.simulation.scenario import load_scenario
from rps_pin.errors import InputError, RPSPinError
from rps_pin.trajectories import point_to_point
from tests.control.tasks import plain, start, task

SMALLEST = """\
mechanism: {folder}/urdf/ankle.yaml
trajectory: {{kind: point_to_point, start: [0.0, 0.0], end: [0.05, -0.03], duration: 0.05}}
controller: {{law: computed_torque, bandwidth: 15.0}}
"""
HERE = Path(__file__).resolve().parents[2]


def written(folder: Path, more: str = "", text: str = SMALLEST) -> Path:
    path = folder / "scenario.yaml"
    path.write_text(text.format(folder=HERE) + more)
    return path


def test_a_run_of_a_task_is_recorded_and_written(tmp_path: Path) -> None:
    name = "ankle"
    path = point_to_point(start(name), start(name) - 0.03, duration=0.05)
    controller = ComputedTorque(task(name), start(name), Gains.placed(15.0))
    plant = Plant(plain(name), start(name))
    faults = [Fault("lost", 0.01, 0.001), Fault("target", 0.03, 0.001, offset=(50.0, 0.0))]
    run = run_loop(controller, plant, path, faults=faults, speeds="measured")
    assert (run.parameters, run.time.size) == (None, 50)
    assert run.status[10] == Status.BAD_INPUT
    assert run.status[30] == Status.TARGET_HELD
    np.testing.assert_allclose(run.pose[0], start(name), atol=1e-9)
    np.testing.assert_allclose(run.target[-1], path.sample(0.049).pose, atol=1e-12)
    assert np.isnan(run.reading[10]).all()
    rows = [plain(name).mechanism.complete(a, plain(name).mechanism.home) for a in run.length[::10]]
    np.testing.assert_allclose(plain(name).at(np.array(rows)), run.pose[::10], atol=1e-9)
    summary = TaskSummary.of(run)
    errors = run.pose - run.target
    assert summary.names == ("cross_joint", "foot_joint")
    assert summary.units == ("rad", "rad")
    assert summary.force_unit == "N m"
    np.testing.assert_allclose(summary.largest, np.abs(errors).max(axis=0))
    np.testing.assert_allclose(summary.rms, np.sqrt((errors**2).mean(axis=0)))
    assert summary.statuses["bad input"] == 1
    write_loop_csv(tmp_path / "loop.csv", run)
    with (tmp_path / "loop.csv").open() as file:
        head, *lines = list(csv.reader(file))
    assert len(head) == columns_of(2, 2) == 17
    assert head[:3] == ["time_s", "target_cross_joint_rad", "target_foot_joint_rad"]
    assert "length_left_crank_joint_rad" in head
    assert "command_left_crank_joint_Nm" in head
    assert float(lines[20][head.index("pose_foot_joint_rad")]) == pytest.approx(run.pose[20, 1])


def test_faults_that_the_robot_has_not_are_refused() -> None:
    controller = ComputedTorque(task("ankle"), start("ankle"), Gains.placed(15.0))
    plant = Plant(plain("ankle"), start("ankle"))
    path = point_to_point(start("ankle"), start("ankle") + 0.01, duration=0.05)
    with pytest.raises(InputError, match="fault leg = 3: legs are 1 to 2"):
        run_loop(controller, plant, path, faults=[Fault("nan", 0.0, leg=3)])
    with pytest.raises(InputError, match="the pose has 2 coordinates"):
        run_loop(controller, plant, path, faults=[Fault("target", 0.0, offset=(1.0, 0.0, 0.0))])


def test_a_scenario_of_a_mechanism(tmp_path: Path) -> None:
    more = "plant: {masses: 1.2, delay: 1, force_limit: 30.0}\nsettle: 0.02\n"
    scenario: Any = load_scenario(written(tmp_path, more))
    assert scenario.margins().stable
    heavy, light = scenario.machine.mechanism.model, scenario.model.mechanism.model
    for one, other in zip(heavy.inertias, light.inertias, strict=True):
        assert one.mass == pytest.approx(1.2 * other.mass)
        np.testing.assert_allclose(one.inertia, 1.2 * other.inertia)
    run = scenario.run()
    assert run.time.size == 70
    np.testing.assert_array_equal(run.status, 0)
    assert np.abs(run.pose - run.target).max() < 0.02


def test_the_command_writes_its_files_and_table(tmp_path: Path) -> None:
    out = tmp_path / "out"
    path = written(tmp_path, "settle: 0.01\n")
    result = CliRunner().invoke(app, ["control", str(path), "-o", str(out), "--json"])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["names"] == ["cross_joint", "foot_joint"]
    report = (out / "report.md").read_text()
    assert "error of cross_joint" in report
    assert "urad" in report
    assert "to a singularity" in report
    for name in ("loop.csv", "summary.json", "tracking.png", "forces.png", "viewer.html"):
        assert (out / name).stat().st_size > 100


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("robot: micro", "line 4: unknown key 'robot'"),
        ("plant: {platform: 1.2}", "line 4: unknown key 'platform'; the keys of plant are: masses"),
        ("plant: {masses: -1.0}", "line 4: plant.masses = -1.0"),
        ("faults: [{kind: nan, start: 0.0, leg: 3}]", "line 4: fault leg = 3: legs are 1 to 2"),
        ("faults: [{kind: target, start: 0.0, offset: [1.0]}]", "line 4: .*2 coordinates"),
        ("period: 0.0", "line 4: period = 0.0"),
    ],
)
def test_mistakes_are_told_with_their_line(tmp_path: Path, line: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_scenario(written(tmp_path, line + "\n"))


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    text = SMALLEST.replace("end:", "ende:").replace("duration: ", "duration: -")
    with pytest.raises(InputError) as told:
        load_scenario(written(tmp_path, "period: 0.0\n", text))
    for words in ("line 4: period = 0", "line 2: unknown key 'ende'", "line 2: duration = -"):
        assert words in str(told.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("urdf/ankle.yaml", "urdf/none.yaml", "line 1: mechanism = .*no such file"),
        ("urdf/ankle.yaml", "urdf/gripper.yaml", "line 1: .*has no task"),
        (
            "point_to_point",
            "helix",
            "line 2: kind: .*'helix' is not one; .*point_to_point, spline, csv",
        ),
        ("end: [0.05, -0.03]", "end: [0.05]", "line 2: "),
        (
            "start: [0.0, 0.0], end: [0.05, -0.03]",
            "start: [0.0], end: [0.1]",
            "line 2: 1 numbers for the 2 coordinates",
        ),
        ("end: [0.05, -0.03]", "final: [0.05, -0.03]", "line 2: unknown key 'final'"),
        ("bandwidth: 15.0", "gains: {{proportional: [1.0, 2.0, 3.0], derivative: 1.0}}", "errors"),
        ("bandwidth: 15.0", "bandwidth: -1.0", "line 3: controller.bandwidth"),
    ],
)
def test_other_mistakes(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in SMALLEST
    with pytest.raises(RPSPinError, match=words):
        load_scenario(written(tmp_path, text=SMALLEST.replace(old, new)))

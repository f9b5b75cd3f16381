"""The distance to a singularity: one number under one name wherever it is printed or written."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rps_pin import RPSRobot, helix
from rps_pin.panel import RPSPanel
from rps_pin.plots.conditioning import plot_height_conditioning, plot_tilt_conditioning
from rps_pin.rps import check_path, singularity_measures
from rps_pin.rps.kinematics.rates import leg_jacobians
from rps_pin.rps.singularity.measures import SingularityMeasures, passive_conditioning
from rps_pin.rps.workspace import load_workspace, pose_grid, save_workspace, workspace
from tests.cli.commands import rps_pin

#: Of PathCheck and MotionSummary, and keys of what every command prints of a path.
KEYS = ("minimum_distance", "minimum_singularity", "minimum_time")
SHOWN = re.compile(r"([\d.]+) \(type II\)")


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[str, dict[str, object]]]:
    """What each command prints of the paper's helix: its text, and its JSON."""
    folder = tmp_path_factory.mktemp("helix")
    (folder / "helix.yaml").write_text("kind: helix\nradius: 0.75e-3\npitch: 0.5e-3\nheight: 0.4\n")
    commands = {
        "check": ("check",),
        "helix": ("helix", "--rate", "20"),
        "dynamics": ("dynamics", "helix.yaml", "--rate", "20"),
    }
    found = {}
    for name, command in commands.items():
        text = rps_pin(*command, folder=folder)
        assert text.returncode == 0, text.stderr
        found[name] = text.stdout, json.loads(rps_pin(*command, "--json", folder=folder).stdout)
    return found


def test_every_command_prints_the_same_distance(
    answers: dict[str, tuple[str, dict[str, object]]],
) -> None:
    robot = RPSRobot.from_preset("sokolov")
    check = check_path(robot, helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4))
    for name, (text, answer) in answers.items():
        assert tuple(answer[key] for key in KEYS) == tuple(check[:9])[2:5], name
        assert_allclose(answer["minimum_pose"], check.minimum_pose, rtol=1e-15)
        assert "smallest distance to a singularity" in " ".join(text.split()), name
        (shown,) = SHOWN.findall(text)
        assert shown == f"{check.minimum_distance:.4g}", name


def test_it_is_the_least_of_the_three_measures() -> None:
    robot = RPSRobot.from_preset("sokolov")
    path = helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)
    check = check_path(robot, path)
    measures = singularity_measures(
        robot.parameters, path.sample(np.linspace(0.0, path.duration, 2001)).pose
    )
    least = np.min([measures.type_i, measures.type_ii, np.abs(measures.constraint)], axis=0)
    assert_allclose(measures.distance, least, rtol=0)
    assert_allclose(check.minimum_distance, least.min(), rtol=1e-7)
    there = singularity_measures(robot.parameters, check.minimum_pose)
    assert_allclose(check.minimum_distance, there.distance, rtol=1e-12)
    # Each of the three can be the least.
    mixed = SingularityMeasures(
        *np.array([[0.1, 2, 2], [0.9, 0.2, 0.9], [0.8, 0.8, -0.3], [1] * 3])
    )
    assert_allclose(mixed.distance, [0.1, 0.2, 0.3], rtol=0)


def test_a_control_loop_logs_type_ii_under_its_name(tmp_path: Path) -> None:
    """On a plant like its model, the least of the log is that of the path itself."""
    (tmp_path / "helix.yaml").write_text(
        "robot: sokolov\n"
        "trajectory: {kind: circle, height: 0.4, tilt: 0.05, duration: 0.3}\n"
        "controller: {bandwidth: 20.0}\n"
    )
    run = rps_pin("control", "helix.yaml", "--json", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)
    with (tmp_path / "helix-control" / "loop.csv").open() as file:
        rows = list(csv.DictReader(file))
    logged = np.array([float(row["type_ii"]) for row in rows])
    pose = np.array(
        [
            [float(row[f"estimate_{name}"]) for name in ("z_m", "tilt_x_rad", "tilt_y_rad")]
            for row in rows
        ]
    )
    robot = RPSRobot.from_preset("sokolov")
    measures = singularity_measures(robot.parameters, pose)
    assert_allclose(logged, measures.type_ii, rtol=1e-9)
    assert_allclose(summary["minimum_type_ii"], logged.min(), rtol=1e-9)
    assert_allclose(summary["minimum_type_ii"], measures.distance.min(), rtol=1e-9)
    report = (tmp_path / "helix-control" / "report.md").read_text()
    assert f"Smallest distance to type II: {summary['minimum_type_ii']:.4g}" in report


def test_a_workspace_and_its_file_hold_the_conditioning_of_k(tmp_path: Path) -> None:
    robot = RPSRobot.from_preset("micro")
    found = workspace(robot, pose_grid([0.22, 0.23], [-0.1, 0.1]))
    save_workspace(found, tmp_path / "space.h5")
    K = leg_jacobians(robot.parameters, found.pose).length_jacobian / [
        1.0,
        *[robot.parameters.platform_radius] * 2,
    ]
    expected = 1 / np.linalg.cond(K)
    for space in (found, load_workspace(tmp_path / "space.h5")):
        assert_allclose(space.conditioning, expected, rtol=1e-9)


def test_passive_conditioning_is_the_mechanism_s_and_the_runs() -> None:
    robot = RPSRobot.from_preset("sokolov")
    pose = [0.4, 0.1, -0.05]
    q = robot.state(pose, np.zeros(3), np.zeros(3))[0]
    expected = 1 / robot.mechanism.condition(q)
    assert_allclose(passive_conditioning(robot.parameters, pose), expected, rtol=1e-9)


def test_plots_and_the_panel_name_the_measure_they_show() -> None:
    robot = RPSRobot.from_preset("sokolov")
    panel = RPSPanel(robot, [0.4, 0.1, 0.0])
    shown = dict(panel.readings())["distance to type II"]
    measures = singularity_measures(robot.parameters, [0.4, 0.1, 0.0])
    assert float(shown.split()[0]) == pytest.approx(float(measures.type_ii), abs=1e-4)
    for figure in (
        plot_tilt_conditioning(robot.parameters, 0.4, [-0.1, 0.0, 0.1]),
        plot_height_conditioning(robot.parameters, [0.3, 0.4, 0.5], [-0.1, 0.0, 0.1]),
    ):
        assert any("distance to type II" in axes.get_ylabel() for axes in figure.axes)

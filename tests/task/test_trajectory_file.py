"""Trajectories of a task from YAML files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import InputError
from rps_pin.task.trajectory_file import load_task_trajectory
from rps_pin.trajectories import point_to_point, spline
from tests.task.robots import task
from tests.worst import worst


def written(folder: Path, text: str, name: str = "path.yaml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_named_coordinates_are_set_and_others_are_those_of_home(tmp_path) -> None:
    one = task("stewart")
    text = "kind: point_to_point\nend: {z: 0.66, rx: 0.1}\nduration: 2"
    found = load_task_trajectory(written(tmp_path, text), one)
    end = one.home
    end[[2, 3]] = 0.66, 0.1
    expected = point_to_point(one.home, end, duration=2.0)
    for t in (0.0, 0.7, 2.0):
        for part, wanted in zip(found.sample(t), expected.sample(t), strict=True):
            assert worst(part - wanted) < 1e-15


def test_limits_are_by_coordinate_and_lists_are_in_the_tasks_order(tmp_path) -> None:
    one = task("five_bar")
    text = "kind: point_to_point\nstart: [0.1, 0.5]\nend: [0.2, 0.45]\nmax_rate: {x: 0.05}"
    found = load_task_trajectory(written(tmp_path, text), one)
    rates = np.array([found.sample(t).rate for t in np.linspace(0, found.duration, 200)])
    assert worst(rates[:, 0]) == pytest.approx(0.05, rel=1e-4)
    assert worst(found.sample(0.0).pose - [0.1, 0.5]) < 1e-15


@pytest.mark.parametrize("timing", ["times: [0, 1, 3]", "duration: 3"])
def test_splines_meet_their_poses(tmp_path, timing) -> None:
    one = task("delta")
    poses = "poses: [{}, {x: 0.05}, {x: 0.05, z: -0.5}]"
    found = load_task_trajectory(written(tmp_path, f"kind: spline\n{poses}\n{timing}"), one)
    assert found.duration == pytest.approx(3)
    last = one.home
    last[[0, 2]] = 0.05, -0.5
    assert worst(found.sample(0.0).pose - one.home) < 1e-12
    assert worst(found.sample(3.0).pose - last) < 1e-12
    if "times" in timing:
        middle = np.array([one.home, [0.05, *one.home[1:]], last])
        assert worst(found.sample(1.0).pose - spline(middle, [0, 1, 3]).sample(1.0).pose) < 1e-12


def test_a_table_is_named_from_the_files_folder(tmp_path) -> None:
    one = task("delta")
    rows = [f"{t},{one.home[2] + 0.01 * t},{0.01 * t},{-0.01 * t}" for t in np.linspace(0, 1, 11)]
    written(tmp_path, "time_s,z_m,x_m,y_m\n" + "\n".join(rows), "points.csv")
    for path in (written(tmp_path, "kind: csv\nfile: points.csv"), tmp_path / "points.csv"):
        found = load_task_trajectory(path, one)
        assert worst(found.sample(1.0).pose - [0.01, -0.01, one.home[2] + 0.01]) < 1e-12


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("end: {z: 1}", "kind: is missing; of a task there are: point_to_point, spline, csv"),
        ("kind: helix", "'helix' is not one; of a task there are"),
        ("kind: [1]", "is not one"),
        ("kind: point_to_point\nend: {q: 1}\nduration: 1", "line 2: the task has no 'q'"),
        ("kind: point_to_point\nend: [1, 2]\nduration: 1", "line 2: 2 numbers for the 3"),
        ("kind: point_to_point\nend: {z: 1e400}\nduration: 1", "1e400"),
        ("kind: point_to_point\nend: {z: -0.5}", "duration"),
        ("kind: point_to_point\nend: {z: -0.5}\nduration: 1\nspeed: 3", "speed"),
        ("kind: point_to_point\nend: {}\nduration: 1", "line 1"),
        ("kind: point_to_point\nend: {z: -0.5}\nmax_rate: {q: 1}", "line 3: the task has no 'q'"),
        ("kind: spline\nposes: [{}, {q: 1}]\nduration: 1", "the task has no 'q'"),
        ("kind: spline\nposes: [{}, {x: 0.1}]", "duration"),
        ("kind: csv\nfile: missing.csv", "missing.csv"),
    ],
)
def test_what_is_wrong_is_told(tmp_path, text, message) -> None:
    with pytest.raises(InputError, match=message) as caught:
        load_task_trajectory(written(tmp_path, text), task("delta"))
    assert "path.yaml" in str(caught.value)


def test_other_files_are_refused(tmp_path) -> None:
    with pytest.raises(InputError, match=r"must end in \.csv, \.yaml or \.yml"):
        load_task_trajectory(tmp_path / "path.txt", task("delta"))
    with pytest.raises(InputError, match="given by its path"):
        load_task_trajectory(3, task("delta"))

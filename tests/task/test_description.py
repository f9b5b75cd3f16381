"""Tasks in a mechanism's description, and what is wrong with them, with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, MechanismError, RPSPinError
from tests.task.robots import poses, task
from tests.worst import worst


def described(folder: Path, text: str) -> ClosedLoopModel:
    """The five-bar with a task."""
    lines = Path("urdf/five_bar.yaml").read_text().splitlines()
    kept = [line for line in lines if not line.startswith("task:")]
    source = "\n".join(kept).replace("five_bar.urdf", str(Path("urdf/five_bar.urdf").resolve()))
    path = folder / "mine.yaml"
    path.write_text(f"{source}\ntask: {text}\n")
    return ClosedLoopModel.load(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{frame: hand, coordinates: [x, z]}", "no frame 'hand'"),
        ("{frame: left_tip, coordinates: [x, w]}", "no coordinate 'w'"),
        ("{frame: left_tip, coordinates: [x, z], reference: floor}", "no frame 'floor'"),
        ("{frame: left_tip}", "a frame and its coordinates, or joints"),
        ("{}", "a frame and its coordinates, or joints"),
        ("{joints: [elbow, wrist]}", "no joint 'elbow'"),
        ("{joints: [left_joint, right_joint], reference: base}", "reference belongs to a frame's"),
        ("{frame: left_tip, coordinates: [x, z], speed: 3}", "speed"),
        ("{frame: left_tip, coordinates: 3}", "coordinates"),
        ("[x, z]", "task"),
        ("{frame: left_tip, coordinates: [x, z], placement: {xyz: [1, 2]}}", "xyz"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path, text, message) -> None:
    with pytest.raises(RPSPinError, match=message) as caught:
        described(tmp_path, text)
    assert "mine.yaml" in str(caught.value)
    assert "line" in str(caught.value)


def test_what_does_not_fit_the_mechanism_is_told_when_the_task_is_asked_for(tmp_path) -> None:
    m = described(tmp_path, "{frame: left_tip, coordinates: [x, y]}")
    with pytest.raises(MechanismError, match="coordinate y of the task does not move"):
        _ = m.task


def test_a_placement_and_a_reference_are_those_of_the_file(tmp_path) -> None:
    offset = "{xyz: [0.1, 0, 0.02], rpy: [0, 0.3, 0]}"
    text = "{frame: left_tip, coordinates: [x, z], reference: base, placement: " + offset + "}"
    m = described(tmp_path, text)
    found = m.task.home
    placed = m.frame_placement(m.home, "left_tip") @ np.array([0.1, 0, 0.02, 1.0])
    assert worst(found - placed[[0, 2]]) < 1e-12


@pytest.mark.parametrize("name", ["five_bar", "stewart", "ankle"])
def test_a_written_mechanism_has_its_task(tmp_path, name) -> None:
    one, (x, q) = task(name), poses(name)
    again = ClosedLoopModel.load(one.mechanism.to_urdf(tmp_path / "written.urdf")).task
    assert again.coordinates == one.coordinates
    assert worst(again.to_actuators(x[0], near=q[0]) - one.to_actuators(x[0], near=q[0])) < 1e-9


def test_changed_mechanisms_keep_the_task() -> None:
    m = task("stewart").mechanism
    other = m.with_actuated([*m.actuated[:5], "leg_6_cylinder_joint"])
    assert other.task.coordinates == task("stewart").coordinates
    assert other.task.jacobian(m.home).shape == (6, 6)

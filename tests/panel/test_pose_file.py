"""Named poses in a file that people write too: nothing of it is lost, nothing replaced unasked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, InputError, RPSRobot
from rps_pin.panel import MechanismPanel, PoseFile, RPSPanel
from tests.worst import worst

URDF = Path(__file__).resolve().parents[2] / "urdf"
BY_HAND = """\
# of my robot
level: {z: 0.22, rx: 0, ry: 0}   # comment
low:
  z: 0.21
  rx: 0.1
  ry: -0.05

# the end
"""


@pytest.fixture
def panel() -> RPSPanel:
    return RPSPanel(RPSRobot.from_preset("micro"))


def test_poses_are_saved_and_come_back(panel: RPSPanel, tmp_path: Path) -> None:
    file = PoseFile(tmp_path / "poses.yaml", panel)
    assert file.poses == {}
    rng, names = np.random.default_rng(4), ["a b", "yes", "12", "ä: {x}", '"quoted" \\ #', "-", "y"]
    saved = {name: rng.uniform(-1, 1, 3) * 10.0 ** rng.integers(-7, 1, 3) for name in names}
    saved["small"] = np.array([1e-5, -1e-17, 0.22500000000000003])
    for name, values in saved.items():
        file.save(name, values)
    found = PoseFile(tmp_path / "poses.yaml", panel).poses
    assert list(found) == [*names, "small"]
    assert worst([found[name] - values for name, values in saved.items()]) < 1e-12
    assert "small: {z: 1e-05, rx: 0.0, ry: 0.225}" in (tmp_path / "poses.yaml").read_text("utf-8")


def test_what_was_written_by_hand_stays(panel: RPSPanel, tmp_path: Path) -> None:
    path = tmp_path / "poses.yaml"
    path.write_text(BY_HAND, "utf-8")
    file = PoseFile(path, panel)
    assert worst(file.poses["low"] - [0.21, 0.1, -0.05]) == 0.0
    file.save("new", [0.23, 0.0, 0.0])
    assert path.read_text("utf-8") == BY_HAND + "new: {z: 0.23, rx: 0.0, ry: 0.0}\n"
    file.save("low", [0.2, 0.0, 0.0], replace=True)
    text = path.read_text("utf-8")
    assert text.startswith(
        "# of my robot\nlevel: {z: 0.22, rx: 0, ry: 0}   # comment\n\n# the end\n"
    )
    assert worst(file.poses["low"] - [0.2, 0.0, 0.0]) == 0.0
    assert set(file.poses) == {"level", "low", "new"}


def test_a_name_is_not_taken_twice_and_others_changes_are_seen(
    panel: RPSPanel, tmp_path: Path
) -> None:
    path = tmp_path / "poses.yaml"
    first, second = PoseFile(path, panel), PoseFile(path, panel)
    first.save("a", [0.22, 0.0, 0.0])
    with pytest.raises(InputError, match="has a pose 'a' already: it is not replaced"):
        second.save("a", [0.23, 0.0, 0.0])
    second.save("b", [0.23, 0.0, 0.0])
    first.read()
    assert list(first.poses) == ["a", "b"]
    assert first.poses["a"][0] == 0.22


@pytest.mark.parametrize("name", ["", "  ", "x" * 61, "a\nb", "\x1b[31m", None])
def test_names_that_are_none_are_refused(panel: RPSPanel, tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="name"):
        PoseFile(tmp_path / "poses.yaml", panel).save(name, [0.22, 0.0, 0.0])
    assert not (tmp_path / "poses.yaml").exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: {z: 1, rx: 0}", "line 1: the pose 'a' has z, rx; one of this mechanism has z, rx, ry"),
        ("\na: {z: 1, rx: 0, ry: 0, rz: 0}", "line 2: the pose 'a' has"),
        ("a: [1, 2, 3]", "line 1: 'a' is no pose: one has the numbers z, rx, ry"),
        ("a: {z: .nan, rx: 0, ry: 0}", "line 1: 'a' is no pose"),
        ("- 1", "must hold 'key: value' lines"),
        ("base_radius: 1", "line 1: 'base_radius' is no pose"),
    ],
)
def test_other_files_are_refused_with_the_line(
    panel: RPSPanel, tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "poses.yaml"
    path.write_text(text, "utf-8")
    with pytest.raises(InputError) as refused:
        PoseFile(path, panel)
    assert message in str(refused.value)
    assert path.read_text("utf-8") == text


def test_without_a_task_they_are_of_the_actuators(tmp_path: Path) -> None:
    panel = MechanismPanel(ClosedLoopModel.load(URDF / "gripper.yaml"))
    file = PoseFile(tmp_path / "poses.yaml", panel)
    file.save("open", panel.values(file.group))
    assert worst(file.poses["open"] - panel.values("joints")) < 1e-12

"""The key ``fastest`` of a task's trajectory files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rps_pin import InputError
from rps_pin.errors import InfeasibleError
from rps_pin.task import MotionLimits, Payload, load_task_trajectory
from rps_pin.task.motion import time_optimal as module
from tests.task import robots
from tests.task.slides import MASS, WAY, slide

LINE = f"kind: point_to_point\nstart: [0.1]\nend: [{0.1 + WAY}]\n"
TO = "kind: point_to_point\nend: {z: -0.5}\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "path.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("timing", ["", "duration: 7\n", "max_rate: 0.01\n"])
def test_the_shortest_time_takes_no_other(tmp_path: Path, timing: str) -> None:
    found = load_task_trajectory(written(tmp_path, f"{LINE}{timing}fastest: {{force: 3}}"), slide())
    assert found.duration == pytest.approx(2 * math.sqrt(WAY * MASS / 3), rel=1e-4)
    ends = found.sample([0.0, found.duration]).pose[:, 0]
    np.testing.assert_allclose(ends, [0.1, 0.1 + WAY], atol=1e-12)


def test_jerk_is_a_limit_too(tmp_path: Path) -> None:
    text = f"{LINE}fastest:\n  force: 1000\n  coordinate_jerk: {{slide: 20}}\n"
    found = load_task_trajectory(written(tmp_path, text), slide())
    assert found.duration == pytest.approx((32 * WAY / 20) ** (1 / 3), rel=1e-3)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """With what `time_optimal` is called."""
    found: dict[str, Any] = {}

    def time_optimal(task: Any, path: Any, **options: Any) -> Any:
        found.update(options)
        return path

    monkeypatch.setattr(module, "time_optimal", time_optimal)
    return found


def test_limits_are_by_name_in_order_or_ranges(tmp_path: Path, asked: dict[str, Any]) -> None:
    task = robots.task("delta")
    text = TO + (
        "fastest:\n  force: {arm_2_joint: 0.5}\n  speed: [1, 2, 3]\n  jerk: {arm_1_joint: 300}\n"
        "  acceleration: [[-1, -2, -3], [4, 5, 6]]\n  coordinate_speed: {y: 0.1}\n"
        "  coordinate_jerk: 7\n"
    )
    payload = Payload(0.3)
    load_task_trajectory(written(tmp_path, text), task, payload=payload, wrench=np.ones(6))
    limits = asked["limits"]
    own = task.mechanism.model.effortLimit[task.mechanism.actuated_indices]
    assert limits.force.tolist() == [own[0], 0.5, own[2]]
    assert limits.speed.tolist() == [1, 2, 3]
    assert limits.jerk.tolist() == [300, math.inf, math.inf]
    assert limits.acceleration == [[-1, -2, -3], [4, 5, 6]]
    assert limits.coordinate_speed.tolist() == [math.inf, 0.1, math.inf]
    assert limits.coordinate_jerk == 7
    assert limits.coordinate_acceleration is None
    limits.of(task)
    assert asked["payload"] is payload
    assert asked["wrench"].tolist() == [1] * 6


@pytest.mark.parametrize("text", ["fastest: {}\n", "fastest: {force: 0.3}\n"])
def test_what_is_left_out_is_the_models(tmp_path: Path, asked: dict[str, Any], text: str) -> None:
    load_task_trajectory(written(tmp_path, TO + text), robots.task("delta"))
    assert isinstance(asked["limits"], MotionLimits)
    assert asked["limits"].speed is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("fastest: 3", "line 3: fastest = 3"),
        ("fastest: {power: 3}", "line 3: unknown key 'power'; the keys of fastest are"),
        ("fastest:\n  force: 1\n  jrek: 3", "line 5: unknown key 'jrek'"),
        ("fastest: {force: -3}", "line 3: fastest.force = -3: .*-3 is not positive"),
        ("fastest:\n  jerk: 0", "line 4: fastest.jerk = 0: .*0 is not positive"),
        ("fastest: {jerk: .nan}", "line 3: .*nan"),
        ("fastest: {jerk: .inf}", "line 3: .*inf"),
        ("fastest: {jerk: much}", "line 3: .*'much' is no number"),
        ("fastest: {jerk: true}", "line 3: .*true is no number"),
        ("fastest: {jerk: []}", "line 3: .*it must be a number"),
        ("fastest: {force: [1, 2]}", "line 3: 2 numbers for the 3 actuators arm_1_joint"),
        ("fastest: {coordinate_jerk: [1, 2]}", "line 3: 2 numbers for the 3 coordinates x, y, z"),
        ("fastest:\n  force: {arm: 1}", "line 4: the task has no 'arm'; it has: arm_1_joint"),
        ("fastest: {coordinate_speed: {q: 1}}", "line 3: the task has no 'q'; it has: x, y, z"),
        ("fastest: {jerk: [[1, 1, 1], [2, 2, 2]]}", "line 3: jerk limit: the least must be"),
        ("fastest: {jerk: [[1], [2]]}", r"line 3: jerk limit has shape \(2, 1\)"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        load_task_trajectory(written(tmp_path, TO + text), robots.task("delta"))
    assert str(caught.value).count("path.yaml") == 1


def test_what_cannot_be_held_is_told(tmp_path: Path) -> None:
    with pytest.raises(InfeasibleError, match=r"slide force of 19\.62 N"):
        load_task_trajectory(written(tmp_path, LINE + "fastest: {force: 19}"), slide("0 0 1"))

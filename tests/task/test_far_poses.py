"""Poses that no joint within its limits reaches are refused in few steps, with numbers."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest

from rps_pin.closed_loop.assembly import continuation
from rps_pin.closed_loop.assembly.reach import far_frame
from rps_pin.errors import ClosureError
from rps_pin.task import Task
from tests.task import robots
from tests.worst import worst

#: Axis and motion from home, m.
FAR = [(0, 1000.0), (2, 1000.0), (1, -1000.0), (2, -30_000.0)]


@pytest.fixture
def points(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The number of decompositions of a Jacobian so far."""
    count = [0]

    class Counted(continuation._Point):
        def __init__(self, *given, **named) -> None:
            count[0] += 1
            super().__init__(*given, **named)

    monkeypatch.setattr(continuation, "_Point", Counted)
    return count


def legs_by_hand(task: Task, x: np.ndarray) -> np.ndarray:
    """Lengths of the legs from the places of cardans and balls in the model, (6,)."""
    model = task.mechanism.model
    turn = pin.exp3(x[3:])
    found = []
    for leg in range(1, 7):
        base = model.jointPlacements[model.getJointId(f"leg_{leg}_cross_joint")].translation
        ball = model.frames[model.getFrameId(f"platform_ball_{leg}")].placement.translation
        found.append(np.linalg.norm(x[:3] + turn @ ball - base))
    return np.array(found)


@pytest.mark.parametrize("engine", [robots.task, robots.compiled])
@pytest.mark.parametrize(("axis", "move"), FAR)
def test_a_far_pose_is_refused_in_few_steps(engine, axis, move, points) -> None:
    task = engine("stewart")
    x = task.home.copy()
    x[axis] += move
    x[3] += 0.2
    with pytest.raises(ClosureError, match="in the assembly mode of the guess is outside") as told:
        task.to_actuators(x)
    assert 0 < points[0] < 400
    lengths = legs_by_hand(task, x)
    for leg, length in enumerate(lengths, start=1):
        said = re.search(rf"'leg_{leg}_rod_joint' at ([0-9.e+]+)", str(told.value))
        assert said, str(told.value)
        assert float(said.group(1)) == pytest.approx(length, rel=1e-5)


def test_without_limits_it_is_reached_as_ever(points) -> None:
    task = robots.task("stewart")
    x = task.home.copy()
    x[2] += 20.0
    assert worst(task.to_actuators(x, within_limits=False) - legs_by_hand(task, x)) < 1e-9
    assert points[0] > 200  # in short steps


@pytest.mark.parametrize("name", ["stewart", "delta", "linear_delta", "five_bar", "rotary_stewart"])
def test_no_pose_within_limits_is_beyond_the_reach(name) -> None:
    task, rng = robots.task(name), np.random.default_rng(0)
    system = task.extended.system
    asked = task.joined(task.mechanism.home, task.home)
    at = task._x.idx_q[: len([one for one in task.angular if not one])]
    asked[at] = 1e6
    far = far_frame(system, asked)
    assert far is not None and np.array_equal(far.at, at)
    model = task.mechanism.model
    joints = [model.joints[model.getJointId(one)] for one in task.mechanism.actuated]
    ends = np.array([[m[j.idx_q] for j in joints] for m in
                     (model.lowerPositionLimit, model.upperPositionLimit)])  # fmt: skip
    ends = np.clip(ends, -3.0, 3.0)
    farthest, reached = 0.0, 0
    home = task.to_actuators(task.home)
    for share in (0.3, 0.6, 0.9):
        a = home + share * (rng.uniform(*ends, size=(40, home.size)) - home)
        x = task.to_task(a, errors="mask")
        x = np.asarray(x)[np.isfinite(np.asarray(x)).all(axis=1)]
        reached += len(x)
        lengths = np.linalg.norm(x[:, [not one for one in task.angular]], axis=1)
        farthest = float(np.append(lengths, farthest).max())
    assert reached > 20
    assert farthest <= far.reach < 4 * farthest

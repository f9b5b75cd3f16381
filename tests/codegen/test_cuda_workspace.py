"""Workspaces whose configurations a graphics card continues; its code runs on the host here."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.errors import InputError, MechanismError
from rps_pin.task import Task
from rps_pin.task.workspace import task_grid, workspace
from rps_pin.task.workspace.filling import continuation
from tests.codegen.device import FakeCuPy
from tests.worst import worst

URDF = Path(__file__).parents[2] / "urdf"
AXES = {"x": np.linspace(-0.8, 0.9, 35), "z": np.linspace(-0.8, 0.9, 35)}


@pytest.fixture(scope="module")
def task(cupy: FakeCuPy) -> Task:
    found: Task = ClosedLoopModel.load(URDF / "five_bar.yaml").task.compile(device="cuda")
    return found


def test_a_workspace_is_that_of_the_processor(
    task: Task, cupy: FakeCuPy, monkeypatch: pytest.MonkeyPatch
) -> None:
    grid = task_grid(task, AXES)
    few = len(cupy.launches)
    right = workspace(task, grid)
    assert len(cupy.launches) == few, "small batches are the processor's"
    monkeypatch.setattr(continuation, "LEAST_ON_CARD", 1)
    found = workspace(copy.deepcopy(task), grid)
    assert len(cupy.launches) > few + 30
    assert 0.2 < right.inside.mean() < 0.4
    np.testing.assert_array_equal(found.reason, right.reason)
    assert worst(found.actuators - right.actuators) < 1e-9
    assert worst(found.gains - right.gains) < 1e-8


def test_ways_are_followed_as_by_the_processor(task: Task) -> None:
    """Those that end at a singularity or beyond the reach are not reached, by either."""
    rng = np.random.default_rng(3)
    start = task.home + rng.uniform(-0.05, 0.05, (300, 2))
    q = task.joined(task.configuration(start), start)
    goal = start + rng.uniform(-0.6, 0.6, (300, 2))
    found, reached = task.card.continued(goal, q)
    right, also = task.engines[0].continued(goal, q)
    np.testing.assert_array_equal(reached, also)
    assert 50 < reached.sum() < 250
    assert worst(found[reached] - right[reached]) < 1e-9


def test_what_cannot_be_continued_is_refused(task: Task) -> None:
    five_bar = ClosedLoopModel.load(URDF / "five_bar.yaml")
    single = five_bar.compile(device="cuda", dtype="float32")
    with pytest.raises(InputError, match="in double precision"):
        single.continued(np.zeros((1, 2)), five_bar.home[None])
    with pytest.raises(InputError, match="in double precision"):
        single.build("closing")
    fewer = ClosedLoopModel(five_bar.model, five_bar.closures, ["left_joint"], home=five_bar.home)
    with pytest.raises(MechanismError, match="that determine all others"):
        fewer.compile(device="cuda").continued(np.zeros((1, 1)), five_bar.home[None])
    with pytest.raises(InputError, match="device = 'gpu'"):
        five_bar.task.compile(device="gpu")

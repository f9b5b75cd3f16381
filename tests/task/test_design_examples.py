"""The designs of examples/design: fronts against grids by closed forms, and the robots written."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.rps.workspace.certified import certify as certify_rps
from rps_pin.task.design import DescribedDesign, DesignResult, design, load_design
from rps_pin.task.design.search import best_of
from rps_pin.task.path_check import check_path
from rps_pin.task.workspace import task_grid, workspace
from tests.task.design_examples import (
    EXAMPLES,
    FOLDER,
    area,
    beyond,
    grid,
    judged,
    rps_parameters,
)

pytestmark = pytest.mark.slow

#: Candidates; and points of the grid along each dimension, fewer in all than candidates. All four
#: examples, with more of both: docs/design_table.py.
SIZES = {"3-RPS": (240, 13), "Delta": (240, 6)}
#: Least share of the area that a grid's best points dominate.
LEAST = 0.97


@cache
def found(name: str) -> tuple[DescribedDesign, DesignResult]:
    described = load_design(FOLDER / EXAMPLES[name].file)
    result = design(
        described.space,
        described.requirements,
        described.objectives,
        candidates=SIZES[name][0],
        population=60,
        seed=4,
        workers=1,
    )
    return described, result


@pytest.mark.parametrize("name", SIZES)
def test_objectives_are_those_of_closed_forms(name: str) -> None:
    """Of candidates that meet all requirements, and of some that do not."""
    described, result = found(name)
    rows = np.concatenate([np.flatnonzero(result.feasible)[:40], np.arange(40)])
    truth = judged(EXAMPLES[name], described, result.values[rows])
    np.testing.assert_array_equal(truth.met, result.feasible[rows])
    assert 0 < truth.met.sum() < len(rows)
    met = rows[truth.met]
    np.testing.assert_allclose(result.scores[met], truth.scores[truth.met], rtol=1e-9)


@pytest.mark.parametrize("name", SIZES)
def test_the_front_is_not_worse_than_a_grid(name: str) -> None:
    described, result = found(name)
    truth = judged(EXAMPLES[name], described, grid(described, SIZES[name][1]))
    signs = np.array([-1.0 if one.maximised else 1.0 for one in result.objectives])
    scores, front = truth.scores[truth.met], result.scores[result.front]
    best = scores[best_of(scores * signs)]
    assert len(best) > 1
    ends = np.stack([np.vstack([best, front]).min(axis=0), np.vstack([best, front]).max(axis=0)])
    share = area(front, result.objectives, ends) / area(best, result.objectives, ends)
    assert share > LEAST, share


@pytest.mark.parametrize("name", SIZES)
def test_a_robot_that_is_written_does_its_task(name: str, tmp_path: Path) -> None:
    """By the workspace on another grid, and by the checks of paths: nothing of the design's own."""
    described, result = found(name)
    asked = described.requirements
    result.write(tmp_path, [one for one in result.chosen() if one.name == "between"])
    task = ClosedLoopModel.load(tmp_path / "between.yaml").task
    over = {key: np.linspace(*ends, 3) for key, ends in asked.region.box.items()}
    for part in asked.region.round:  # a box in the disc or ball
        half = part.radius / np.sqrt(len(part.coordinates))
        for key, centre in zip(part.coordinates, part.centre, strict=True):
            over[key] = np.linspace(centre - half, centre + half, 3)
    space = workspace(
        task,
        task_grid(task, over),
        start=asked.region.grid(task)[0],
        min_conditioning=asked.min_conditioning,
    )
    assert space.inside.all()
    for path in (asked.motions or {}).values():
        assert check_path(task, path).ok


def test_the_region_of_a_3_rps_is_proven() -> None:
    """Between the points too, with the cones of the balls; what is not proven is outside of it."""
    _, result = found("3-RPS")
    (row,) = [one.row for one in result.chosen() if one.name == "between"]
    robot = rps_parameters(result.values[result.front[row]])
    boxes = certify_rps(robot, [0.215, -0.1, -0.1], [0.235, 0.1, 0.1], undecided=1e-5)
    assert boxes.volumes[0] > 0
    assert beyond(boxes, [1, 2], 0.1)
    too_far = certify_rps(robot, [0.195, -0.1, -0.1], [0.235, 0.1, 0.1])
    assert not beyond(too_far, [1, 2], 0.1)

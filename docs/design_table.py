"""Write the table of docs/design.md: PYTHONPATH=. .venv/bin/python docs/design_table.py.

Runs the designs of examples/design, compares each front with that of a grid by closed forms that
share nothing with the generated code (tests/task/design_examples.py), and proves what can be proven
of the robots that are chosen.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from marked import replaced

from rps_pin.arrays import Array
from rps_pin.numerics.boxes import CertifiedBoxes
from rps_pin.rps.workspace.certified import certify as certify_rps
from rps_pin.task import certify
from rps_pin.task.design import DescribedDesign, DesignResult, RoundPart, design, load_design
from rps_pin.task.design.search import best_of
from tests.task.design_examples import (
    EXAMPLES,
    FOLDER,
    area,
    beyond,
    grid,
    judged,
    rps_parameters,
)

PAGE = Path(__file__).parent / "design.md"
#: Points of the grid along each dimension.
GRIDS = {"3-RPS": 41, "Stewart": [8, 8, 5, 5], "Delta": [20, 20, 10], "ankle": 8}


class Compared(NamedTuple):
    """A front beside a grid."""

    best: Array
    """Best of each objective in the front, (2,)."""
    grid_best: Array
    """Best of each on the grid, (2,)."""
    share: float
    """Area that the front is better than, as a share of that of the grid's front."""
    error: float
    """Largest relative difference of the front's objectives from closed forms."""


def compare(name: str, described: DescribedDesign, found: DesignResult) -> Compared:
    """Compare a design's front with that of a grid."""
    example, asked = EXAMPLES[name], found.objectives
    front = found.scores[found.front]
    again = judged(example, described, found.values[found.front])
    if not again.met.all():
        raise AssertionError(f"{name}: {int((~again.met).sum())} robots of the front fail")
    on_grid = judged(example, described, grid(described, GRIDS[name]))
    signs = np.array([-1.0 if one.maximised else 1.0 for one in asked])
    scores = on_grid.scores[on_grid.met]
    best = scores[best_of(scores * signs)]
    ends = np.stack([np.vstack([best, front]).min(axis=0), np.vstack([best, front]).max(axis=0)])
    return Compared(
        signs * (signs * front).min(axis=0),
        signs * (signs * best).min(axis=0),
        area(front, asked, ends) / area(best, asked, ends),
        float(np.abs(again.scores / front - 1).max()),
    )


def proven_rps(found: DesignResult, row: int) -> str:
    """Prove the region of a 3-RPS: what is not inside is beyond its tilts."""
    robot = rps_parameters(found.values[found.front[row]])
    boxes = certify_rps(robot, [0.215, -0.1, -0.1], [0.235, 0.1, 0.1], undecided=1e-5)
    return "the whole region" if beyond(boxes, [1, 2], 0.1) else _shares(boxes)


def proven(
    found: DesignResult,
    row: int,
    low: list[float],
    high: list[float],
    round_: RoundPart | None = None,
) -> CertifiedBoxes:
    """Prove a box of coordinates of a robot of the front."""
    values = found.values[found.front[[row]]]
    q = found.measuring.middles(values)[0]
    robot = found.measuring.space.robot(values[0], q)  # type: ignore[attr-defined]
    return certify(
        robot.task, low, high, round=[round_] if round_ else [], undecided=0.01, most_boxes=20_000
    )


def proven_stewart(found: DesignResult, row: int) -> str:
    """Prove the cube of positions with all turns of at most 0.3 rad, of a Stewart platform."""
    low, high = [-0.06, -0.06, 0.54, -0.3, -0.3, -0.3], [0.06, 0.06, 0.66, 0.3, 0.3, 0.3]
    begun = time.process_time()
    boxes = proven(found, row, low, high, RoundPart(["rx", "ry", "rz"], [0.0, 0.0, 0.0], 0.3))
    seconds = time.process_time() - begun
    whole = boxes.verdict == "inside"
    return f"the whole region, in {seconds:.0f} s" if whole else _shares(boxes)


def proven_delta(found: DesignResult, row: int) -> str:
    """Prove the cylinder of a Delta: what is not inside of its box is beyond its radius."""
    boxes = proven(found, row, [-0.15, -0.15, -0.55], [0.15, 0.15, -0.45])
    return "the whole region" if beyond(boxes, [0, 1], 0.15) else _shares(boxes)


def proven_ankle(found: DesignResult, row: int) -> str:
    """Prove the range of an ankle."""
    boxes = proven(found, row, [-0.5, -0.25], [0.4, 0.25])
    return "the whole region" if not len(boxes.outside) + len(boxes.undecided) else _shares(boxes)


def _shares(boxes: CertifiedBoxes) -> str:
    inside, outside, undecided = boxes.volumes
    whole = sum(boxes.volumes)
    if outside == undecided == 0:
        return "the whole box"
    return f"{inside / whole:.2%} of a box inside, {undecided / whole:.2%} undecided"


PROOFS = {
    "3-RPS": proven_rps,
    "Stewart": proven_stewart,
    "Delta": proven_delta,
    "ankle": proven_ankle,
}


def row(name: str) -> str:
    """Return the row of an example."""
    described = load_design(FOLDER / EXAMPLES[name].file)
    begun = time.process_time()
    found = design(
        described.space,
        described.requirements,
        described.objectives,
        candidates=described.candidates,
        population=described.population,
        seed=described.seed,
        workers=1,
    )
    seconds = time.process_time() - begun
    compared = compare(name, described, found)
    between = next(one for one in found.chosen() if one.name == "between")
    binds = {found.binding(k).requirement for k in range(len(found.front))}
    proof = PROOFS[name](found, between.row)
    bests = " | ".join(
        f"{one.name}: {a:.4g}, grid {b:.4g}"
        for one, a, b in zip(found.objectives, compared.best, compared.grid_best, strict=True)
    )
    line = (
        f"| [`{EXAMPLES[name].file}`](../examples/design/{EXAMPLES[name].file}) | "
        f"{len(found.values)} | {seconds:.0f} s | {len(found.front)} | {bests} | "
        f"{compared.share:.3f} | {compared.error:.0e} | {', '.join(sorted(binds))} | {proof} |"
    )
    print(line, flush=True)
    return line


def main() -> None:
    """Write the table."""
    lines = [
        "| design | candidates | CPU | front | best | best | area | closed form | binds | proven |",
        "|---|---|---|---|---|---|---|---|---|---|",
        *(row(name) for name in EXAMPLES),
    ]
    PAGE.write_text(replaced(PAGE.read_text("utf-8"), "examples", "\n".join(lines)), "utf-8")


if __name__ == "__main__":
    main()

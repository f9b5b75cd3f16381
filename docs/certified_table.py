"""Write the table of proven boxes of docs/workspaces.md: .venv/bin/python docs/certified_table.py.

Names of rows as arguments run these only, and print them.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from marked import replaced

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.rps.workspace import certify as certify_rps
from rps_pin.task import certify

DOCS = Path(__file__).parent
PAGE = DOCS / "workspaces.md"
#: Least and greatest coordinates, and options.
BOXES: dict[str, tuple[Any, Any, dict[str, Any]]] = {
    "micro": ((0.19, -0.3, -0.3), (0.26, 0.3, 0.3), {"undecided": 0.01}),
    "stewart": ((-0.4, -0.4, 0.35, 0, 0, 0), (0.4, 0.4, 1.05, 0, 0, 0), {"undecided": 0.05}),
    "delta": ((-0.25, -0.25, -0.7), (0.25, 0.25, -0.4), {"undecided": 0.05}),
    "five_bar": ((-0.8, -0.8), (1.2, 0.8), {"undecided": 0.1}),
}


def row(name: str) -> str:
    """Return the row of a robot."""
    lower, upper, options = BOXES[name]
    if name == "micro":
        robot = RPSRobot.from_preset(name)
        coordinates, of, prove = robot.task.coordinates, robot, certify_rps
    else:
        task = ClosedLoopModel.load(DOCS.parent / "urdf" / f"{name}.yaml").task
        coordinates, of, prove = task.coordinates, task, certify
    begun = time.process_time()
    found = prove(of, lower, upper, **options)
    seconds, shares = time.process_time() - begun, np.array(found.volumes)
    inside, outside, undecided = (100 * shares / shares.sum()).tolist()
    ends = zip(coordinates, lower, upper, strict=True)
    box = ", ".join(f"{one} {low} to {high}" for one, low, high in ends if low < high)
    counts = sum(len(one) for one in (found.inside, found.outside, found.undecided))
    return (
        f"| `{name}` | {box} | {inside:.2f} % | {outside:.2f} % | {undecided:.2f} % | "
        f"{found.share_undecided:.1%} | {counts:,} | {seconds:.2g} s |"
    )


def main() -> None:
    """Write the table."""
    if names := sys.argv[1:]:
        print("\n".join(row(name) for name in names))
        return
    lines = [
        "| robot | box | inside | outside | undecided | of that inside | boxes | time |",
        "|---|---|---|---|---|---|---|---|",
        *(row(name) for name in BOXES),
    ]
    PAGE.write_text(replaced(PAGE.read_text("utf-8"), "boxes", "\n".join(lines)), "utf-8")


if __name__ == "__main__":
    main()

"""Write the table of docs/workspaces.md: .venv/bin/python docs/workspaces_table.py."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from marked import replaced

from rps_pin import ClosedLoopModel
from rps_pin.task.workspace import task_grid, volume, workspace

DOCS = Path(__file__).parent
PAGE = DOCS / "workspaces.md"

#: Ends of each axis, and points of each.
GRIDS = {
    "five_bar": ({"x": (-0.8, 0.9), "z": (-0.8, 0.9)}, (317, 1000)),
    "delta": ({"x": (-0.6, 0.6), "y": (-0.6, 0.6), "z": (-0.9, -0.1)}, (47, 100)),
    "stewart": ({"x": (-0.5, 0.5), "y": (-0.5, 0.5), "z": (0.3, 1.0)}, (47, 100)),
}


def row(name: str, points: int) -> str:
    """Return the row of a mechanism and a number of points along each axis."""
    task = ClosedLoopModel.load(DOCS.parent / "urdf" / f"{name}.yaml").task.compile()
    axes, _ = GRIDS[name]
    over = {key: np.linspace(*ends, points) for key, ends in axes.items()}
    few = {key: np.linspace(*ends, 21) for key, ends in axes.items()}
    workspace(task, task_grid(task, few))  # builds and loads the code
    for engine in task.engines:
        engine.wait()
    begun = time.process_time()
    found = workspace(task, task_grid(task, over))
    seconds, size = time.process_time() - begun, volume(found)
    per_point = 1e6 * seconds / found.grid.size
    share = found.inside.mean()
    return (
        f"| `{name}` | {found.grid.size:,} | {share:.0%} | {seconds:.2g} s | {per_point:.1f} us | "
        f"{size.value:.5g} +- {size.error:.1g} {size.unit} |"
    )


def main() -> None:
    """Write the table."""
    lines = [
        "| mechanism | points | inside | time | a point | volume, or area |",
        "|---|---|---|---|---|---|",
        *(row(name, points) for name, (_, counts) in GRIDS.items() for points in counts),
    ]
    PAGE.write_text(replaced(PAGE.read_text("utf-8"), "speed", "\n".join(lines)), "utf-8")


if __name__ == "__main__":
    main()

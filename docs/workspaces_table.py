"""Write tables of docs/workspaces.md: .venv/bin/python docs/workspaces_table.py [--huge].

Speed in memory, and grids of 10^4 to 10^7 points to a file by two threads; `--huge` adds 10^8,
which takes minutes.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from marked import replaced

from rps_pin import ClosedLoopModel
from rps_pin.task.workspace import task_grid, volume, workspace, workspace_to_file

DOCS = Path(__file__).parent
PAGE = DOCS / "workspaces.md"

#: Ends of each axis, and points of each.
GRIDS = {
    "five_bar": ({"x": (-0.8, 0.9), "z": (-0.8, 0.9)}, (317, 1000)),
    "delta": ({"x": (-0.6, 0.6), "y": (-0.6, 0.6), "z": (-0.9, -0.1)}, (47, 100)),
    "stewart": ({"x": (-0.5, 0.5), "y": (-0.5, 0.5), "z": (0.3, 1.0)}, (47, 100)),
}
#: Points along each axis of grids that go to a file; the last is huge.
COUNTS = (22, 47, 100, 216, 465)
THREADS = 2


def to_file(name: str, points: int) -> str:
    """Return the row of a grid that goes to a file; for a process of its own, by its memory."""
    task = ClosedLoopModel.load(DOCS.parent / "urdf" / f"{name}.yaml").task.compile()
    for engine in task.engines:
        engine.wait()
    axes, _ = GRIDS[name]
    over = {key: np.linspace(*ends, points) for key, ends in axes.items()}
    few = {key: np.linspace(*ends, 21) for key, ends in axes.items()}
    with tempfile.TemporaryDirectory() as folder:
        workspace_to_file(task, Path(folder) / "few.h5", task_grid(task, few), threads=THREADS)
        wall, cpu = time.perf_counter(), time.process_time()
        path = Path(folder) / "space.h5"
        found = workspace_to_file(task, path, task_grid(task, over), threads=THREADS)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        size = path.stat().st_size / 1e6
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return (
        f"| `{name}` | {found.points:,} | {found.inside / found.points:.0%} | {wall:.3g} s | "
        f"{cpu:.3g} s | {1e6 * cpu / found.points:.1f} us | {memory:.0f} MiB | {size:.3g} MB |"
    )


def in_process(name: str, points: int) -> str:
    """Return `to_file`'s row from a process of its own."""
    call = [sys.executable, __file__, "--row", name, str(points)]
    return subprocess.run(call, check=True, capture_output=True, text=True).stdout.strip()


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
    """Write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--huge", action="store_true", help="10^8 points too")
    parser.add_argument("--row", nargs=2, metavar=("NAME", "POINTS"), help="print one row")
    given = parser.parse_args()
    if given.row:
        print(to_file(given.row[0], int(given.row[1])))
        return
    speed = [
        "| mechanism | points | inside | time | a point | volume, or area |",
        "|---|---|---|---|---|---|",
        *(row(name, points) for name, (_, counts) in GRIDS.items() for points in counts),
    ]
    large = [
        "| mechanism | points | inside | time | CPU | CPU a point | memory | file |",
        "|---|---|---|---|---|---|---|---|",
        *(
            in_process(name, points)
            for name in ("delta", "stewart")
            for points in COUNTS[: None if given.huge else -1]
        ),
    ]
    text = replaced(PAGE.read_text("utf-8"), "speed", "\n".join(speed))
    PAGE.write_text(replaced(text, "large", "\n".join(large)), "utf-8")


if __name__ == "__main__":
    main()

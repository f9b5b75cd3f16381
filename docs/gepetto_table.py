"""Write the table of docs/mechanisms.md on Gepetto's example-parallel-robots.

Give it a checkout of that repository (https://github.com/Gepetto/example-parallel-robots):

    PYTHONPATH=. .venv/bin/python docs/gepetto_table.py ../example-parallel-robots
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

from marked import replaced

from benchmarks.robot_files.find import YAML, RobotFile
from benchmarks.robot_files.trial import LOADS, tried
from rps_pin import ClosedLoopModel
from rps_pin.closed_loop.io.gepetto import FILE
from rps_pin.errors import RPSPinError

PAGE = Path(__file__).parent / "mechanisms.md"
LONGEST = 130


def main() -> None:
    """Write the table."""
    folders = sorted(path.parent for path in Path(sys.argv[1]).rglob("robot.yaml"))
    head = (
        "| folder | velocities | rows | rank | mobility | actuators | held, accelerated, one step "
        "| MuJoCo file |"
    )
    lines = [head, "|---|---|---|---|---|---|---|---|", *map(row, folders)]
    PAGE.write_text(replaced(PAGE.read_text("utf-8"), "folders", "\n".join(lines)), "utf-8")


def row(folder: Path) -> str:
    """Return the row of a folder: its numbers, or why it is refused."""
    name = folder.name if folder.parent.name == "robots" else f"{folder.parent.name}/{folder.name}"
    trial = tried(RobotFile(folder / FILE, YAML, name))
    if trial.outcome != LOADS:
        return f"| `{name}` | | | | | | | {reason(trial.message, folder)} |"
    numbers = [trial.sizes[size] for size in ("nv", "rows", "rank", "mobility", "actuators")]
    stages = reason(trial.message, folder) if trial.stage else "yes"
    with tempfile.TemporaryDirectory() as scratch:
        try:
            ClosedLoopModel.load(folder).to_mjcf(Path(scratch) / "robot.xml")
            written = "written"
        except RPSPinError as error:
            written = reason(str(error), folder)
    return f"| `{name}` | {' | '.join(map(str, numbers))} | {stages} | {written} |"


def reason(message: str, folder: Path) -> str:
    """Return the beginning of a message, without the folder's path."""
    text = message.replace(f"{folder}/", "").replace("no home was given, and for ", "for ")
    text = re.sub(r"; there are: .*", "", text)
    return text if len(text) <= LONGEST else f"{text[:LONGEST].rsplit(' ', 1)[0]} ..."


if __name__ == "__main__":
    main()

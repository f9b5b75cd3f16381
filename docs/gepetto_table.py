"""Write the table of docs/mechanisms.md on Gepetto's example-parallel-robots.

Give it a checkout of that repository (https://github.com/Gepetto/example-parallel-robots):

    .venv/bin/python docs/gepetto_table.py ../example-parallel-robots
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

from marked import replaced

from rps_pin import ClosedLoopModel
from rps_pin.errors import RPSPinError

PAGE = Path(__file__).parent / "mechanisms.md"
LONGEST = 130


def main() -> None:
    """Write the table."""
    folders = sorted(path.parent for path in Path(sys.argv[1]).rglob("robot.yaml"))
    head = "| folder | velocities | rows | mobility | actuators | MuJoCo file |"
    lines = [head, "|---|---|---|---|---|---|", *map(row, folders)]
    PAGE.write_text(replaced(PAGE.read_text("utf-8"), "folders", "\n".join(lines)), "utf-8")


def row(folder: Path) -> str:
    """Return the row of a folder: its numbers, or why it is refused."""
    name = folder.name if folder.parent.name == "robots" else f"{folder.parent.name}/{folder.name}"
    try:
        mechanism = ClosedLoopModel.load(folder)
    except RPSPinError as error:
        return f"| `{name}` | | | | | {reason(error, folder)} |"
    numbers = (
        mechanism.model.nv,
        mechanism.constraint_size,
        mechanism.describe().mobility,
        len(mechanism.actuated),
    )
    with tempfile.TemporaryDirectory() as scratch:
        try:
            mechanism.to_mjcf(Path(scratch) / "robot.xml")
            written = "written"
        except RPSPinError as error:
            written = reason(error, folder)
    return f"| `{name}` | {' | '.join(map(str, numbers))} | {written} |"


def reason(error: RPSPinError, folder: Path) -> str:
    """Return the beginning of a message, without the folder's path."""
    text = str(error).replace(f"{folder}/", "").replace("no home was given, and for ", "for ")
    text = re.sub(r"; there are: .*", "", text)
    return text if len(text) <= LONGEST else f"{text[:LONGEST].rsplit(' ', 1)[0]} ..."


if __name__ == "__main__":
    main()

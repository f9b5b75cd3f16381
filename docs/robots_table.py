"""Write the tables of docs/robots.md from the results of a run of the zoo.

.venv/bin/python -m benchmarks.zoo_fetch ../robots
.venv/bin/python -m benchmarks.zoo ../robots --json zoo.json
PYTHONPATH=. .venv/bin/python docs/robots_table.py zoo.json
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

from marked import replaced

from benchmarks.robot_files.packages import packages
from benchmarks.robot_files.totals import Tried, causes, numbers, table
from benchmarks.robot_files.trial import Trial

PAGE = Path(__file__).parent / "robots.md"


def main() -> None:
    """Write the tables."""
    found = results(Path(sys.argv[1]))
    text = replaced(PAGE.read_text("utf-8"), "totals", table(found))
    text = replaced(text, "packages", by_package(found))
    PAGE.write_text(replaced(text, "causes", listed(found)), "utf-8")


def results(path: Path) -> list[Tried]:
    """Return what a run has written."""
    found = []
    for entry in json.loads(path.read_text("utf-8"))["files"]:
        shown, kind, _ = entry.pop("file"), entry.pop("kind"), entry.pop("agrees")
        found.append(Tried(shown, kind, Trial(**entry)))
    return found


def by_package(found: list[Tried]) -> str:
    """Return packages, their licences, and how many of their files load and agree."""
    lines = [
        "| package | licence it states | MJCF tried | load | agree | URDF tried | load | agree |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    for package in packages():
        own = [one for one in found if one.package == package.name]
        cells = [str(cell) for kind in ("MJCF", "URDF") for cell in numbers(own, kind)]
        name = f"{package.name} {package.version}"
        lines.append(f"| {name} | {package.licence} | {' | '.join(cells)} |")
    return "\n".join(lines)


def listed(found: list[Tried]) -> str:
    """Return why files are refused, at loading or later, or disagree; the most frequent first."""
    told = [one for one in causes(found) if re.search("refused|timeout|disagrees", one.what)]
    rows = ["| files | | such as |", "|---:|---|---|"]
    for one in told:
        what = one.what.replace("FILE is not a valid URDF: ", "").replace("|", " ")
        what = re.sub(r"<[\w:]+>", r"`\g<0>`", what)
        package, *_, name = one.files[0].split("/")
        rows.append(f"| {len(one.files)} | {what} | `{package}`: `{name}` |")
    return "\n".join(rows)


if __name__ == "__main__":
    main()

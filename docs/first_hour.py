"""Make frequent mistakes and write their error messages into docs/first_hour.md.

    .venv/bin/python docs/first_hour.py

Commands run in this process, as `rps-pin` runs them, in an empty folder.
"""

from __future__ import annotations

import contextlib
import io
import os
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import numpy as np

import rps_pin
from rps_pin import RPSParameters
from rps_pin.cli.app import run

PAGE = Path(__file__).with_name("first_hour.md")
ROOT = PAGE.parent.parent


class Edit(NamedTuple):
    """A wrong line in a file."""

    file: str
    right: str
    wrong: str


class Mistake(NamedTuple):
    """A mistake: a command or a line of Python, and a wrong line in a file."""

    title: str
    typed: str
    """A command, or a line of Python."""
    edit: Edit | None = None


MINE, MECHANISM, TREE = "mine.yaml", "four_bar.yaml", "four_bar.urdf"
IK = "rps-pin ik --robot mine.yaml --pose 0.22 0 0"
DESCRIBE = "rps-pin describe four_bar.yaml"

ROBOT = (
    Mistake("Missing file", "rps-pin ik --robot my.yaml --pose 0.22 0 0"),
    Mistake("Misspelt preset", "rps-pin helix --robot mirco"),
    Mistake("Misspelt command", "rps-pin hleix"),
    Mistake("Misspelt key", IK, Edit(MINE, "base_radius: 0.12", "base_radus: 0.12")),
    Mistake("Missing key", IK, Edit(MINE, "base_radius: 0.12\n", "")),
    Mistake("Number with a unit", IK, Edit(MINE, "base_radius: 0.12", "base_radius: 0.12 m")),
    Mistake("Decimal comma", IK, Edit(MINE, "base_radius: 0.12", "base_radius: 0,12")),
    Mistake(
        "Millimetres instead of metres",
        "rps-pin helix --robot mine.yaml",
        Edit(MINE, "base_radius: 0.12\n", "base_radius: 120\n"),
    ),
    Mistake(
        "kg mm^2 instead of kg m^2",
        IK,
        Edit(MINE, "leg_inertia: 0.00065625\n", "leg_inertia: 656.25\n"),
    ),
    Mistake(
        "Negative moment of inertia",
        IK,
        Edit(MINE, "- [0.00432, 0.0, 0.0]", "- [-0.00432, 0.0, 0.0]"),
    ),
    Mistake(
        "Inertia that no rigid body has",
        IK,
        Edit(MINE, "- [0.0, 0.0, 0.00864]", "- [0.0, 0.0, 0.0864]"),
    ),
    Mistake("Missing colon", IK, Edit(MINE, "base_radius: 0.12", "base_radius 0.12")),
    Mistake("Pose out of reach", "rps-pin ik --robot micro --pose 0.22 0.3 0"),
    Mistake("Leg lengths in millimetres", "rps-pin fk --robot micro --lengths 223 223 223"),
    Mistake("Pose of two numbers", "rps-pin ik --robot micro --pose 0.22 0.3"),
    Mistake("CSV column without a unit", "rps-pin dynamics path.csv --robot micro"),
)
OWN_MECHANISM = (
    Mistake(
        "Misspelt URDF file",
        DESCRIBE,
        Edit(MECHANISM, "urdf: four_bar.urdf", "urdf: fuor_bar.urdf"),
    ),
    Mistake(
        "Misspelt frame", DESCRIBE, Edit(MECHANISM, "frame_b: rocker_tip", "frame_b: rocker_top")
    ),
    Mistake("Unknown kind of closure", DESCRIBE, Edit(MECHANISM, "kind: revolute", "kind: hinge")),
    Mistake(
        "Link instead of a joint",
        DESCRIBE,
        Edit(MECHANISM, "actuated: [crank_joint]", "actuated: [crank]"),
    ),
    Mistake("Wrong axis", DESCRIBE, Edit(MECHANISM, "axis: [0, 1, 0]", "axis: [1, 0, 0]")),
    Mistake(
        "URDF: misspelt parent", DESCRIBE, Edit(TREE, 'parent link="crank"', 'parent link="crnak"')
    ),
    Mistake("URDF: misspelt tag", DESCRIBE, Edit(TREE, "</link>", "</lnik>")),
    Mistake("URDF: misspelt attribute", DESCRIBE, Edit(TREE, 'ixx="0.004"', 'ixxx="0.004"')),
    Mistake("URDF: negative mass", DESCRIBE, Edit(TREE, 'mass value="1.1"', 'mass value="-1.1"')),
)
PYTHON = (
    Mistake("Name instead of parameters", 'RPSRobot("micro")'),
    Mistake("Array of two numbers", "micro.inverse_kinematics([0.22, 0.1])"),
    Mistake("Pose instead of a configuration", "micro.inverse_dynamics(pose, rate, acceleration)"),
    Mistake(
        "Pair instead of a closure",
        'ClosedLoopModel.from_urdf("four_bar.urdf", [("a", "b")], [])',
    ),
    Mistake("Time after the end", "path.sample(7.0)"),
)
PARTS = {"robot": ROBOT, "mechanism": OWN_MECHANISM, "python": PYTHON}


def main() -> None:
    """Write the messages of the page."""
    text = PAGE.read_text("utf-8")
    for name, mistakes in PARTS.items():
        start, end = f"<!-- made by docs/first_hour.py: {name} -->\n", "<!-- end -->"
        before, found, rest = text.partition(start)
        assert found, f"the page has no place for {name}"
        text = before + start + "\n" + told(mistakes) + end + rest.partition(end)[2]
    PAGE.write_text(text, "utf-8")


def told(mistakes: tuple[Mistake, ...]) -> str:
    """Return mistakes and their messages as Markdown."""
    parts = []
    for mistake in mistakes:
        edit = mistake.edit
        words = f" (`{edit.wrong.strip()}` in `{edit.file}`)" if edit and edit.wrong else ""
        lines = [f"$ {mistake.typed}", *answer(mistake).splitlines()]
        if not mistake.typed.startswith("rps-pin"):
            lines[0] = f">>> {mistake.typed}"
        shown = "\n".join(f"    {line}".rstrip() for line in lines)
        parts.append(f"**{mistake.title}**{words}\n\n{shown}\n\n")
    return "".join(parts)


def answer(mistake: Mistake) -> str:
    """Make a mistake and return its message; fail if there is none or it is a traceback."""
    with right_files() as folder:
        edit = mistake.edit
        if edit:
            file = folder / edit.file
            text = file.read_text("utf-8")
            assert edit.right in text, edit
            file.write_text(text.replace(edit.right, edit.wrong, 1), "utf-8")
        do = of_command if mistake.typed.startswith("rps-pin") else of_python
        said = do(mistake.typed)
    assert said and "Traceback" not in said, said
    return said


@contextlib.contextmanager
def right_files() -> Iterator[Path]:
    """Change to a folder with a correct robot and mechanism, and a CSV file without units."""
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        folder = Path(name)
        RPSParameters.from_preset("micro").to_yaml(MINE)
        for file in (MECHANISM, TREE):
            (folder / file).write_bytes((ROOT / "urdf" / file).read_bytes())
        (folder / "path.csv").write_text("time,z,tilt_x,tilt_y\n0,0.22,0,0\n")
        yield folder


def of_command(line: str) -> str:
    """Return the standard error of a command."""
    screen = {"COLUMNS": "90", "TERM": "dumb"}
    said = io.StringIO()
    with (
        mock.patch.object(sys, "argv", shlex.split(line)),
        mock.patch.dict(os.environ, screen),
        contextlib.redirect_stderr(said),
        contextlib.redirect_stdout(io.StringIO()),
    ):
        try:
            run()
        except SystemExit as end:
            status = end.code
        else:
            status = 0
    assert status in (0, 1, 2)
    text = said.getvalue()
    if status == 2:  # Typer's own: a box, of which only the words are shown
        text = "\n".join(line.strip("│ ") for line in text.splitlines() if line.startswith("│"))
    return folded(text) + (f"\n(exit status {status})" if status != 1 else "")


def of_python(line: str) -> str:
    """Return the error message of a line of Python."""
    micro = rps_pin.RPSRobot.from_preset("micro")
    names = {name: getattr(rps_pin, name) for name in ("RPSRobot", "ClosedLoopModel")}
    still = np.zeros(3)
    path = rps_pin.helix(micro, radius=0.5e-3, pitch=0.3e-3, height=0.22)
    values = {"micro": micro, "path": path, "pose": [0.22, 0, 0], "rate": still}
    try:
        eval(line, {**names, **values, "acceleration": still})
    except rps_pin.RPSPinError as error:
        return folded(f"{type(error).__name__}: {error}")
    return ""


def folded(text: str) -> str:
    """Return text with long lines broken at blanks."""
    lines = []
    for line in text.strip().splitlines():
        now = ""
        for word in line.split(" "):
            if now and len(now) + len(word) >= 92:
                lines.append(now)
                now = " " * 4 + word
            else:
                now = f"{now} {word}" if now else word
        lines.append(now.rstrip())
    return "\n".join(lines)


if __name__ == "__main__":
    main()

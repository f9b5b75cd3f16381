"""Type the first hour of a new user, and write what is said into docs/first_hour.md.

    .venv/bin/python docs/first_hour.py

Commands run in this process, as `rps-pin` runs them, one after the other in one empty folder.
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

import marked

import rps_pin
from rps_pin.cli.app import run

PAGE = Path(__file__).with_name("first_hour.md")
WIDTH = 90


class Edit(NamedTuple):
    """What a user changes in a file."""

    file: str
    old: str
    new: str


class Typed(NamedTuple):
    """A command or a line of Python."""

    line: str
    lines: int | None = None
    """Lines of its answer that the page shows, below 0 the last; None shows all."""
    edits: tuple[Edit, ...] = ()
    """Mistakes that are made before; they are undone afterwards."""


MINE, HEXAPOD = "mine/mine.yaml", "hexapod/mine.yaml"
IK = f"rps-pin ik --robot {MINE} --pose 0.22 0.1 0"
PARTS = {
    "begin": (Typed("rps-pin new 3rps --output mine", 1),),
    "robot": (
        Typed(IK, 5),
        Typed(f"rps-pin dynamics mine/path.yaml --robot {MINE}", 6),
        Typed(f"rps-pin view {MINE} --html mine.html"),
    ),
    "python": (
        Typed(f'robot = RPSRobot(RPSParameters.from_yaml("{MINE}"))'),
        Typed("robot.inverse_kinematics([0.22, 0.1, 0]).length.round(4)"),
    ),
    "hexapod": (
        Typed("rps-pin new stewart --output hexapod", 2),
        Typed(f"rps-pin describe {HEXAPOD}", 1),
        Typed(f"rps-pin ik --mechanism {HEXAPOD} --at z=0.65 --forces", 5),
    ),
    "refused": (
        Typed(
            IK,
            edits=(
                Edit(MINE, "base_radius: 0.12", "base_radius: 120 mm"),
                Edit(MINE, "platform_mass: 1.2", "platform_mass: -1.2"),
            ),
        ),
        Typed(f"rps-pin ik --robot {MINE} --pose 0.22 0.3 0", -3),
    ),
}


def main() -> None:
    """Write what is said into the page."""
    text = PAGE.read_text("utf-8")
    for name, shown in session().items():
        text = marked.replaced(text, name, marked.block(shown))
    PAGE.write_text(text, "utf-8")


def session() -> dict[str, list[str]]:
    """Return the lines of each part of the page, typed in order in an empty folder."""
    told: dict[str, list[str]] = {}
    names = {name: getattr(rps_pin, name) for name in ("RPSRobot", "RPSParameters")}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for part, steps in PARTS.items():
            told[part] = []
            for step in steps:
                command = step.line.startswith("rps-pin")
                with edited(step.edits):
                    said = of_command(step.line) if command else of_python(step.line, names)
                told[part] += [f"{'$' if command else '>>>'} {step.line}", *cut(said, step.lines)]
    return told


def cut(said: list[str], lines: int | None) -> list[str]:
    """Return the first lines of an answer, or below 0 the last, and dots for what is left out."""
    if lines is None or len(said) <= abs(lines):
        return said
    return ["...", *said[lines:]] if lines < 0 else [*said[:lines], "..."]


@contextlib.contextmanager
def edited(edits: tuple[Edit, ...]) -> Iterator[None]:
    """Let files be changed for a while."""
    right = {edit.file: Path(edit.file).read_text("utf-8") for edit in edits}
    for edit in edits:
        text = Path(edit.file).read_text("utf-8")
        assert edit.old in text, edit
        Path(edit.file).write_text(text.replace(edit.old, edit.new, 1), "utf-8")
    yield
    for file, text in right.items():
        Path(file).write_text(text, "utf-8")


def of_command(line: str) -> list[str]:
    """Return the lines that a command prints."""
    said = io.StringIO()
    with (
        mock.patch.object(sys, "argv", shlex.split(line)),
        mock.patch.dict(os.environ, {"COLUMNS": str(WIDTH), "TERM": "dumb"}),
        contextlib.redirect_stderr(said),
        contextlib.redirect_stdout(said),
    ):
        try:
            run()
        except SystemExit as end:
            assert end.code in (0, 1), line
    assert "Traceback" not in said.getvalue()
    return folded(said.getvalue())


def of_python(line: str, names: dict[str, object]) -> list[str]:
    """Return what Python shows of a line."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(line, "first hour", "single"), names)
    return folded(said.getvalue())


def folded(text: str) -> list[str]:
    """Return lines, long ones broken at blanks."""
    lines = []
    for line in text.strip().splitlines():
        now = ""
        for word in line.split(" "):
            if now and len(now) + len(word) >= WIDTH + 2:
                lines.append(now)
                now = " " * 4 + word
            else:
                now = f"{now} {word}" if now else word
        lines.append(now.rstrip())
    return lines


if __name__ == "__main__":
    main()

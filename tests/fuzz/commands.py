"""Mutants of command lines: each option of each command, with values of its kind and others."""

from __future__ import annotations

import contextlib
import enum
import importlib
import inspect
import os
import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from typing import Annotated, Any, get_args, get_origin, get_type_hints
from unittest import mock

import typer
from matplotlib.figure import Figure

from rps_pin.cli import workspace
from rps_pin.errors import InputError
from rps_pin.paper import PaperComparison, paper_comparison
from rps_pin.plots import style
from tests.cli.commands import rps_pin
from tests.fuzz import hostile
from tests.fuzz.case import Case, WrongAnswerError

ROOT = Path(__file__).resolve().parents[2]
#: A fast line of each command; files of `_FILES` are in the folder.
BASES: dict[str, str] = {
    "view": "--html page.html --pose 0.4 0 0",
    "ik": "--pose 0.4 0 0",
    "fk": "--lengths 0.5 0.5 0.5",
    "workspace": "--points 3 --output out",
    "urdf": "--output robot_out.urdf",
    "helix": "--rate 20 --output out",
    "dynamics": "circle.yaml --robot micro --rate 20 --output out",
    "check": "--radius 0.01",
    "control": "short.yaml --output out",
    "describe": "four_bar.yaml",
    "assembly-modes": "four_bar.yaml --starts 50 --seconds 1",
    "simulate": "four_bar.yaml --duration 0.01 --output out",
    "convert": "four_bar.yaml --to urdf --output out",
    "new": "delta --output out",
    "examples": "--output out",
    "reproduce": "--quick --output a_file",
    "export c": "four_bar.yaml --output out",
    "doctor": "",
}
#: They wait for a browser, or compute for minutes what their other options do not change.
LEFT_OUT = {"view": {"interactive", "mechanism", "port", "video", "png"}, "reproduce": {"output"}}
#: How often another is drawn instead of commands that have few options, or take long.
SELDOM = {"reproduce": 0.9, "doctor": 0.9, "workspace": 0.5}
_FILES = {
    "four_bar.yaml": ROOT / "urdf" / "four_bar.yaml",
    "four_bar.urdf": ROOT / "urdf" / "four_bar.urdf",
    "loop.xml": ROOT / "tests" / "fuzz" / "start" / "loop.xml",
    "circle.yaml": ROOT / "docs" / "trajectories" / "circle.yaml",
    "micro.yaml": ROOT / "src" / "rps_pin" / "rps" / "presets" / "micro.yaml",
}
_SHORT = """robot: micro
trajectory: {kind: circle, height: 0.223, tilt: 0.02, duration: 0.02}
settle: 0.01
controller: {law: computed_torque, bandwidth: 15.0}
"""
_INTEGERS = ["0", "1", "-1", "2", "7", "999999999999", "1e3", "2.5", "2147483648", "10" * 30]
_NAMES = [
    "crank_joint",
    "coupler",
    "rocker_joint",
    "micro",
    "sokolov",
    "four_bar",
    "delta",
    "gravity",
]


@cache
def options(command: str) -> dict[str, tuple[str, Any]]:
    """Return the options of a command by parameter: name ("" of an argument), and type."""
    module = command.replace(" ", "_").replace("-", "_")
    if module == "doctor":
        return {"as_json": ("--json", bool)}
    function = getattr(importlib.import_module(f"rps_pin.cli.{module}"), f"{module}_command")
    hints = get_type_hints(function, include_extras=True)
    found = {}
    for name in inspect.signature(function).parameters:
        kind, *more = (
            get_args(hints[name]) if get_origin(hints[name]) is Annotated else [hints[name]]
        )
        given = [one for one in more if isinstance(one, typer.models.OptionInfo)]
        words = [w for one in given for w in one.param_decls or () if w.startswith("--")]
        is_argument = any(isinstance(one, typer.models.ArgumentInfo) for one in more)
        option = "" if is_argument else (words or [f"--{name.replace('_', '-')}"])[0]
        if name not in LEFT_OUT.get(command, ()):
            found[name] = option, kind
    return found


def mutant(rng: Random) -> Case:
    """Return a command line with one to three options changed, put in, doubled or left out."""
    command = rng.choice(sorted(BASES))
    if rng.random() < SELDOM.get(command, 0.0):
        command = "ik"
    words = BASES[command].split()
    known = options(command)
    for _ in range(rng.choice([1, 1, 2, 3])):
        option, kind = known[rng.choice(sorted(known))]
        if rng.random() < 0.8:
            _without(words, option)
        if option:
            words += [option, *_values(kind, rng)]
        elif words and not words[0].startswith("-"):
            words[0] = _path(rng)
    if rng.random() < 0.05:
        words.insert(rng.randrange(len(words) + 1), rng.choice(hostile.TEXTS))
    if rng.random() < 0.05 and words:
        del words[rng.randrange(len(words))]
    words = [word.replace("\0", "") for word in words]
    if command == "reproduce" and "a_file" not in words:
        words += ["--output", "a_file"]
    return Case("command", {}, (*command.split(), *words))


def _without(words: list[str], option: str) -> None:
    if option in words:
        at = words.index(option)
        end = at + 1
        while end < len(words) and not words[end].startswith("--"):
            end += 1
        del words[at:end]


def _values(kind: Any, rng: Random) -> list[str]:
    """Return words for an option of a type: most fit it."""
    parts = [one for one in get_args(kind) if one is not type(None)]
    if kind is bool:
        found = []
    elif rng.random() < 0.12:
        found = [hostile.text(rng)]
    elif get_origin(kind) is tuple:
        found = [word for one in parts for word in _values(one, rng)[:1]]
    elif parts:  # a list's, or without None
        found = _values(parts[0], rng)
    else:
        found = [_value(kind, rng)]
    return found


def _value(kind: type, rng: Random) -> str:
    if issubclass(kind, enum.Enum):
        return str(rng.choice(list(kind)).value)
    if kind is float:
        return rng.choice([hostile.number(rng), rng.choice(hostile.NO_NUMBERS)])
    if kind is int:
        return rng.choice([*_INTEGERS, rng.choice(hostile.NO_NUMBERS)])
    if kind is Path:
        return _path(rng)
    name = rng.choice(_NAMES)
    return rng.choice([name, f"{name}={hostile.number(rng)}", hostile.text(rng), _path(rng)])


def _path(rng: Random) -> str:
    own = [
        *_FILES,
        "short.yaml",
        "a_file",
        "out",
        "new",
        "new/deep/er",
        ".",
        "..",
        "a_file/x",
        "loop",
    ]
    odd = ["/dev/null", "/dev/full", "/proc/self/mem", "x" * 300, "", " ", "[b]", "new.csv", "fifo"]
    return rng.choice([*own, *odd, *_NAMES, hostile.text(rng).replace("/etc", "etc")])


def use(given: Case, folder: Path) -> None:
    """Run the command; a refusal is raised as `InputError` with the command's words.

    Raises
    ------
    InputError
        If it ends with 1 or 2 and says why.
    WrongAnswerError
        If it ends otherwise, shows a traceback, or is silent.
    """
    for name, path in _FILES.items():
        shutil.copy(path, folder / name)
    (folder / "short.yaml").write_text(_SHORT)
    (folder / "a_file").write_text("x")
    os.mkfifo(folder / "fifo")
    os.link(folder / "circle.yaml", folder / "loop")
    with _without_what_no_option_changes():
        ended = rps_pin(*given.arguments, folder=folder, RPS_PIN_CHROMIUM="", COLUMNS="200")
    said = ended.stdout + ended.stderr
    if "Traceback" in said or ended.returncode not in (0, 1, 2):
        raise WrongAnswerError(f"status {ended.returncode} {_where(said)}: {said[-600:]}")
    if "\x1b" in said:
        raise WrongAnswerError(f"escapes in the output: {said!r}")
    if ended.returncode:
        if not ended.stderr.strip() and "check" not in given.arguments:
            raise WrongAnswerError(f"status {ended.returncode} without a word: {said!r}")
        raise InputError(ended.stderr.strip() or "the check failed")
    words = {"nan", "NaN", "Infinity"}
    if words & set(ended.stdout.replace(",", " ").split()):
        raise WrongAnswerError(f"a number is not finite: {ended.stdout[-600:]}")


@contextlib.contextmanager
def _without_what_no_option_changes() -> Iterator[None]:
    """Compute the paper's comparison once a process; draw nothing, which takes seconds."""
    with contextlib.ExitStack() as stack:
        stack.enter_context(mock.patch.object(Figure, "savefig", _without_drawing))
        stack.enter_context(mock.patch.object(style, "_large_as_pictures", contextlib.nullcontext))
        stack.enter_context(mock.patch.object(workspace, "paper_comparison", _paper_comparison))
        yield


@cache
def _paper_comparison() -> tuple[PaperComparison, ...]:
    return paper_comparison()


def _without_drawing(figure: Figure, target: Any, **options: Any) -> None:
    """Write no picture."""
    del figure, options
    if isinstance(target, (str, Path)):
        Path(target).write_bytes(b"picture")


def _where(said: str) -> str:
    kind, _, rest = said.partition("a fault of rps-pin: ")[2].partition(":")
    return f"{kind} {rest.rpartition(' (')[2].partition(')')[0]}"

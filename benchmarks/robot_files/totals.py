"""Totals of many trials: how many load, agree with MuJoCo, and why others do not."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.robot_files.find import MJCF, URDF, YAML
from benchmarks.robot_files.trial import APART, CRASHED, LOADS, REFUSED, TIMEOUT, Trial

KINDS = MJCF, URDF, YAML
_LINE = re.compile(r":\d+\b|\bline \d+")


class Tried(NamedTuple):
    """One file's line."""

    shown: str
    kind: str
    trial: Trial

    @property
    def package(self) -> str:
        """The folder right below the one that was searched."""
        return self.shown.split("/")[0]


class Cause(NamedTuple):
    """Files that fail for one reason."""

    what: str
    files: list[str]


def line(one: Tried) -> str:
    """Return one line for one file."""
    trial = one.trial
    head = f"{trial.outcome:8} {one.kind:5} {one.shown}"
    if trial.outcome != LOADS:
        return f"{head}: {trial.message}"
    parts = [" ".join(f"{name} {size}" for name, size in trial.sizes.items())]
    if trial.differences:
        worst = max(
            trial.differences, key=lambda name: np.nan_to_num(trial.differences[name], nan=np.inf)
        )
        word = "agrees" if trial.agrees else "DISAGREES"
        parts.append(f"{word} (worst: {worst} {trial.differences[worst]:.1e})")
    else:
        parts.append(f"not compared: {trial.mujoco}")
    if trial.stage:
        parts.append(f"{trial.stage} refused: {trial.message}")
    return f"{head}: {'; '.join(parts)}; {trial.seconds:.1f} s"


def table(found: Sequence[Tried]) -> str:
    """Return the totals by kind, as a Markdown table."""
    lines = [
        "| | " + " | ".join(KINDS) + " |",
        "|---|" + "---:|" * len(KINDS),
    ]
    rows = {
        "files tried": lambda t: True,
        "load": lambda t: t.outcome == LOADS,
        "refused": lambda t: t.outcome == REFUSED,
        "refused, and the line named": lambda t: (
            t.outcome == REFUSED and bool(_LINE.search(t.message))
        ),
        "another exception": lambda t: t.outcome == CRASHED,
        "longer than the limit": lambda t: t.outcome == TIMEOUT,
        "load, but refuse a later stage": lambda t: t.outcome == LOADS and bool(t.stage),
        "compared with MuJoCo": lambda t: t.agrees is not None,
        "agree to 1e-9": lambda t: t.agrees is True,
    }
    for name, test in rows.items():
        counts = [_count(found, kind, test) for kind in KINDS]
        lines.append(f"| {name} | " + " | ".join(map(str, counts)) + " |")
        if name == "load":
            lines.append("| share that loads | " + " | ".join(_shares(found, counts)) + " |")
    return "\n".join(lines)


def _shares(found: Sequence[Tried], counts: Sequence[int]) -> list[str]:
    all_of = [len(tried(found, kind)) for kind in KINDS]
    return [f"{n / of:.1%}" if of else "" for n, of in zip(counts, all_of, strict=True)]


def by_package(found: Sequence[Tried]) -> str:
    """Return how many files of each package load and agree, as a Markdown table."""
    lines = [
        "| package | MJCF tried | load | agree | URDF tried | load | agree |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for package in sorted({one.package for one in found}):
        own = [one for one in found if one.package == package]
        rows = [numbers(own, kind) for kind in (MJCF, URDF)]
        if any(count for count, *_ in rows):
            cells = [str(cell) for row in rows for cell in row]
            lines.append(f"| {package} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def numbers(found: Sequence[Tried], kind: str) -> tuple[int, int, str]:
    """Return how many of a kind are tried, load, and agree of how many."""
    agree = _count(found, kind, lambda t: t.agrees is True)
    compared = _count(found, kind, lambda t: t.agrees is not None)
    loads = _count(found, kind, lambda t: t.outcome == LOADS)
    return len(tried(found, kind)), loads, f"{agree} of {compared}" if compared else ""


def _count(found: Sequence[Tried], kind: str, test: Callable[[Trial], bool]) -> int:
    return sum(test(one.trial) for one in tried(found, kind))


def tried(found: Iterable[Tried], kind: str) -> list[Tried]:
    """Return the files of a kind that are not counted apart."""
    return [one for one in found if one.kind == kind and one.trial.outcome != APART]


def causes(found: Sequence[Tried]) -> list[Cause]:
    """Return why files do not load, refuse a stage or disagree, the most frequent first."""
    groups: dict[str, list[str]] = defaultdict(list)
    for one in found:
        trial = one.trial
        if trial.outcome == APART:
            groups[f"apart: {one.kind}: {_general(trial.message)}"].append(one.shown)
        elif trial.stage:
            word = REFUSED if trial.outcome == LOADS else trial.outcome
            what = f"{one.kind}: {trial.stage} {word}: {_general(trial.message)}"
            groups[what].append(one.shown)
        if trial.agrees is False:
            wrong = [name for name, value in trial.differences.items() if not value <= 1e-9]
            groups[f"{one.kind}: disagrees: {', '.join(wrong)}"].append(one.shown)
        elif trial.outcome == LOADS and trial.agrees is None and one.kind != YAML:
            groups[f"{one.kind}: not compared: {_general(trial.mujoco)}"].append(one.shown)
    return sorted((Cause(*pair) for pair in groups.items()), key=lambda c: -len(c.files))


def _general(message: str) -> str:
    """Return a message without what belongs to one file: paths, names, numbers, lists."""
    message = re.sub(r"; there are:.*|there are: .*", "", message)
    message = re.sub(r"(it moves the joints) [^(]*", r"\1 NAMES ", message)
    message = re.sub(r"\S*/\S+", "FILE", message)
    message = re.sub(r"'[^']*'|\"[^\"]*\"", "NAME", message)
    message = re.sub(r"(?<![A-Za-z])[-+]?\d[\d.]*(e[-+]?\d+)?", "N", message)
    return message[:160]

"""Figures of `generated_code_table`, their tables, and the goals that they are compared with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

FIRST_LOOPS = 8
"""Costs of fewer loops are mostly those of a call."""
BATCH = "batch of 10^5, one thread (us a sample)"
CHAIN_BATCH = "batch of 1000, one thread (us a sample)"
DIRECT = "direct kinematics, batch of 10^5, one thread (us a pose)"


class Figures(dict[str, dict[str, dict[str, float]]]):
    """Figures by kind, mechanism and engine; kinds in us are shown with ratios."""

    def add(self, kind: str, mechanism: str, found: Mapping[str, float]) -> None:
        """Add the figures of a mechanism, ours first."""
        self.setdefault(kind, {})[mechanism] = dict(found)

    def ratio(self, kind: str, mechanism: str, engine: str) -> float:
        """Return ours over that of another engine."""
        found = self[kind][mechanism]
        return found["generated"] / found[engine]


def table(figures: Figures, kind: str) -> str:
    """Return a kind of figure: a line for each mechanism, a column for each engine."""
    lines = figures[kind]
    columns = list(dict.fromkeys(name for found in lines.values() for name in found))
    text = [f"| | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for mechanism, found in lines.items():
        cells = [_cell(found, column, "(us" in kind and "generated" in found) for column in columns]
        text.append(f"| {mechanism} | {' | '.join(cells)} |")
    return "\n".join(text)


def _cell(found: Mapping[str, float], column: str, with_ratio: bool) -> str:
    if column not in found:
        return ""
    if np.isnan(found[column]):
        return "NaN"
    text = f"{found[column]:.3g}"
    if with_ratio and column != "generated":
        text += f" ({found['generated'] / found[column]:.2g})"
    return text


# Goals --------------------------------------------------------------------------------------------


class Goal(NamedTuple):
    """A figure and the most that it may be."""

    what: str
    limit: float
    figure: Callable[[Figures], float]
    mechanism: str
    unit: str = ""


def _over(kind: str, engine: str, limits: Mapping[str, float]) -> list[Goal]:
    """Return goals of ratios, by mechanism."""
    return [
        Goal(
            f"{kind.removesuffix(' (us)')} / {engine}",
            limit,
            lambda figures, name=name: figures.ratio(kind, name, engine),
            name,
        )
        for name, limit in limits.items()
    ]


def _at_most(
    kind: str, engine: str, limits: Mapping[str, float], unit: str, what: str
) -> list[Goal]:
    """Return goals of figures, by mechanism."""
    return [
        Goal(what, limit, lambda figures, name=name: figures[kind][name][engine], name, unit)
        for name, limit in limits.items()
    ]


def growth(figures: Figures, kind: str, engine: str) -> float:
    """Return the exponent of a figure over the number of loops of chains."""
    chains = {
        int(name.split()[0]): found[engine]
        for name, found in figures[kind].items()
        if "four-bar" in name
    }
    loops = [n for n in chains if n >= FIRST_LOOPS]
    costs = [chains[n] for n in loops]
    return float(np.polyfit(np.log(loops), np.log(costs), 1)[0])


_LEGS = ("leg", "biped")
_ALL = ("3-RPS", "Delta with rods", "Stewart", "five-bar", *_LEGS)
GOALS = [
    *_over(
        "forward dynamics (us)",
        "mj_forward",
        {"3-RPS": 0.25, "Delta with rods": 0.3, "Stewart": 0.3, "biped": 0.4},
    ),
    *_over(
        "step of 1 ms, 64 in a call (us)",
        "mj_step Euler",
        {"3-RPS": 0.4, "Delta with rods": 0.8, "Stewart": 0.8, "biped": 1.2},
    ),
    *_at_most(
        "largest gap in 1000 steps (m)",
        "generated",
        dict.fromkeys(_ALL, 1e-12),
        "m",
        "largest gap in 1000 steps",
    ),
    *(
        goal
        for which in ("inverse", "forward")
        for goal in _over(
            f"derivatives of {which} dynamics (us)",
            "Pinocchio engine",
            dict.fromkeys(_ALL, 0.01),
        )
    ),
    *_at_most(
        BATCH,
        "inverse dynamics",
        {"3-RPS": 0.05, "Stewart": 0.1},
        "us",
        "batch of 10^5 inverse dynamics, a sample and thread",
    ),
    *_at_most(
        "build (s)", "generated", {"3-RPS": 2.0, "Stewart": 5.0, "biped": 30.0}, "s", "build, gcc"
    ),
    *_at_most(DIRECT, "generated", {"3-RPS": 0.1}, "us", "direct kinematics in a batch, a pose"),
    *(
        Goal(
            f"exponent over loops: {what}",
            1.1,
            lambda figures, kind=kind, engine=engine: growth(figures, kind, engine),
            f"{FIRST_LOOPS} to 64 four-bars",
        )
        for what, kind, engine in (
            ("call of inverse dynamics", "inverse dynamics (us)", "generated"),
            ("call of forward dynamics", "forward dynamics (us)", "generated"),
            ("inverse dynamics in a batch", CHAIN_BATCH, "inverse dynamics"),
            ("forward dynamics in a batch", CHAIN_BATCH, "forward dynamics"),
            ("build", "build (s)", "generated"),
        )
    ),
]


def goals_table(figures: Figures) -> str:
    """Return a line for each goal whose figure was measured."""
    text = ["| goal | mechanism | at most | found | met |", "|---|---|---|---|---|"]
    for goal in GOALS:
        try:
            found = goal.figure(figures)
        except (KeyError, TypeError, ValueError):  # not measured this time
            continue
        met = "yes" if found <= goal.limit else "**no**"
        unit = f" {goal.unit}" if goal.unit else ""
        text.append(
            f"| {goal.what} | {goal.mechanism} | {goal.limit:g}{unit} | {found:.2g}{unit} | {met} |"
        )
    return "\n".join(text)

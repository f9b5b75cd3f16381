"""What a design found: all candidates, the front of the best, and robots chosen from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.errors import InputError
from rps_pin.files import csv_of, write_text
from rps_pin.task.design.measures import Measures, Measuring
from rps_pin.task.design.requirements import Objective
from rps_pin.task.design.violations import WITHOUT_ROOM
from rps_pin.validation import whole_number


class Binding(NamedTuple):
    """The requirement that a candidate meets with the least room."""

    requirement: str
    margin: float
    """In the unit of `rps_pin.task.design.violations`: 0.03 is 3 % of the bound."""
    limit: str
    """Which limit of a joint, where it is limits; otherwise empty."""


class Chosen(NamedTuple):
    """A robot of the front."""

    name: str
    """Such as ``"least_size"`` or ``"between"``."""
    row: int
    """Its row in the front."""


@dataclass(frozen=True, eq=False)
class DesignResult:
    """What a design found.

    Attributes
    ----------
    measuring : Measuring
        Space and requirements, and what measured the candidates.
    objectives : tuple of Objective
        As asked.
    seed : int
        Of the random numbers.
    values : array
        Dimensions of all candidates, shape (n, d), in the order of the search.
    measures : Measures
        Of all candidates.
    scores : array
        Their objectives, shape (n, k).
    violations : dict of array
        By how much they fail each requirement, (n,) each; at most 0 where they meet it.
    front : array
        Rows of the candidates that meet all requirements, and than which none is better in all
        objectives; sorted by the first one.
    """

    measuring: Measuring
    objectives: tuple[Objective, ...]
    seed: int
    values: Array
    measures: Measures
    scores: Array
    violations: dict[str, Array]
    front: Indices

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the dimensions."""
        return tuple(one.name for one in self.measuring.space.dimensions)

    @property
    def feasible(self) -> Bools:
        """Which candidates meet all requirements, shape (n,)."""
        return np.asarray(np.max([*self.violations.values()], axis=0) <= 0)

    def __str__(self) -> str:
        objectives = ", ".join(
            f"{one.name} {self.scores[self.front, k].min():.6g} to "
            f"{self.scores[self.front, k].max():.6g}"
            for k, one in enumerate(self.objectives)
        )
        return (
            f"{len(self.values)} candidates, of which {int(self.feasible.sum())} meet all "
            f"requirements; {len(self.front)} in the front: {objectives}"
        )

    def binding(self, row: int) -> Binding:
        """Return which requirement the front's robot of a row meets with the least room."""
        at = int(self.front[row])
        rooms = {
            name: -float(value[at])
            for name, value in self.violations.items()
            if name not in WITHOUT_ROOM
        }
        if not rooms or not np.isfinite(min(rooms.values())):
            return Binding("none", float("inf"), "")
        name = min(rooms, key=rooms.__getitem__)
        limit = self.measuring.limits[int(self.measures.limit[at])] if name == "limits" else ""
        return Binding(name, rooms[name], limit)

    def chosen(self, most: int = 5) -> list[Chosen]:
        """Return robots of the front: the best in each objective, and those between.

        The one between is nearest to the best of all objectives at once, each as a share of its
        range in the front; the others are spread along the front.
        """
        count = whole_number(most, "most")
        scores = self._small(self.scores[self.front])
        found: list[Chosen] = []
        for k, objective in enumerate(self.objectives):
            self._add(found, Chosen(_best_in(objective), int(np.argmin(scores[:, k]))))
        span = np.ptp(scores, axis=0)
        share = (scores - scores.min(axis=0)) / np.where(span > 0, span, 1.0)
        self._add(found, Chosen("between", int(np.argmin(np.linalg.norm(share, axis=1)))))
        for k, index in enumerate(np.linspace(0, len(self.front) - 1, 2 * count).astype(int), 1):
            if len(found) < count:
                self._add(found, Chosen(f"front_{k}", int(index)))
        return found[:count]

    @staticmethod
    def _add(found: list[Chosen], one: Chosen) -> None:
        if one.row not in [other.row for other in found]:
            found.append(one)

    def _small(self, scores: Array) -> Array:
        signs = [-1.0 if one.maximised else 1.0 for one in self.objectives]
        return np.asarray(scores * signs)

    # Tables ---------------------------------------------------------------------------------------

    def table(self, rows: Sequence[int] | None = None) -> tuple[list[str], list[list[Any]]]:
        """Return the columns and rows of a table of the front, or of some rows of it."""
        at = range(len(self.front)) if rows is None else rows
        columns = [*self.names]
        columns += [one.name for one in self.objectives if one.name not in columns]
        more = [
            "size",
            "mass",
            "conditioning",
            "stroke",
            "force",
            "speed",
            "stiffness",
            "clearance",
        ]
        found = self.measures._asdict()
        more = [n for n in more if n not in columns and np.isfinite(found[n][self.front]).all()]
        columns += [*more, "binding", "margin"]
        table = []
        for row in at:
            index, binding = int(self.front[row]), self.binding(row)
            scores = {one.name: self.scores[index, k] for k, one in enumerate(self.objectives)}
            known = scores | dict(zip(self.names, self.values[index], strict=True))
            known |= {name: found[name][index] for name in more}
            bound = (
                f"{binding.requirement}: {binding.limit}" if binding.limit else binding.requirement
            )
            table.append([*(float(known[name]) for name in columns[:-2]), bound, binding.margin])
        return columns, table

    def csv_text(self) -> str:
        """Return the front as CSV, SI units."""
        columns, rows = self.table()
        cells = [[repr(c) if isinstance(c, float) else c for c in row] for row in rows]
        return csv_of([columns, *cells])

    def sheet(self, chosen: Sequence[Chosen]) -> str:
        """Return a text that says of each chosen robot how it meets each requirement."""
        lines = [str(self), ""]
        for one in chosen:
            at, binding = int(self.front[one.row]), self.binding(one.row)
            lines.append(f"{one.name}")
            for name, value in zip(self.names, self.values[at], strict=True):
                lines.append(f"  {name} = {value:.9g}")
            for k, objective in enumerate(self.objectives):
                lines.append(f"  objective {objective.name}: {self.scores[at, k]:.6g}")
            for name, value in self.violations.items():
                met = "met" if name in WITHOUT_ROOM else f"margin {-value[at]:.4g}"
                mark = "  <- binds" if name == binding.requirement else ""
                limit = f" ({binding.limit})" if mark and binding.limit else ""
                lines.append(f"  {name}: {met}{limit}{mark}")
            lines.append("")
        return "\n".join(lines)

    # Files ----------------------------------------------------------------------------------------

    def files(self, folder: Path, chosen: Sequence[Chosen]) -> list[Path]:
        """Return the files that `write` writes."""
        space = self.measuring.space
        robots = [file for one in chosen for file in space.files(folder, one.name)]
        return [folder / "front.csv", folder / "sheet.txt", *robots]

    def write(self, folder: Path, chosen: Sequence[Chosen] | None = None) -> list[Path]:
        """Write the front, the sheet and the chosen robots; replace what is there.

        Parameters
        ----------
        folder
            A folder that is there.
        chosen
            Robots of the front; `chosen` if left out.
        """
        robots = self.chosen() if chosen is None else chosen
        write_text(folder / "front.csv", self.csv_text())
        write_text(folder / "sheet.txt", self.sheet(robots))
        space = self.measuring.space
        values = self.values[self.front[[one.row for one in robots]]]
        for one, row, q in zip(robots, values, self.measuring.middles(values), strict=True):
            space.write(row, q, folder, one.name)
        return self.files(folder, robots)

    def dimensions_of(self, row: int) -> Mapping[str, float]:
        """Return the dimensions of the front's robot of a row, by name."""
        if not 0 <= row < len(self.front):
            raise InputError(f"row {row}: the front has {len(self.front)}")
        return dict(zip(self.names, self.values[self.front[row]].tolist(), strict=True))


def possible_names(objectives: Sequence[Objective], most: int) -> list[str]:
    """Return the names that `DesignResult.chosen` may give to at most so many robots."""
    spread = [f"front_{k}" for k in range(1, 2 * most + 1)]
    return [*map(_best_in, objectives), "between", *spread]


def _best_in(objective: Objective) -> str:
    """Return the name of the robot that is best in an objective."""
    word = "most" if objective.maximised else "least"
    return "_".join([word, *objective.name.replace("+", "and").split()])

"""First-order errors of the output's pose, and which tolerance they come from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.assembly.completion import beyond_limits
from rps_pin.errors import InputError, few
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.tolerances.model import Nominal, ToleranceModel
from rps_pin.task.tolerances.poses import Poses
from rps_pin.task.tolerances.specification import Chosen
from rps_pin.validation import positive_number

#: Slopes below this part of a unit of the number are rounding errors: nothing sees it.
UNSEEN = 1e-9
#: Units of a workshop, a thousandth of SI's.
SHOWN_PART = {"position": "mm", "angle": "mrad"}


class Part(NamedTuple):
    """The coordinates of the output in one unit: its position, or its angles."""

    name: str
    """``"position"`` or ``"angle"``."""
    columns: Indices
    """Which coordinates."""
    unit: str
    """``"m"`` or ``"rad"``."""


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class ToleranceAnalysis:
    """Errors of the output's pose by tolerances, to first order: dx = S dp.

    The errors of the numbers are independent of each other, and the same at all poses, as those of
    one machine are. Errors of a rotation are those of its rotation vector.
    """

    model: ToleranceModel
    """The mechanism, for other poses and for exact errors."""
    tolerances: Chosen
    """Of the numbers, p of them."""
    poses: Poses
    """n poses."""
    nominal: Nominal
    """The same, of the extended mechanism."""
    slopes: Array
    """S, derivatives of the m coordinates by the p numbers, shape (n, m, p)."""
    left_out: tuple[str, ...] = ()
    """Numbers whose errors would open loops that are redundant, which were left out."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the numbers."""
        return self.tolerances.labels

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Of the output, names."""
        return self.model.coordinates

    @property
    def parts(self) -> tuple[Part, ...]:
        """Coordinates in one unit: position and angles, as far as there are any."""
        turns = self.model.angular
        both = (
            Part("position", np.flatnonzero(~turns), "m"),
            Part("angle", np.flatnonzero(turns), "rad"),
        )
        return tuple(part for part in both if part.columns.size)

    def part(self, name: str) -> Part:
        """Return ``"position"`` or ``"angle"``.

        Raises
        ------
        InputError
            If the output has no such coordinates.
        """
        for part in self.parts:
            if part.name == name:
                return part
        raise InputError(
            f"no part {name!r}; the output has: {', '.join(part.name for part in self.parts)}"
        )

    @property
    def deviations(self) -> Array:
        """Standard deviations of the coordinates at the poses, shape (n, m), m or rad."""
        return np.asarray(np.sqrt((self.slopes**2) @ self.tolerances.deviations**2))

    @property
    def worst(self) -> Array:
        """Largest errors that the tolerances allow, shape (n, m): sum of |S| t."""
        return np.asarray(np.abs(self.slopes) @ self.tolerances.limits)

    def size(self, part: str) -> Array:
        """Return root mean square lengths of the error of position, or angle, at the poses, (n,).

        The root of the sum of the coordinates' variances.
        """
        return np.asarray(np.linalg.norm(self.deviations[:, self.part(part).columns], axis=1))

    def rms(self, part: str) -> float:
        """Return the root mean square of `size` over the poses."""
        return float(np.sqrt(np.mean(self.size(part) ** 2)))

    def own(self, part: str) -> Array:
        """Return the root mean square error that each number makes alone, over the poses, (p,)."""
        slopes = self.slopes[:, self.part(part).columns]
        return np.asarray(
            np.sqrt((slopes**2).sum(axis=1).mean(axis=0)) * self.tolerances.deviations
        )

    def shares(self, part: str) -> Array:
        """Return which share of the variance each number makes, over the poses, (p,); sum 1."""
        squares = self.own(part) ** 2
        total = squares.sum()
        return np.asarray(squares / total if total > 0 else squares)

    def halved(self, part: str) -> Array:
        """Return `rms` if the tolerance of each number, of it alone, were half as large, (p,)."""
        return np.asarray(self.rms(part) * np.sqrt(1 - 0.75 * self.shares(part)))

    @property
    def unseen(self) -> tuple[str, ...]:
        """Numbers whose errors change no coordinate at any of the poses, to first order."""
        turns = np.array([self.model.output.kinds[label] == "angle" for label in self.labels])
        length = self.model.task.characteristic_length
        of_coordinates = np.where(self.model.angular, length, 1.0)
        slopes = np.abs(self.slopes * of_coordinates[:, None]).max(axis=(0, 1))
        unseen = slopes < UNSEEN * np.where(turns, length, 1.0)
        return tuple(label for label, none in zip(self.labels, unseen, strict=True) if none)

    @property
    def doubts(self) -> tuple[str, ...]:
        """What a reader should know of, in sentences."""
        found = []
        if self.left_out:
            found.append(
                f"{few(self.left_out, 6)}: errors would open loops whose closures are redundant; "
                "they were left out: what such errors do, rigid links cannot tell"
            )
        if unseen := self.unseen:
            found.append(f"{few(unseen, 6)}: to first order no error of these changes the output")
        system = self.model.task.mechanism.system
        if beyond := sum(bool(beyond_limits(system, q).any()) for q in self.poses.q):
            found.append(
                f"{beyond} of {len(self.poses.q)} poses are beyond joints' limits of position"
            )
        return tuple(found)

    def scaled(self, factor: float) -> ToleranceAnalysis:
        """Return the analysis of tolerances that are larger by a factor."""
        positive_number(factor, "factor")
        return replace(self, tolerances=self.tolerances.scaled(factor))

    def summary(self, part: str) -> str:
        """Return the whole error of position, or angle, over all poses, in words."""
        columns, unit = self.part(part).columns, SHOWN_PART[part]
        names = ", ".join(self.coordinates[k] for k in columns)
        size, worst = self.size(part), self.worst[:, columns]
        return (
            f"{part} ({names}), {len(size)} {'pose' if len(size) == 1 else 'poses'}: "
            f"three sigma {3e3 * self.rms(part):.4g} {unit} (root mean square), at the worst "
            f"pose {3e3 * size.max():.4g} {unit}; no coordinate off by more than "
            f"{1e3 * worst.max():.4g} {unit}"
        )

    def __str__(self) -> str:
        return "\n".join(self.summary(part.name) for part in self.parts)

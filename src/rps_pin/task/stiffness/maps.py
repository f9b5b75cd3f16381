"""Stiffness and frequencies over a workspace."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.codegen.engine.batches import Errors
from rps_pin.errors import ClosureError, InputError, SingularityError, UnreachableError
from rps_pin.files import write_rows
from rps_pin.plain_text import short
from rps_pin.task.stiffness.model import StiffnessModel
from rps_pin.validation import choice, numbers, refuse_not_finite, whole_number

#: Directions of the output that are shifts of a frame.
_SHIFTS = ("x", "y", "z")
#: The units of `StiffnessMap.unit` in names of columns.
_COLUMNS = {"N/m": "N_per_m", "N m/rad": "Nm_per_rad", "of mixed units": "mixed_units"}


class Span(NamedTuple):
    """What a quantity is over the poses of a map that are reached."""

    name: str
    unit: str
    least: float
    most: float
    at: Array
    """Task coordinates where it is least, shape (m,), m and rad."""


@dataclass(frozen=True, eq=False)
class StiffnessMap:
    """Stiffness and frequencies at poses of a task; NaN where there is none.

    Attributes
    ----------
    coordinates : tuple of str
        Of the task.
    x : array
        The poses, shape (..., m).
    output : tuple of str
        Names of the output's directions.
    compliance : array
        C at each, shape (..., p, p).
    displacement : array
        Under the loads, shape (..., p), m and rad.
    frequencies : array
        The lowest at each, shape (..., k), Hz.
    angular, output_angular : tuples of bool
        Which coordinates, and which directions of the output, are angles.
    """

    coordinates: tuple[str, ...]
    x: Array
    output: tuple[str, ...]
    compliance: Array
    displacement: Array
    frequencies: Array
    angular: tuple[bool, ...]
    output_angular: tuple[bool, ...]

    @property
    def reached(self) -> Bools:
        """Where there is an equilibrium, shape (...)."""
        return np.asarray(~np.isnan(self.displacement[..., 0]))

    @property
    def unit(self) -> str:
        """Unit of `softest`: of a task of slides and hinges there is none."""
        if any(name in _SHIFTS for name in self.output) or not any(self.output_angular):
            return "N/m"
        return "N m/rad" if all(self.output_angular) else "of mixed units"

    @property
    def softest(self) -> Array:
        """Least stiffness against a force in any direction, shape (...), N/m.

        One over the largest eigenvalue of the compliance's part of shifts and forces; of a task of
        joints one over the largest of the whole, see `unit`.
        """
        shifts = [k for k, name in enumerate(self.output) if name in _SHIFTS]
        part = self.compliance[..., shifts, :][..., shifts] if shifts else self.compliance
        found = np.full(self.x.shape[:-1], np.nan)
        some = self.reached
        with np.errstate(divide="ignore"):  # what is rigid
            found[some] = 1 / np.maximum(np.linalg.eigvalsh(part[some])[..., -1], 0.0)
        return found

    def spans(self) -> list[Span]:
        """Return what the least stiffness and the lowest frequency are over the poses reached."""
        some = self.reached
        if not some.any():
            return []
        return [
            Span(
                name, unit, float(values.min()), float(values.max()), self.x[some][values.argmin()]
            )
            for name, unit, values in (
                ("least stiffness", self.unit, self.softest[some]),
                ("lowest frequency", "Hz", self.frequencies[some][:, 0]),
            )
        ]

    def summary(self) -> str:
        """Return the least and largest stiffness and frequency, in a line each, and where."""
        some = self.reached
        lines = [f"{int(some.sum())} of {some.size} poses"]
        for one in self.spans():
            told = ", ".join(
                f"{name} = {short(float(value))} {'rad' if turns else 'm'}"
                for name, value, turns in zip(self.coordinates, one.at, self.angular, strict=True)
            )
            ends = f"{one.least:.4g} to {one.most:.4g} {one.unit}"
            lines.append(f"{one.name}: {ends}, the least at {told}")
        return "\n".join(lines)


def stiffness_map(
    model: StiffnessModel,
    x: ArrayLike,
    wrench: ArrayLike | None = None,
    *,
    wrenches: Wrenches | None = None,
    frequencies: int = 3,
    errors: Errors = "mask",
    progress: Callable[[Iterable[int]], Iterable[int]] = iter,
) -> StiffnessMap:
    """Return stiffness and frequencies at poses of a task, in the assembly mode of home.

    Parameters
    ----------
    model
        The mechanism and what gives way.
    x
        Task coordinates, shape (..., m).
    wrench, wrenches
        As for `StiffnessModel.deflection`: the same at all poses.
    frequencies
        How many are kept, the lowest.
    errors
        ``"mask"``: poses that are not reached, singular, or without a stable equilibrium are NaN;
        ``"raise"``: the first one's error.
    progress
        Wraps the loop over the poses, for a progress bar.

    Raises
    ------
    InputError
        If an array does not fit.
    RPSPinError
        As `StiffnessModel.deflection`, with ``errors="raise"``.
    """
    choice(errors, "errors", ("raise", "mask"))
    count, m, p = whole_number(frequencies, "frequencies"), model.task.size, len(model.output)
    poses = numbers(x, "x", f"numbers of shape (..., {m})")
    if poses.shape[-1:] != (m,):
        raise InputError(f"x has shape {poses.shape}; expected (..., {m})")
    refuse_not_finite(poses, "x")
    flat = poses.reshape(-1, m)
    C = np.full((len(flat), p, p), np.nan)
    moved, lowest = np.full((len(flat), p), np.nan), np.full((len(flat), count), np.nan)
    options: dict[str, Any] = {"wrenches": wrenches}
    for k in progress(range(len(flat))):
        try:
            found = model.at(flat[k], wrench, **options)
        except (ClosureError, SingularityError, UnreachableError):
            if errors == "raise":
                raise
            continue
        C[k], moved[k] = found.compliance, found.displacement
        some = found.frequencies[:count]
        lowest[k, : some.size] = some
    batch = poses.shape[:-1]
    return StiffnessMap(
        model.task.coordinates,
        poses,
        model.output,
        C.reshape(*batch, p, p),
        moved.reshape(*batch, p),
        lowest.reshape(*batch, count),
        model.task.angular,
        model.angular,
    )


def write_map(found: StiffnessMap, path: str | os.PathLike[str]) -> None:
    """Write a map as CSV, a row for each pose, units in the names of the columns.

    Coordinates, `StiffnessMap.softest`, of each direction of the output displacement and compliance
    (its own displacement by a load of one), and frequencies. Where there is no equilibrium, cells
    are empty; a direction that is rigid has the compliance 0.
    """
    units = dict(zip(found.coordinates, found.angular, strict=True))
    header = [f"{name}_{'rad' if turns else 'm'}" for name, turns in units.items()]
    header.append(f"least_stiffness_{_COLUMNS[found.unit]}")
    out = list(zip(found.output, found.output_angular, strict=True))
    header += [f"displacement_{name}_{'rad' if turns else 'm'}" for name, turns in out]
    header += [f"compliance_{name}_{'rad_per_Nm' if turns else 'm_per_N'}" for name, turns in out]
    k = found.frequencies.shape[-1]
    header += [f"frequency_{i + 1}_Hz" for i in range(k)]
    m, p = len(found.coordinates), len(found.output)
    own = np.diagonal(found.compliance, axis1=-2, axis2=-1)
    table = np.hstack(
        [
            found.x.reshape(-1, m),
            found.softest.reshape(-1, 1),
            found.displacement.reshape(-1, p),
            own.reshape(-1, p),
            found.frequencies.reshape(-1, k),
        ]
    )
    rows = [["" if np.isnan(one) else f"{one:.9g}" for one in row] for row in table]
    write_rows(path, [header, *rows])

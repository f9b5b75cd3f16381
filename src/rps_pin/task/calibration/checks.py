"""How well a calibration explains readings: by sensor, by kind, and of poses that were left out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, shown
from rps_pin.task.calibration.prediction import CalibrationModel
from rps_pin.task.calibration.problem import Problem
from rps_pin.task.calibration.sensors import Readings
from rps_pin.task.calibration.solve import Calibration, calibrate, prior_of

Progress = Callable[[Iterable[Any]], Iterable[Any]]


class Explained(NamedTuple):
    """Readings of a sensor, or of a kind of sensors, and what is left of them."""

    name: str
    readings: int
    """How many there are."""
    outliers: int
    """How many were left out."""
    ratio: float
    """Root mean square of the residuals in use, over their deviations; below 1, as poses are
    fitted."""
    size: float
    """Root mean square of the same in m or rad; NaN of a kind with both."""
    unit: str


class CrossValidation(NamedTuple):
    """Residuals of poses that were left out of the calibration, each with its own pose fitted."""

    residuals: Array
    """(Reading - predicted) / deviation, shape (poses, sensors); NaN where nothing was read."""
    outliers: Bools
    """Readings that the others of their pose contradict, shape (poses, sensors)."""
    freedom: int
    """Readings in use, less the poses' coordinates."""

    @property
    def ratio(self) -> float:
        """Root mean square over what the deviations say: near 1 if the calibration holds there."""
        squares = np.nansum(np.where(self.outliers, 0.0, self.residuals) ** 2)
        return float(np.sqrt(squares / max(self.freedom, 1)))


def by_sensor(model: CalibrationModel, found: Calibration) -> tuple[Explained, ...]:
    """Return what is left of the readings of each sensor."""
    return tuple(
        _explained(name, [k], found, "rad" if model.angular[k] else "m")
        for k, name in enumerate(model.sensors)
    )


def by_kind(model: CalibrationModel, found: Calibration) -> tuple[Explained, ...]:
    """Return what is left of actuators, other joints, coordinates and each kind of instrument."""
    kinds: dict[str, list[int]] = {}
    actuators = model.task.mechanism.actuated
    for k, name in enumerate(model.sensors):
        kind = "coordinates" if name in model.task.coordinates else "other joints"
        kind = "actuators" if name in actuators else kind
        for one in model.instruments:
            kind = type(one).__name__ if name in one.sensors else kind
        kinds.setdefault(kind, []).append(k)
    told = []
    for kind, columns in kinds.items():
        units = {"rad" if model.angular[k] else "m" for k in columns}
        told.append(_explained(kind, columns, found, units.pop() if len(units) == 1 else ""))
    return tuple(told)


def by_pose(found: Calibration) -> Array:
    """Return the root mean square of the residuals in use of each pose, shape (poses,).

    NaN where none is in use.
    """
    r = np.where(found.outliers, np.nan, found.residuals)
    count = np.isfinite(r).sum(axis=1)
    mean = np.nansum(r**2, axis=1) / np.maximum(count, 1)
    return np.where(count > 0, np.sqrt(mean), np.nan)


def cross_validate(
    model: CalibrationModel,
    read: Readings,
    *,
    folds: int = 5,
    seed: int = 0,
    priors: Mapping[str, float] | None = None,
    widest: float | None = None,
    progress: Progress = iter,
) -> CrossValidation:
    """Return residuals at poses, each by a calibration from other poses.

    The parameters are those of the other poses; the pose itself is fitted to its readings.

    Parameters
    ----------
    model, read, priors, widest
        As for `calibrate`.
    folds
        Into how many parts the poses are divided, at random.
    seed
        Of the random numbers.
    progress
        Wrapper of the loop over the parts.

    Raises
    ------
    InputError
        If there are fewer than 2 folds, or more than poses.
    RPSPinError
        As `calibrate`, from the poses of all parts but one.
    """
    n = len(read.values)
    if not (isinstance(folds, int) and 2 <= folds <= n):
        raise InputError(f"folds = {shown(folds)}: a whole number from 2 to {n}, the poses")
    part = np.random.default_rng(seed).permutation(n) % folds
    residuals = np.full(read.values.shape, np.nan)
    outliers = np.zeros(read.values.shape, dtype=bool)
    for k in progress(range(folds)):
        own, others = np.flatnonzero(part == k), np.flatnonzero(part != k)
        found = calibrate(model, read.of_poses(others), priors=priors, widest=widest)
        problem = Problem(model, read.of_poses(own), prior_of(model, {}))
        problem.begin(None, found.parameters)
        problem.find_poses()
        residuals[own] = problem.residuals()
        outliers[own] = np.isfinite(residuals[own]) & ~problem.used
    used = np.isfinite(residuals) & ~outliers
    freedom = int(used.sum() - model.task.size * used.any(axis=1).sum())
    return CrossValidation(residuals, outliers, freedom)


def _explained(name: str, columns: list[int], found: Calibration, unit: str) -> Explained:
    r, out = found.residuals[:, columns], found.outliers[:, columns]
    used = np.isfinite(r) & ~out
    off = r * found.read.deviations[:, columns]
    size = float(np.sqrt(np.mean(off[used] ** 2))) if used.any() and unit else np.nan
    ratio = float(np.sqrt(np.mean(r[used] ** 2))) if used.any() else np.nan
    return Explained(name, int(np.isfinite(r).sum()), int(out.sum()), ratio, size, unit)

"""Calibration: the parameters of a mechanism that explain readings of sensors best.

Unknown are the parameters and the pose at each measurement. The residuals are weighed with the
deviations of the sensors. A robust loss (Cauchy's) finds where most readings agree; then those that
the others of their pose contradict are left out (`outliers`), and the rest is fitted by least
squares, until these stay the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, UnreachableError, did_you_mean
from rps_pin.task.calibration.fit import approach, fit
from rps_pin.task.calibration.information import Identifiable
from rps_pin.task.calibration.prediction import CalibrationModel
from rps_pin.task.calibration.problem import Problem
from rps_pin.task.calibration.sensors import Readings
from rps_pin.validation import positive_number, real_array

#: Rounds of leaving outliers out, at most.
_ROUNDS = 10
#: Deviations of the sum of squares from what is expected, and share of outliers, that are a doubt.
_SURE, _MANY = 5.0, 0.2
#: A parameter is determined alone if no unseen combination of length 1 has more of it.
_ALONE = 1e-6
#: Share of the characteristic length beyond which a deviation is too large to be of use.
WIDEST = 0.01


class Calibration(NamedTuple):
    """What readings say of a mechanism."""

    labels: tuple[str, ...]
    """What each parameter is."""
    before: Array
    """The parameters believed before, shape (p,)."""
    parameters: Array
    """The parameters found, shape (p,): those that are not seen alone change least."""
    covariance: Array
    """Of the parameters, shape (p, p), in the combinations that are seen."""
    alone: Bools
    """Which parameters are determined alone; of the others only combinations are."""
    identifiable: Identifiable
    """Which combinations are determined."""
    x: Array
    """Task coordinates of the poses, shape (poses, m)."""
    residuals: Array
    """(Reading - predicted) / deviation, shape (poses, sensors); NaN where nothing was read."""
    outliers: Bools
    """Readings that were left out, shape (poses, sensors)."""
    freedom: int
    """Readings that were used, less what was fitted."""
    read: Readings
    """What it was found from."""
    units: Array
    """What a unit of each parameter counts for as a length, shape (p,), m."""
    held: float
    """By how many deviations the readings contradict, at most, a combination that is seen too
    weakly and was left as believed; see `calibrate`, `widest`."""

    @property
    def correlations(self) -> Array:
        """Of the parameters that are known alone, shape (p, p); NaN of the others."""
        spread = np.where(self.alone, np.sqrt(np.maximum(np.diag(self.covariance), 0.0)), np.nan)
        return np.asarray(self.covariance / np.outer(spread, spread))

    @property
    def deviations(self) -> Array:
        """Standard deviations of the parameters, shape (p,); infinite where not seen alone."""
        return np.where(self.alone, np.sqrt(np.maximum(np.diag(self.covariance), 0.0)), np.inf)

    @property
    def doubts(self) -> tuple[str, ...]:
        """What speaks against the calibration, a sentence each; empty if nothing does."""
        found = []
        ratio = self.chi_squared / self.freedom
        if ratio > 1 + _SURE * math.sqrt(2 / self.freedom):
            found.append(
                f"the residuals are {math.sqrt(ratio):.3g} times what the sensors' deviations say: "
                "deviations are too small, or the machine has errors that are no parameters"
            )
        if self.held > 1 + _SURE:
            found.append(
                f"the readings contradict, by {self.held:.3g} deviations, a combination of "
                "parameters that is seen weakly and was left as believed: raise widest, or "
                "measure other poses"
            )
        share = self.outliers.sum() / np.isfinite(self.residuals).sum()
        if share > _MANY:
            found.append(f"{share:.0%} of the readings are outliers")
        return tuple(found)

    @property
    def chi_squared(self) -> float:
        """Sum of the squared residuals in use; about `freedom` if the deviations are right."""
        return float(np.nansum(np.where(self.outliers, 0.0, self.residuals) ** 2))


def calibrate(
    model: CalibrationModel,
    read: Readings,
    *,
    priors: Mapping[str, float] | None = None,
    start: ArrayLike | None = None,
    widest: float | None = None,
) -> Calibration:
    """Return the parameters that explain readings best.

    Parameters
    ----------
    model
        The mechanism, its parameters and its sensors: `CalibrationModel`.
    read
        Readings of these sensors: `readings`.
    priors
        Standard deviations of parameters about what is believed, by label or by group, in m or rad;
        those of tolerances, as an example. A parameter without one is free.
    start
        Task coordinates at the poses, about, shape (poses, m); left out, they follow from what is
        read.
    widest
        Deviation of a combination of parameters, m, beyond which it is left as believed; a
        hundredth of the task's characteristic length if left out. While it is off by less, it
        changes no reading by more than the reading's deviation.

    Raises
    ------
    InputError
        If the readings are of other sensors, a prior is of no parameter, or there are fewer
        readings than what is to be found.
    UnreachableError
        If no parameters near the believed ones explain the readings.
    """
    if read.sensors != model.sensors:
        raise InputError(
            f"the readings are of {', '.join(read.sensors)}; the model's sensors are "
            f"{', '.join(model.sensors)}"
        )
    problem = Problem(model, read, prior_of(model, priors or {}))
    problem.begin(None if start is None else _start(model, read, start))
    if widest is None:
        widest = WIDEST * model.task.characteristic_length
    seen = problem.identifiable().within(positive_number(widest, "widest", "m"))
    wanted = seen.rank + problem.x.size
    if wanted >= read.total + problem.priors:
        raise InputError(
            f"{read.total} readings, poses: {len(read.values)}, leave nothing to check by: "
            f"{seen.rank} combinations of parameters and {problem.x.size} coordinates of the poses "
            "take them all; read more, or at more poses"
        )
    approach(problem, seen)
    for _ in range(_ROUNDS):
        used = problem.used
        problem.leave_out()
        _refuse_contradiction(problem, seen, read)
        fit(problem, seen)
        if np.array_equal(used, problem.used):
            break
    turn = seen.seen / model.units[:, None]
    covariance = turn @ problem.covariance(seen) @ turn.T
    alone = np.abs(seen.unseen).max(axis=1, initial=0.0) < _ALONE
    known = np.isfinite(read.values)
    poses = int(problem.used.any(axis=1).sum())
    fitted = seen.rank + poses * model.task.size
    freedom = int(np.count_nonzero(problem.used)) + problem.priors - fitted
    return Calibration(
        model.labels,
        model.nominal,
        problem.p,
        covariance,
        alone,
        seen,
        problem.x,
        problem.residuals(),
        known & ~problem.used,
        freedom,
        read,
        model.units,
        problem.contradicted(seen),
    )


def _refuse_contradiction(problem: Problem, seen: Identifiable, read: Readings) -> None:
    """Raise `UnreachableError` if too few readings are left to find the parameters."""
    used = int(np.count_nonzero(problem.used))
    poses = int(problem.used.any(axis=1).sum())
    if used + problem.priors < seen.rank + poses * problem.x.shape[1] or not used:
        raise UnreachableError(
            f"the readings contradict each other: {read.total - used} of {read.total} are "
            f"outliers, and the {used} that are left do not determine {seen.rank} combinations of "
            "parameters; are they those of this mechanism, in the units of their columns, and "
            "their deviations right?"
        )


def prior_of(model: CalibrationModel, given: Mapping[str, float]) -> Array:
    """Return the deviation of each parameter about the believed one; infinite if free."""
    found = np.full(len(model.labels), np.inf)
    for name, deviation in given.items():
        at = [
            i
            for i, label in enumerate(model.labels)
            if label == name or label.startswith(f"{name}.")
        ]
        if not at:
            raise InputError(f"priors: no parameter {name!r}{did_you_mean(name, model.labels)}")
        found[at] = positive_number(deviation, f"prior of {name}")
    return found


def _start(model: CalibrationModel, read: Readings, given: ArrayLike) -> Array:
    x = real_array(given, "start")
    shape = (len(read.values), model.task.size)
    if x.shape != shape:
        raise InputError(f"start has shape {x.shape}; expected {shape}")
    return x

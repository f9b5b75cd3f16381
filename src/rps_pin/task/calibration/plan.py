"""Which poses to measure: those that make the determinant of the information largest.

With N'B of a pose i (see `information`) in the combinations of parameters that all candidates
together determine, R_i, the information of chosen poses is

    M = M_0 + sum_i R_i' R_i,

where M_0 is that of priors and of poses measured before, and of all combinations being off by no
more than a length, `widest`. Poses are taken one by one, each that of the largest growth

    log det(M + R_i' R_i) - log det M = log det(1 + R_i M^-1 R_i'),

and then exchanged for others while that makes det M larger (Fedorov 1972).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Indices
from rps_pin.errors import InputError, did_you_mean, shown
from rps_pin.task.calibration.information import Identifiable, identifiable, reduced
from rps_pin.task.calibration.prediction import CalibrationModel
from rps_pin.task.calibration.problem import Problem
from rps_pin.task.calibration.sensors import Readings
from rps_pin.task.calibration.solve import WIDEST, Calibration, prior_of
from rps_pin.task.task import Task
from rps_pin.validation import positive_number, real_array

#: An exchange counts if log det M grows by more; and exchanges for each pose, at most.
_GROWTH, _ROUNDS = 1e-6, 10
#: Sets of random poses that a plan is compared with.
_RANDOM = 50
#: Distance from singularities that candidates keep; see `rps_pin.task.singularity`.
MIN_DISTANCE = 0.02


class Plan(NamedTuple):
    """Poses to measure, and how well the parameters will be known."""

    x: Array
    """Task coordinates of the poses, shape (count, m)."""
    chosen: Indices
    """Which candidates they are, in the order in which each adds most."""
    log_determinant: float
    """log det M."""
    deviation: float
    """Root mean square of the deviations of the combinations of parameters, m."""
    pose_deviation: float
    """Root mean square, over the candidates, of the pose's deviation after the calibration, m:
    that of the pose which the actuators' readings give; NaN unless all of them are read."""
    random: Array
    """Both of random sets of as many candidates, shape (sets, 2), m."""
    identifiable: Identifiable
    """Which combinations of parameters all candidates together, and what is measured, determine."""

    @property
    def factors(self) -> tuple[float, float]:
        """By what factor random sets (their median) are worse: of parameters, and of poses."""
        worse = np.median(self.random, axis=0) / [self.deviation, self.pose_deviation]
        return float(worse[0]), float(worse[1])


def candidate_poses(
    task: Task,
    ranges: Mapping[str, tuple[float, float]],
    count: int,
    *,
    seed: int = 0,
    min_distance: float = MIN_DISTANCE,
) -> Array:
    """Return random poses within ranges, joint limits, and clear of singularities, (n, m).

    Parameters
    ----------
    task
        The task.
    ranges
        By coordinate, the least and the largest; of those that are not named, home.
    count
        How many are tried: what is outside the workspace is left out.
    seed
        Of the random numbers.
    min_distance
        Distance from singularities that is kept: `SingularityMeasures.distance`.

    Raises
    ------
    InputError
        If a coordinate is unknown, a range is none, or no pose is left.
    """
    low, high = task.home.copy(), task.home.copy()
    for name, ends in ranges.items():
        if name not in task.coordinates:
            raise InputError(
                f"ranges: no coordinate {name!r}{did_you_mean(name, task.coordinates)}"
            )
        k = task.coordinates.index(name)
        low[k], high[k] = real_array(ends, f"range of {name}", (2,))
        if not low[k] <= high[k]:
            raise InputError(f"range of {name} = {shown(ends)}: the least, then the largest")
    x = np.random.default_rng(seed).uniform(low, high, (count, task.size))
    q = task.configuration(x, errors="mask")
    x, q = x[np.isfinite(q).all(axis=1)], q[np.isfinite(q).all(axis=1)]
    clear = task.singularities(q).distance >= min_distance if len(q) else np.zeros(0, bool)
    if not clear.any():
        raise InputError(
            f"none of {count} random poses is in the workspace and clear of singularities "
            f"({len(q)} are reached within joint limits): give narrower ranges"
        )
    return np.asarray(x[clear])


def plan_poses(
    model: CalibrationModel,
    candidates: ArrayLike,
    count: int,
    deviations: Mapping[str, float],
    *,
    priors: Mapping[str, float] | None = None,
    measured: ArrayLike | Readings | None = None,
    widest: float | None = None,
    seed: int = 0,
    progress: Callable[[Iterable[Any]], Iterable[Any]] = iter,
) -> Plan:
    """Return the poses to measure, from candidates.

    Parameters
    ----------
    model
        The mechanism as it is believed to be, its parameters and sensors.
    candidates
        Task coordinates of poses that may be measured, shape (n, m): see `candidate_poses`.
    count
        How many poses.
    deviations
        By sensor, the standard deviation of its noise.
    priors, widest
        As for `calibrate`.
    measured
        What is measured already: readings of the model's sensors, NaN where nothing was read (with
        their own deviations; their poses are found with the believed numbers), or task coordinates
        of poses at which all sensors are read, shape (k, m).
    seed
        Of the random sets that the plan is compared with.
    progress
        Wrapper of the loop over the poses.

    Raises
    ------
    InputError
        If there are fewer candidates than poses, or a deviation is missing.
    ClosureError, UnreachableError
        If a candidate is not reached from home.
    """
    x, m = real_array(candidates, "candidates"), model.task.size
    if x.ndim != 2 or x.shape[1] != m or not 1 <= count <= len(x):
        raise InputError(f"candidates have shape {x.shape}; expected (n, {m}), n from {count}")
    missing = [name for name in model.sensors if name not in deviations]
    if missing:
        raise InputError(f"deviations: there is none of {missing[0]!r}")
    if widest is None:
        widest = WIDEST * model.task.characteristic_length
    spread = np.array([positive_number(deviations[one], one) for one in model.sensors])
    before, weights = _measured(model, measured, 1.0 / spread)
    every = np.vstack([x, before])
    rows, opening = _rows(model, every, np.vstack([np.tile(1.0 / spread, (len(x), 1)), weights]))
    known = 1.0 / (prior_of(model, priors or {}) * model.units)
    prior = np.diag(known)[known > 0]
    seen = identifiable(np.vstack([*rows, prior]), np.vstack([*opening])).within(widest)
    R = rows @ seen.seen
    start = prior @ seen.seen
    M_0 = np.eye(seen.rank) / widest**2 + start.T @ start
    M_0 = M_0 + np.einsum("nsa,nsb->ab", R[len(x) :], R[len(x) :])
    R = R[: len(x)]
    chosen = _exchanged(R, M_0, _greedy(R, M_0, count, progress))
    slopes = pose_slopes(model, x, model.home(x, model.nominal), model.nominal)
    slopes = slopes / model.units @ seen.seen
    rng = np.random.default_rng(seed)
    random = [rng.choice(len(x), count, replace=False) for _ in range(_RANDOM)]
    M = _information(R, M_0, chosen)
    deviation, pose_deviation = _spreads(M, slopes)
    return Plan(
        x[chosen],
        chosen,
        float(np.linalg.slogdet(M)[1]),
        deviation,
        pose_deviation,
        np.array([_spreads(_information(R, M_0, one), slopes) for one in random]),
        seen,
    )


def pose_slopes(model: CalibrationModel, x: Array, q: Array, p: Array) -> Array:
    """Return how the pose that the actuators' readings give changes with the parameters, (n, m, p).

    Readings r(x, p) that stay: dx = -(dr/dx)^+ dr/dp dp, x in one unit, m. NaN unless all actuators
    are read.
    """
    sensors = [
        model.sensors.index(name) for name in model.task.mechanism.actuated if name in model.sensors
    ]
    if len(sensors) < len(model.task.mechanism.actuated):
        return np.full((len(x), model.task.size, p.size), np.nan)
    found = model.predict(x, q, p)
    gain = np.linalg.pinv(found.by_pose[:, sensors])
    return np.asarray(-model.task.scale[:, None] * (gain @ found.by_parameters[:, sensors]))


def pose_deviations(model: CalibrationModel, found: Calibration, x: ArrayLike) -> Array:
    """Return the deviation, at poses, of what the calibrated mechanism says of them, (n, m).

    Of the task's coordinates that the actuators' readings give, by the parameters' covariance; m
    and rad. Combinations of parameters that were not seen count as right.

    Parameters
    ----------
    model, found
        A calibration.
    x
        Task coordinates, shape (n, m), reached from home.
    """
    at = real_array(x, "x", (model.task.size,))
    slopes = pose_slopes(model, at, model.home(at, found.parameters), found.parameters)
    variance = np.einsum("nmp,pr,nmr->nm", slopes, found.covariance, slopes)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)) / model.task.scale)


def _measured(
    model: CalibrationModel, given: ArrayLike | Readings | None, planned: Array
) -> tuple[Array, Array]:
    """Return poses that are measured already, (k, m), and 1 / deviation there, 0 where unread."""
    if given is None:
        return np.zeros((0, model.task.size)), np.zeros((0, len(planned)))
    if not isinstance(given, Readings):
        x = real_array(given, "measured", (model.task.size,))
        return x, np.tile(planned, (len(x), 1))
    if given.sensors != model.sensors:
        raise InputError(
            f"measured: readings of {', '.join(given.sensors)}; the model's sensors are "
            f"{', '.join(model.sensors)}"
        )
    problem = Problem(model, given, np.full(len(model.labels), np.inf))
    problem.begin(None)
    return problem.x, np.where(np.isfinite(given.values), 1.0 / given.deviations, 0.0)


def _rows(model: CalibrationModel, x: Array, weights: Array) -> tuple[Array, Array]:
    """Return N'B of poses, and what opens the loops, by parameters in one unit."""
    found = model.predict(x, model.home(x, model.nominal), model.nominal)
    A = found.by_pose * weights[..., None] / model.task.scale
    B = found.by_parameters * weights[..., None] / model.units
    return reduced(A, B), found.opening / model.units


def _information(R: Array, M_0: Array, chosen: Indices) -> Array:
    return np.asarray(M_0 + np.einsum("nsa,nsb->ab", R[chosen], R[chosen]))


def _growth(R: Array, M: Array) -> Array:
    """Return by how much each pose (n, s, c) makes log det M larger, (n,)."""
    gram = R @ np.linalg.solve(M, np.swapaxes(R, 1, 2))
    return np.asarray(np.linalg.slogdet(np.eye(R.shape[1]) + gram)[1])


def _greedy(
    R: Array, M_0: Array, count: int, progress: Callable[[Iterable[Any]], Iterable[Any]]
) -> Indices:
    chosen: list[int] = []
    M = M_0
    for _ in progress(range(count)):
        growth = _growth(R, M)
        growth[chosen] = -np.inf
        chosen.append(int(np.argmax(growth)))
        M = M + R[chosen[-1]].T @ R[chosen[-1]]
    return np.array(chosen, dtype=np.intp)


def _exchanged(R: Array, M_0: Array, chosen: Indices) -> Indices:
    """Exchange poses for better ones until none is."""
    chosen = chosen.copy()
    for _ in range(_ROUNDS):
        before = chosen.copy()
        for k in range(len(chosen)):
            others = _information(R, M_0, np.delete(chosen, k))
            growth = _growth(R, others)
            growth[np.delete(chosen, k)] = -np.inf
            best = int(np.argmax(growth))
            if growth[best] > growth[chosen[k]] + _GROWTH:
                chosen[k] = best
        if np.array_equal(before, chosen):
            break
    return chosen


def _spreads(M: Array, slopes: Array) -> tuple[float, float]:
    """Return root mean squares of the combinations' deviations, and of the pose's, m."""
    C = np.linalg.inv(M)
    pose = np.einsum("nmc,cd,nmd->n", slopes, C, slopes).mean()
    return float(np.sqrt(np.trace(C) / max(len(C), 1))), float(np.sqrt(pose))

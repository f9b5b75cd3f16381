"""Identification: the dynamic parameters of a mechanism that explain logs best."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import welch

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.task.identification.evidence import Evidence, Fit, evidence_of, fit
from rps_pin.task.identification.factors import FactorFit, fit_with_factors, unknown_factors
from rps_pin.task.identification.log import Log
from rps_pin.task.identification.model import DynamicsModel, Progress
from rps_pin.task.identification.physical import Possible, body_scale, possible
from rps_pin.task.identification.result import Identification
from rps_pin.validation import positive_number, real_vector

#: Part of the cut-off frequency in which the residuals' power is looked at, and how many times
#: that of noise it may be.
_LOW, _COLOURED = 0.25, 2.0
#: Least size of a body, over the characteristic length: that of one that is given as a point.
_POINT = 1e-3
#: Condition number of the base regressor from which the motion is doubted.
POOR = 1000.0


def identify(
    model: DynamicsModel,
    logs: Log | Sequence[Log],
    *,
    unknown_constants: Sequence[str] = (),
    cut_off: float | None = None,
    near: ArrayLike | None = None,
    physical: bool = True,
    progress: Progress = iter,
) -> Identification:
    """Return the dynamic parameters that explain logs best.

    Positions are filtered, speeds and accelerations follow from them, and the loops are closed with
    the actuators' positions; forces and regressors are filtered alike (`filtering`). The base
    parameters follow by least squares (`evidence`), each actuator weighed by its residuals, and
    beside them the most likely parameters that are physically possible (`physical`).

    Parameters
    ----------
    model
        The mechanism, and what is unknown of it.
    logs
        One or more: `force_log` or `read_log`.
    unknown_constants
        Actuators whose motor constant is found too: the logs' constants, or a force sensor's
        scale, times an unknown factor. What is held as known fixes the scale.
    cut_off
        Of the filter, Hz: well above the motion's frequencies. Left out: 8 times the frequency
        below which the positions have all but 1e-4 of their power.
    near
        Closed configuration whose assembly mode the logs begin in, shape (nq,); home if left out.
    physical
        Whether physically possible parameters are looked for.
    progress
        Wraps the loop over the samples.

    Raises
    ------
    InputError
        If a log is too short, or the cut-off frequency too high for it; if nothing fixes the
        scale of unknown constants.
    RPSPinError
        If the loops do not close at a log's positions, or a motion is singular.
    """
    given = [logs] if isinstance(logs, Log) else list(logs)
    if not given or not all(isinstance(one, Log) for one in given):
        raise InputError("logs: one or more Log objects are needed; see force_log and read_log")
    if cut_off is not None:
        cut_off = positive_number(cut_off, "cut_off", "Hz")
    start = None if near is None else real_vector(near, model.mechanism.model.nq, "near")
    unknown = unknown_factors(model, unknown_constants)
    doubts = [note for one in given for note in one.notes]
    _refuse_dead(model, given, cut_off)
    evidence = evidence_of(model, given, cut_off, start, doubts, progress)
    known = np.ones(len(model.actuators))
    try:
        first = fit(model, evidence)
    except InputError as error:  # what was left out may be why
        raise InputError("; ".join([str(error), *doubts])) from None
    found, evidence, factors, spread = FactorFit(first, evidence, known, 0 * known)
    if unknown.size:
        found, evidence, factors, spread = fit_with_factors(model, evidence, unknown)
    _doubt_motion(found, doubts)
    _doubt_residuals(model, evidence, found, doubts)
    answer = _possible(model, found, doubts) if physical else None
    return Identification(
        model,
        found.values,
        found.covariance,
        found.alone,
        found.noise,
        found.condition,
        evidence[0].filtered.cut_off,
        sum(int(one.used.sum()) for one in evidence),
        answer,
        tuple(doubts),
        factors,
        spread,
    )


def _refuse_dead(model: DynamicsModel, logs: Sequence[Log], cut_off: float | None) -> None:
    """Refuse actuators whose force is the same at all samples, and a cut-off by no motion."""
    for log in logs:
        if cut_off is None and not np.ptp(log.position, axis=0).any():
            raise InputError(
                f"{log.name}: no actuator moves, all positions are the same: no cut-off frequency "
                "follows from them; log a motion, or give cut_off"
            )
    for k, name in enumerate(model.actuators):
        if not any(np.ptp(log.force[:, k]) for log in logs):
            raise InputError(
                f"{logs[0].name}: the force of {name} is {logs[0].force[0, k]:.6g} at all samples: "
                "nothing was measured there"
            )


def _possible(model: DynamicsModel, found: Fit, doubts: list[str]) -> Possible | None:
    sizes = sizes_of(model, found)
    answer = possible(
        model.labels,
        model.nominal,
        sizes,
        model.base.matrix,
        found.values,
        found.covariance,
    )
    if answer is None:
        doubts.append("no physically possible parameters were found: the solver did not converge")
    elif answer.distance > 3 * np.sqrt(found.values.size):
        doubts.append(
            f"the physically possible parameters are {answer.distance:.3g} deviations from the "
            f"free ones, of {found.values.size} parameters: the forces have parts that the model "
            "lacks"
        )
    return answer


def sizes_of(model: DynamicsModel, found: Fit) -> Array:
    """Return the sizes of the estimated parameters, in their units, shape (p,).

    Of a body those of what is believed; of effects the larger of what is believed and of the free
    answer.
    """
    sizes = np.abs(model.nominal)
    least = _POINT * model.mechanism.characteristic_length
    free = model.base.matrix.T @ found.values
    deviation = np.sqrt(np.diag(found.covariance))
    for k, label in enumerate(model.labels):
        if label.endswith(".mass"):
            sizes[k : k + 10] = body_scale(model.nominal[k : k + 10], least)
        elif not label.startswith("inertia:"):
            spread = float(np.abs(model.base.matrix[:, k]) @ deviation)
            sizes[k] = max(sizes[k], abs(free[k]), spread, np.finfo(np.float64).tiny)
    return sizes


def _doubt_motion(found: Fit, doubts: list[str]) -> None:
    lost = found.values.size - found.rank
    if lost:
        doubts.append(
            f"the logs' motion determines {found.rank} of {found.values.size} base parameters; of "
            "the others the believed values are kept: move more joints, and further"
        )
    elif found.condition > POOR:
        doubts.append(
            f"the condition number of the logs' regressor is {found.condition:.3g}: some base "
            "parameters are hardly determined; an exciting motion helps (see exciting_motion)"
        )


def _doubt_residuals(
    model: DynamicsModel, evidence: Sequence[Evidence], found: Fit, doubts: list[str]
) -> None:
    """Doubt residuals that have more power at low frequencies than noise would."""
    one = max(evidence, key=lambda each: each.time.size)
    left = (one.forces - one.rows @ found.values)[one.used]
    step, cut_off = one.filtered.step, one.filtered.cut_off
    length = min(len(left), int(16 / (_LOW * cut_off * step)))
    frequency, power = welch(left, 1 / step, nperseg=length, axis=0)
    low = (frequency > 0) & (frequency < _LOW * cut_off)
    inside = (frequency > 0) & (frequency < 0.8 * cut_off)
    high = inside & ~low
    if low.sum() < 3 or high.sum() < 3:
        return
    ratio = power[low].mean(axis=0) / np.maximum(
        power[high].mean(axis=0), np.finfo(np.float64).tiny
    )
    for name, value in zip(model.actuators, ratio, strict=True):
        if value > _COLOURED:
            doubts.append(
                f"the residuals of {name} have {value:.2g} times as much power at low frequencies "
                "as noise would: the force has parts that the model lacks, and the deviations are "
                "too small"
            )

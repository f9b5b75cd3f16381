"""Sobol indices of the output's errors, by SALib: shares of the variance without linearisation.

For several coordinates and poses the indices are weighed by the variances of these (Lamboni,
Monod and Makowski 2011, "Multivariate sensitivity analysis to measure global contribution of input
factors in dynamic models", Reliability Engineering and System Safety 96): where all is linear,
they are the shares of `ToleranceAnalysis.shares`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError, UnreachableError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.tolerances.analysis import ToleranceAnalysis
from rps_pin.task.tolerances.draws import Progress, errors_of, poses_of_machines
from rps_pin.validation import whole_number


class SobolIndices(NamedTuple):
    """Shares of the variance of position, or angle, by number."""

    labels: tuple[str, ...]
    first: Array
    """Share that a number makes alone, shape (p,)."""
    total: Array
    """Share that it takes part in, with others, shape (p,)."""
    first_bounds: Array
    """Half the width of a 95 % interval of `first`, from resampling, at most; shape (p,)."""
    total_bounds: Array
    """The same of `total`."""
    machines: int
    """How many were closed."""


@refuses_other_kinds
def sobol(
    analysis: ToleranceAnalysis,
    part: str = "position",
    *,
    samples: int = 512,
    seed: int = 0,
    progress: Progress = iter,
) -> SobolIndices:
    """Return Sobol indices of the errors of an analysis, exactly closed.

    Parameters
    ----------
    analysis
        Of `tolerance`.
    part
        ``"position"`` or ``"angle"``.
    samples
        N, a power of 2: N (p + 2) machines are closed at each pose.
    seed
        Of the random numbers.
    progress
        Wraps a loop, for a progress bar.

    Raises
    ------
    InputError
        If SALib is not installed (the extra ``tolerances``), or N is not a power of 2.
    UnreachableError
        If a machine does not reach a pose.
    """
    columns = analysis.part(part).columns
    whole_number(samples, "samples", 2)
    whole_number(seed, "seed", 0)
    if samples & (samples - 1):
        raise InputError(f"samples = {samples}: it must be a power of 2, as Sobol's sequence is")
    sample, analyze = _salib()
    labels = analysis.labels
    problem = {"num_vars": len(labels), "names": list(labels), "bounds": [[0.0, 1.0]] * len(labels)}
    uniform = sample(problem, samples, calc_second_order=False, seed=seed)
    errors = errors_of(analysis.tolerances, uniform)
    x, reached = poses_of_machines(analysis.model, analysis.nominal, errors, progress)
    if not reached.all():
        raise UnreachableError(
            f"{np.count_nonzero(~reached.all(axis=1))} of {len(errors)} machines do not reach all "
            "poses: indices need all of them; with smaller tolerances they exist"
        )
    off = (x - analysis.nominal.x)[:, :, columns].reshape(len(errors), -1)
    variances = off.var(axis=0)
    moved = variances > 1e-12 * variances.max(initial=0.0)
    if not moved.any():
        raise InputError(f"no error of these numbers changes the {part}")
    weights = variances[moved] / variances[moved].sum()
    found = [
        analyze(problem, one / one.std(), calc_second_order=False, num_resamples=100, seed=seed)
        for one in off[:, moved].T
    ]
    first, total, first_bounds, total_bounds = (
        np.asarray(sum(w * one[name] for w, one in zip(weights, found, strict=True)))
        for name in ("S1", "ST", "S1_conf", "ST_conf")
    )
    return SobolIndices(labels, first, total, first_bounds, total_bounds, len(errors))


def _salib() -> tuple[Any, Any]:
    """Return SALib's functions that sample and that analyze."""
    try:
        from SALib.analyze.sobol import analyze  # noqa: PLC0415
        from SALib.sample.sobol import sample  # noqa: PLC0415
    except ImportError as error:
        raise InputError(
            f"Sobol indices need SALib: pip install rps-pin[tolerances] ({error})"
        ) from None
    return sample, analyze

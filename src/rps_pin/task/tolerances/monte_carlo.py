"""Exact errors of the output's pose: machines at random, whose loops are closed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import UnreachableError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.tolerances.analysis import ToleranceAnalysis
from rps_pin.task.tolerances.draws import Progress, errors_of, poses_of_machines
from rps_pin.validation import numbers, whole_number

#: What first order may leave of errors.
_ENOUGH = 0.05


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class MonteCarlo:
    """Errors of s machines at n poses: the same numbers of a machine are wrong at all of them.

    Means and deviations are of the machines that reach a pose; see `failures`.
    """

    analysis: ToleranceAnalysis
    """What they are compared with."""
    numbers: Array
    """Errors of the machines' numbers, shape (s, p), m, rad or ratios."""
    errors: Array
    """Of the output's coordinates, shape (s, n, m), m or rad; NaN where not reached."""
    reached: Bools
    """Whether a machine can be assembled at a pose with its readings, shape (s, n)."""

    @property
    def failures(self) -> int:
        """How many machines do not reach all poses."""
        return int(np.count_nonzero(~self.reached.all(axis=1)))

    @property
    def mean(self) -> Array:
        """Mean errors at the poses, shape (n, m): 0 to first order."""
        return np.asarray(np.nanmean(self.errors, axis=0))

    @property
    def deviations(self) -> Array:
        """Standard deviations about the mean at the poses, shape (n, m)."""
        return np.asarray(np.nanstd(self.errors, axis=0))

    def sizes(self, part: str) -> Array:
        """Return the lengths of errors of position, or angle, (s, n); NaN where not reached."""
        columns = self.analysis.part(part).columns
        return np.asarray(np.linalg.norm(self.errors[..., columns], axis=-1))

    def rms(self, part: str) -> float:
        """Return the root mean square of `sizes`."""
        return float(np.sqrt(np.nanmean(self.sizes(part) ** 2)))

    def percentile(self, part: str, percent: ArrayLike) -> Array:
        """Return the lengths of errors that a share of the machines stays below at all poses.

        Parameters
        ----------
        part
            ``"position"`` or ``"angle"``.
        percent
            Per cent of the machines that reach all poses.
        """
        good = self.reached.all(axis=1)
        largest = self.sizes(part)[good].max(axis=1)
        asked = numbers(percent, "percent", "numbers from 0 to 100")
        return np.asarray(np.percentile(largest, asked))

    def ratio(self, part: str) -> float:
        """Return `rms` over that of first order: 1 where first order is enough."""
        return self.rms(part) / self.analysis.rms(part)

    @property
    def linear(self) -> Array:
        """Errors of the same machines to first order, shape (s, n, m)."""
        return np.asarray(np.einsum("nmp,sp->snm", self.analysis.slopes, self.numbers))

    def remainder(self, part: str) -> float:
        """Return what first order leaves of the errors of the same machines, as a part of them.

        Root mean squares over machines and poses that are reached.
        """
        columns = self.analysis.part(part).columns
        off = (self.errors - self.linear)[..., columns]
        return float(np.sqrt(np.nanmean((off**2).sum(axis=-1)))) / self.rms(part)

    @property
    def doubts(self) -> tuple[str, ...]:
        """What a reader should know of, in sentences."""
        found = [
            f"first order leaves {left:.1%} of errors of {part.name}: take those of the machines"
            for part in self.analysis.parts
            if (left := self.remainder(part.name)) > _ENOUGH
        ]
        if self.failures:
            found.append(
                f"{self.failures} of {len(self.numbers)} machines cannot be closed at all poses; "
                "errors are those of the others"
            )
        return tuple(found)

    def spread(self, part: str) -> float:
        """Return the standard deviation of `ratio` from the number of machines."""
        some = self.reached.any(axis=1)
        good = np.nanmean(self.sizes(part)[some] ** 2, axis=1)
        deviation = np.std(good) / np.sqrt(good.size)
        return float(deviation / (2 * np.mean(good)) * self.ratio(part))


@refuses_other_kinds
def monte_carlo(
    analysis: ToleranceAnalysis,
    machines: int = 1000,
    *,
    seed: int = 0,
    progress: Progress = iter,
) -> MonteCarlo:
    """Return exact errors of machines at random, at the poses of an analysis.

    Nothing is compiled again. A machine whose loops do not close at a pose is counted, not left
    out in silence: `MonteCarlo.failures`.

    Parameters
    ----------
    analysis
        Of `tolerance`.
    machines
        How many.
    seed
        Of the random numbers.
    progress
        Wraps a loop, for a progress bar.

    Raises
    ------
    UnreachableError
        If no machine reaches a pose.
    """
    whole_number(machines, "machines", 2)
    whole_number(seed, "seed", 0)
    uniform = np.random.default_rng(seed).random((machines, len(analysis.labels)))
    errors = errors_of(analysis.tolerances, uniform)
    x, reached = poses_of_machines(analysis.model, analysis.nominal, errors, progress)
    if not reached.any(axis=0).all():
        k = int(np.argmin(reached.any(axis=0)))
        raise UnreachableError(f"no one of {machines} machines can be closed at pose {k}")
    return MonteCarlo(analysis, errors, x - analysis.nominal.x, reached)

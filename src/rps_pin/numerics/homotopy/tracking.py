"""Tracking of solution paths: a predictor and a corrector over complex numbers, many paths at once.

A homotopy H(x, s) = 0, of as many equations as unknowns, leads solutions at s = 0 to those at
s = 1. Along a path dx/ds = -(dH/dx)^-1 dH/ds. A step is predicted by the Runge-Kutta method of
order four and corrected by Newton's method at the new s. It is taken if the first correction is
small (`Accuracy.prediction`) and the corrections contract; else it is halved. Each path has a step
of its own.

With a start that is generic over the complex numbers, paths meet for no s < 1 (with probability
one), and what ends at s = 1 includes all isolated solutions there (Sommese and Wampler, The
Numerical Solution of Systems of Polynomials, 2005). Paths whose ends are singular or at infinity
stop short of s = 1.

Licences of libraries that do this: Bertini (1 and 2), PHCpack (phcpy), POLSYS_PLP (pypolsys) and
msolve are GPL; HomotopyContinuation.jl is MIT and needs a Julia installation. There is no
maintained permissive one on PyPI, which is why this file exists.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from rps_pin.arrays import Array, Bools, ComplexArray, Indices


class Homotopy(Protocol):
    """H(x, s) with its derivatives, of n unknowns, at k points."""

    def __call__(
        self, x: ComplexArray, s: Array
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return H (k, n), dH/dx (k, n, n) and dH/ds (k, n) at x (k, n) and s (k,)."""


@runtime_checkable
class Homotopies(Protocol):
    """A homotopy of its own for each path."""

    def of(self, which: Indices) -> Homotopy:
        """Return the homotopies of some paths."""


def _of(homotopy: Homotopy, which: Indices) -> Homotopy:
    return homotopy.of(which) if isinstance(homotopy, Homotopies) else homotopy


class Accuracy(NamedTuple):
    """How near to its path a point is kept, relative to the size of x."""

    prediction: float = 1e-4
    """Largest first correction of a step that is taken."""
    correction: float = 1e-8
    """Corrections end below this: the next one, of its square, is rounding error."""
    least_step: float = 1e-10
    """Paths that need shorter steps in s stop."""
    most_steps: int = 3000


#: For paths whose ends coincide: one may have jumped to the other.
TIGHT = Accuracy(prediction=1e-7, least_step=1e-12, most_steps=30_000)

_CORRECTIONS = 4
#: Newton steps of ends.
_POLISHING = 2
_FIRST_STEP, _LONGEST_STEP = 0.01, 0.2
#: Ends nearer than this, relative to their size, coincide.
_COINCIDE = 1e-6
#: Condition numbers above this are those of singular ends.
SINGULAR = 1e10


class Ends(NamedTuple):
    """Where paths end."""

    x: ComplexArray
    """Last points, shape (k, n)."""
    s: Array
    """How far they came, shape (k,): 1 where the end is reached."""
    condition: Array
    """Condition numbers of dH/dx with its rows scaled to one size there, shape (k,)."""

    @property
    def regular(self) -> Bools:
        """Which have reached a solution that is not singular."""
        return np.asarray((self.s == 1.0) & (self.condition < SINGULAR))


def tracked(homotopy: Homotopy, start: ComplexArray, accuracy: Accuracy | None = None) -> Ends:
    """Follow solutions from s = 0 to s = 1.

    Without an accuracy, paths with ends that coincide are followed a second time with shorter
    steps (`TIGHT`): two paths that end in one regular solution cannot both be right.

    Parameters
    ----------
    homotopy
        The homotopy.
    start
        Solutions at s = 0, shape (k, n).
    accuracy
        How near to their paths the points are kept.
    """
    ends = _tracked(homotopy, start, accuracy or Accuracy())
    if accuracy is None:
        again = np.flatnonzero(coinciding(ends.x, ends.regular))
        if again.size:
            better = _tracked(_of(homotopy, again), start[again], TIGHT)
            for kept, new in zip(ends, better, strict=True):
                kept[again] = new
    return ends


def coinciding(x: ComplexArray, which: Bools, near: float = _COINCIDE) -> Bools:
    """Return which of some points, (k, n), coincide with another one of them."""
    at = np.flatnonzero(which)
    found = np.zeros(len(x), dtype=bool)
    if at.size:
        points = x[at]
        apart = np.abs(points[:, None] - points[None]).max(axis=2)
        np.fill_diagonal(apart, np.inf)
        found[at] = apart.min(axis=1) <= near * np.abs(points).max(axis=1)
    return found


def _tracked(homotopy: Homotopy, start: ComplexArray, accuracy: Accuracy) -> Ends:
    x, s = start.astype(np.complex128), np.zeros(len(start))
    step = np.full(len(start), _FIRST_STEP)
    active = np.arange(len(start))
    for _ in range(accuracy.most_steps):
        active = active[(s[active] < 1.0) & (step[active] >= accuracy.least_step)]
        if not active.size:
            break
        _advance(homotopy, x, s, step, active, accuracy)
    for _ in range(_POLISHING):
        values, slopes, _ = homotopy(x, s)
        better = x - solved(slopes, values)
        reached = (s == 1.0) & np.isfinite(better).all(axis=1)
        x[reached] = better[reached]
    return Ends(x, s, _conditions(homotopy(x, s)[1]))


def _advance(
    homotopy: Homotopy, x: ComplexArray, s: Array, step: Array, active: Indices, accuracy: Accuracy
) -> None:
    """Take a step of each active path, or shorten it; changes x, s and step."""
    homotopy, here, at = _of(homotopy, active), x[active], s[active]
    length = np.minimum(step[active], 1.0 - at)
    ahead = np.where(length >= 1.0 - at, 1.0, at + length)
    predicted = _predicted(homotopy, here, at, ahead - at)
    corrected, first, good = _corrected(homotopy, predicted, ahead, accuracy)
    good &= first <= accuracy.prediction
    taken = active[good]
    x[taken], s[taken] = corrected[good], ahead[good]
    with np.errstate(divide="ignore"):
        factor = 0.8 * (accuracy.prediction / np.maximum(first, 1e-300)) ** 0.2
    factor = np.where(good, np.clip(factor, 0.5, 2.0), np.clip(factor, 0.1, 0.5))
    factor = np.where(np.isfinite(factor), factor, 0.25)
    # The last step to s = 1 may be shorter than the path's own step.
    step[active] = np.minimum(np.where(good, np.maximum(length, 0), length) * factor, _LONGEST_STEP)


def _predicted(homotopy: Homotopy, x: ComplexArray, s: Array, h: Array) -> ComplexArray:
    half, by = h / 2, h[:, None]
    one = _tangent(homotopy, x, s)
    two = _tangent(homotopy, x + by / 2 * one, s + half)
    three = _tangent(homotopy, x + by / 2 * two, s + half)
    four = _tangent(homotopy, x + by * three, s + h)
    return np.asarray(x + by / 6 * (one + 2 * two + 2 * three + four))


def _tangent(homotopy: Homotopy, x: ComplexArray, s: Array) -> ComplexArray:
    _, by_x, by_s = homotopy(x, s)
    return -solved(by_x, by_s)


def _corrected(
    homotopy: Homotopy, x: ComplexArray, s: Array, accuracy: Accuracy
) -> tuple[ComplexArray, Array, Bools]:
    """Return corrected points, the first corrections relative to their sizes, and which converge.

    Corrections converge if each is at most a tenth of the one before.
    """
    first = last = np.zeros(len(x))
    good = np.ones(len(x), dtype=bool)
    done = np.zeros(len(x), dtype=bool)
    for k in range(_CORRECTIONS):
        values, by_x, _ = homotopy(x, s)
        correction = solved(by_x, values)
        size = np.abs(correction).max(axis=1) / np.maximum(np.abs(x).max(axis=1), 1e-300)
        x = np.where((done | ~good)[:, None], x, x - correction)
        first = size if k == 0 else first
        good &= np.isfinite(size) & (done | (k == 0) | (size <= 0.1 * last))
        done |= size <= accuracy.correction
        last = size
        if (done | ~good).all():
            break
    return x, first, good & done


def solved(matrices: ComplexArray, right: ComplexArray) -> ComplexArray:
    """Return the solutions of linear systems (k, n, n) and (k, n); NaN for singular ones."""
    try:
        return np.asarray(np.linalg.solve(matrices, right[..., None])[..., 0])
    except np.linalg.LinAlgError:
        found = np.full(right.shape, np.nan, dtype=np.complex128)
        for k, (matrix, one) in enumerate(zip(matrices, right, strict=True)):
            try:
                found[k] = np.linalg.solve(matrix, one)
            except np.linalg.LinAlgError:
                continue
        return found


def _conditions(matrices: ComplexArray) -> Array:
    rows = np.abs(matrices).max(axis=2, keepdims=True)
    scaled = matrices / np.where(rows > 0, rows, 1.0)
    scaled = np.where(np.isfinite(scaled), scaled, 0.0)
    values = np.linalg.svd(scaled, compute_uv=False)
    return np.asarray(values[:, 0] / np.maximum(values[:, -1], 1e-300), np.float64)

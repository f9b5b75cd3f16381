"""The fit of a calibration: steps within a trust region, and a robust loss that comes before.

With weighed residuals r, A = dr/dx of a pose and B = dr/dp (signs of a prediction), the best
correction of a pose is dx = A^+ (r - B dp), which leaves (1 - A A^+) (r - B dp). The parameters'
step is the minimum of

    |R dp - d|^2   within   |dp| <= radius,

where R are the rows (1 - A A^+) B of all poses, and those of priors. It follows from the singular
values of R (More and Sorensen 1983): dp = V (S^2 + l)^-1 S U'd, with l >= 0 so that |dp| = radius.
Strongly seen combinations are then corrected in full, weakly seen ones by no more than the radius.
"""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from rps_pin.arrays import Array
from rps_pin.errors import UnreachableError
from rps_pin.task.calibration.information import Identifiable, svd
from rps_pin.task.calibration.problem import Problem, State, Weighed

#: Residuals over their deviations where the robust loss begins to count them less, at the end; and
#: over their median before.
_ROBUST, _TYPICAL = 2.0, 4.0
#: Steps at most, of least squares and of the robust loss.
_STEPS, _ROBUST_STEPS = 200, 50
#: A step that would change no predicted reading by more, over its deviation, is not taken any more;
#: of the robust loss, which only finds outliers, by more than this share of its scale.
_SMALL, _NEAR = 1e-4, 2e-2
#: Relative growth of the cost that is rounding, and radii that are tried for a step.
_ROUNDING, _TRIES = 1e-9, 20
#: Shares of the gain expected of a step below and above which the radius falls and grows.
_POOR, _GOOD = 0.25, 0.75
#: The next radius over the step's length, if it gained well, poorly, or nothing.
_GROWN, _HALVED, _REFUSED = 3.0, 0.5, 0.25
#: Relative accuracy of the radius that a step keeps to.
_ACCURACY = 1e-3
#: Singular values below this part of the largest are none.
_NONE = 1e-13


class Step(NamedTuple):
    """A step of poses and parameters."""

    x: Array
    """Of the poses, in one unit, shape (n, m)."""
    p: Array
    """Of the combinations of parameters, shape (c,)."""
    size: float
    """|dp|, m."""
    gain: float
    """By how much it lowers the sum of squares, if residuals are linear."""
    limited: bool
    """Whether the radius limits it."""


class Linearised:
    """Residuals and slopes at a point, poses eliminated: steps of any radius follow at once.

    Parameters
    ----------
    r, A, B
        Weighed residuals (n, s), slopes (n, s, m) by poses and (n, s, c) by combinations.
    prior, off
        Rows of priors, (k, c), and how far they are from what is believed, (k,).
    """

    def __init__(self, r: Array, A: Array, B: Array, prior: Array, off: Array) -> None:
        self._r, self._A, self._B = r, A, B
        self._M = np.linalg.pinv(A)
        rows = np.vstack([*(B - A @ (self._M @ B)), prior])
        d = np.concatenate([r.ravel(), -off])
        u, s, across = svd(rows)
        kept = s > _NONE * s.max(initial=0.0)
        self._s, self._V, self._d = s[kept], across[kept].T, (u.T @ d)[kept]
        self._own = float(np.square((A @ (self._M @ r[..., None]))[..., 0]).sum())

    def step(self, radius: float = np.inf) -> Step:
        """Return the best step within a radius, m."""
        more = 0.0
        if np.linalg.norm(self._d / self._s) > radius:
            high = np.linalg.norm(self._s * self._d) / radius
            more = brentq(lambda more: self._length(more) / radius - 1.0, 0.0, high, rtol=_ACCURACY)
        a = self._s * self._d / (self._s**2 + more)
        p = self._V @ a
        x = (self._M @ (self._r - self._B @ p)[..., None])[..., 0]
        gain = float((2 * self._d * self._s * a - (self._s * a) ** 2).sum()) + self._own
        return Step(x, p, float(np.linalg.norm(a)), gain, more > 0.0)

    def largest(self, step: Step) -> float:
        """Return the largest change of a reading over its deviation that a step makes."""
        moved = np.einsum("nsm,nm->ns", self._A, step.x) + self._B @ step.p
        return float(np.abs(moved).max(initial=0.0))

    def _length(self, more: float) -> float:
        return float(np.linalg.norm(self._s * self._d / (self._s**2 + more)))


class _Point(NamedTuple):
    state: State
    weighed: Weighed
    cost: float


def fit(problem: Problem, seen: Identifiable, scale: float = np.inf) -> None:
    """Correct the poses, and the combinations that are seen, by the readings in use.

    By Gauss-Newton steps in which the poses are eliminated, within a trust region: see the module.
    With a finite `scale` c the loss of a residual r is Cauchy's c^2 log(1 + (r/c)^2), as weights
    1 / (1 + (r/c)^2) of the squares.

    Raises
    ------
    UnreachableError
        If that does not converge.
    """
    radius, at = np.inf, _point(problem, problem.state, scale)
    small, steps = (_NEAR * scale, _ROBUST_STEPS) if scale < np.inf else (_SMALL, _STEPS)
    for _ in range(steps):
        there = _linearised(problem, at.weighed, seen, scale)
        if there.largest(there.step()) < small:
            return
        found, radius = _next(problem, there, seen, at.cost, scale, radius)
        if found is None:
            break
        problem.state, at = found.state, found
    raise UnreachableError(
        "the calibration does not converge: the residuals, over their deviations, are "
        f"{np.sqrt(at.cost / max(int(problem.used.sum()), 1)):.3g} (root mean square); "
        "are the readings those of this mechanism, and the believed parameters near?"
    )


def approach(problem: Problem, seen: Identifiable) -> None:
    """Fit with a robust loss whose scale falls with the residuals; most readings agree then.

    At first all residuals are large, as the parameters are wrong; those that remain so are of
    outliers.
    """
    scale = np.inf
    while scale > _ROBUST:
        size = np.median(np.abs(problem.weighed(problem.state).residuals[problem.used]))
        scale = max(_ROBUST, min(_TYPICAL * float(size), scale / 2))
        with suppress(UnreachableError):  # this only tells outliers; the last fit decides
            fit(problem, seen, scale)


def _next(
    problem: Problem,
    there: Linearised,
    seen: Identifiable,
    cost: float,
    scale: float,
    radius: float,
) -> tuple[_Point | None, float]:
    """Return where a step leads that does not raise the cost, None if none does; the next radius.

    The radius falls until there is one.
    """
    for _ in range(_TRIES):
        step = there.step(radius)
        state = problem.moved(step.x, seen.seen @ step.p)
        if state is not None:
            found = _point(problem, state, scale)
            if found.cost > cost - _POOR * step.gain:  # the poses went straight, not along a curve
                found = _poses_corrected(problem, found, scale)
            if found.cost <= cost * (1 + _ROUNDING):
                gain = cost - found.cost
                if gain > _GOOD * step.gain:
                    radius = max(radius, _GROWN * step.size) if step.limited else np.inf
                elif gain < _POOR * step.gain:
                    radius = _HALVED * step.size
                return found, radius
        radius = _REFUSED * step.size
    return None, radius


def _poses_corrected(problem: Problem, at: _Point, scale: float) -> _Point:
    """Return a point with its poses corrected once more, if that lowers the cost."""
    r, A, _ = at.weighed
    w = _weights(problem, r, scale)[..., None]
    step = (np.linalg.pinv(A * w) @ (r[..., None] * w))[..., 0]
    state = problem.moved(step, np.zeros(at.state.p.size), at.state)
    found = at if state is None else _point(problem, state, scale)
    return found if found.cost < at.cost else at


def _point(problem: Problem, state: State, scale: float) -> _Point:
    """Return residuals and slopes, and the sum of the losses of the readings in use."""
    found = problem.weighed(state)
    squares = found.residuals[problem.used] ** 2
    if np.isfinite(scale):
        squares = scale**2 * np.log1p(squares / scale**2)
    off = problem.off_prior(state.p)
    return _Point(state, found, float(squares.sum() + (off**2).sum()))


def _linearised(problem: Problem, now: Weighed, seen: Identifiable, scale: float) -> Linearised:
    r, A, B = now
    w = _weights(problem, r, scale)[..., None]
    off = problem.off_prior(problem.state.p)
    return Linearised(r * w[..., 0], A * w, B @ seen.seen * w, problem.prior @ seen.seen, off)


def _weights(problem: Problem, r: Array, scale: float) -> Array:
    """Return the roots of the weights of a loss; zero of what is not in use."""
    return np.asarray(np.sqrt(problem.used / (1.0 + (r / scale) ** 2)))

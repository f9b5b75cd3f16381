"""The iteration for the shortest time along a curve, around the convex program.

- Friction depends on the speed. It is linearised in u'^2 about the last solution, until that is the
  solution.
- Limits are imposed at a few points of each piece, and checked at many. If a force or speed exceeds
  its limit in between, the limit of that piece is tightened by as much.
- Nearly everywhere one limit is active: the shortest time leaves none unused. Pieces without an
  active limit are divided.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import RPSPinError
from rps_pin.task.motion.curve_dynamics import ACTIVE, CurveDynamics, CurveTerms, breaks_of
from rps_pin.task.motion.fastest_profile import ProfileLimits, fastest_profile
from rps_pin.task.motion.speed_profile import SpeedProfile

Progress = Callable[[Iterable[int]], Iterable[int]]

#: Pieces at first.
INTERVALS = 100
#: Relative tolerance of limits. Half of it is subtracted from them, so that a motion keeps its
#: limits at every time.
KEPT = 1e-6
#: Pieces are divided if no limit is reached to `ACTIVE` for more than this share of the time: at
#: first, and once limits have been tightened.
INACTIVE, INACTIVE_TIGHTENED = 2e-3, 6e-3

# Points of each piece where limits are imposed, and where they are checked: denser towards the
# ends, where a rate that starts from rest grows like a root. Not at the ends themselves, where the
# second derivative of a curve may jump.
_INSIDE = 1e-9
_IMPOSED = np.linspace(_INSIDE, 1 - _INSIDE, 4)
_CHECKED = ((1 - np.cos(np.linspace(0.0, np.pi, 33))) / 2).clip(_INSIDE, 1 - _INSIDE)
MOST_ROUNDS = 60
_MOST_HALVINGS = 12
#: If fewer of the pieces than this are divided, each is divided into four, otherwise into two.
_FEW = 0.15
#: Largest error of the linear friction, over the limit of force: at the end, and before pieces are
#: divided.
_SETTLED, _NEARLY = 1e-6, 5e-4
#: Linearisations at half the speed before a curve is infeasible.
_MOST_SLOWER = 12
#: A limit is tightened by its excess and a little more: a tenth, and this part of the limit.
_SPARE = 1e-7


class TimeSearch:
    """State of the iteration: pieces, by how much limits are tightened, and the last profile.

    Parameters
    ----------
    dynamics
        What is bounded along the curve.
    rest
        Whether u' must be zero at its beginning, and at its end.
    intervals
        Pieces at first.
    infeasible
        Returns the error of a curve without a time law.
    """

    def __init__(
        self,
        dynamics: CurveDynamics,
        rest: tuple[bool, bool],
        intervals: int,
        infeasible: Callable[[], RPSPinError],
    ) -> None:
        self.dynamics = dynamics
        self.infeasible = infeasible
        self.rest = rest
        self.knots = _first_knots(dynamics, intervals)
        self.tightened = np.zeros((len(self.knots) - 1, len(dynamics.sides)))  # over the limit
        self.narrowest = dynamics.curve.length / intervals / 2**_MOST_HALVINGS
        self.profile: SpeedProfile | None = None
        self.linearised_at: Array | None = None  # u'^2 where limits are asked for
        self.mismatch = math.inf
        self.slower = 0
        self.excess = self.inactive = math.inf

    def advance(self) -> bool:
        """Do one round, and return whether it has converged."""
        u = self._points(_IMPOSED)
        friction = slope = np.zeros((*u.shape, self.dynamics.half.size))
        if self.linearised_at is not None:
            friction, slope = self.dynamics.friction(u, self.linearised_at)
        terms = self.dynamics.terms(u)
        limits = self._limits(terms, friction, slope)
        found = fastest_profile(self.knots, limits, self.rest, self._guess(terms))
        if found is None:
            self._linearise_slower()
            return False
        self.profile = found
        self._linearise(found, u, friction, slope)
        beyond, inactive = self._check_pieces(found)
        settled = self.mismatch <= _SETTLED
        if settled and (beyond <= 0).all():
            np.maximum(beyond, self._check_times(found), out=beyond)
        self.excess, self.inactive = float(beyond.max()), float(inactive.sum())
        refinable = (inactive > 0) & (np.diff(self.knots) > self.narrowest)
        most_inactive = INACTIVE_TIGHTENED if self.tightened.any() else INACTIVE
        if self.mismatch <= _NEARLY and self.inactive > most_inactive and refinable.any():
            self._refine(found, refinable, 4 if refinable.mean() < _FEW else 2)
            return False
        if settled:
            self.tightened += np.where(beyond > 0, 1.1 * beyond + _SPARE, 0.0)
        return settled and self.excess <= 0

    def run(self, progress: Progress) -> SpeedProfile:
        """Return the profile of the shortest time.

        Raises
        ------
        RPSPinError
            If the iteration does not converge; that of `infeasible` if there is no time law.
        """
        for _ in progress(range(MOST_ROUNDS)):
            if self.advance():
                assert self.profile is not None  # `advance` made it
                return self.profile
        raise self.failure()

    def failure(self) -> RPSPinError:
        """Return the error of an iteration that did not converge."""
        if self.mismatch > _SETTLED:
            return RPSPinError(
                f"friction does not converge in {MOST_ROUNDS} rounds: its linear form is wrong by "
                f"{self.mismatch:.3g} of the force limit"
            )
        return RPSPinError(
            f"no motion was found in {MOST_ROUNDS} rounds that keeps the limits to {KEPT:.0e}: "
            f"the last exceeds one by {self.excess:.3g} of it"
        )

    def _points(self, share: Array) -> Array:
        return (1 - share) * self.knots[:-1, None] + share * self.knots[1:, None]

    def _limits(self, terms: CurveTerms, friction: Array, slope: Array) -> ProfileLimits:
        """Return the limits at points (n, m), relative to themselves."""
        inertia, product, holding, slopes = terms
        about = 0.0 if self.linearised_at is None else self.linearised_at[..., None]
        half, limited = self.dynamics.half, self.dynamics.limited
        square = (product + slope) / half
        constant = (holding - self.dynamics.middle + friction - slope * about) / half
        speeds = self.dynamics.speed_over_limit(slopes)
        kept = 1 - KEPT / 2 - self.tightened[:, None, :]  # of each limit
        p = np.concatenate([inertia / half, -inertia / half, np.zeros_like(slopes)], axis=-1)
        q = np.concatenate([square, -square, speeds**2], axis=-1)
        still = np.concatenate([constant, -constant], axis=-1)
        levels = 2 * half.size
        r = np.concatenate([kept[..., :levels] - still, kept[..., levels:] ** 2 + 0 * slopes], -1)
        return ProfileLimits(_IMPOSED, p[..., limited], q[..., limited], r[..., limited])

    def _guess(self, terms: CurveTerms) -> Array:
        """Return the magnitude of u'^2 at the knots: of the last profile, or from the limits."""
        if self.profile is not None:
            return self.profile.along(self.knots)[0]
        # A steady force F takes a mass m from rest to u'^2 = 2 u F / m; a speed is d u'.
        inertia = np.abs(terms.inertia / self.dynamics.half).max(axis=-1, initial=0.0)
        speeds = np.abs(self.dynamics.speed_over_limit(terms.speed_slope))
        by_inertia = float(np.median(inertia))
        reach = float(np.median(speeds.max(axis=-1, initial=0.0)))
        length = self.knots[-1]
        by_force = length / by_inertia if by_inertia > 0 else math.inf
        by_speed = (1 / reach) ** 2 if reach > 0 else math.inf
        shape = np.ones_like(self.knots)
        for rests, way in zip(self.rest, (self.knots, length - self.knots), strict=True):
            shape *= np.minimum(1.0, 2 * way / length) if rests else 1.0
        return min(by_force, by_speed) * shape

    def _linearise(self, found: SpeedProfile, u: Array, friction: Array, slope: Array) -> None:
        """Set the error of the linear friction, and the u'^2 about which it is linear next."""
        if not self.dynamics.has_friction:
            self.mismatch = 0.0
            return
        square = found.within(_IMPOSED)[1].clip(0.0)
        about = np.zeros_like(square) if self.linearised_at is None else self.linearised_at
        made_for = friction + slope * (square - about)[..., None]
        wrong = np.abs(self.dynamics.friction(u, square)[0] - made_for) / self.dynamics.half
        before, self.mismatch = self.mismatch, float(wrong.max())
        # If it does not converge, half of each step is taken.
        self.linearised_at = (about + square) / 2 if self.mismatch > before / 2 else square

    def _linearise_slower(self) -> None:
        """Linearise friction about a slower motion: about a fast one it may exceed the limits."""
        if self.linearised_at is None or self.slower == _MOST_SLOWER:
            raise self.infeasible()
        self.slower += 1
        self.linearised_at = self.linearised_at / 4
        self.mismatch = math.inf

    def _check_pieces(self, found: SpeedProfile) -> tuple[Array, Array]:
        """Return the excess of each limit in each piece, (n, sides), and unused shares of time."""
        u, square, acceleration = found.within(_CHECKED)
        square = square.clip(0.0)
        sides = self.dynamics.use_along(u, square, acceleration).sides
        beyond = (sides + _possible_excess(sides)).max(axis=1) - 1
        rate = np.sqrt(square)
        steps = np.diff(u, axis=1) / ((rate[:, 1:] + rate[:, :-1]) / 2)
        unused = sides.max(axis=-1) < 1 - ACTIVE
        unused_steps = steps * (unused[:, 1:].astype(float) + unused[:, :-1]) / 2
        return beyond, unused_steps.sum(axis=1) / steps.sum()

    def _check_times(self, found: SpeedProfile) -> Array:
        """Return the excess of each limit in each piece at evenly spaced times, (n, sides)."""
        t = np.linspace(0.0, found.duration, self.dynamics.times)
        u, rate, acceleration = found.at(t)
        sides = self.dynamics.use_along(u, rate**2, acceleration).sides - 1
        piece = np.searchsorted(found.times[1:-1], t, side="right")
        beyond = np.full_like(self.tightened, -1.0)
        np.maximum.at(beyond, piece, sides)
        return beyond

    def _refine(self, found: SpeedProfile, chosen: Bools, parts: int) -> None:
        """Divide pieces; tightenings fall with the square of their width, as errors do."""
        shares = np.arange(1, parts) / parts
        more = self._points(shares)[chosen]
        times = np.where(chosen, parts, 1)
        self.tightened = np.repeat(self.tightened / (times**2)[:, None], times, axis=0)
        self.knots = np.sort(np.concatenate([self.knots, more.ravel()]))
        if self.linearised_at is not None:
            self.linearised_at = found.along(self._points(_IMPOSED))[0].clip(0.0)
            self.mismatch = math.inf


def _possible_excess(values: Array) -> Array:
    """Return by how much a function may exceed its samples between them, shape (n, m, k).

    Between equal steps (m), half the larger second difference bounds it: an eighth of it does where
    the function is smooth, half of it where its slope jumps.
    """
    bends = np.pad(np.abs(np.diff(values, 2, axis=1)), ((0, 0), (2, 2), (0, 0)), "edge")
    missed: Array = np.maximum(np.maximum(bends[:, :-2], bends[:, 2:]), bends[:, 1:-1]) / 2
    return missed


def _first_knots(dynamics: CurveDynamics, intervals: int) -> Array:
    """Return even knots; with friction, which jumps when a motion begins, denser at the ends."""
    length = dynamics.curve.length
    knots = np.linspace(0.0, length, intervals + 1)
    if dynamics.has_friction:
        more = knots[1] / 4.0 ** np.arange(1, 5)
        knots = np.concatenate([knots, more, length - more])
    # Where pieces of a curve meet, forces have a kink.
    inner = breaks_of(dynamics.curve)[1:-1]
    near = np.abs(inner[:, None] - knots).min(axis=1, initial=math.inf) < 1e-3 * knots[1]
    return np.sort(np.concatenate([knots, inner[~near]]))

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

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import RPSPinError
from rps_pin.rps.dynamics.friction import has_friction
from rps_pin.rps.motion.curve_dynamics import CurveDynamics, CurveTerms
from rps_pin.rps.motion.curve_refusal import infeasible
from rps_pin.rps.motion.fastest_profile import ProfileLimits, fastest_profile
from rps_pin.rps.motion.limited_motion import ACTIVE, LimitedMotion
from rps_pin.rps.motion.speed_profile import SpeedProfile

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
_TIMES = 20_001
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
    """State of the iteration: pieces, by how much limits are tightened, and the last profile."""

    def __init__(self, dynamics: CurveDynamics, rest: tuple[bool, bool], intervals: int) -> None:
        self.dynamics = dynamics
        self.rest = rest
        self.knots = _first_knots(dynamics, intervals)
        self.tightened = np.zeros((len(self.knots) - 1, 9))  # by side, over the limit
        self.narrowest = dynamics.curve.length / intervals / 2**_MOST_HALVINGS
        self.profile: SpeedProfile | None = None
        self.linearised_at: Array | None = None  # u'^2 where limits are asked for
        self.mismatch = math.inf
        self.slower = 0
        self.excess = self.inactive = math.inf

    def advance(self) -> bool:
        """Do one round, and return whether it has converged."""
        u = self._points(_IMPOSED)
        friction = slope = np.zeros((*u.shape, 3))
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

    def motion(self) -> LimitedMotion:
        """Return the last motion."""
        assert self.profile is not None  # `advance` has been called
        return LimitedMotion(self.dynamics, self.profile)

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
        force, speed = self.dynamics.limits.force, self.dynamics.limits.speed
        inertia, product, holding, length_slope = terms
        about = 0.0 if self.linearised_at is None else self.linearised_at[..., None]
        square = product + slope
        constant = holding + friction - slope * about
        kept = 1 - KEPT / 2 - self.tightened[:, None, :]  # of each limit
        p = np.concatenate([inertia, -inertia, np.zeros_like(inertia)], axis=-1) / force
        q = np.concatenate([square / force, -square / force, (length_slope / speed) ** 2], axis=-1)
        still = np.concatenate([constant, -constant], axis=-1) / force
        r = np.concatenate([kept[..., :6] - still, kept[..., 6:] ** 2 + 0 * inertia], axis=-1)
        sides = 6 if math.isinf(speed) else 9
        return ProfileLimits(_IMPOSED, p[..., :sides], q[..., :sides], r[..., :sides])

    def _guess(self, terms: CurveTerms) -> Array:
        """Return the magnitude of u'^2 at the knots: of the last profile, or from the limits."""
        if self.profile is not None:
            return self.profile.along(self.knots)[0]
        # A steady force F takes a mass m from rest to u'^2 = 2 u F / m; a speed d' is d_u u'.
        inertia = float(np.median(np.abs(terms.inertia).max(axis=-1)))
        reach = float(np.median(np.abs(terms.length_slope).max(axis=-1)))
        length = self.knots[-1]
        limits = self.dynamics.limits
        by_force = limits.force * length / inertia if inertia > 0 else math.inf
        by_speed = (limits.speed / reach) ** 2 if reach > 0 else math.inf
        shape = np.ones_like(self.knots)
        for rests, way in zip(self.rest, (self.knots, length - self.knots), strict=True):
            shape *= np.minimum(1.0, 2 * way / length) if rests else 1.0
        return min(by_force, by_speed) * shape

    def _linearise(self, found: SpeedProfile, u: Array, friction: Array, slope: Array) -> None:
        """Set the error of the linear friction, and the u'^2 about which it is linear next."""
        if not has_friction(self.dynamics.robot.parameters):
            self.mismatch = 0.0
            return
        square = found.within(_IMPOSED)[1].clip(0.0)
        about = np.zeros_like(square) if self.linearised_at is None else self.linearised_at
        made_for = friction + slope * (square - about)[..., None]
        wrong = np.abs(self.dynamics.friction(u, square)[0] - made_for).max()
        before, self.mismatch = self.mismatch, float(wrong / self.dynamics.limits.force)
        # If it does not converge, half of each step is taken.
        self.linearised_at = (about + square) / 2 if self.mismatch > before / 2 else square

    def _linearise_slower(self) -> None:
        """Linearise friction about a slower motion: about a fast one it may exceed the limits."""
        if self.linearised_at is None or self.slower == _MOST_SLOWER:
            raise infeasible(self.dynamics)
        self.slower += 1
        self.linearised_at = self.linearised_at / 4
        self.mismatch = math.inf

    def _check_pieces(self, found: SpeedProfile) -> tuple[Array, Array]:
        """Return the excess of each limit in each piece, (n, 9), and inactive shares of time."""
        u, square, acceleration = found.within(_CHECKED)
        square = square.clip(0.0)
        motion = self.dynamics.sample(u, square, acceleration)
        sides = self.dynamics.use(motion).sides
        beyond = (sides + _possible_excess(sides)).max(axis=1) - 1
        rate = np.sqrt(square)
        steps = np.diff(u, axis=1) / ((rate[:, 1:] + rate[:, :-1]) / 2)
        unused = sides.max(axis=-1) < 1 - ACTIVE
        unused_steps = steps * (unused[:, 1:].astype(float) + unused[:, :-1]) / 2
        return beyond, unused_steps.sum(axis=1) / steps.sum()

    def _check_times(self, found: SpeedProfile) -> Array:
        """Return the excess of each limit in each piece at evenly spaced times, (n, 9)."""
        t = np.linspace(0.0, found.duration, _TIMES)
        sides = LimitedMotion(self.dynamics, found).use(t).sides - 1
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
    if has_friction(dynamics.robot.parameters):
        more = knots[1] / 4.0 ** np.arange(1, 5)
        knots = np.concatenate([knots, more, length - more])
    # Where pieces of a curve meet, forces have a kink.
    inner = np.asarray(getattr(dynamics.curve, "knots", ()), dtype=np.float64)
    near = np.abs(inner[:, None] - knots).min(axis=1, initial=math.inf) < 1e-3 * knots[1]
    return np.sort(np.concatenate([knots, inner[(inner > 0) & (inner < length) & ~near]]))

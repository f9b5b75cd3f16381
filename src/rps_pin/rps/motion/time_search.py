"""The search for the shortest time along a curve: what goes on around the convex program.

- Friction depends on the speed. It is taken as linear in u'^2 about the motion found last, until
  that is what it is linear about.
- Limits are asked for at a few places in each piece, and looked at in many. Where the true force or
  speed is beyond a limit in between, the limit is tightened for that piece by as much.
- Nearly everywhere, one limit or another is reached: the shortest time leaves none unused. Pieces
  where none is are divided.
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

#: To what part of a limit it is kept. Half of that is aimed below it, so that a motion is within
#: its limits wherever it is looked at.
KEPT = 1e-6
#: At most this share of the time may no limit be reached to `ACTIVE` before pieces are divided:
#: first, and once limits have been tightened.
IDLE, IDLE_TIGHTENED = 2e-3, 6e-3

# Where limits are asked for in each piece, and where they are looked at: denser towards the ends,
# where a rate that starts from rest grows like a root. Within the piece, for a curve may jump in
# its second derivative where two pieces meet.
_INSIDE = 1e-9
_ASKED = np.linspace(_INSIDE, 1 - _INSIDE, 4)
_LOOKED = ((1 - np.cos(np.linspace(0.0, np.pi, 33))) / 2).clip(_INSIDE, 1 - _INSIDE)
_CHECKED_TIMES = 20_001
MOST_ROUNDS = 60
_MOST_HALVINGS = 12
#: Where fewer of the pieces than this are to be divided, it is by four.
_FEW = 0.15
#: How well the linear friction must agree with the true one, over the limit of force.
_SETTLED = 1e-6
#: How well, before pieces are divided.
_NEARLY = 5e-4
#: How often it is tried about half the speed before a curve is infeasible.
_MOST_SLOWED = 12
#: A limit is tightened by a little more than what is beyond it: a tenth, and this part of it.
_SPARE = 1e-7


class TimeSearch:
    """The loop's state: pieces, what limits are tightened by, and the profile found last."""

    def __init__(self, dynamics: CurveDynamics, rest: tuple[bool, bool], intervals: int) -> None:
        self.dynamics = dynamics
        self.rest = rest
        self.knots = _first_knots(dynamics, intervals)
        self.tightened = np.zeros((len(self.knots) - 1, 9))  # by side, over the limit
        self.narrowest = dynamics.curve.length / intervals / 2**_MOST_HALVINGS
        self.profile: SpeedProfile | None = None
        self.linear_about: Array | None = None  # u'^2 where limits are asked for
        self.mismatch = math.inf
        self.step, self.slowed = 1.0, 0
        self.excess = self.idle = math.inf

    def advance(self) -> bool:
        """Do a round, and return whether the motion is as wanted."""
        u = self._places(_ASKED)
        friction, slope = self._friction(u)
        terms = self.dynamics.terms(u)
        limits = self._limits(terms, friction, slope)
        found = fastest_profile(self.knots, limits, self.rest, self._guess(terms))
        if found is None:
            self._slow_down()
            return False
        self.profile = found
        self._settle(found, u, friction, slope)
        beyond, idle = self._look(found)
        settled = self.mismatch <= _SETTLED
        if settled and (beyond <= 0).all():
            np.maximum(beyond, self._look_at_times(found), out=beyond)
        self.excess, self.idle = float(beyond.max()), float(idle.sum())
        lazy = (idle > 0) & (np.diff(self.knots) > self.narrowest)
        most_idle = IDLE_TIGHTENED if self.tightened.any() else IDLE
        if self.mismatch <= _NEARLY and self.idle > most_idle and lazy.any():
            self._divide(found, lazy, 4 if lazy.mean() < _FEW else 2)
            return False
        if settled:
            self.tightened += np.where(beyond > 0, 1.1 * beyond + _SPARE, 0.0)
        return settled and self.excess <= 0

    def motion(self) -> LimitedMotion:
        """Return what was found last."""
        if self.profile is None:
            raise self.failure()
        return LimitedMotion(self.dynamics, self.profile)

    def failure(self) -> RPSPinError:
        """Return the error of a search that came to no end."""
        if self.mismatch > _SETTLED:
            return RPSPinError(
                f"friction does not settle in {MOST_ROUNDS} rounds: it still differs by "
                f"{self.mismatch:.3g} of the force limit from what the motion was made for"
            )
        return RPSPinError(
            f"no motion was found in {MOST_ROUNDS} rounds that keeps the limits to {KEPT:.0e}: "
            f"the last exceeds one by {self.excess:.3g} of it"
        )

    def _places(self, share: Array) -> Array:
        return (1 - share) * self.knots[:-1, None] + share * self.knots[1:, None]

    def _limits(self, terms: CurveTerms, friction: Array, slope: Array) -> ProfileLimits:
        """Return the limits at places (n, m), as parts of themselves."""
        force, speed = self.dynamics.limits.force, self.dynamics.limits.speed
        mass, swing, weight, lengths = terms
        about = 0.0 if self.linear_about is None else self.linear_about[..., None]
        square = swing + slope
        constant = weight + friction - slope * about
        kept = 1 - KEPT / 2 - self.tightened[:, None, :]  # of each limit
        p = np.concatenate([mass, -mass, np.zeros_like(mass)], axis=-1) / force
        q = np.concatenate([square / force, -square / force, (lengths / speed) ** 2], axis=-1)
        still = np.concatenate([constant, -constant], axis=-1) / force
        r = np.concatenate([kept[..., :6] - still, kept[..., 6:] ** 2 + 0 * mass], axis=-1)
        sides = 6 if math.isinf(speed) else 9
        return ProfileLimits(_ASKED, p[..., :sides], q[..., :sides], r[..., :sides])

    def _guess(self, terms: CurveTerms) -> Array:
        """Return of what size u'^2 is at the knots: as found last, or as the limits have it."""
        if self.profile is not None:
            return self.profile.along(self.knots)[0]
        # A steady force F takes a mass m from rest to u'^2 = 2 u F / m; a speed d' is d_u u'.
        inertia = float(np.median(np.abs(terms.mass).max(axis=-1)))
        reach = float(np.median(np.abs(terms.lengths).max(axis=-1)))
        length = self.knots[-1]
        sizes = [self.dynamics.limits.force * length / inertia if inertia > 0 else math.inf]
        sizes.append((self.dynamics.limits.speed / reach) ** 2 if reach > 0 else math.inf)
        shape = np.ones_like(self.knots)
        for rests, way in zip(self.rest, (self.knots, length - self.knots), strict=True):
            shape *= np.minimum(1.0, 2 * way / length) if rests else 1.0
        return min(sizes) * shape

    def _friction(self, u: Array) -> tuple[Array, Array]:
        """Return friction and its slope about the motion found last; none at first."""
        if self.linear_about is None:
            return np.zeros((*u.shape, 3)), np.zeros((*u.shape, 3))
        return self.dynamics.friction(u, self.linear_about)

    def _settle(self, found: SpeedProfile, u: Array, friction: Array, slope: Array) -> None:
        """Set by how much friction differs from what the profile was made for, and what is next."""
        if not has_friction(self.dynamics.robot.parameters):
            self.mismatch = 0.0
            return
        square = found.within(_ASKED)[1].clip(0.0)
        about = np.zeros_like(square) if self.linear_about is None else self.linear_about
        made_for = friction + slope * (square - about)[..., None]
        wrong = np.abs(self.dynamics.friction(u, square)[0] - made_for).max()
        before, self.mismatch = self.mismatch, float(wrong / self.dynamics.limits.force)
        # Where it does not come nearer, half of each step is taken.
        self.step = 0.5 if self.mismatch > before / 2 else 1.0
        first = self.linear_about is None
        self.linear_about = square if first else about + self.step * (square - about)

    def _slow_down(self) -> None:
        """Take friction as linear about a slower motion: about a fast one, it may be too much."""
        if self.linear_about is None or self.slowed == _MOST_SLOWED:
            raise infeasible(self.dynamics)
        self.slowed += 1
        self.linear_about = self.linear_about / 4
        self.mismatch = math.inf

    def _look(self, found: SpeedProfile) -> tuple[Array, Array]:
        """Return how far each side is exceeded in each piece, (n, 9), and idle shares of time."""
        u, square, acceleration = found.within(_LOOKED)
        square = square.clip(0.0)
        motion = self.dynamics.sample(u, square, acceleration)
        sides = self.dynamics.use(motion).sides
        beyond = (sides + _missed(sides)).max(axis=1) - 1
        rate = np.sqrt(square)
        steps = np.diff(u, axis=1) / ((rate[:, 1:] + rate[:, :-1]) / 2)
        unused = sides.max(axis=-1) < 1 - ACTIVE
        unused_steps = steps * (unused[:, 1:].astype(float) + unused[:, :-1]) / 2
        return beyond, unused_steps.sum(axis=1) / steps.sum()

    def _look_at_times(self, found: SpeedProfile) -> Array:
        """Return how far each side is exceeded in each piece at evenly spaced times, (n, 9)."""
        t = np.linspace(0.0, found.duration, _CHECKED_TIMES)
        sides = LimitedMotion(self.dynamics, found).use(t).sides - 1
        piece = np.searchsorted(found.times[1:-1], t, side="right")
        beyond = np.full_like(self.tightened, -1.0)
        np.maximum.at(beyond, piece, sides)
        return beyond

    def _divide(self, found: SpeedProfile, chosen: Bools, parts: int) -> None:
        """Divide pieces; what their limits are tightened by falls by the square, as errors do."""
        shares = np.arange(1, parts) / parts
        more = self._places(shares)[chosen]
        times = np.where(chosen, parts, 1)
        self.tightened = np.repeat(self.tightened / (times**2)[:, None], times, axis=0)
        self.knots = np.sort(np.concatenate([self.knots, more.ravel()]))
        if self.linear_about is not None:
            self.linear_about = found.along(self._places(_ASKED))[0].clip(0.0)
            self.mismatch = math.inf


def _missed(values: Array) -> Array:
    """Return by how much a function may be greater near samples than at them, shape (n, m, k).

    Between equal steps (m), half the larger second difference bounds it: an eighth of it does where
    the function is smooth, half of it where its slope jumps.
    """
    bends = np.abs(np.diff(values, 2, axis=1))
    bends = np.concatenate([bends[:, :1], bends, bends[:, -1:]], axis=1)
    around = np.concatenate([bends[:, :1], bends, bends[:, -1:]], axis=1)
    missed: Array = np.maximum(np.maximum(around[:, :-2], around[:, 2:]), bends) / 2
    return missed


def _first_knots(dynamics: CurveDynamics, intervals: int) -> Array:
    """Return even knots; with friction, which jumps when a motion begins, denser at the ends."""
    length = dynamics.curve.length
    knots = np.linspace(0.0, length, intervals + 1)
    if has_friction(dynamics.robot.parameters):
        more = knots[1] / 4.0 ** np.arange(1, 5)
        knots = np.concatenate([knots, more, length - more])
    # Where a curve's pieces meet, its forces bend.
    inner = np.asarray(getattr(dynamics.curve, "knots", ()), dtype=np.float64)
    near = np.abs(inner[:, None] - knots).min(axis=1, initial=math.inf) < 1e-3 * knots[1]
    return np.sort(np.concatenate([knots, inner[(inner > 0) & (inner < length) & ~near]]))

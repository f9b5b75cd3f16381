"""The iteration for the shortest time under limits of jerk, by linear programs.

It begins with the motion of the shortest time without these limits, smoothed by a moving average,
which keeps its way and limits its jerk. A step of `linear_step` is taken if the time, with the
excess over limits, becomes shorter as foreseen, and shortened otherwise: a trust region. The
program is not convex. What is found is a local optimum: no small change of the time law makes it
shorter; a quite different one might.

Limits are imposed at a few points of each piece and checked at many. A limit that is exceeded is
tightened there by as much. Pieces without a limit that is reached are divided. At last, limits are
checked by the dynamics themselves in all pieces and at thousands of times, and the motion is made
slower as a whole by the excess that is left.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import RPSPinError
from rps_pin.task.motion.curve_dynamics import CurveDynamics
from rps_pin.task.motion.jerk.curve_table import CurveTable
from rps_pin.task.motion.jerk.jerk_profile import JerkProfile, Passages
from rps_pin.task.motion.jerk.limit_rows import LimitRows, limit_rows, limit_use
from rps_pin.task.motion.jerk.linear_step import linear_step
from rps_pin.task.motion.speed_profile import SpeedProfile
from rps_pin.task.motion.time_search import KEPT, Progress
from rps_pin.trajectories.time_laws import QuinticLaw

#: Rounds, steps of each, and pieces at most.
MOST_ROUNDS, _MOST_STEPS, _MOST_PIECES = 12, 25, 300
#: Foreseen decrease of the time that ends a round, relative.
_CONVERGED = 1e-5
#: Pieces are divided if more than this is left unused of the most used limit, in the mean of time.
_LOOSE = 1e-3
#: Of one unit of excess over a limit, in durations: at first, and at last.
_COST, _DEAREST = 20.0, 1e5
#: First, largest and smallest reach of a step, over the length.
_REACH, _LARGEST, _SMALLEST = 0.1, 0.5, 1e-5
#: Where in each piece limits are checked by the table, and by the dynamics: not at its ends, where
#: derivatives of a curve may jump.
_CHECKED, _EXACT = np.linspace(1e-9, 1 - 1e-9, 13), np.linspace(1e-9, 1 - 1e-9, 5)
#: An excess of this is no reason for another round.
ENOUGH = 1e-4
#: A limit is tightened by so much of its excess.
_SPARE = 1.1
_MOST_SLOWER = 60
#: Times at which the first law is integrated, and least pieces between two breaks of the curve.
_DENSE, _FEWEST = 4001, 4


class JerkSearch:
    """State of the iteration: the last law, and by how much limits are tightened.

    Parameters
    ----------
    dynamics
        What is limited along the curve.
    free
        Its shortest time without limits of jerk; None if nothing else limits accelerations.
    intervals
        Pieces at first.
    """

    def __init__(self, dynamics: CurveDynamics, free: SpeedProfile | None, intervals: int) -> None:
        self.dynamics = dynamics
        self.table = CurveTable(dynamics)
        self.profile = (
            _quintic(dynamics, self.table, intervals)
            if free is None
            else _smoothed(dynamics, self.table, free, intervals)
        )
        self.tightened = np.full((self.profile.pieces, len(dynamics.sides)), KEPT / 2)
        self.cost = _COST
        self.loose = math.inf

    def run(self, progress: Progress) -> JerkProfile:
        """Return the law of the shortest time that was found.

        Raises
        ------
        RPSPinError
            If no law is found that keeps the limits.
        """
        for _ in progress(range(MOST_ROUNDS)):
            if self.advance():
                break
        return self._within_limits()

    def advance(self) -> bool:
        """Do one round, and return whether it has converged."""
        self._settle()
        sides = limit_use(self.dynamics, self.table, self.profile, _CHECKED).sides
        beyond = sides.max(axis=1) - 1
        excess = float(beyond.max())
        if excess > ENOUGH:
            self.tightened += np.where(beyond > 0, _SPARE * beyond, 0.0)
        loose = 1 - (sides + self.tightened[:, None]).max(axis=-1).clip(max=1.0).mean(axis=1)
        share = self.profile.shares * loose
        self.loose = float(share.sum())
        if self.loose > _LOOSE and self.profile.pieces < _MOST_PIECES:
            self._divide(share)
            return False
        return excess <= ENOUGH

    def _divide(self, share: Array) -> None:
        """Divide pieces, those with the largest shares of what is unused first."""
        most = min(_MOST_PIECES - share.size, int((share > _LOOSE / 2 / share.size).sum()))
        parts = np.ones(share.size, dtype=np.intp)
        parts[np.argsort(-share)[:most]] = 2
        self.profile = self.profile.divided(parts)
        # Tightenings fall with the square of the width, as errors do.
        self.tightened = np.repeat(self.tightened / parts[:, None] ** 2, parts, axis=0)
        self.tightened = self.tightened.clip(KEPT / 2)

    def _settle(self) -> None:
        """Take steps until none is foreseen to make the motion faster."""
        rows, reach = self._rows(self.profile), _REACH
        for _ in range(_MOST_STEPS):
            trial = linear_step(self.profile, rows, reach, self.cost)
            if trial is None:
                reach /= 3
                continue
            new = self._rows(trial.profile)
            foreseen = self.cost * (rows.excess - trial.excess) - math.log(trial.duration)
            longer = trial.profile.duration / self.profile.duration
            made = self.cost * (rows.excess - new.excess) - math.log(longer)
            if made > 0.1 * foreseen or (made > 0 and foreseen < _CONVERGED):
                self.profile, rows = trial.profile, new
                if made > 0.7 * foreseen:
                    reach = min(2 * reach, _LARGEST)
            else:
                reach /= 3
            if foreseen < _CONVERGED or reach < _SMALLEST:
                if rows.excess <= KEPT or self.cost > _DEAREST:
                    return
                # A shorter time was worth an excess: where holding takes nearly all of a limit.
                self.cost, reach = 10 * self.cost, _REACH

    def _within_limits(self) -> JerkProfile:
        """Return the law, as much slower as it exceeds limits by the dynamics themselves."""
        t = np.linspace(0.0, self.profile.duration, self.dynamics.times)
        at_times = (*self.profile.at(t), self.profile.jerk_at(t))
        in_pieces = self.profile.within(_EXACT)
        parts = zip(in_pieces, at_times, strict=True)
        u, r, a, j = (np.concatenate([one.ravel(), more]) for one, more in parts)
        slower = 1.0
        for tries in range(_MOST_SLOWER):
            square = (r.clip(0.0) / slower) ** 2
            use = self.dynamics.use_along(u, square, a / slower**2, j / slower**3)
            most = float(use.most.max())
            if most <= 1 + KEPT / 2:
                return self.profile.slower(slower)
            # More with each: where holding takes nearly all of a limit, slowness helps little.
            slower *= 1 + 0.6 * (most - 1) * 1.2**tries
        raise RPSPinError(
            f"no motion was found that keeps the limits to {KEPT:.0e}: the last exceeds one by "
            f"{most - 1:.3g} of it"
        )

    def _rows(self, profile: JerkProfile) -> LimitRows:
        return limit_rows(self.dynamics, self.table, profile, self.tightened)


# The first law ------------------------------------------------------------------------------------


def _smoothed(
    dynamics: CurveDynamics, table: CurveTable, free: SpeedProfile, pieces: int
) -> JerkProfile:
    """Return a moving average of a law, as long as limits of jerk take, at most its duration."""
    width = free.duration / pieces
    while True:
        average = partial(_average, free, width)
        profile = _with_accelerations(table, average, free.duration + width, pieces)
        if width >= free.duration or _jerk_use(dynamics, table, profile) <= 1:
            return profile
        width = min(2 * width, free.duration)


def _average(law: SpeedProfile, width: float, t: Array) -> Array:
    """Return the mean of u'' in a time up to each of times: by the difference of the rates."""

    def rate(at: Array) -> Array:
        inside = (at > 0) & (at < law.duration)
        return np.where(inside, law.at(at.clip(0.0, law.duration)).rate, 0.0)

    mean: Array = (rate(t) - rate(t - width)) / width
    return mean


def _quintic(dynamics: CurveDynamics, table: CurveTable, pieces: int) -> JerkProfile:
    """Return a smooth law of a duration in which jerks and speeds keep their limits."""
    law = QuinticLaw(float(table.breaks[-1]), 1.0)
    profile = _with_accelerations(table, lambda t: law.at(t).acceleration, 1.0, pieces)
    use = limit_use(dynamics, table, profile, _CHECKED)
    fast = max(float(np.abs(part).max(initial=0.0)) for part in (use.speed, use.coordinate_speed))
    return profile.slower(max(fast, _jerk_use(dynamics, table, profile) ** (1 / 3)))


def _with_accelerations(
    table: CurveTable, acceleration: Callable[[Array], Array], duration: float, pieces: int
) -> JerkProfile:
    """Return the law of accelerations u'' over time, with knots where it passes the breaks."""
    breaks = table.breaks / table.breaks[-1]
    t = np.linspace(0.0, duration, _DENSE)
    rate = np.append(0.0, np.cumsum((acceleration(t[1:]) + acceleration(t[:-1])) / 2))
    way = np.append(0.0, np.cumsum((rate[1:] + rate[:-1]) / 2))
    passed = np.interp(breaks, way / way[-1], t / duration)
    counts = np.maximum(_FEWEST, np.rint(pieces * np.diff(passed))).astype(np.intp)
    shares = np.repeat(np.diff(passed) / counts, counts)
    at_knots = acceleration(duration * np.append(0.0, np.cumsum(shares)).clip(0.0, 1.0))
    by_time = duration**2 / table.breaks[-1]
    passages = Passages(np.cumsum(counts)[:-1], breaks[1:-1])
    jerks = np.diff(at_knots) * by_time / shares
    return JerkProfile(shares, jerks, float(table.breaks[-1]), duration, passages)


def _jerk_use(dynamics: CurveDynamics, table: CurveTable, profile: JerkProfile) -> float:
    use = limit_use(dynamics, table, profile, _CHECKED)
    return max(float(np.abs(part).max(initial=0.0)) for part in (use.jerk, use.coordinate_jerk))

"""Interference of links along a path: signed distances as signals, their zeros, and the least one.

The signal of a pair of links is its signed distance less the clearance. Its rate is exact
(`rps_pin.closed_loop.interference.distances`), and its zeros are bracketed as those of limits are.

What this relies on is what the check relies on: between two samples no distance turns more than
once. Distances of shapes with edges are smooth in pieces, and can turn with every edge that passes.
So a contact that is shorter than a step between samples can be missed; how deep it can be at most
is `PathInterference.hidden`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.closed_loop.interference.distances import LinkDistances
from rps_pin.errors import InputError, shown
from rps_pin.task.paths.events import InterferenceEvent, LimitEvent, PathInterference
from rps_pin.task.paths.findings import Findings, Signal
from rps_pin.task.paths.signals import TaskSignals, lowest

#: What is said where there is nothing to check.
NO_SHAPES = "no collision shapes"
#: Values that are looked at together.
_BLOCK = 100_000
_KINDS = {"leaves": "begins", "returns": "ends", "starts outside": "starts inside"}


def path_interference(
    path: TaskSignals, asked: bool | None, clearance: float, ignore: Any
) -> PathInterference | None:
    """Return the interference of links on a path that was followed.

    Parameters
    ----------
    path
        The path.
    asked
        Whether it is checked; None: where all shapes can be read.
    clearance
        Least distance of two links, m.
    ignore
        Pairs of links that may overlap.

    Raises
    ------
    InputError
        If it is asked for, and there are no shapes or one cannot be read.
    """
    mechanism = path.task.mechanism
    if not (asked is None or isinstance(asked, (bool, np.bool_))):
        raise InputError(f"interference = {shown(asked)}: it must be True, False or None")
    if asked is not None and not asked:
        return None
    stated = mechanism.collision_shapes
    if not (stated.shapes or stated.faults):
        if asked:
            raise InputError(f"{mechanism.name or 'the mechanism'} has {NO_SHAPES}")
        return not_checked(NO_SHAPES, clearance)
    try:
        mechanism.collision_model  # noqa: B018, built here
    except InputError as error:
        if asked:
            raise
        return not_checked(str(error), clearance)
    return _checked(path, mechanism.link_distances(ignore), clearance)


def not_checked(why: str, clearance: float = 0.0) -> PathInterference:
    """Return that nothing was checked, and why."""
    return PathInterference((), 0, clearance, np.inf, ("", ""), 0.0, 0.0, why)


def _checked(path: TaskSignals, distances: LinkDistances, clearance: float) -> PathInterference:
    signals = PairSignals(path, distances, clearance)
    if not distances.pairs:
        return not_checked("no pair of links to check", clearance)
    found = PairFindings(signals)
    least, pair, time = found.least()
    return PathInterference(
        found.events(),
        len(distances.pairs),
        clearance,
        least,
        distances.pairs[pair],
        time,
        found.hidden(),
    )


class PairSignals:
    """Distances of pairs of links less the clearance, along a path that was followed.

    Attributes
    ----------
    near : array of int
        Numbers of the pairs that come near; the others stay farther apart than the clearance, and
        than these.
    times : array
        Of the samples, s, shape (n,).
    values, slopes
        Signals and rates there, (n, near); of a pair that is far away a lower bound, and 0.
    ways
        Between the samples, how far the links of a pair move against each other at most, if no
        faster than at them, m, (n - 1, near).
    """

    kinds: tuple[Signal, ...] = ()

    def __init__(self, path: TaskSignals, distances: LinkDistances, clearance: float) -> None:
        self.path, self.distances, self.clearance = path, distances, clearance
        self.duration, self.tolerance, self.scale = path.duration, path.tolerance, path.scale
        self.times, self._state = path.states()
        bounds, speeds = self._bounds()
        ways = np.maximum(speeds[:-1], speeds[1:]) * np.diff(self.times)[:, None]
        enough = max(self._some_distance(bounds), clearance) + ways.max(axis=0, initial=0.0)
        close = bounds <= enough
        self.near = np.flatnonzero(close.any(axis=0))
        self.limits = tuple(
            Signal("distance", int(number), "lower", clearance, "m") for number in self.near
        )
        close, self.values = close[:, self.near], bounds[:, self.near] - clearance
        self.slopes = np.zeros_like(self.values)
        self.ways = ways[:, self.near]
        for k, i in np.argwhere(close).tolist():
            if not close[k, :i].any():
                self._take(self._state, k)
            self.values[k, i], self.slopes[k, i] = self._one(i)

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Return poses and rates at times (n,), shape (n, m) each."""
        return self.path.sample(times)

    def signals(self, times: Array) -> tuple[Array, Array]:
        """Return every signal and its rate at times (n,), shape (n, signals) each."""
        every = np.arange(self.near.size)
        found = np.empty((2, times.size, every.size))
        for i in every:
            found[:, :, i] = self.at(times, np.full(times.size, i))
        return found[0], found[1]

    def rates(self, times: Array) -> Array:
        """Return the rates alone at times (n,)."""
        return self.signals(times)[1]

    def at(self, times: Array, signal: Indices) -> tuple[Array, Array]:
        """Return one signal at each time, and its rate, shape (n,) each."""
        found = np.empty((2, times.size))
        if times.size:
            state = self.path.state(times)[2]
            for k, i in enumerate(signal.tolist()):
                self._take(state, k)
                found[:, k] = self._one(i)
        return found[0], found[1]

    def matters(self, sizes: Array, slopes: Array, steps: Array, threshold: float) -> Bools:
        """Return which turning points may be a contact, of some signals at a time."""
        block = max(_BLOCK // max(len(sizes), 1), 1)
        parts = [slice(k, k + block) for k in range(0, sizes.shape[1], block)]
        return np.concatenate(
            [lowest(sizes[:, one], slopes[:, one], steps) <= 0.0 for one in parts], axis=1
        )

    def may_jump(self, values: Array) -> Bools:
        """Return False: distances do not jump."""
        return np.zeros(len(values), dtype=bool)

    def where(self, pose: Array) -> str:
        """Return a pose in words."""
        return self.path.where(pose)

    def _take(self, state: Any, k: int) -> None:
        self.distances.set_state(state.q[k], state.v[k])

    def _one(self, signal: int) -> tuple[float, float]:
        distance, rate = self.distances.with_rate(int(self.near[signal]))
        return distance - self.clearance, rate

    def _bounds(self) -> tuple[Array, Array]:
        """Return a lower bound of each distance and its largest rate, shape (n, pairs) each."""
        found = np.empty((2, self.times.size, len(self.distances.pairs)))
        for k in range(self.times.size):
            self._take(self._state, k)
            found[:, k] = self.distances.bounds(), self.distances.largest_speeds()
        return found[0], found[1]

    def _some_distance(self, bounds: Array) -> float:
        """Return the least distance of pairs at the samples where their balls are nearest."""
        least, samples = np.inf, bounds.argmin(axis=0)
        for pair in np.argsort(bounds.min(axis=0), kind="stable"):
            if bounds[samples[pair], pair] > least:
                break
            self._take(self._state, int(samples[pair]))
            least = min(least, self.distances.with_rate(int(pair))[0])
        return float(least)


class PairFindings(Findings):
    """When pairs of links begin and cease to be nearer than the clearance."""

    path: PairSignals

    def __init__(self, signals: PairSignals) -> None:
        super().__init__(signals, signals.times, signals.values, signals.slopes, 0.0)

    def events(self) -> tuple[InterferenceEvent, ...]:
        """Return every event, in order of time; a pair that stays nearer throughout has one."""
        events = self.limits()
        changing = {one.leg for one in events if one.kind != "starts outside"}
        return tuple(self._event(one, one.leg not in changing) for one in events)

    def least(self) -> tuple[float, int, float]:
        """Return the least distance, m, the number of its pair, and when, s."""
        values, times = self.values, self.times
        best = float(values.min())
        way = np.abs(np.diff(values, axis=0)).max(axis=0, initial=0.0)
        found: list[tuple[float, int, float]] = []
        for i in np.flatnonzero(values.min(axis=0) - way <= best):
            k = int(values[:, i].argmin())
            ends = times[max(k - 1, 0)], times[min(k + 1, times.size - 1)]
            found.append((float(values[k, i]), int(self.path.near[i]), float(times[k])))

            def at(time: float, signal: int = int(i)) -> float:
                return float(self.path.at(np.array([time]), np.array([signal]))[0][0])

            width = max(self.path.tolerance, 1e-9 * (ends[1] - ends[0]))
            refined = minimize_scalar(at, bounds=ends, method="bounded", options={"xatol": width})
            found.append((float(refined.fun), int(self.path.near[i]), float(refined.x)))
        value, pair, time = min(found, key=lambda one: one[0])
        return value + self.path.clearance, pair, time

    def hidden(self) -> float:
        """Return how deep a contact between samples can be that was not found, m."""
        both = (self.values[:-1] > 0) & (self.values[1:] > 0)
        deep = np.where(both, self.path.ways - self.values[:-1] - self.values[1:], 0.0) / 2
        return float(deep.max(initial=0.0))

    def _event(self, found: LimitEvent, alone: bool) -> InterferenceEvent:
        pair = self.path.distances.pairs[found.leg]
        kind = "throughout" if alone else _KINDS[found.kind]
        where = self.path.where(found.pose)
        return InterferenceEvent(
            kind, *pair, found.time, found.width, found.pose, found.limit, where
        )

    def _at(self, times: Array, signal: Indices) -> Array:
        return self.path.at(times, signal)[0]

    def _rates_at(self, times: Array, signal: Indices) -> Array:
        return self.path.at(times, signal)[1]

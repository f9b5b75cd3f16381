"""Zeros and turning points of signals along a path, and what they mean: the events of a check.

Everything that can go wrong is a *signal*: a function of time that is zero where it happens, with
its rate. Between two neighbouring samples of the path,

- a signal that changes its sign has a zero: bisection brackets it;
- a signal that falls towards zero at the first and rises from it at the second has a turning point:
  bisection of its rate brackets that. If the signal's sign is different there, it has two zeros,
  which are bracketed in turn; else the path has come near and turned away, and if it came nearer to
  a singularity than the threshold, it *grazes* it.

So two crossings are told apart however near in time they are, down to the tolerance. What this
relies on: **between two samples, no signal turns more than once.**
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.errors import InputError
from rps_pin.numerics.bisection import bisected
from rps_pin.task.paths.events import LimitEvent, PathCheck, SingularityEvent
from rps_pin.trajectories.path import Trajectory
from rps_pin.validation import positive_number

#: A path whose distance to a singularity stays below this is in it: what rounding leaves of zero.
NOISE = 1e-13
#: A smallest distance to a singularity below this is a graze.
GRAZE = 1e-3
#: Widest bracket of an event, over the duration, unless another is given.
BRACKET = 1e-10

_MOST_SAMPLES = 1_000_000


class Signal(NamedTuple):
    """What a signal is about."""

    name: str
    """Kind of singularity, or quantity with a limit."""
    leg: int = 0
    """1 to 3; 0 for the whole mechanism, or where a joint is named."""
    side: str = ""
    limit: float = 0.0
    unit: str = ""
    joint: str = ""


class Signals(Protocol):
    """A path of a mechanism as signals of time: first those of singularities, then limits."""

    @property
    def duration(self) -> float:
        """Of the path, s."""
        ...

    @property
    def tolerance(self) -> float:
        """Widest bracket of an event, s."""
        ...

    @property
    def kinds(self) -> tuple[Signal, ...]:
        """The signals of singularities: signed or absolute distances."""
        ...

    @property
    def limits(self) -> tuple[Signal, ...]:
        """The signals of limits: the room that is left, negative beyond the limit."""
        ...

    @property
    def scale(self) -> Array:
        """What makes the pose's coordinates dimensionless, shape (m,)."""
        ...

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Return poses and rates at times (n,), shape (n, m) each."""
        ...

    def signals(self, times: Array) -> tuple[Array, Array]:
        """Return every signal and its rate at times (n,), shape (n, signals) each."""
        ...

    def may_jump(self, values: Array) -> Bools:
        """Return whether a change of sign may be a jump, shape (n,), of values (n, signals)."""
        ...

    def rates(self, times: Array) -> Array:
        """Return the rates alone at times (n,)."""
        ...

    def matters(self, sizes: Array, slopes: Array, steps: Array, threshold: float) -> Bools:
        """Return which turning points are to be bracketed, shape (n, signals).

        Of the signals' sizes (n + 1, signals) and their slopes at samples `steps` (n,) apart, s.
        """
        ...

    def where(self, pose: Array) -> str:
        """Return a pose in words; empty for the 3-RPS's."""
        ...


def check_signals(path: Signals, times: Array, threshold: float) -> PathCheck:
    """Return the events of a path that is sampled at times (n,), of which signals are known."""
    values, rates = path.signals(times)
    found = Findings(path, times, values, rates, threshold)
    singularities = found.singularities()
    nearest = found.nearest(singularities)
    pose = path.sample(np.array([nearest[2]]))[0][0]
    density = times.size, float(np.diff(times).max())
    about = path.duration, threshold, path.tolerance
    return PathCheck(singularities, found.limits(), *nearest, *about, *density, pose)


def checked_times(trajectory: Trajectory, tolerance: float | None) -> tuple[float, float]:
    """Return a trajectory's duration and the widest bracket of an event, s.

    The latter is `BRACKET` of the duration where no tolerance is given.
    """
    width = None if tolerance is None else positive_number(tolerance, "tolerance", "s")
    duration = positive_number(trajectory.duration, "the trajectory's duration", "s")
    width = BRACKET * duration if width is None else width
    least = 4 * float(np.spacing(duration))
    if width < least:
        raise InputError(
            f"tolerance = {width:.3g} s: times up to {duration:.6g} s can be told apart down to "
            f"{least:.3g} s"
        )
    return duration, width


def checked_samples(value: Array, times: Array, name: str, size: int) -> Array:
    """Return what a trajectory returned for its pose or a rate at times (n,), shape (n, size)."""
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.shape != (times.size, size):
        raise InputError(
            f"the trajectory's {name} at {times.size} times has shape {array.shape} and type "
            f"{array.dtype}; it must be ({times.size}, {size}) numbers"
        )
    finite = np.isfinite(array).all(axis=-1)
    if not finite.all():
        when = times[int(np.argmin(finite))]
        raise InputError(f"the trajectory's {name} is not finite at {when:.9g} s")
    return array.astype(np.float64, copy=False)


def sample_times(path: Signals, least_steps: int, max_step: float) -> Array:
    """Return times so dense that neighbours are no further apart than asked for."""
    if least_steps > _MOST_SAMPLES:
        raise InputError(f"least_steps = {least_steps}: at most {_MOST_SAMPLES:,} are accepted")
    scale = path.scale
    times = np.linspace(0.0, path.duration, least_steps + 1)
    while True:
        pose, rate = path.sample(times)
        speed = np.abs(rate * scale).max(axis=-1)
        gap = np.diff(times)
        moved = np.maximum(
            np.maximum(speed[1:], speed[:-1]) * gap,
            np.abs(np.diff(pose, axis=0) * scale).max(axis=-1),
        )
        # A step of the floats' own size is not halved any more: there the path jumps.
        parts = np.where(gap > 8 * np.spacing(path.duration), np.ceil(moved / max_step), 1.0)
        parts = np.clip(parts, 1, 1000)
        if (parts == 1).all():
            return times
        wanted = parts.sum()
        if wanted > _MOST_SAMPLES:
            raise InputError(
                f"max_step = {max_step:.3g} would take {wanted:.3g} samples of this path, and at "
                f"most {_MOST_SAMPLES:,} are accepted"
            )
        # Each step is divided into equal parts.
        count = parts.astype(np.intp)
        within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        inner = np.repeat(times[:-1], count) + np.repeat(gap / count, count) * within
        times = np.append(inner, times[-1])


# Events -------------------------------------------------------------------------------------------


class _Brackets(NamedTuple):
    """Stretches of time (n,), each for one signal, and whether the signal is negative at `low`."""

    low: Array
    high: Array
    signal: Indices
    negative: Bools

    def part(self, chosen: Bools | Indices) -> _Brackets:
        """Return some of them."""
        return _Brackets._make(field[chosen] for field in self)

    def joined(self, more: _Brackets) -> _Brackets:
        """Return these and more of them."""
        return _Brackets._make(map(np.concatenate, zip(self, more, strict=True)))


class Findings:
    """The zeros and turning points of every signal, from samples of them."""

    def __init__(
        self, path: Signals, times: Array, values: Array, rates: Array, threshold: float
    ) -> None:
        self.path = path
        self.kinds = len(path.kinds)
        self.times = times
        self.values = values
        self.threshold = threshold
        singular = np.arange(values.shape[1]) < self.kinds
        self.noise = np.where(singular, NOISE, 0.0)
        self.zero = (np.abs(values) <= self.noise) & singular
        self.sign = _filled_signs(np.where(self.zero, 0.0, np.where(values < 0, -1.0, 1.0)))
        # Of each signal's size: negative where it falls towards zero.
        self.growth = self.sign * rates
        self.turning, split = self._turning_points()
        self.zeros = self._zeros(split)

    def singularities(self) -> tuple[SingularityEvent, ...]:
        """Return every event of the first signals, in order of time."""
        zeros, touches = _apart(
            self.zeros.part(self.zeros.signal < self.kinds), self.path.tolerance
        )
        events = [
            *self._events("crosses", self._continuous(zeros)),
            *self._events("grazes", touches),
            *(e for e in self._approaches() if abs(e.distance) < self.threshold),
            *self._events("grazes", self._ends()),
            *self._events("stays", self._stays()),
        ]
        return tuple(sorted(events, key=lambda event: event.time))

    def limits(self) -> tuple[LimitEvent, ...]:
        """Return every event of the limits, in order of time."""
        start = np.flatnonzero(self.values[0, self.kinds :] < 0) + self.kinds
        zeros = self.zeros.part(self.zeros.signal >= self.kinds)
        events = [self._limit_event("starts outside", 0.0, 0.0, signal) for signal in start]
        events += [
            self._limit_event("returns" if negative else "leaves", low, high, signal)
            for low, high, signal, negative in zip(*zeros, strict=True)
        ]
        return tuple(sorted(events, key=lambda event: event.time))

    def nearest(self, events: tuple[SingularityEvent, ...]) -> tuple[float, str, float]:
        """Return the smallest distance to a singularity, which kind, and when."""
        sizes = np.abs(self.values[:, : self.kinds])
        sample, signal = np.unravel_index(int(np.argmin(sizes)), sizes.shape)
        best = float(sizes[sample, signal]), self.path.kinds[signal].name, float(self.times[sample])
        near = (*self._approaches(), *events)
        found = [(abs(e.distance), e.singularity, e.time) for e in near]
        return min([best, *found], key=lambda candidate: candidate[0])

    # Zeros and turning points ---------------------------------------------------------------------

    def _turning_points(self) -> tuple[_Brackets, _Brackets]:
        """Return where signals' sizes are smallest, and where signals jut beyond zero instead."""
        falls = (self.growth[:-1] < 0) & (self.growth[1:] >= 0)
        same = self.sign[:-1] == self.sign[1:]
        standing = self.zero[:-1] & self.zero[1:]
        sizes = self.sign * self.values
        matters = self.path.matters(sizes, self.growth, np.diff(self.times), self.threshold)
        step, signal = np.nonzero(falls & same & ~standing & matters)
        sign = self.sign[step, signal]

        def falling(times: Array, which: Indices) -> Bools:
            return np.asarray(sign[which] * self._rates_at(times, signal[which]) < 0)

        low, high = bisected(falling, self.times[step], self.times[step + 1], self.path.tolerance)
        middle = (low + high) / 2
        beyond = sign * self._at(middle, signal) < -self.noise[signal]
        before = _Brackets(self.times[step], middle, signal, sign < 0).part(beyond)
        after = _Brackets(middle, self.times[step + 1], signal, sign >= 0).part(beyond)
        return _Brackets(low, high, signal, sign < 0).part(~beyond), before.joined(after)

    def _zeros(self, split: _Brackets) -> _Brackets:
        """Return brackets of every sign change: between samples, and beside turning points."""
        step, signal = np.nonzero(self.sign[:-1] != self.sign[1:])
        low, high, signal, negative = _Brackets(
            self.times[step], self.times[step + 1], signal, self.sign[step, signal] < 0
        ).joined(split)

        def same_sign(times: Array, which: Indices) -> Bools:
            return np.asarray((self._at(times, signal[which]) < 0) == negative[which])

        low, high = bisected(same_sign, low, high, self.path.tolerance)
        order = np.lexsort((low, signal))
        return _Brackets(low, high, signal, negative).part(order)

    def _at(self, times: Array, signal: Indices) -> Array:
        """Return one signal at each time, shape (n,)."""
        if not times.size:
            return np.zeros(0)
        return np.asarray(self.path.signals(times)[0][np.arange(times.size), signal])

    def _rates_at(self, times: Array, signal: Indices) -> Array:
        """Return the rate of one signal at each time, shape (n,)."""
        return np.asarray(self.path.rates(times)[np.arange(times.size), signal])

    def _continuous(self, zeros: _Brackets) -> _Brackets:
        """Leave out jumps, where a signal may have them."""
        if not zeros.low.size:
            return zeros
        index = np.arange(zeros.low.size)
        (at_low, low_rates), (at_high, high_rates) = map(self.path.signals, (zeros.low, zeros.high))
        jump = np.abs(at_high - at_low)[index, zeros.signal]
        fastest = np.maximum(np.abs(low_rates), np.abs(high_rates))[index, zeros.signal]
        smooth = jump <= 1e-6 + 10 * fastest * (zeros.high - zeros.low)
        return zeros.part(smooth | ~self.path.may_jump(np.minimum(at_low, at_high)))

    # What they mean -------------------------------------------------------------------------------

    def _events(self, kind: str, brackets: _Brackets) -> list[SingularityEvent]:
        """Return events in the middle of brackets; stays at their beginning."""
        low, high, signals, _ = brackets
        if not low.size:
            return []
        times = low if kind == "stays" else (low + high) / 2
        pose, distance = self.path.sample(times)[0], self._at(times, signals).tolist()
        events = zip(signals, times.tolist(), (high - low).tolist(), pose, distance, strict=True)
        return [
            SingularityEvent(kind, about.name, time, width, x, size, about.leg, self.path.where(x))
            for about, time, width, x, size in ((self.path.kinds[i], *rest) for i, *rest in events)
        ]

    def _approaches(self) -> list[SingularityEvent]:
        """Return where the path comes near to a singularity and turns away, however far it is."""
        return self._events("grazes", self.turning.part(self.turning.signal < self.kinds))

    def _ends(self) -> _Brackets:
        """Return where the path begins or ends near a singularity that it does not enter."""
        ends, beside = [0, -1], [1, -2]
        away = np.stack([self.growth[0] >= 0, self.growth[-1] < 0])
        near = (np.abs(self.values[ends]) < self.threshold) & ~(self.zero[ends] & self.zero[beside])
        end, signal = np.nonzero((near & (away | self.zero[ends]))[:, : self.kinds])
        time = self.times[-end]  # 0 the first, 1 the last
        return _Brackets(time, time, signal, signal < 0)

    def _stays(self) -> _Brackets:
        """Return when the path stays in a singularity: at two neighbouring samples or more."""
        edges = np.diff(np.pad(self.zero.astype(int), ((1, 1), (0, 0))), axis=0).T
        signal, first = np.nonzero(edges == 1)
        last = np.nonzero(edges == -1)[1] - 1
        stays = _Brackets(self.times[first], self.times[last], signal, signal < 0)
        return stays.part(last > first)

    def _limit_event(self, kind: str, low: float, high: float, signal: Any) -> LimitEvent:
        name, leg, side, limit, unit, joint = self.path.limits[signal - self.kinds]
        time = (low + high) / 2
        pose = self.path.sample(np.array([time]))[0][0]
        width = float(high - low)
        return LimitEvent(kind, leg, name, float(time), width, pose, limit, side, unit, joint)


def _filled_signs(signs: Array) -> Array:
    """Give zeros the sign before them, or the first one after; columns are signals."""
    known = signs != 0
    last = np.maximum.accumulate(np.where(known, np.arange(len(signs))[:, None], 0), axis=0)
    filled = np.take_along_axis(signs, np.maximum(last, known.argmax(axis=0)), axis=0)
    return np.where(filled == 0, 1.0, filled)


def _apart(zeros: _Brackets, tolerance: float) -> tuple[_Brackets, _Brackets]:
    """Part zeros from touches: pairs of zeros, of one signal, that cannot be told apart in time."""
    near = (zeros.signal[1:] == zeros.signal[:-1]) & (zeros.low[1:] - zeros.high[:-1] <= tolerance)
    alone = np.ones(zeros.low.size, dtype=bool)
    first = np.zeros(zeros.low.size, dtype=bool)
    for k in np.flatnonzero(near):
        if alone[k]:  # else it is the second of the pair before
            alone[k : k + 2], first[k] = False, True
    touches = zeros.part(first)._replace(high=zeros.high[np.flatnonzero(first) + 1])
    return zeros.part(alone), touches

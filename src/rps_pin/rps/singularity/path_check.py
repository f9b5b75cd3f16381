"""The path check: where and when a path of the 3-RPS meets a singularity or leaves a limit.

Everything that can go wrong is a *signal*: a function of the pose that is zero where it happens,
with its exact rate along the path (`rps_pin.rps.singularity.path_signals`).

Between two neighbouring samples of the path,

- a signal that changes its sign has a zero: bisection brackets it;
- a signal that falls towards zero at the first and rises from it at the second has a turning point:
  bisection of its rate brackets that. If the signal's sign is different there, it has two zeros,
  which are bracketed in turn; else the path has come near and turned away, and if it came nearer to
  a singularity than the threshold, it *grazes* it.

So two crossings are told apart however near in time they are, down to the tolerance. What the
check relies on: **between two samples, no signal turns more than once.** The samples are as dense
as asked for: neighbours are apart by at most ``duration / least_steps`` in time, and by `max_step`
in z / h and in the tilts, as far as the rates at both ends tell. Accelerations may jump.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.errors import InputError
from rps_pin.numerics.bisection import bisected
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.singularity.measures import GRAZE
from rps_pin.rps.singularity.path_events import LimitEvent, PathCheck, SingularityEvent
from rps_pin.rps.singularity.path_signals import SINGULARITIES, TYPE_I, PathSignals
from rps_pin.trajectories.path import Trajectory
from rps_pin.validation import positive_number, whole_number

#: A path whose distance to a singularity stays below this is in it: what rounding leaves of zero.
NOISE = 1e-13

#: A leg shorter than this part of h, where the sign of type II jumps, is passing through zero.
_VANISHING = 1e-6

_MOST_SAMPLES = 1_000_000


class _HasParameters(Protocol):
    @property
    def parameters(self) -> RPSParameters: ...


def check_path(
    robot: _HasParameters,
    trajectory: Trajectory,
    *,
    tolerance: float = 1e-9,
    threshold: float = GRAZE,
    least_steps: int = 1000,
    max_step: float = 0.01,
) -> PathCheck:
    """Return where and when a path meets a singularity, grazes one, or leaves a limit.

    Parameters
    ----------
    robot
        The 3-RPS, for its geometry and limits.
    trajectory
        The path; its rates must be the derivatives of its poses. Accelerations are not used.
    tolerance
        Widest bracket of an event, s. Two crossings less than this apart count as a graze.
    threshold
        A smallest distance below this is a graze. Distances are those of `SingularityMeasures`: of
        type II, the legs' speed over the platform's; 1e-3 means that the actuators feel a
        thousandth of what the platform does, and push a thousandfold.
    least_steps, max_step
        How dense the path is sampled: at least so many steps, each of at most so much of z / h and
        of the tilts (rad). See the module's text for what that guarantees.

    Raises
    ------
    InputError
        If a number is out of its range, the trajectory's samples are not finite poses and rates of
        the right shapes, or it is tilted by a whole turn.
    """
    threshold = positive_number(threshold, "threshold")
    path = PathSignals(robot.parameters, trajectory, positive_number(tolerance, "tolerance", "s"))
    steps = whole_number(least_steps, "least_steps")
    times = _sample_times(path, steps, positive_number(max_step, "max_step"))
    values, rates = path.signals(times)
    found = _Findings(path, times, values, rates, threshold)
    singularities = found.singularities()
    least, singularity, when = found.nearest(singularities)
    return PathCheck(
        singularities,
        found.limits(),
        least,
        singularity,
        when,
        path.duration,
        threshold,
        tolerance,
        times.size,
        float(np.diff(times).max()),
        path.sample(np.array([when]))[0][0],
    )


# Events -------------------------------------------------------------------------------------------


class _Brackets(NamedTuple):
    """Stretches of time (n,), each for one signal, and whether the signal is negative at `low`."""

    low: Array
    high: Array
    signal: Indices
    negative: Bools

    def part(self, chosen: Bools | Indices) -> _Brackets:
        """Return some of them."""
        return _Brackets(
            self.low[chosen], self.high[chosen], self.signal[chosen], self.negative[chosen]
        )

    def joined(self, more: _Brackets) -> _Brackets:
        """Return these and more of them."""
        return _Brackets(
            np.concatenate([self.low, more.low]),
            np.concatenate([self.high, more.high]),
            np.concatenate([self.signal, more.signal]),
            np.concatenate([self.negative, more.negative]),
        )


class _Findings:
    """The zeros and turning points of every signal, from samples of them."""

    def __init__(
        self, path: PathSignals, times: Array, values: Array, rates: Array, threshold: float
    ) -> None:
        self.path = path
        self.times = times
        self.values = values
        self.threshold = threshold
        singular = np.arange(values.shape[1]) < len(SINGULARITIES)
        self.noise = np.where(singular, NOISE, 0.0)
        self.zero = (np.abs(values) <= self.noise) & singular
        self.sign = _filled_signs(np.where(self.zero, 0.0, np.where(values < 0, -1.0, 1.0)))
        # Of each signal's size: negative where it falls towards zero.
        self.growth = self.sign * rates
        turning, split = self._turning_points()
        self.turning = turning
        self.zeros = self._zeros(split)

    def singularities(self) -> tuple[SingularityEvent, ...]:
        """Return every event of the first signals, in order of time."""
        zeros, touches = _apart(self._only(self.zeros, singular=True), self.path.tolerance)
        zeros = self._continuous(zeros)
        turning = self._only(self.turning, singular=True)
        events = [
            *self._events("crosses", zeros),
            *self._events("grazes", touches),
            *(e for e in self._events("grazes", turning) if abs(e.distance) < self.threshold),
            *self._ends(),
            *self._stays(),
        ]
        return tuple(sorted(events, key=lambda event: event.time))

    def limits(self) -> tuple[LimitEvent, ...]:
        """Return every event of the limits, in order of time."""
        zeros = self._only(self.zeros, singular=False)
        start = np.flatnonzero(self.values[0, len(SINGULARITIES) :] < 0) + len(SINGULARITIES)
        events = [self._limit_event("starts outside", 0.0, 0.0, int(signal)) for signal in start]
        for low, high, signal, negative in zip(*zeros, strict=True):
            kind = "returns" if negative else "leaves"
            events.append(self._limit_event(kind, (low + high) / 2, high - low, int(signal)))
        return tuple(sorted(events, key=lambda event: event.time))

    def nearest(self, events: tuple[SingularityEvent, ...]) -> tuple[float, str, float]:
        """Return the smallest distance to a singularity, which kind, and when."""
        sizes = np.abs(self.values[:, : len(SINGULARITIES)])
        sample, signal = np.unravel_index(int(np.argmin(sizes)), sizes.shape)
        best = (
            float(sizes[sample, signal]),
            SINGULARITIES[signal].name,
            float(self.times[sample]),
        )
        turning = self._only(self.turning, singular=True)
        near = self._events("grazes", turning)
        found = [(abs(e.distance), e.singularity, e.time) for e in (*near, *events)]
        return min([best, *found], key=lambda candidate: candidate[0])

    # Zeros and turning points ---------------------------------------------------------------------

    def _turning_points(self) -> tuple[_Brackets, _Brackets]:
        """Return where signals' sizes are smallest, and where signals jut beyond zero instead."""
        falls = (self.growth[:-1] < 0) & (self.growth[1:] >= 0)
        same = self.sign[:-1] == self.sign[1:]
        standing = self.zero[:-1] & self.zero[1:]
        step, signal = np.nonzero(falls & same & ~standing)
        sign = self.sign[step, signal]

        def falling(times: Array, which: Indices) -> Bools:
            rates = self.path.signals(times)[1]
            return np.asarray(sign[which] * rates[np.arange(which.size), signal[which]] < 0)

        low, high = bisected(falling, self.times[step], self.times[step + 1], self.path.tolerance)
        there = sign * self._at((low + high) / 2, signal)
        beyond = there < -self.noise[signal]
        middle = ((low + high) / 2)[beyond]
        negative = sign < 0
        begin, end = self.times[step[beyond]], self.times[step[beyond] + 1]
        before = _Brackets(begin, middle, signal[beyond], negative[beyond])
        after = _Brackets(middle, end, signal[beyond], ~negative[beyond])
        return _Brackets(low, high, signal, negative).part(~beyond), before.joined(after)

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

    def _continuous(self, zeros: _Brackets) -> _Brackets:
        """Leave out jumps: type II's sign flips where a leg passes through no length, type I."""
        if not zeros.low.size:
            return zeros
        index = np.arange(zeros.low.size)
        (at_low, low_rates), (at_high, high_rates) = map(self.path.signals, (zeros.low, zeros.high))
        jump = np.abs(at_high - at_low)[index, zeros.signal]
        fastest = np.maximum(np.abs(low_rates), np.abs(high_rates))[index, zeros.signal]
        smooth = jump <= 1e-6 + 10 * fastest * (zeros.high - zeros.low)
        shortest = np.minimum(at_low, at_high)[:, TYPE_I].min(axis=-1)
        return zeros.part(smooth | (shortest > _VANISHING))

    @staticmethod
    def _only(brackets: _Brackets, *, singular: bool) -> _Brackets:
        return brackets.part((brackets.signal < len(SINGULARITIES)) == singular)

    # What they mean -------------------------------------------------------------------------------

    def _events(self, kind: str, brackets: _Brackets) -> list[SingularityEvent]:
        low, high, signal, _ = brackets
        if not low.size:
            return []
        times = (low + high) / 2
        pose, _ = self.path.sample(times)
        distance = self._at(times, signal)
        return [
            _singularity_event(kind, *item)
            for item in zip(signal, times, high - low, pose, distance, strict=True)
        ]

    def _ends(self) -> list[SingularityEvent]:
        """Return grazes where the path begins or ends near a singularity that it does not enter."""
        events = []
        for end, moving_away in ((0, self.growth[0] >= 0), (-1, self.growth[-1] < 0)):
            near = np.abs(self.values[end]) < self.threshold
            standing = self.zero[end] & self.zero[1 if end == 0 else -2]
            chosen = near & (moving_away | self.zero[end]) & ~standing
            signal = np.flatnonzero(chosen[: len(SINGULARITIES)])
            time = np.full(signal.size, self.times[end])
            events += self._events("grazes", _Brackets(time, time, signal, signal < 0))
        return events

    def _stays(self) -> list[SingularityEvent]:
        """Return when the path stays in a singularity: at two neighbouring samples or more."""
        events = []
        for signal in range(len(SINGULARITIES)):
            edges = np.diff(np.concatenate([[0], self.zero[:, signal].astype(int), [0]]))
            first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
            for begin, end in zip(first, last, strict=True):
                if end > begin:
                    time, until = self.times[begin], self.times[end]
                    pose, _ = self.path.sample(np.array([time]))
                    distance = self.values[begin, signal]
                    events.append(
                        _singularity_event("stays", signal, time, until - time, pose[0], distance)
                    )
        return events

    def _limit_event(self, kind: str, time: float, width: float, signal: int) -> LimitEvent:
        about = self.path.limits[signal - len(SINGULARITIES)]
        pose, _ = self.path.sample(np.array([time]))
        return LimitEvent(
            kind,
            about.leg,
            about.name,
            float(time),
            float(width),
            pose[0],
            about.limit,
            about.side,
            about.unit,
        )


def _filled_signs(signs: Array) -> Array:
    """Give zeros the sign before them, or the first one after; columns are signals."""
    filled = signs.copy()
    for column in filled.T:
        known = np.flatnonzero(column)
        if known.size == 0:
            column[:] = 1.0
            continue
        last = np.searchsorted(known, np.arange(column.size), side="right") - 1
        column[:] = column[known[np.maximum(last, 0)]]
    return filled


def _apart(zeros: _Brackets, tolerance: float) -> tuple[_Brackets, _Brackets]:
    """Part zeros from touches: pairs of zeros, of one signal, that cannot be told apart in time."""
    near = (zeros.signal[1:] == zeros.signal[:-1]) & (zeros.low[1:] - zeros.high[:-1] <= tolerance)
    alone = np.ones(zeros.low.size, dtype=bool)
    first = []
    for k in np.flatnonzero(near):
        if alone[k]:  # else it is the second of the pair before
            alone[k : k + 2] = False
            first.append(k)
    touching = zeros.part(np.array(first, dtype=np.intp))
    last = zeros.part(np.array(first, dtype=np.intp) + 1)
    return zeros.part(alone), touching._replace(high=last.high)


def _singularity_event(
    kind: str, signal: Any, time: float, width: float, pose: Array, distance: float
) -> SingularityEvent:
    about = SINGULARITIES[int(signal)]
    return SingularityEvent(
        kind, about.name, float(time), float(width), pose, float(distance), about.leg
    )


def _sample_times(path: PathSignals, least_steps: int, max_step: float) -> Array:
    """Return times so dense that neighbours are no further apart than asked for."""
    if least_steps > _MOST_SAMPLES:
        raise InputError(f"least_steps = {least_steps}: at most {_MOST_SAMPLES:,} are accepted")
    scale = np.array([1 / path.parameters.platform_radius, 1.0, 1.0])
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
        times = _subdivided(times, parts.astype(np.intp))


def _subdivided(times: Array, parts: Indices) -> Array:
    """Return times with each step divided into equal parts."""
    first = np.cumsum(parts) - parts
    within = np.arange(parts.sum()) - np.repeat(first, parts)
    inner = np.repeat(times[:-1], parts) + np.repeat(np.diff(times) / parts, parts) * within
    return np.append(inner, times[-1])

"""Clock of a control loop: ticks at multiples of a period, and statistics of their timing.

Deadlines are absolute, t_k = t_0 + k T, so that lateness does not accumulate. (The library
`loop-rate-limiters` counts each period from the end of the last sleep, which took 5.46 s for 5000
ticks of 1 ms, and does not count late ticks.) A tick that ends after the next deadline is an
overrun: the deadlines that have passed are skipped and counted, without a burst of short ticks
afterwards. Tick k is always at time k T, whatever was skipped.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.table import Column, Table

from rps_pin.errors import InputError
from rps_pin.validation import non_negative_number, positive_number, whole_number

#: Resolution of the percentiles, s, for periods up to 10 ms; maxima are exact.
RESOLUTION = 1e-6
_RELATIVE_RESOLUTION = 1e-4
_BINS = 20_000


@dataclass(frozen=True)
class ClockReport:
    """Timing statistics of a loop; times in s, maxima exact.

    Percentiles are rounded up to 1 us or 1e-4 periods, whichever is larger; one above 20000 of
    these is reported as the maximum.

    Attributes
    ----------
    period
        As asked for.
    ticks
        Ticks that have begun.
    overruns
        Ticks that ended after the next deadline.
    longest_overrun
        Largest lateness of an end.
    skipped
        Deadlines skipped after overruns.
    interval_median, interval_p99, interval_p999, interval_max
        From the beginning of a tick to that of the next one: the period and its jitter.
    late_median, late_p99, late_p999, late_max
        From a deadline to the beginning of its tick.
    busy_median, busy_p99, busy_p999, busy_max
        From there to the end of the tick's body; not of one left by ``break`` or an exception.
    """

    period: float
    ticks: int
    overruns: int
    longest_overrun: float
    skipped: int
    interval_median: float
    interval_p99: float
    interval_p999: float
    interval_max: float
    late_median: float
    late_p99: float
    late_p999: float
    late_max: float
    busy_median: float
    busy_p99: float
    busy_p999: float
    busy_max: float

    @property
    def load(self) -> float:
        """The body's median time over the period."""
        return self.busy_median / self.period

    def as_dict(self) -> dict[str, Any]:
        """Return the statistics and the load as plain data."""
        return {**asdict(self), "load": self.load}

    def table(self) -> Table:
        """Return the statistics as a table for a terminal."""
        title = (
            f"{self.ticks} ticks of {1e3 * self.period:.6g} ms, load {100 * self.load:.3g} %: "
            f"{self.overruns} overruns, the longest by {1e6 * self.longest_overrun:.0f} us, "
            f"{self.skipped} deadlines skipped"
        )
        figures = (Column(name, justify="right") for name in ("median", "p99", "p99.9", "maximum"))
        table = Table("us", *figures, title=title)
        for name in ("interval", "late", "busy"):
            row = [getattr(self, f"{name}_{which}") for which in ("median", "p99", "p999", "max")]
            table.add_row(name, *(f"{1e6 * value:.0f}" for value in row))
        return table


class LoopClock:
    """Fixed rate of a loop: ``with LoopClock(1e-3) as clock: for k in clock.ticks(1000): ...``.

    In its ``with`` block the garbage collector is frozen and off by default, since a collection
    takes milliseconds. Its state is restored afterwards, also after an exception; objects that the
    program itself has frozen stay frozen.

    Parameters
    ----------
    period
        T, s; positive.
    spin
        Time before a deadline in which to wait without sleeping, s: less lateness, more load.
    pause_gc
        Whether to switch off the garbage collector.
    now, sleep
        Source of time, for tests.

    Raises
    ------
    InputError
        If a time is negative or not finite.
    """

    def __init__(
        self,
        period: float,
        *,
        spin: float = 0.0,
        pause_gc: bool = True,
        now: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.period = positive_number(period, "period", "s")
        self._spin, self._pause_gc = non_negative_number(spin, "spin", "s"), pause_gc
        self._now, self._sleep = now, sleep
        self._was_enabled = self._freezes = False
        resolution = max(RESOLUTION, _RELATIVE_RESOLUTION * self.period)
        self._interval, self._late, self._busy = (_Histogram(resolution) for _ in range(3))
        self._overruns = self._skipped = 0
        self._longest_overrun = 0.0

    def __enter__(self) -> LoopClock:
        self._was_enabled = self._pause_gc and gc.isenabled()
        # unfreeze() would also unfreeze the program's own frozen objects: then do not freeze.
        self._freezes = self._was_enabled and gc.get_freeze_count() == 0
        if self._was_enabled:
            gc.collect()
            gc.disable()
        if self._freezes:
            gc.freeze()
        return self

    def __exit__(self, *_: object) -> None:
        if self._freezes:
            gc.unfreeze()
        if self._was_enabled:
            gc.enable()

    def ticks(self, count: int | None = None, *, duration: float | None = None) -> Iterator[int]:
        """Yield 0, 1, 2, ... at their deadlines, the first at once; overruns skip some.

        Parameters
        ----------
        count
            Number of deadlines: the last tick is count - 1, or an earlier one if that is skipped.
            Default: endless.
        duration
            Instead of a count, s: all deadlines before it.

        Raises
        ------
        InputError
            If count or duration is out of range, or both are given.
        """
        if count is not None and duration is not None:
            raise InputError("count and duration: only one of them can be given")
        if duration is not None:
            # 1e-9: 0.3 s of 0.1 ms are 3000 deadlines in spite of rounding.
            count = math.ceil(positive_number(duration, "duration", "s") / self.period - 1e-9)
        return self._run(None if count is None else whole_number(count, "count", 0))

    def _run(self, count: int | None) -> Iterator[int]:
        now, period = self._now, self.period
        start, last, k = now(), 0.0, 0
        while count is None or k < count:
            begin = self._wait(start + k * period)
            self._late.add(begin - (start + k * period))
            if k > 0:
                self._interval.add(begin - last)
            last = begin
            yield k
            end = now()
            self._busy.add(end - begin)
            k += 1
            behind = end - (start + k * period)
            if behind > 0.0:
                passed = math.floor(behind / period) + 1
                self._overruns += 1
                self._longest_overrun = max(self._longest_overrun, behind)
                self._skipped += passed if count is None else min(passed, count - k)
                k += passed

    def report(self) -> ClockReport:
        """Return the statistics of the ticks so far."""
        run = (self._late.count, self._overruns, self._longest_overrun, self._skipped)
        times = (*self._interval.figures(), *self._late.figures(), *self._busy.figures())
        return ClockReport(self.period, *run, *times)

    def _wait(self, deadline: float) -> float:
        """Wait for a deadline and return the time."""
        time_left = deadline - self._now()
        if time_left > self._spin:
            self._sleep(time_left - self._spin)
        while (at := self._now()) < deadline:  # spin, also after a sleep that was too short
            pass
        return at


class _Histogram:
    """A histogram of times in memory that is allocated once."""

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self._bins = [0] * (_BINS + 1)
        self.count, self.largest = 0, 0.0

    def add(self, value: float) -> None:
        self._bins[min(int(value / self._resolution), _BINS)] += 1
        self.count += 1
        self.largest = max(self.largest, value)

    def figures(self) -> tuple[float, ...]:
        """Return median, percentiles 99 and 99.9, and the largest value."""
        reached = np.cumsum(self._bins[:_BINS])
        wanted = np.maximum(np.multiply((0.5, 0.99, 0.999), self.count), 1)
        index = np.searchsorted(reached, wanted)  # _BINS: in the last bin, which has no upper end
        ends = np.where(index < _BINS, (index + 1) * self._resolution, self.largest)
        return *np.minimum(ends, self.largest).tolist(), self.largest

"""A clock for control loops: ticks at multiples of a period, and what became of them.

Deadlines are absolute, t_k = t_0 + k T, so that no lateness adds up. (`loop-rate-limiters`, which
would be the library for this, counts each period from when the last sleep returned: 5000 ticks of
1 ms took 5.46 s here; and it keeps no count of what is late.) A tick whose body ends
after the next deadline is an overrun: the deadlines that have passed are skipped and counted, never
made up for by a burst of short ticks. Tick k is always at time k T, whatever was skipped.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from numbers import Integral
from typing import Any

from rich.table import Table

from rps_pin.errors import InputError
from rps_pin.rps.kinematics.leg_equations import checked_positive

#: Resolution of the percentiles, s, where the period is at most 10 ms; maxima are exact.
RESOLUTION = 1e-6
_PART = 1e-4
_BINS = 20_000


@dataclass(frozen=True)
class ClockReport:
    """What became of a loop's ticks; times in s, maxima exact.

    Percentiles are rounded up to 1 us or 1e-4 periods, whichever is more; one that is above 20000
    of these is told as the maximum.

    Attributes
    ----------
    period
        As asked for.
    ticks
        That were begun.
    overruns
        Whose body ended after the next deadline.
    longest_overrun
        By how much at most.
    skipped
        Deadlines that passed meanwhile, and were not run.
    interval_median, interval_p99, interval_p999, interval_max
        From the beginning of a tick to that of the next one: the period and its jitter.
    late_median, late_p99, late_p999, late_max
        From a deadline until its tick began.
    busy_median, busy_p99, busy_p999, busy_max
        From there until its body ended; one left by ``break`` or an exception has no end.
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
        """Share of the period that the body takes: its median time over the period."""
        return self.busy_median / self.period

    def as_dict(self) -> dict[str, Any]:
        """Return the figures, and the load, as plain data."""
        return {**asdict(self), "load": self.load}

    def table(self) -> Table:
        """Return the figures for a terminal."""
        title = (
            f"{self.ticks} ticks of {1e3 * self.period:.6g} ms, load {100 * self.load:.3g} %: "
            f"{self.overruns} overruns, the longest by {1e6 * self.longest_overrun:.0f} us, "
            f"{self.skipped} deadlines skipped"
        )
        table = Table("us", "median", "p99", "p99.9", "maximum", title=title)
        for column in table.columns[1:]:
            column.justify = "right"
        for name in ("interval", "late", "busy"):
            row = [getattr(self, f"{name}_{which}") for which in ("median", "p99", "p999", "max")]
            table.add_row(name, *(f"{1e6 * value:.0f}" for value in row))
        return table


class LoopClock:
    """Keeps a loop's rate: ``with LoopClock(1e-3) as clock: for k in clock.ticks(1000): ...``.

    While its ``with`` block lasts, the garbage collector is frozen and switched off, unless told
    otherwise: a collection takes milliseconds. It is as it was afterwards, whatever happened; what
    the program itself has frozen stays so.

    Parameters
    ----------
    period
        T, s; positive.
    spin
        For how long before a deadline to wait without sleeping, s: less lateness, more heat.
    pause_gc
        Whether to switch off the garbage collector.
    now, sleep
        Where time comes from, for tests.

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
        self.period = checked_positive(period, "period")
        if not 0.0 <= spin < math.inf:
            raise InputError(f"spin = {spin}: it must be a time, zero or more")
        self._spin, self._pause_gc = spin, pause_gc
        self._now, self._sleep = now, sleep
        self._collecting = self._freezing = False
        resolution = max(RESOLUTION, _PART * self.period)
        self._interval, self._late, self._busy = (_Times(resolution) for _ in range(3))
        self._overruns = self._skipped = 0
        self._longest_overrun = 0.0

    def __enter__(self) -> LoopClock:
        self._collecting = self._pause_gc and gc.isenabled()
        # unfreeze() would also thaw what the program has frozen: then it is left alone.
        self._freezing = self._collecting and gc.get_freeze_count() == 0
        if self._collecting:
            gc.collect()
            gc.disable()
        if self._freezing:
            gc.freeze()
        return self

    def __exit__(self, *_: object) -> None:
        if self._freezing:
            gc.unfreeze()
        if self._collecting:
            gc.enable()

    def ticks(self, count: int | None = None, *, duration: float | None = None) -> Iterator[int]:
        """Yield 0, 1, 2, ... at their times, the first at once; some are skipped by overruns.

        Parameters
        ----------
        count
            How many deadlines there are: the last tick is number count - 1 or, if that was skipped,
            one before. For ever if left out.
        duration
            Instead of a count, s: every deadline before it.

        Raises
        ------
        InputError
            If count or duration is not one, or both are given.
        """
        if count is not None and duration is not None:
            raise InputError("count and duration: only one of them can be given")
        if duration is not None:
            # 1e-9: 0.3 s of 0.1 ms are 3000 deadlines, though the quotient is rounded.
            count = math.ceil(checked_positive(duration, "duration") / self.period - 1e-9)
        if count is not None and (not isinstance(count, Integral) or count < 0):
            raise InputError(f"count = {count!r}: it must be a whole number, zero or more")
        return self._run(None if count is None else int(count))

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
        """Return what became of the ticks so far."""
        run = (self._late.count, self._overruns, self._longest_overrun, self._skipped)
        times = (*self._interval.figures(), *self._late.figures(), *self._busy.figures())
        return ClockReport(self.period, *run, *times)

    def _wait(self, deadline: float) -> float:
        """Return the time once a deadline has come."""
        time_left = deadline - self._now()
        if time_left > self._spin:
            self._sleep(time_left - self._spin)
        while (at := self._now()) < deadline:  # spin, and what a sleep was short of
            pass
        return at


class _Times:
    """A histogram of times: memory is allocated once, however many there are."""

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self._bins = [0] * (_BINS + 1)
        self.count, self.most = 0, 0.0

    def add(self, value: float) -> None:
        self._bins[min(int(value / self._resolution), _BINS)] += 1
        self.count += 1
        self.most = max(self.most, value)

    def figures(self) -> tuple[float, float, float, float]:
        """Return median, p99, p99.9 and maximum, s."""
        return self._percentile(0.5), self._percentile(0.99), self._percentile(0.999), self.most

    def _percentile(self, share: float) -> float:
        """Return a time that so many are not above, to the resolution, s."""
        wanted, found = share * self.count, 0
        for place, count in enumerate(self._bins[:_BINS]):
            found += count
            if found >= wanted and found:
                return min((place + 1) * self._resolution, self.most)
        return self.most  # beyond the last bin: the only time that is known not to be exceeded

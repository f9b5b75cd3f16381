"""The clock with a time of its own: which ticks run and when, what is counted, what is left."""

import gc
import io
import math
from collections.abc import Callable

import numpy as np
import pytest
from rich.console import Console

from rps_pin.control.loop.clock import RESOLUTION, LoopClock
from rps_pin.errors import InputError

T = 0.25  # exact in binary, and so are its multiples: deadlines can be compared with ==


class FakeTime:
    """Time passes only in a sleep, in the body, and by `look` a look at it."""

    def __init__(self, start: float = 0.0, look: float = 0.0, late: float = 0.0) -> None:
        self.at, self.look, self.late = start, look, late
        self.looks: list[float] = []
        self.sleeps: list[float] = []

    def now(self) -> float:
        self.at += self.look
        self.looks.append(self.at)
        return self.at

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.sleeps.append(seconds)
        self.at += seconds + self.late

    def clock(self, period: float = T, **options) -> LoopClock:
        return LoopClock(period, now=self.now, sleep=self.sleep, **options)


def run(
    time: FakeTime, clock: LoopClock, body: Callable[[int], float], count: int
) -> list[tuple[int, float]]:
    """Run ticks whose body takes `body(k)` seconds; return (k, its beginning)."""
    done = []
    for k in clock.ticks(count):
        done.append((k, time.at))
        time.at += body(k)
    return done


def simulated(busy: dict[int, float], count: int, period: float) -> tuple[list[int], int, int]:
    """Walk the deadlines by the stated policy: those that pass while a body runs are skipped."""
    ran, overruns, skipped, end = [], 0, 0, -math.inf
    for k in range(count):
        if k * period < end:
            skipped += 1
            continue
        ran.append(k)
        end = k * period + busy.get(k, 0.0)
        overruns += end > (k + 1) * period
    return ran, overruns, skipped


def test_every_tick_begins_at_its_deadline():
    time = FakeTime(start=100.0)
    with time.clock() as clock:
        done = run(time, clock, lambda k: 0.125, 8)
    assert done == [(k, 100.0 + k * T) for k in range(8)]
    report = clock.report()
    assert (report.ticks, report.overruns, report.skipped, report.longest_overrun) == (8, 0, 0, 0.0)
    assert (report.late_max, report.busy_max, report.interval_max) == (0.0, 0.125, T)
    assert report.load == 0.5


def test_a_sleep_that_is_always_late_does_not_add_up():
    time = FakeTime(late=0.01)
    with time.clock() as clock:
        done = run(time, clock, lambda k: 0.125, 1000)
    late = [at - k * T for k, at in done]
    assert [k for k, _ in done] == list(range(1000))
    np.testing.assert_allclose(late[1:], 0.01, atol=1e-9)
    assert clock.report().late_max == pytest.approx(0.01)


@pytest.mark.parametrize("seed", range(30))
def test_deadlines_that_have_passed_are_skipped_and_never_made_up_for(seed):
    random = np.random.default_rng(seed)
    # Sixteenths of a period, a fifth of the bodies too long; one may end just on a deadline's heels
    # but not on it: whether that is late is a matter of taste.
    busy = {}
    for k in range(200):
        periods = random.uniform(1.0, 6.0) if random.random() < 0.2 else random.uniform(0.0, 0.9)
        busy[k] = T * (math.floor(16 * periods) + 0.5) / 16
    time = FakeTime()
    with time.clock() as clock:
        done = run(time, clock, busy.__getitem__, 200)
    ran, overruns, skipped = simulated(busy, 200, T)
    assert done == [(k, k * T) for k in ran]
    report = clock.report()
    assert (report.ticks, report.overruns, report.skipped) == (len(ran), overruns, skipped)
    assert report.ticks + report.skipped == 200
    assert report.longest_overrun == max(0.0, *(busy[k] - T for k in ran))
    assert report.busy_max == max(busy[k] for k in ran)
    assert report.interval_max == max(np.diff(ran)) * T


def test_a_body_that_ends_on_the_deadline_is_no_overrun():
    time = FakeTime()
    with time.clock() as clock:
        done = run(time, clock, lambda k: T, 5)
    assert [k for k, _ in done] == list(range(5))
    assert clock.report().overruns == 0


def test_a_sleep_that_is_too_short_is_made_up_for_by_looking():
    time = FakeTime(look=0.001, late=-0.02)
    with time.clock() as clock:
        done = run(time, clock, lambda k: 0.125, 20)
    start = time.looks[0]
    assert all(0.0 <= at - (start + k * T) <= 0.001 + 1e-12 for k, at in done[1:])
    assert clock.report().late_max <= 0.002 + 1e-12  # tick 0: two looks after the start


def test_spin_sleeps_less_and_looks_at_the_time_instead():
    time = FakeTime(look=0.001, late=0.02)
    with time.clock(spin=0.05) as clock:
        done = run(time, clock, lambda k: 0.125, 20)
    # Each sleep ends 0.03 s early, late as it is, and the rest is looked away.
    assert len(time.sleeps) == 19
    start = time.looks[0]
    assert all(0.0 <= at - (start + k * T) <= 0.001 + 1e-12 for k, at in done[1:])


@pytest.mark.parametrize("period", [1e-4, 1e-3, 1e-2, 0.1, 1.0])
def test_percentiles_are_those_of_numpy_to_the_resolution(period):
    random = np.random.default_rng(7)
    busy = period * random.gamma(2.0, 0.05, 5000).clip(0.0, 0.95)
    time = FakeTime()
    with time.clock(period) as clock:
        run(time, clock, lambda k: float(busy[k]), 5000)
    report = clock.report()
    assert report.ticks == 5000
    resolution = max(RESOLUTION, 1e-4 * period)
    rounding = 1e-9 * period  # of times that are differences
    for share, told in ((0.5, "median"), (0.99, "p99"), (0.999, "p999")):
        exact = np.quantile(busy, share, method="inverted_cdf")
        above = getattr(report, f"busy_{told}") - exact
        assert -rounding <= above <= resolution + rounding
    assert report.busy_max == pytest.approx(busy.max(), abs=rounding)


def test_what_is_beyond_the_histogram_is_told_as_the_maximum():
    time = FakeTime()
    with time.clock(1e-3) as clock:
        run(time, clock, lambda k: 3.0 + k, 10_000)
    report = clock.report()
    assert report.busy_median == report.busy_p999 == report.busy_max >= 3.0


def test_statistics_do_not_grow():
    time = FakeTime()
    random = np.random.default_rng(3)
    with time.clock(1e-3) as clock:
        run(time, clock, lambda k: float(random.uniform(0, 1e-3)), 2000)
        sizes = [len(times._bins) for times in (clock._interval, clock._late, clock._busy)]
        run(time, clock, lambda k: float(random.uniform(0, 5e-2)), 20_000)
    assert sizes == [len(times._bins) for times in (clock._interval, clock._late, clock._busy)]
    assert clock.report().ticks + clock.report().skipped == 22_000


def test_a_tick_that_is_broken_off_counts_but_has_no_end():
    time = FakeTime()
    with time.clock() as clock:
        for k in clock.ticks():
            time.at += 0.125
            if k == 4:
                break
    report = clock.report()
    assert report.ticks == 5
    assert sum(clock._busy._bins) == 4


@pytest.mark.parametrize(
    ("period", "duration", "count"),
    [(1e-3, 5.0, 5000), (1e-4, 0.3, 3000), (0.25, 1.0, 4), (0.25, 1.1, 5), (0.25, 1e-3, 1)],
)
def test_a_duration_is_every_deadline_before_it(period, duration, count):
    time = FakeTime()
    with time.clock(period) as clock:
        assert list(clock.ticks(duration=duration)) == list(range(count))


def test_two_runs_add_up_and_the_pause_between_them_is_no_interval():
    time = FakeTime()
    with time.clock() as clock:
        run(time, clock, lambda k: 0.125, 4)
        time.at += 100.0
        run(time, clock, lambda k: 0.125, 4)
    report = clock.report()
    assert (report.ticks, report.overruns, report.interval_max) == (8, 0, T)


def test_a_clock_that_has_not_run_has_a_report():
    report = LoopClock(T).report()
    assert (report.ticks, report.overruns, report.busy_p999, report.load) == (0, 0, 0.0, 0.0)


def test_the_report_as_data_and_as_a_table():
    time = FakeTime()
    with time.clock() as clock:
        run(time, clock, lambda k: 0.3 if k == 3 else 0.125, 8)
    report = clock.report()
    told = report.as_dict()
    assert told["ticks"] == 7
    assert told["load"] == report.load
    assert all(isinstance(value, int | float) for value in told.values())
    console = Console(width=120, file=io.StringIO())
    console.print(report.table())
    text = " ".join(console.file.getvalue().split())  # the title is broken into lines
    assert "7 ticks of 250 ms, load 50 %" in text
    assert "1 overruns, the longest by 50000 us, 1 deadlines skipped" in text


@pytest.mark.parametrize("period", [0.0, -1e-3, math.nan, math.inf, "fast", None])
def test_an_impossible_period_is_refused(period):
    with pytest.raises(InputError, match="period"):
        LoopClock(period)


@pytest.mark.parametrize("spin", [-1e-6, math.nan, math.inf])
def test_an_impossible_spin_is_refused(spin):
    with pytest.raises(InputError, match="spin"):
        LoopClock(T, spin=spin)


@pytest.mark.parametrize("count", [-1, 2.5, "ten", math.nan])
def test_an_impossible_count_is_refused_before_the_first_tick(count):
    with pytest.raises(InputError, match="count"):
        LoopClock(T).ticks(count)


@pytest.mark.parametrize("duration", [0.0, -1.0, math.inf, math.nan])
def test_an_impossible_duration_is_refused(duration):
    with pytest.raises(InputError, match="duration"):
        LoopClock(T).ticks(duration=duration)


def test_a_count_and_a_duration_are_too_much():
    with pytest.raises(InputError, match="only one"):
        LoopClock(T).ticks(5, duration=1.0)


# The garbage collector ----------------------------------------------------------------------------


@pytest.fixture
def collector():
    """Leave the collector as pytest had it."""
    enabled, frozen = gc.isenabled(), gc.get_freeze_count()
    assert (enabled, frozen) == (True, 0)
    yield
    gc.enable()
    gc.unfreeze()


@pytest.mark.usefixtures("collector")
@pytest.mark.parametrize("error", [None, RuntimeError, KeyboardInterrupt, SystemExit])
def test_the_collector_rests_during_the_block_and_is_as_before_afterwards(error):
    def block() -> None:
        with LoopClock(T):
            assert not gc.isenabled()
            assert gc.get_freeze_count() > 0
            if error is not None:
                raise error

    if error is None:
        block()
    else:
        with pytest.raises(error):
            block()
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


@pytest.mark.usefixtures("collector")
def test_a_collector_that_was_off_stays_off_and_one_within_another_leaves_it_off():
    gc.disable()
    with LoopClock(T):
        assert gc.get_freeze_count() == 0
    assert not gc.isenabled()
    gc.enable()
    with LoopClock(T):
        with LoopClock(T):
            pass
        assert not gc.isenabled()
    assert gc.isenabled()


@pytest.mark.usefixtures("collector")
def test_what_the_program_has_frozen_stays_frozen():
    gc.freeze()
    frozen = gc.get_freeze_count()
    with LoopClock(T):
        assert not gc.isenabled()
    # Not those that another thread of pytest-xdist has freed meanwhile.
    assert gc.get_freeze_count() > 0.9 * frozen > 0


@pytest.mark.usefixtures("collector")
def test_the_collector_can_be_left_alone():
    with LoopClock(T, pause_gc=False):
        assert gc.isenabled()
        assert gc.get_freeze_count() == 0


# With the machine's own time ----------------------------------------------------------------------


def test_real_ticks_come_in_order_never_early_and_add_up():
    import time

    begins = {}
    with LoopClock(2e-3, spin=1e-4) as clock:
        before = time.perf_counter()
        for k in clock.ticks(60):
            begins[k] = time.perf_counter()
            if k in (20, 40):
                time.sleep(7e-3)  # at least three deadlines pass
    ran = list(begins)
    assert ran == sorted(ran)
    assert ran[0] == 0
    # The clock's own start is not before this one.
    assert all(at - before >= k * 2e-3 for k, at in begins.items())
    report = clock.report()
    assert report.ticks == len(ran)
    assert report.ticks + report.skipped == 60
    assert report.overruns >= len({20, 40} & set(ran))
    assert report.skipped >= 3 * len({20, 40} & set(ran))

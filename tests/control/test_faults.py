"""Faults: each kind against what it says, any number at once against ticks counted in integers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rps_pin.control.simulation.faults import Fault, Faults
from rps_pin.errors import InputError
from tests.strategies import floats

Array = NDArray[np.float64]

PERIOD, TICKS = 1e-3, 30
READINGS = np.random.default_rng(1).uniform(0.2, 0.25, size=(TICKS, 3))
TARGETS = np.random.default_rng(2).normal(size=(TICKS, 3, 3))

sizes = st.one_of(floats(1e-6, 1.0), floats(-1.0, -1e-6))


@st.composite
def windows(draw: st.DrawFn) -> tuple[int, int]:
    """First tick, and the tick after the last; some last for ever."""
    first = draw(st.integers(0, TICKS - 1))
    return first, first + draw(st.one_of(st.integers(1, TICKS), st.just(10 * TICKS)))


def between_ticks(window: tuple[int, int]) -> dict[str, float]:
    """Its times, half a period before the ticks, so that no rounding matters."""
    first, after = window
    start = max(first - 0.5, 0.0) * PERIOD
    if after >= 10 * TICKS:
        return {"start": start}
    return {"start": start, "duration": (after - 0.5) * PERIOD - start}


@st.composite
def reading_faults(draw: st.DrawFn) -> tuple[Fault, tuple[int, int]]:
    window = draw(windows())
    kind = draw(st.sampled_from(["nan", "jump", "stuck"]))
    size = {"size": draw(sizes)} if kind == "jump" else {}
    leg = draw(st.sampled_from([None, 1, 2, 3]))
    return Fault(kind, leg=leg, **size, **between_ticks(window)), window  # type: ignore[arg-type]


def arrived(faults: Faults) -> list[Array | None]:
    return [faults.reading(k * PERIOD, READINGS[k]) for k in range(TICKS)]


def assert_readings(found: list[Array | None], expected: list[Array | None]) -> None:
    assert [row is None for row in found] == [row is None for row in expected]
    for one, other in zip(found, expected, strict=True):
        if one is not None and other is not None:
            np.testing.assert_array_equal(one, other)


# Readings -----------------------------------------------------------------------------------------


@given(st.lists(reading_faults(), max_size=4), st.lists(windows(), max_size=2))
def test_any_number_at_once(
    faults: list[tuple[Fault, tuple[int, int]]], lost: list[tuple[int, int]]
) -> None:
    """In the order they are given in, leg by leg; a lost reading is lost whatever else it is."""
    expected: list[Array | None] = []
    for k in range(TICKS):
        row: Array | None = READINGS[k].copy()
        for fault, (first, after) in faults:
            for leg in range(3):
                if row is None or not first <= k < after or fault.leg not in (None, leg + 1):
                    continue
                if fault.kind == "nan":
                    row[leg] = math.nan
                elif fault.kind == "jump":
                    row[leg] += fault.size
                else:
                    row[leg] = READINGS[max(first - 1, 0), leg]
        if any(first <= k < after for first, after in lost):
            row = None
        expected.append(row)
    given_ = [fault for fault, _ in faults]
    given_ += [Fault("lost", **between_ticks(window)) for window in lost]
    assert_readings(arrived(Faults(given_)), expected)


@given(reading_faults())
def test_true_readings_are_not_touched_and_runs_do_not_share_memory(
    pair: tuple[Fault, tuple[int, int]],
) -> None:
    fault, _ = pair
    before = READINGS.copy()
    first, second = Faults([fault]), Faults(iter([fault]))
    assert_readings(arrived(first), arrived(second))
    np.testing.assert_array_equal(READINGS, before)
    reading = Faults([fault]).reading(1.0, READINGS[0])
    assert reading is not None
    assert not np.shares_memory(reading, READINGS)
    reading[:] = 0.0
    np.testing.assert_array_equal(READINGS, before)


def test_without_faults_all_arrives() -> None:
    assert_readings(arrived(Faults()), list(READINGS))
    true = tuple(TARGETS[0])
    for found, row in zip(Faults().target(0.0, true), true, strict=True):
        np.testing.assert_array_equal(found, row)


def test_half_a_period_hits_one_tick() -> None:
    for k in range(3000):
        fault = Fault("lost", start=float(f"{k * PERIOD:.3f}"), duration=PERIOD / 2)
        assert [fault.on((k + j) * PERIOD) for j in (-2, -1, 0, 1, 2)] == [0, 0, 1, 0, 0]


@pytest.mark.parametrize("period", [1e-3, 7e-4, 1 / 3000])
def test_times_written_in_decimals_hit_the_ticks_they_mean(period: float) -> None:
    """As read from a file: k T, rounded to twelve digits; lasts whole periods."""
    for k in range(300):
        for length in (1, 2, 5):
            written = {
                "start": float(f"{k * period:.12g}"),
                "duration": float(f"{length * period:.12g}"),
            }
            fault = Fault("lost", **written)
            ticks = [j for j in range(max(k - 2, 0), k + 9) if fault.on(j * period)]
            assert ticks == list(range(k, k + length)), written


def test_an_encoder_sticks_where_it_is_whether_or_not_readings_arrive() -> None:
    lost, stuck = Fault("lost", 0.0045, 0.004), Fault("stuck", 0.0065)
    expected: list[Array | None] = [*READINGS[:5], *[None] * 4, *[READINGS[6]] * (TICKS - 9)]
    assert_readings(arrived(Faults([stuck, lost])), expected)
    assert_readings(arrived(Faults([lost, stuck])), expected)


def test_a_leg_s_reading_that_is_lost_leaves_the_others() -> None:
    """Or it is refused: said to be lost are all of them in neither case."""
    try:
        fault = Fault("lost", 0.0, leg=2)
    except InputError:
        return
    reading = Faults([fault]).reading(0.0, READINGS[0])
    assert reading is not None
    np.testing.assert_array_equal(np.isnan(reading), [False, True, False])


# Targets ------------------------------------------------------------------------------------------


@given(
    st.lists(st.tuples(windows(), st.tuples(sizes, sizes, sizes)), max_size=3),
    st.lists(windows(), max_size=2),
)
def test_targets_are_off_by_the_sum_of_offsets_or_no_numbers(
    offsets: list[tuple[tuple[int, int], tuple[float, float, float]]],
    none: list[tuple[int, int]],
) -> None:
    faults = [Fault("target", offset=offset, **between_ticks(w)) for w, offset in offsets]
    faults += [Fault("target_nan", **between_ticks(w)) for w in none]
    np.random.default_rng(3).shuffle(faults)
    spoilt = Faults(faults)
    before = TARGETS.copy()
    for k in range(TICKS):
        true = tuple(TARGETS[k])
        pose, rate, acceleration = spoilt.target(k * PERIOD, true)
        off = [offset for (first, after), offset in offsets if first <= k < after]
        expected = true[0] + np.sum([np.zeros(3), *off], axis=0)
        if any(first <= k < after for first, after in none):
            expected = np.full(3, math.nan)
        np.testing.assert_allclose(pose, expected, rtol=0, atol=1e-14, equal_nan=True)
        np.testing.assert_array_equal(rate, true[1])
        np.testing.assert_array_equal(acceleration, true[2])
        reading = spoilt.reading(k * PERIOD, READINGS[k])
        assert reading is not None
        np.testing.assert_array_equal(reading, READINGS[k])
    np.testing.assert_array_equal(TARGETS, before)


@given(reading_faults())
def test_faults_of_readings_leave_targets_alone(pair: tuple[Fault, tuple[int, int]]) -> None:
    spoilt = Faults([pair[0]])
    for k in range(TICKS):
        found = spoilt.target(k * PERIOD, tuple(TARGETS[k]))
        np.testing.assert_array_equal(found, TARGETS[k])


# What there is not, and what it is called ---------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"kind": "late"}, "fault kind = 'late': it must be 'lost' or 'nan' or 'jump' or 'stuck'"),
        ({"start": -1e-3}, "fault start = -0.001: it must be a number of s, zero or more"),
        ({"start": math.nan}, "fault start = nan"),
        ({"start": math.inf}, "fault start = inf"),
        ({"duration": 0.0}, "fault duration = 0.0: it must be a positive number"),
        ({"duration": -1.0}, "fault duration = -1.0"),
        ({"duration": math.nan}, "fault duration = nan"),
        ({"leg": 0}, "fault leg = 0: it must be a whole number"),
        ({"leg": "one"}, "fault leg = 'one'"),
        ({"kind": "jump"}, "fault size = 0.0: a size, in m, is for a jump only"),
        ({"kind": "jump", "size": math.nan}, "fault size = nan"),
        ({"kind": "jump", "size": math.inf}, "fault size = inf"),
        ({"size": 1e-3}, "fault size = 0.001: a size, in m, is for a jump only"),
        ({"kind": "target"}, "an offset is for a fault of the target only"),
        ({"offset": (1e-3, 0.0, 0.0)}, "an offset is for a fault of the target only"),
        ({"kind": "target_nan", "offset": (0.0, 0.1, 0.0)}, "of the target only"),
        ({"kind": "target", "offset": ((1e-3, 0.0),)}, r"fault offset has shape \(1, 2\)"),
        (
            {"kind": "target", "offset": (0.0, math.nan, 0.0)},
            "offset is not finite: entry 1 is nan",
        ),
    ],
)
def test_what_is_no_fault_is_refused(changes: dict[str, Any], said: str) -> None:
    arguments: dict[str, Any] = {"kind": "nan", "start": 0.0} | changes
    with pytest.raises(InputError, match=said):
        Fault(**arguments)


@pytest.mark.parametrize(
    "changes", [{"start": "soon"}, {"offset": 0.1}, {"offset": [0, 0, "a"]}, {"leg": 2.0}, {}]
)
def test_a_fault_that_can_be_made_can_be_used(changes: dict[str, Any]) -> None:
    """A list as offset, as from a file, and a leg that is a float: used, or refused at once."""
    arguments: dict[str, Any] = {"kind": "stuck", "start": 0.0, "offset": [0.0, 0.0, 0.0]}
    try:
        fault = Fault(**(arguments | changes))
    except InputError:
        return
    assert np.shape(Faults([fault]).reading(0.0, READINGS[0])) == (3,)


def test_words() -> None:
    assert str(Fault("lost", 0.25)) == "lost from t = 0.25 s"
    assert str(Fault("nan", 0.5, 0.001, leg=2)) == "nan of leg 2 from t = 0.5 s for 0.001 s"
    jump = Fault("jump", 1.0, 0.5, leg=3, size=-2e-3)
    assert str(jump) == "jump of leg 3 by -0.002 m from t = 1 s for 0.5 s"
    assert "by (0.1, 0.0, 0.2) m, rad, rad" in str(Fault("target", 0.0, offset=(0.1, 0.0, 0.2)))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"leg": 4}, "fault leg = 4: legs are 1, 2 and 3"),
        ({"kind": "target", "offset": (1e-3, 0.0)}, "the pose has 3 coordinates"),
    ],
)
def test_what_does_not_fit_the_robot_is_refused(changes: dict[str, Any], said: str) -> None:
    """Of another robot it may: a fault has no robot of its own."""
    fault = Fault(**({"kind": "nan", "start": 0.0} | changes))
    with pytest.raises(InputError, match=said):
        fault.check(3, 3)
    fault.check(6, len(fault.offset))

"""Margins against the poles of an axis that is run tick by tick at the edge of each margin."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from rps_pin.control.margins import LoopMargins, loop_margins
from rps_pin.errors import InputError
from tests.control.axis_ticks import Axis, random_axis


def margins_of(axis: Axis) -> LoopMargins:
    return loop_margins(axis.proportional, axis.derivative, axis.integral, **axis.options)


def stable_axes(seed: int, count: int) -> Iterator[tuple[Axis, LoopMargins]]:
    rng = np.random.default_rng(seed)
    while count:
        axis = random_axis(rng)
        if axis.radius() < 1 - 1e-9:
            count -= 1
            yield axis, margins_of(axis)


def test_stable_where_every_pole_is_inside_the_unit_circle() -> None:
    rng = np.random.default_rng(0)
    stable = 0
    for _ in range(1000):
        axis = random_axis(rng)
        radius, margins = axis.radius(), margins_of(axis)
        if abs(radius - 1) < 1e-9:
            continue
        assert margins.stable == (radius < 1), axis
        assert np.isfinite(margins[2:]).all()
        stable += margins.stable
    assert 200 < stable < 800


def test_stability_holds_up_to_the_gain_factors_and_not_beyond() -> None:
    upper = lower = 0
    for axis, margins in stable_axes(1, 300):
        up, down = margins.gain_up, margins.gain_down
        assert up > 1 > down >= 0
        # Nothing between them is unstable: the poles cross at the factors and nowhere else.
        lowest, highest = (down or 0.03) * 1.001, min(up, 1e3) * 0.999
        for factor in np.geomspace(lowest, highest, 12):
            assert axis._replace(inertia=axis.inertia * factor).radius() < 1, (axis, factor)
        if math.isfinite(up):
            upper += 1
            assert axis._replace(inertia=axis.inertia * up * 1.001).radius() > 1, axis
        if down:
            lower += 1
            assert axis._replace(inertia=axis.inertia * down * 0.999).radius() > 1, axis
    assert upper > 250
    assert lower > 80


def test_without_integral_the_gain_may_fall_to_nothing_if_damping_outweighs_the_lag() -> None:
    """As the gain k goes to 0 the poles are 1 +- j sqrt(k Kp) T - k T (Kd - (d + 1/2) T Kp) / 2."""
    rng, found = np.random.default_rng(2), []
    for axis, _ in stable_axes(2, 100):
        lag = (axis.delay + 0.5) * axis.period
        damped = axis._replace(integral=0.0, derivative=axis.derivative * rng.choice([0.2, 1.0]))
        margins = margins_of(damped)
        if margins.stable:
            found.append(margins.gain_down == 0)
            assert found[-1] == (damped.derivative > lag * damped.proportional), damped
    assert len(found) > 50


def test_a_pole_is_on_the_unit_circle_at_each_gain_factor() -> None:
    for axis, margins in stable_axes(3, 100):
        for factor in (margins.gain_up, margins.gain_down):
            if factor and math.isfinite(factor):
                at = axis._replace(inertia=axis.inertia * factor).closed()
                poles = np.abs(np.linalg.eigvals(axis.scaled(at)))
                assert np.abs(poles - 1).min() < 1e-6


@pytest.mark.parametrize("seed", range(6))
def test_axis_released_in_time_settles_or_runs_away_as_its_poles_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis = random_axis(rng)
    while abs(axis.radius() - 1) < 1e-2 or (axis.radius() < 1) != bool(seed % 2):
        axis = random_axis(rng)
    state = axis.start(0.01)
    for _ in range(1500):
        state, _ = axis.tick(state)
        if abs(state[0]) > 1e6:
            break
    assert margins_of(axis).stable == (abs(state[0]) < 1e-3 * 0.01)


def test_whole_ticks_of_further_delay_up_to_the_delay_margin() -> None:
    beyond = 0
    for axis, margins in stable_axes(4, 300):
        ticks = margins.delay / axis.period
        if abs(ticks - round(ticks)) < 1e-3 or ticks > 60:
            continue
        for more in {1, math.floor(ticks) // 2, math.floor(ticks)}:
            if more <= ticks:
                assert axis._replace(delay=axis.delay + more).radius() < 1, axis
        t = np.linspace(1e-3, math.pi, 3000)
        gain = np.abs(axis.opened(np.exp(1j * t)))
        if np.count_nonzero(np.diff(gain > 1)) == 1:
            # One crossing: every pole that it moves out stays out.
            beyond += 1
            for more in (math.ceil(ticks), math.ceil(ticks) + 1):
                assert axis._replace(delay=axis.delay + more).radius() > 1, axis
    assert beyond > 100


def test_phase_modulus_and_crossover_on_the_curve_of_the_axis() -> None:
    """On a grid of the curve that the axis itself gives, as fine as the tolerance asks."""
    for axis, margins in stable_axes(5, 30):
        corner = 2 * math.pi * axis.period * margins.crossover
        t = np.union1d(corner * np.geomspace(1e-2, 30, 4000), np.linspace(0.01, math.pi, 500))
        t = np.append(t[t < math.pi], math.pi)
        curve = axis.opened(np.exp(1j * t))
        assert margins.modulus == pytest.approx(np.abs(1 + curve).min(), rel=2e-4)
        assert margins.modulus <= np.abs(1 + curve).min() * (1 + 1e-9)
        above = np.abs(curve) > 1
        last = np.flatnonzero(above)[-1]
        if last + 1 < t.size:
            assert t[last] <= corner * (1 + 1e-9) and corner <= t[last + 1] * (1 + 1e-9)
        ends = np.flatnonzero(np.diff(above))
        turn = np.abs(np.angle(-curve[ends])).min(initial=np.inf)
        assert margins.phase == pytest.approx(turn, abs=0.02)
        inside = np.abs(curve / (1 + curve)) >= math.sqrt(0.5)
        first = np.flatnonzero(~inside)[0] if not inside.all() else t.size - 1
        assert margins.bandwidth * 2 * math.pi * axis.period == pytest.approx(t[first], rel=0.01)


@pytest.mark.parametrize("factor", [0.86, 0.87, 0.885])
def test_loop_that_crosses_unit_gain_three_times(factor: float) -> None:
    """Kp, Kd, Ki = k (0.12, 1, 0.1) w^(2, 1, 3): a dip of abs(L) below 1, and stable all the same.

    Routh asks k > 0.1 / 0.12; the dip is below 1 for k < 0.9.
    """
    w = 50.0
    gains = 0.12 * factor * w**2, factor * w, 0.1 * factor * w**3
    axis = Axis(*gains, period=1e-4, delay=0, cut_off=None)
    margins = margins_of(axis)
    assert margins.stable
    assert axis.radius() < 1
    t = axis.period * w * np.geomspace(0.05, 5, 20_001)
    curve = axis.opened(np.exp(1j * t))
    at = np.flatnonzero(np.diff(np.abs(curve) > 1))
    assert at.size == 3
    ahead = np.angle(-curve[at])
    hertz = t / (2 * math.pi * axis.period)
    assert margins.crossover == pytest.approx(hertz[at[-1]], rel=1e-3)
    assert margins.phase == pytest.approx(np.abs(ahead).min(), rel=1e-2)
    assert np.abs(ahead).argmin() != 2
    least = (ahead % (2 * math.pi) / t[at]).min() * axis.period
    assert margins.delay == pytest.approx(least, rel=1e-2)
    ticks = margins.delay / axis.period
    assert axis._replace(delay=math.floor(ticks)).radius() < 1
    assert axis._replace(delay=math.ceil(ticks)).radius() > 1


def test_phase_margin_is_the_turn_that_brings_a_pole_onto_the_circle() -> None:
    """1 + exp(-j phase) L = 0 at the crossover, of either sign, at some frequency."""
    for axis, margins in stable_axes(6, 60):
        t = 2 * math.pi * axis.period * margins.crossover
        if axis.integral == 0:  # one crossover
            value = axis.opened(np.exp(1j * np.array([t])))[0]
            assert abs(abs(value) - 1) < 1e-6
            turned = [abs(1 + value * np.exp(1j * s * margins.phase)) for s in (-1, 1)]
            assert min(turned) < 1e-6


def test_short_ticks_give_the_margins_of_the_continuous_loop() -> None:
    """PD on a double integrator: L = (Kp + Kd s) / s^2.

    abs(L) = 1 at w^4 = Kp^2 + Kd^2 w^2, phase margin atan(Kd w / Kp), delay margin phase / w,
    modulus: min abs(1 + L)^2 over w by its polynomial.
    """
    rng = np.random.default_rng(7)
    for _ in range(30):
        kp, kd = 10 ** rng.uniform(2, 4), 10 ** rng.uniform(0.5, 2.5)
        w = math.sqrt((kd**2 + math.sqrt(kd**4 + 4 * kp**2)) / 2)
        phase = math.atan2(kd * w, kp)
        margins = loop_margins(kp, kd, period=1e-7, delay=0, cut_off=None)
        assert margins.stable
        assert margins.crossover == pytest.approx(w / (2 * math.pi), rel=1e-4)
        # The hold lags by half a tick, no more.
        assert margins.phase == pytest.approx(phase - w * 0.5e-7, abs=1e-8)
        assert margins.delay == pytest.approx(phase / w - 0.5e-7, rel=1e-6)
        # abs(1 + L)^2 = ((u - kp)^2 + kd^2 u) / u^2, u = w^2: least at 2 kp^2 / (2 kp - kd^2).
        least = 1.0
        if kd**2 < 2 * kp:
            u = 2 * kp**2 / (2 * kp - kd**2)
            least = math.sqrt((u - kp) ** 2 + kd**2 * u) / u
        assert margins.modulus == pytest.approx(least, abs=1e-4)


def test_integral_of_the_continuous_loop_needs_its_gain() -> None:
    """Routh: s^3 + k Kd s^2 + k Kp s + k Ki is stable above k = Ki / (Kd Kp)."""
    w = 2 * math.pi * 10
    for c in (0.05, 0.2, 1.0):
        margins = loop_margins(w**2, 2 * w, c * w**3, period=1e-7, delay=0, cut_off=None)
        assert margins.gain_down == pytest.approx(c / 2, rel=1e-4)


def test_measured_speed_without_delay_is_limited_at_half_the_sampling_frequency() -> None:
    """Pure damping, v+ = (1 - k Kd T) v, is stable up to k = 2 / (Kd T)."""
    margins = loop_margins(1.0, 40.0, delay=0, cut_off=None)
    assert margins.gain_up == pytest.approx(2 / (40 * 1e-3), rel=1e-9)


def test_only_the_products_with_the_period_count() -> None:
    for axis, margins in stable_axes(8, 50):
        f = 3.0
        scaled = Axis(
            axis.proportional / f**2,
            axis.derivative / f,
            axis.integral / f**3,
            axis.period * f,
            axis.delay,
            axis.cut_off and axis.cut_off / f,
            axis.inertia,
        )
        found = margins_of(scaled)
        seconds = np.array([1, 1, 1, 1, f, 1, 1 / f, 1 / f])
        np.testing.assert_allclose(found, np.array(margins) * seconds, rtol=1e-6)


def test_inertia_is_a_factor_of_every_gain() -> None:
    for axis, margins in stable_axes(9, 50):
        gains = np.array(axis[:3]) * axis.inertia
        found = loop_margins(*gains, **(axis.options | {"inertia": 1.0}))
        np.testing.assert_allclose(found, margins, rtol=1e-9)


def test_unstable_loop_has_no_margins_and_no_nan() -> None:
    undamped = loop_margins(400.0, 0.0)
    assert undamped == (False, 1, 1, 0, 0, 0, undamped.crossover, 0)
    assert undamped.crossover == pytest.approx(20 / (2 * math.pi), rel=1e-3)
    assert "unstable" in str(undamped)
    # abs(L) = Kd T / 2 at half the sampling frequency, where a curve of measured speed ends.
    assert loop_margins(1.0, 3000.0, cut_off=None).crossover == pytest.approx(500)
    assert not loop_margins(0.0, 40.0).stable  # the position drifts
    assert not loop_margins(0.0, 0.0).stable
    assert not loop_margins(0.0, 40.0, 5.0).stable


def test_sentence_states_the_margins() -> None:
    text = str(loop_margins(4000.0, 126.0))
    assert text.startswith("stable; loop gain may change by factors of 0 to ")
    assert "phase margin" in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"proportional": -1.0}, "proportional = -1.0: it must be a number of 1/s.2, zero or more"),
        ({"derivative": math.nan}, "derivative = nan"),
        ({"integral": math.inf}, "integral = inf"),
        ({"proportional": np.ones(3)}, "proportional = .*: it must be a number of 1/s.2"),
        ({"proportional": "stiff"}, "proportional = 'stiff'"),
        ({"proportional": "4000"}, "proportional = '4000'"),
        ({"integral": True}, "integral = True"),
        ({"derivative": None}, "derivative = None"),
        ({"period": 0.0}, "period = 0.0: it must be a positive number of s"),
        ({"period": -1e-3}, "period = -0.001"),
        ({"delay": -1}, "delay = -1: it must be a whole number, at least 0"),
        ({"delay": 1.0}, "delay = 1.0: it must be a whole number"),
        ({"delay": True}, "delay = True"),
        ({"delay": 10**6}, "delay = 1000000 ticks: it must be at most 200"),
        ({"cut_off": 0.0}, "cut_off = 0.0: it must be a positive number of Hz, or infinite"),
        ({"cut_off": math.nan}, "cut_off = nan"),
        ({"inertia": 0.0}, "inertia = 0.0: it must be a positive number"),
        ({"inertia": math.inf}, "inertia = inf"),
        ({"proportional": 1e300}, "more than 1e12 is refused"),
        ({"integral": 1e-9}, "rounding hides"),
        ({"proportional": 1e-20}, "rounding hides"),
        ({"cut_off": 1e-12}, "rounding hides"),
    ],
)
def test_nonsense_is_refused(change: dict[str, Any], message: str) -> None:
    arguments = {"proportional": 4000.0, "derivative": 126.0} | change
    with pytest.raises(InputError, match=message):
        loop_margins(**arguments)

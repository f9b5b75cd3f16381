"""The axis as a linear system against one that runs tick by tick with the real speed filter."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from scipy.signal import cont2discrete

from rps_pin.control.axis_loop import AxisLoop, axis_loop
from rps_pin.control.loop.filters import SpeedFilter
from tests.control.axis_ticks import Axis, random_axis


def loop_of(axis: Axis) -> AxisLoop:
    gains = axis.proportional, axis.derivative, axis.integral
    return axis_loop(*gains, axis.period, axis.delay, axis.cut_off, axis.inertia)


def test_curve_is_that_of_the_axis_run_tick_by_tick() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        axis = random_axis(rng)
        t = np.append(10 ** rng.uniform(-1.5, 0.49, 8), math.pi)
        expected = axis.opened(np.exp(1j * t))
        scale = np.abs(expected) + 1e-9
        assert np.abs((-loop_of(axis).response(t) - expected) / scale).max() < 1e-6


def test_poles_are_those_of_the_axis_run_tick_by_tick() -> None:
    """Compared by the characteristic polynomial at random points, which has no order."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        axis = random_axis(rng)
        found, expected = loop_of(axis).matrix(), axis.closed()
        for z in rng.uniform(-2, 2, 6) + 1j * rng.uniform(0.5, 2, 6):
            unit = z * np.eye(found.shape[0])
            a, b = np.linalg.det(unit - found), np.linalg.det(unit - axis.scaled(expected))
            assert abs(a - b) < 1e-9 * (abs(a) + abs(b) + np.abs(found).max())


def test_plant_is_the_exact_hold_of_scipy() -> None:
    T = 3e-3
    plant = (np.eye(2, k=1), np.array([[0.0], [1.0]]), np.eye(2), np.zeros((2, 1)))
    A, B, *_ = cont2discrete(plant, T, method="zoh")
    z = np.exp(1j * np.array([0.01, 0.3, 2.0, 3.1]))
    x, v = np.array([np.linalg.solve(value * np.eye(2) - A, B)[:, 0] for value in z]).T
    t = np.angle(z)
    position = -axis_loop(7.0, 0, 0, T, 0, None, 1).response(t)
    speed = -axis_loop(0, 7.0, 0, T, 0, None, 1).response(t)
    np.testing.assert_allclose(position, 7 * x, rtol=1e-10)
    np.testing.assert_allclose(speed, 7 * v, rtol=1e-10)


@pytest.mark.parametrize("cut_off", [20.0, 100.0, math.inf])
@pytest.mark.parametrize("t", [0.02, 0.5, 2.5])
def test_filtered_speed_of_a_sine(cut_off: float, t: float) -> None:
    """The real filter is fed a sine until only the sine is left of its answer."""
    T, ticks = 2e-3, 3000
    speeds, found = SpeedFilter(cut_off), 0.0
    for tick in range(ticks):
        length = (math.cos(t * tick),) * 3
        speed = speeds.after(length, T)
        speeds.update(length, speed)
        found = speed[0]
    angle = np.array(t)
    with_speed = axis_loop(0, 1.0, 0, T, 3, cut_off, 1).response(angle)
    with_position = axis_loop(1.0, 0, 0, T, 3, cut_off, 1).response(angle)
    ratio = complex(with_speed / with_position)
    assert found == pytest.approx(
        (ratio * cmath.exp(1j * t * (ticks - 1))).real, abs=1e-9 * abs(ratio)
    )

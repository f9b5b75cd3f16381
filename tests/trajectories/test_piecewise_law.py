"""Pieces of steady jerk, against SciPy's integrals of the acceleration."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.interpolate import PPoly

from rps_pin import InputError
from rps_pin.trajectories.piecewise_law import PiecewiseLaw
from rps_pin.trajectories.time_laws import SCurveLaw, TrapezoidalLaw
from tests.each import each

Array = NDArray[np.float64]


def random_pieces(seed: int) -> tuple[Array, Array, Array]:
    """Durations, jerks and accelerations that jump; the end is not at rest."""
    rng = np.random.default_rng(seed)
    count = rng.integers(1, 9)
    return rng.uniform(0.05, 1, count), rng.normal(size=count), rng.normal(size=count)


@given(st.integers(0, 2**32 - 1))
def test_speed_and_distance_are_integrals_of_the_acceleration(seed: int) -> None:
    h, j, a = random_pieces(seed)
    law = PiecewiseLaw(h, j, a)
    acceleration = PPoly(np.stack([j, a]), np.concatenate([[0], np.cumsum(h)]))
    t = np.random.default_rng(seed).uniform(0, law.duration, (3, 40))
    found = law.at(t)
    expected = (acceleration.antiderivative(2)(t), acceleration.antiderivative()(t))
    np.testing.assert_allclose(found.u, expected[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.rate, expected[1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.acceleration, acceleration(t), rtol=0, atol=1e-12)
    assert law.duration == pytest.approx(h.sum(), rel=1e-15)
    assert law.distance == pytest.approx(float(acceleration.antiderivative(2)(law.duration)))


@given(st.integers(0, 2**32 - 1))
def test_pieces_without_a_duration_do_not_show(seed: int) -> None:
    h, j, a = random_pieces(seed)
    without = PiecewiseLaw(h, j, a)
    law = PiecewiseLaw(np.insert(h, 1, 0.0), np.insert(j, 1, 7.0), np.insert(a, 1, 5.0))
    np.testing.assert_array_equal(law.knots, without.knots)
    t = np.linspace(0, law.duration, 50)
    np.testing.assert_array_equal(law.at(t), without.at(t))


def test_at_a_jump_the_acceleration_is_the_later_piece_s() -> None:
    """Binary fractions, so that the knots are met; both from the front and from the back."""
    law = PiecewiseLaw([0.25, 0.5, 0.25, 1.0, 0.5], np.zeros(5), [1.0, 2.0, 3.0, 4.0, 5.0])
    np.testing.assert_array_equal(law.at(law.knots).acceleration, [1, 2, 3, 4, 5, 5])
    before = law.at(np.nextafter(law.knots[1:], 0)).acceleration
    np.testing.assert_array_equal(before, [1, 2, 3, 4, 5])


@each("ramp", [1e-3, 1e-9, 1e-15, 1e-20])
@each("kind", [TrapezoidalLaw, SCurveLaw])
def test_the_end_is_at_rest_however_short_the_brake(
    kind: type[TrapezoidalLaw] | type[SCurveLaw], ramp: float
) -> None:
    """Reckoned from the front, rounding of the time would hide the last piece."""
    law = kind(3.0, 7.0, ramp=ramp)
    u, rate, acceleration = law.at([0.0, 7.0])
    np.testing.assert_allclose(u, [0, 3], rtol=1e-14)
    np.testing.assert_allclose(rate, [0, 0], rtol=0, atol=1e-15)
    assert acceleration[0] == -acceleration[1]


def test_knots_are_read_only_and_given_arrays_are_not_kept() -> None:
    h, j, a = np.ones(2), np.zeros(2), np.array([1.0, -1.0])
    law = PiecewiseLaw(h, j, a)
    before = law.at(1.5)
    for array in (h, j, a):
        array[:] = 9
    np.testing.assert_array_equal(law.at(1.5), before)
    with pytest.raises(ValueError, match="read-only"):
        law.knots[0] = 1
    assert repr(law) == "PiecewiseLaw(distance=1, duration=2)"


@pytest.mark.parametrize("bad", [-0.1, 2.1, np.nan])
def test_times_outside_are_refused(bad: float) -> None:
    with pytest.raises(InputError, match="outside"):
        PiecewiseLaw([1.0, 1.0], [0.0, 0.0], [1.0, -1.0]).at(bad)

"""Encoders: bounds of quantisation, the noise's statistics, seeds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import kstest, norm

from rps_pin.control.simulation.encoders import Encoders
from rps_pin.errors import InputError
from tests.strategies import floats, vectors

Array = NDArray[np.float64]

LENGTH = np.array([0.2123456, 0.2234567, 0.2345678])


def readings(encoders: Encoders, length: Array, count: int) -> Array:
    generator = encoders.generator()
    return np.array([encoders.read(length, generator) for _ in range(count)])


@given(vectors(10.0), st.integers(0, 2**40))
def test_perfect_ones_read_the_lengths(length: Array, seed: int) -> None:
    encoders = Encoders(seed=seed)
    reading = encoders.read(length, encoders.generator())
    np.testing.assert_array_equal(reading, length)
    assert not np.shares_memory(reading, length)


@given(vectors(10.0), floats(1e-9, 1e-2))
def test_quantised_readings_are_the_nearest_whole_steps(length: Array, resolution: float) -> None:
    encoders = Encoders(resolution)
    given_, reading = length.copy(), encoders.read(length, encoders.generator())
    assert np.abs(reading - length).max() <= resolution / 2 + 5e-15  # rounding, of 10 m
    steps = reading / resolution
    assert np.abs(steps - np.round(steps)).max() <= 1e-15 * np.abs(steps).max() + 1e-300
    np.testing.assert_array_equal(length, given_)


def test_a_staircase_over_one_step() -> None:
    """Binary steps: exact, each half way up."""
    encoders, generator = Encoders(2.0**-10), Encoders().generator()
    for k in range(200, 260):
        for part, step in ((-0.49, k), (0.0, k), (0.49, k), (0.51, k + 1)):
            reading = encoders.read(np.full(3, (k + part) * 2.0**-10), generator)
            np.testing.assert_array_equal(reading, step * 2.0**-10)


@pytest.mark.parametrize("noise", [2e-8, 3e-6, 1e-3])
def test_the_noise_is_gaussian_of_its_size_and_independent(noise: float) -> None:
    """Within five standard deviations of the estimates."""
    n = 20_000
    error = readings(Encoders(noise=noise, seed=3), LENGTH, n) - LENGTH
    assert np.abs(error.mean(axis=0)).max() < 5 * noise / math.sqrt(n)
    assert np.abs(error.var(axis=0) / noise**2 - 1).max() < 5 * math.sqrt(2 / n)
    for leg in range(3):
        assert kstest(error[:, leg] / noise, norm.cdf).pvalue > 1e-6
    together = np.corrcoef(np.column_stack([error[1:], error[:-1]]).T)  # legs, and ticks, apart
    assert np.abs(together - np.eye(6)).max() < 5 / math.sqrt(n)


def test_noise_comes_before_quantisation() -> None:
    """A step is read as often as the noise leads into it; and the steps stay whole."""
    n, resolution, noise = 20_000, 1e-6, 0.8e-6
    length = np.array([200_000.3, 0.0, -7.5]) * resolution
    found = readings(Encoders(resolution, noise, seed=4), length, n)
    steps = np.round(found / resolution)
    np.testing.assert_allclose(found, steps * resolution, rtol=1e-15)
    for leg, middle in enumerate(length / resolution):
        for step in range(math.floor(middle) - 2, math.floor(middle) + 4):
            edges = (np.array([step - 0.5, step + 0.5]) - middle) * resolution / noise
            share = float(np.diff(norm.cdf(edges)).item())
            spread = math.sqrt(share * (1 - share) / n)
            assert abs(np.mean(steps[:, leg] == step) - share) < 5 * spread


def test_equal_seeds_give_equal_readings_and_others_do_not() -> None:
    one, two, other = (readings(Encoders(1e-9, 1e-6, seed), LENGTH, 50) for seed in (7, 7, 8))
    np.testing.assert_array_equal(one, two)
    assert (one != other).any(axis=1).all()
    assert len(np.unique(one[:, 0])) > 45  # anew at each


def test_no_noise_takes_nothing_from_the_generator() -> None:
    encoders = Encoders(1e-6, seed=1)
    generator = encoders.generator()
    encoders.read(LENGTH, generator)
    assert generator.normal() == encoders.generator().normal()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"resolution": -1e-9},
            "encoder resolution = -1e-09: it must be a number of m, zero",
        ),
        ({"resolution": math.nan}, "encoder resolution = nan"),
        ({"resolution": math.inf}, "encoder resolution = inf"),
        ({"noise": -1.0}, "encoder noise = -1.0"),
        ({"noise": math.nan}, "encoder noise = nan"),
        ({"noise": math.inf}, "encoder noise = inf"),
        ({"seed": -1}, "encoder seed = -1: it must be a whole number, at least 0"),
    ],
)
def test_numbers_that_do_not_fit_are_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Encoders(**changes)


@pytest.mark.parametrize("changes", [{"resolution": "fine"}, {"noise": None}, {"seed": 1.5}])
def test_what_is_no_number_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f"encoder {next(iter(changes))}"):
        Encoders(**changes)

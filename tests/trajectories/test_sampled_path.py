"""Motions through samples: what they meet, how smooth they are, and how fast they come near."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.interpolate import BPoly

from rps_pin import InputError
from rps_pin.trajectories.path import PathSample
from rps_pin.trajectories.sampled_path import SampledPath

Array = NDArray[np.float64]
SEEDS = st.integers(0, 2**32 - 1)


class Swings:
    """A smooth motion whose derivatives are known: sums of sines."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.size = rng.normal(scale=[0.02, 0.1, 0.1], size=(3, 3))
        self.frequency = rng.uniform(0.5, 4.0, size=(3, 3))
        self.phase = rng.uniform(0, 7, size=(3, 3))

    def at(self, t: Array) -> PathSample:
        angle = self.frequency * t[..., None, None] + self.phase
        w = self.frequency
        pose = (self.size * np.sin(angle)).sum(axis=-2) + np.array([0.4, 0.0, 0.0])
        rate = (self.size * w * np.cos(angle)).sum(axis=-2)
        return PathSample(pose, rate, -(self.size * w**2 * np.sin(angle)).sum(axis=-2))


def uneven(rng: np.random.Generator, count: int, duration: float = 2.0) -> Array:
    steps = rng.uniform(0.4, 1.0, size=count - 1)
    return np.concatenate([[0.0], np.cumsum(steps)]) * duration / steps.sum()


@given(SEEDS)
def test_samples_are_met_exactly(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion, t = Swings(rng), 7.0 + uneven(rng, 40)
    samples = motion.at(t)
    hermite, spline = SampledPath(t, *samples), SampledPath(t, samples.pose)
    for found, given_ in zip(hermite.sample(hermite.times), samples, strict=True):
        assert_allclose(found, given_, rtol=0, atol=1e-12)
    assert_allclose(spline.sample(spline.times).pose, samples.pose, rtol=0, atol=1e-13)


@given(SEEDS, st.booleans())
def test_the_error_between_samples_is_of_sixth_order(seed: int, hermite: bool) -> None:
    """Four times the samples: the poses' error falls by 4^6, the accelerations' by 4^4."""
    rng = np.random.default_rng(seed)
    motion, t = Swings(rng), np.linspace(0, 2, 777)
    errors = []
    for count in (25, 97):
        times = np.linspace(0, 2, count)
        samples = motion.at(times) if hermite else motion.at(times)[:1]
        found = SampledPath(times, *samples).sample(t)
        errors.append([np.abs(a - b).max() for a, b in zip(found, motion.at(t), strict=True)])
    order = np.log(np.divide(*errors)) / np.log(4)
    assert (order > [5.0, 4.0, 3.0]).all()
    assert errors[1][2] < 1e-2


@given(SEEDS, st.booleans())
def test_a_quintic_is_reproduced_to_its_ends(seed: int, hermite: bool) -> None:
    """Nothing is assumed about the ends: neither rest nor straightness."""
    rng = np.random.default_rng(seed)
    quintics = [Polynomial(rng.normal(size=6)) for _ in range(3)]

    def at(t: Array) -> list[Array]:
        return [np.stack([q.deriv(k)(t) if k else q(t) for q in quintics], -1) for k in range(3)]

    t = uneven(rng, 9)
    path = SampledPath(t, *(at(t) if hermite else at(t)[:1]))
    fine = np.linspace(0, path.duration, 201)
    for found, expected in zip(path.sample(fine), at(fine), strict=True):
        assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_the_hermite_pieces_are_scipys() -> None:
    """BPoly.from_derivatives builds the same polynomials, one by one."""
    rng = np.random.default_rng(1)
    t, x = uneven(rng, 12), rng.normal(size=(3, 12, 3))
    other = BPoly.from_derivatives(t, np.moveaxis(x, 0, 1))
    fine = np.linspace(0, t[-1], 500)
    for order, found in enumerate(SampledPath(t, *x).sample(fine)):
        expected = other(fine, order)
        assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@given(SEEDS, st.booleans())
def test_rates_and_accelerations_are_derivatives(seed: int, hermite: bool) -> None:
    """Of the interpolant, by central differences, even where the samples are rough."""
    rng = np.random.default_rng(seed)
    t, x = uneven(rng, 12), rng.normal(size=(3, 12, 3))
    path = SampledPath(t, *(x if hermite else x[:1]))
    steps = np.diff(path.times)
    h = 1e-5
    inside = path.times[:-1] + rng.uniform(0.01, 0.99, size=(50, 11)) * steps
    now, before, after = (path.sample(inside + d) for d in (0.0, -h, h))
    for k in range(2):
        difference = (after[k] - before[k]) / (2 * h)
        assert_allclose(difference, now[k + 1], rtol=0, atol=1e-6 * np.abs(now[k + 1]).max())


@given(SEEDS, st.booleans())
def test_pose_rate_and_acceleration_are_continuous(seed: int, hermite: bool) -> None:
    rng = np.random.default_rng(seed)
    t, x = uneven(rng, 12), rng.normal(size=(3, 12, 3))
    path = SampledPath(t, *(x if hermite else x[:1]))
    inner = path.times[1:-1]
    for a, b in zip(path.sample(np.nextafter(inner, 0)), path.sample(inner), strict=True):
        assert_allclose(a, b, rtol=0, atol=1e-10 * np.abs(b).max())


def test_times_of_any_shape_are_sampled() -> None:
    path = SampledPath(np.arange(8.0), np.random.default_rng(0).normal(size=(8, 3)))
    whole = path.sample(np.linspace(0, 7, 12).reshape(3, 4))
    single = path.sample(np.linspace(0, 7, 12)[6])
    for a, b in zip(whole, single, strict=True):
        assert a.shape == (3, 4, 3)
        assert b.shape == (3,)
        assert_array_equal(a[1, 2], b)


def test_samples_are_kept_where_nobody_writes() -> None:
    t, x = np.arange(5.0, 13.0), np.zeros((8, 3))
    path = SampledPath(t, x, x, x)
    x[:] = 9.0
    assert path.rates is not None
    for array in (path.times, path.poses, path.rates):
        assert not array.flags.writeable
    assert_array_equal(path.times, np.arange(8.0))
    assert_array_equal(path.poses, 0.0)
    assert path.duration == 7.0
    assert repr(path) == "SampledPath(<8 samples>, duration=7)"


def test_times_outside_are_refused() -> None:
    path = SampledPath(np.arange(8.0), np.zeros((8, 3)))
    with pytest.raises(InputError, match=r"time 7\.1 s is outside the trajectory"):
        path.sample(7.1)


POSES = np.random.default_rng(0).normal(size=(8, 3))
TIMES = np.arange(8.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((TIMES[:5], POSES[:5]), "5 samples; 6 or more are needed"),
        ((TIMES[:7], POSES), "7 times for 8 poses"),
        ((TIMES, POSES[:, :2]), "poses has shape"),
        ((-TIMES, POSES), "times must increase"),
        ((np.r_[TIMES[:7], np.nan], POSES), "times is not finite"),
        ((TIMES, POSES, POSES), "rates and accelerations are given together"),
        ((TIMES, POSES, POSES[:4], POSES), "rates has shape"),
        ((TIMES, POSES, POSES, POSES * np.inf), "accelerations is not finite"),
        ((TIMES * 5e-324, POSES, POSES, POSES), "no finite motion"),
        ((TIMES * 1e-300, POSES), "no finite motion|too unequal"),
        (
            ([0, 1e-301, 1e-197, 1e-181, 1e-162, 1e-5], POSES[:6]),
            "steps of 1e-301 s to 1e-05 s are too unequal",
        ),
        ((np.r_[TIMES[:7], 6 + 1e-15] * 1e10, POSES), "increase|finite|unequal"),
    ],
)
def test_what_is_no_motion_is_refused(arguments: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        SampledPath(*arguments)

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
from rps_pin.trajectories.time_laws import QuinticLaw
from tests.each import each

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
    hermite = SampledPath(t, *samples)
    for found, given_ in zip(hermite.sample(hermite.times), samples, strict=True):
        assert_allclose(found, given_, rtol=0, atol=1e-12)
    for path in splines(t, samples):
        assert_allclose(path.sample(path.times).pose, samples.pose, rtol=0, atol=1e-13)


def splines(times: Array, samples: PathSample) -> list[SampledPath]:
    """At rest, with the measured rates, and free."""
    return [
        SampledPath(times, samples.pose),
        SampledPath(times, samples.pose, samples.rate),
        SampledPath(times, samples.pose, ends="free"),
    ]


# The ends -----------------------------------------------------------------------------------------


def test_poses_alone_start_and_end_at_rest() -> None:
    """Few samples of a rise from rest: a spline with free ends starts downwards."""
    law = QuinticLaw(0.02, 1.0)
    t = np.append(np.arange(0, 1, 0.15), 1.0)
    poses = np.zeros((len(t), 3))
    poses[:, 0] = 0.2 + np.round(law.at(t).u, 4)
    fine = np.linspace(0, 1, 2001)
    free = SampledPath(t, poses, ends="free").sample(fine)
    assert free.pose[:, 0].min() < 0.2 - 1e-6
    path = SampledPath(t, poses)
    found = path.sample(fine)
    assert found.pose[:, 0].min() >= 0.2
    assert found.pose[:, 0].max() <= 0.22 + 1e-15
    for end in (0, -1):
        assert_allclose(found.rate[end], 0, atol=1e-12)
        assert_allclose(found.acceleration[end], 0, atol=1e-10)
    assert (path.starts, path.ends) == ("at rest", "at rest")


@given(SEEDS)
def test_measured_rates_are_met_at_the_ends(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion, t = Swings(rng), 7.0 + uneven(rng, 40)
    samples = motion.at(t)
    path = SampledPath(t, samples.pose, samples.rate)
    found = path.sample([0.0, path.duration])
    assert_allclose(found.rate, samples.rate[[0, -1]], rtol=0, atol=1e-11)
    assert (path.starts, path.ends) == ("with the measured rate", "with the measured rate")
    assert path.accelerations is None
    assert path.rates is not None
    assert_array_equal(path.rates, samples.rate)


@given(SEEDS, st.sampled_from(["at rest", "measured"]))
def test_splines_have_the_least_jerk(seed: int, ends: Any) -> None:
    """Their third derivative is orthogonal to that of motions that change no pose and no end."""
    rng = np.random.default_rng(seed)
    motion, t = Swings(rng), uneven(rng, 9)
    x, v = motion.at(t)[:2]
    path = SampledPath(t, x, v, ends=ends)
    rates, accelerations = rng.normal(size=(2, 9, 3))
    rates[[0, -1]] = 0
    if ends == "at rest":
        accelerations[[0, -1]] = 0
    change = SampledPath(t, 0 * x, rates, accelerations)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    h = np.diff(path.times)[:, None]
    at = path.times[:-1, None] + h * (nodes + 1) / 2
    jerks = [p._moved[2].derivative(1)(at) for p in (path, change)]

    def integral(values: Array) -> Array:
        return (values * (weights * h / 2)[..., None]).sum(axis=(0, 1))

    sizes = [np.sqrt(integral(jerk**2)) for jerk in jerks]
    assert np.all(np.abs(integral(jerks[0] * jerks[1])) < 1e-9 * sizes[0] * sizes[1])


def test_the_ends_can_be_chosen() -> None:
    t, rng = np.arange(8.0), np.random.default_rng(3)
    x, v = rng.normal(size=(2, 8, 3))
    assert_allclose(SampledPath(t, x, v, ends="at rest").sample([0.0, 7.0]).rate, 0, atol=1e-12)
    one, other = SampledPath(t, x, v, ends="free"), SampledPath(t, x, ends="free")
    for a, b in zip(one.sample(t), other.sample(t), strict=True):
        assert_array_equal(a, b)
    still = SampledPath(t, x, 0 * v)
    assert (still.starts, still.ends) == ("at rest, as measured", "at rest, as measured")
    assert SampledPath(t, x, v, x).starts == "with the measured rate"
    assert len(SampledPath(t[:2], x[:2]).times) == 2


# Between samples ----------------------------------------------------------------------------------


@given(SEEDS, st.booleans())
def test_the_error_between_samples_is_of_sixth_order(seed: int, hermite: bool) -> None:
    """Four times the samples: the poses' error falls by 4^6, the accelerations' by 4^4."""
    rng = np.random.default_rng(seed)
    motion, t = Swings(rng), np.linspace(0, 2, 777)
    errors = []
    for count in (25, 97):
        times = np.linspace(0, 2, count)
        samples = motion.at(times) if hermite else motion.at(times)[:1]
        found = SampledPath(times, *samples, ends=None if hermite else "free").sample(t)
        errors.append([np.abs(a - b).max() for a, b in zip(found, motion.at(t), strict=True)])
    order = np.log(np.divide(*errors)) / np.log(4)
    assert (order > [5.0, 4.0, 3.0]).all()
    assert errors[1][2] < 1e-2


@given(SEEDS, st.booleans())
def test_a_quintic_is_reproduced_to_its_ends(seed: int, hermite: bool) -> None:
    """Nothing is assumed about free ends: neither rest nor straightness."""
    rng = np.random.default_rng(seed)
    quintics = [Polynomial(rng.normal(size=6)) for _ in range(3)]

    def at(t: Array) -> list[Array]:
        return [np.stack([q.deriv(k)(t) if k else q(t) for q in quintics], -1) for k in range(3)]

    t = uneven(rng, 9)
    path = SampledPath(t, *(at(t) if hermite else at(t)[:1]), ends=None if hermite else "free")
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


@each(
    ("arguments", "message"),
    [
        ((TIMES[:7], POSES), "7 times for 8 poses"),
        ((TIMES, POSES[:, :0]), "poses has shape"),
        ((TIMES, POSES[:, 0]), "poses has shape"),
        ((TIMES, POSES[:, :2], POSES), "rates has shape"),
        ((-TIMES, POSES), "times must increase"),
        ((np.r_[TIMES[:7], np.nan], POSES), "times is not finite"),
        ((TIMES, POSES, None, POSES), "accelerations are given without rates"),
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


def test_ends_that_cannot_be_are_refused() -> None:
    with pytest.raises(InputError, match=r"5 samples; 6 or more are needed .* free"):
        SampledPath(TIMES[:5], POSES[:5], ends="free")
    with pytest.raises(InputError, match="ends = 'measured': no rates are given"):
        SampledPath(TIMES, POSES, ends="measured")
    with pytest.raises(InputError, match="ends = 'still': it must be 'at rest' or 'measured' or"):
        SampledPath(TIMES, POSES, ends="still")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="samples with accelerations have measured ends"):
        SampledPath(TIMES, POSES, POSES, POSES, ends="at rest")

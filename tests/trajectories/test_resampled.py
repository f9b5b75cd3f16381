"""The way of a trajectory without its times."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize_scalar

from rps_pin import InputError
from rps_pin.trajectories import (
    SampledPath,
    TimedSpline,
    Trajectory,
    circle,
    lissajous,
    point_to_point,
)
from rps_pin.trajectories.resampled import ResampledCurve

POSES = [[0.215, 0, 0], [0.225, 0.12, 0], [0.23, 0, 0.1], [0.222, -0.08, 0], [0.215, 0, 0]]
SCALE = np.array([1.0, 0.1, 0.1])


def distance(path: Trajectory, pose: np.ndarray, near: float, reach: float) -> float:
    """How far a pose is from a trajectory's way, m."""

    def apart(time: float) -> float:
        return float(np.linalg.norm((path.sample(time).pose - pose) * SCALE))

    bounds = max(0.0, near - reach), min(path.duration, near + reach)
    return float(
        minimize_scalar(apart, bounds=bounds, method="bounded", options={"xatol": 1e-12}).fun
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_curve_lies_on_the_way_and_covers_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = TimedSpline(
        np.arange(6.0), np.cumsum(rng.normal(scale=[0.01, 0.05, 0.05], size=(6, 3)), axis=0)
    )
    curve = path.curve
    times = np.linspace(0, path.duration, 20_001)
    poses = path.sample(times).pose
    assert_allclose(curve.at([0.0, curve.length]).pose, poses[[0, -1]], atol=1e-15)
    for u in rng.uniform(0, curve.length, 20):
        pose = curve.at(u).pose
        nearest = times[np.linalg.norm((poses - pose) * SCALE, axis=-1).argmin()]
        # 1e-7 in the middles of the pieces, where it is looked at
        assert distance(path, pose, nearest, 1e-3) < 3e-7 * curve.length


def test_u_is_the_length_of_the_way() -> None:
    """Straight ways have tangents of length 1; so have circles, nearly: chords are counted."""
    line = point_to_point([0.2, 0, 0], [0.23, 0.1, -0.05], duration=1.0)
    curve = ResampledCurve(line, np.array([0.0, 1.0]))
    length = np.linalg.norm(np.array([0.03, 0.1, -0.05]) * SCALE)
    assert_allclose(curve.length, length, rtol=1e-12)
    u = np.linspace(0, curve.length, 101)
    found = curve.at(u)
    assert_allclose(np.linalg.norm(found.first * SCALE, axis=-1), 1.0, rtol=1e-9)
    assert_allclose(found.second * length, 0.0, atol=1e-6)
    about = circle(height=0.22, tilt=0.1, duration=2.0)
    curve = ResampledCurve(about, np.array([0.0, 2.0]))
    assert_allclose(curve.length, 2 * np.pi * 0.1 * 0.1, rtol=1e-4)  # chords of 400 pieces
    tangent = np.linalg.norm(curve.at(np.linspace(0, curve.length, 57)).first * SCALE, axis=-1)
    assert_allclose(tangent, tangent[0], rtol=1e-6)


def test_derivatives_are_those_of_the_pose() -> None:
    path = lissajous(
        height=0.22, amplitude=(0.1, 0.08), frequency=(1, 2), phase=(0.3, 0), duration=3.0
    )
    curve = ResampledCurve(path, np.linspace(0, 3, 4))
    h = 1e-6 * curve.length
    u = np.linspace(2 * h, curve.length - 2 * h, 333)
    ahead, here, behind = curve.at(u + h), curve.at(u), curve.at(u - h)
    assert_allclose(here.first, (ahead.pose - behind.pose) / (2 * h), rtol=1e-4, atol=1e-5)
    assert_allclose(here.second, (ahead.first - behind.first) / (2 * h), rtol=1e-3, atol=1e-2)


def test_samples_that_crowd_at_rest_do_not_matter() -> None:
    """A file that rests before, between and after its motion."""
    smooth = TimedSpline([0, 1, 2, 3, 4], POSES)
    times = np.linspace(0, 4, 4001)
    moving = smooth.sample(times).pose
    poses = np.concatenate(
        [np.repeat(moving[:1], 50, axis=0), moving, np.repeat(moving[-1:], 50, 0)]
    )
    curve = SampledPath(1e-3 * np.arange(len(poses)), poses).curve
    assert_allclose(curve.length, smooth.curve.length, rtol=1e-6)
    u = np.linspace(0, 1, 101)
    assert_allclose(
        curve.at(u * curve.length).pose, smooth.curve.at(u * smooth.curve.length).pose, atol=1e-7
    )
    assert np.isfinite(curve.at(u * curve.length).second).all()


def test_a_corner_is_told_where_it_is() -> None:
    there = point_to_point([0.21, 0, 0], [0.23, 0, 0], duration=1.0)
    aside = point_to_point([0.23, 0, 0], [0.23, 0.1, 0], duration=1.0)
    t = np.linspace(0, 1, 101)
    poses = np.concatenate([there.sample(t).pose, aside.sample(t[1:]).pose])
    with pytest.raises(InputError, match=r"sharply at t = (0\.9\d*|1|1\.0\d*) s"):
        _ = SampledPath(np.linspace(0, 2, 201), poses).curve


def test_standing_still_is_no_way() -> None:
    still = SampledPath(np.arange(10.0), np.tile([0.22, 0.0, 0.0], (10, 1)))
    with pytest.raises(InputError, match="stays in one pose"):
        _ = still.curve

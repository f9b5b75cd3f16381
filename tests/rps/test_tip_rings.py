"""Rings: the tips, their slopes and time derivatives, against the reference's jets."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin.rps.kinematics.tip_rings import Ring, Tips, resultant, tilt_functions, tips_of
from tests import strategies
from tests.reference import newton_euler as ne

Array = NDArray[np.float64]

BASE, PLATFORM = 0.46, 0.23


def tips(pose: Array, rate: Array, acceleration: Array) -> Tips:
    tilt = tilt_functions(pose[:, 1] ** 2 + pose[:, 2] ** 2)
    return tips_of(PLATFORM, tilt, *(np.ascontiguousarray(x.T) for x in (pose, rate, acceleration)))


def jets(pose: Array, rate: Array, acceleration: Array) -> tuple[ne.Jet, ne.Jet]:
    """Radial coordinate and height of each tip, (n, 3) each, by the reference."""
    robot = ne.ReferenceRobot(BASE, PLATFORM, 1.0, np.eye(3))
    motion = ne.motion(robot, pose, rate, acceleration)
    length = motion.length.map(lambda d: d[..., None])
    leg = length * motion.direction
    radial = leg.map(lambda x: np.sum(x * ne.RADIAL, axis=-1)).shift(BASE)
    return radial, leg.map(lambda x: x[..., 2])


@pytest.mark.parametrize("largest", [1e-3, 1.5, 3.1, 6.0])
def test_tips_and_their_derivatives(largest: float) -> None:
    rng = np.random.default_rng(3)
    pose = strategies.random_poses(300, largest_tilt=largest)
    rate, acceleration = rng.normal(size=(2, 300, 3))
    found = tips(pose, rate, acceleration)
    radial, height = jets(pose, rate, acceleration)
    for ring, expected in (
        (found.radial, radial.value),
        (found.height, height.value),
        (found.radial_rate, radial.first),
        (found.height_rate, height.first),
        (found.radial_acceleration, radial.second),
        (found.height_acceleration, height.second),
    ):
        np.testing.assert_allclose(ring.at_legs().T, expected, rtol=0, atol=2e-12)


def test_slopes_are_rates_of_one_tilt_at_a_time() -> None:
    pose = strategies.random_poses(200)
    zero = np.zeros_like(pose)
    found = tips(pose, zero, zero)
    for axis in (1, 2):
        rate = np.zeros_like(pose)
        rate[:, axis] = 1 / PLATFORM  # slopes are by h times the tilt
        for slopes, jet in zip(
            (found.radial_slopes, found.height_slopes), jets(pose, rate, zero), strict=True
        ):
            np.testing.assert_allclose(slopes[axis - 1].at_legs().T, jet.first, rtol=0, atol=1e-12)


def test_sums_over_legs() -> None:
    """Of numbers against a ring: sum q_i ring_i = mean sum(q) + x sum(q e_x) + y sum(q e_y)."""
    rng = np.random.default_rng(4)
    mean, x, y = rng.normal(size=(3, 20))
    legs = rng.normal(size=(3, 20))
    total, by_x, by_y = resultant(legs)
    np.testing.assert_allclose(
        (legs * Ring(mean, x, y).at_legs()).sum(axis=0), mean * total + x * by_x + y * by_y
    )
    ways = ne.RADIAL
    np.testing.assert_allclose(by_x, (legs * ways[:, :1]).sum(axis=0), atol=1e-14)
    np.testing.assert_allclose(by_y, (legs * ways[:, 1:2]).sum(axis=0), atol=1e-14)

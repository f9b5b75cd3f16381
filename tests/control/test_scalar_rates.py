"""Scalar gains against the library's singular values, also where they coincide."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rps_pin.control.estimator.exponential_map import coefficients
from rps_pin.control.estimator.scalar_rates import (
    LeastGain,
    force_of_wrench,
    leg_gains,
    leg_speed,
    platform_twist,
    pose_rate,
    wrench_of_force,
)
from rps_pin.rps.kinematics import rates
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.kinematics.pose import rotation
from rps_pin.rps.kinematics.tracking import direction_of_legs
from rps_pin.rps.singularity.measures import singularity_measures
from tests import strategies


@pytest.mark.parametrize("largest_tilt", [0.0, 1e-9, 1.0, 3.1])
def test_gains_rates_and_twists_are_the_library_s(largest_tilt: float) -> None:
    rng, least = np.random.default_rng(0), LeastGain()
    for _ in range(10):
        p = strategies.random_parameters(rng)
        h = p.platform_radius
        poses, speeds, _ = strategies.random_motions(rng, p, 40, largest_tilt)
        measures = singularity_measures(p, poses)
        legs = rates.leg_jacobians(p, poses)
        twists = rates.platform_twist(p, poses, speeds).total
        for i, row in enumerate(poses):
            pose = (float(row[0]), float(row[1]), float(row[2]))
            rate = (float(speeds[i, 0]), float(speeds[i, 1]), float(speeds[i, 2]))
            phi = legs.angle[i].tolist()
            coefficient = coefficients(math.fsum(row[1:] ** 2))
            gains = leg_gains(pose, direction_of_legs((phi[0], phi[1], phi[2])), coefficient, h)
            assert least.of(gains) == pytest.approx(measures.type_ii[i], abs=1e-13)
            assert gains.determinant == pytest.approx(measures.determinant[i], abs=1e-13)
            np.testing.assert_allclose(gains.K, legs.length_jacobian[i], rtol=0, atol=1e-13)
            twist = platform_twist(pose, rate, coefficient, h)
            np.testing.assert_allclose(twist, twists[i], rtol=1e-12, atol=1e-12)
            if measures.type_ii[i] > 0.05:
                d1, d2, d3 = (legs.length_jacobian[i] @ speeds[i]).tolist()
                back = pose_rate(gains, (d1, d2, d3))
                np.testing.assert_allclose(back, rate, rtol=0, atol=1e-10 * np.abs(rate).max())
            arms = h * RADIAL @ rotation(row).T
            balls = twists[i, :3] + np.cross(twists[i, 3:], arms)  # v + w x r
            found = np.array(gains.L).T @ rate
            assert found @ found == pytest.approx((balls**2).sum(), rel=1e-10)
            force = rng.normal(size=3)
            f1, f2, f3 = force.tolist()
            power = np.dot(wrench_of_force(gains, (f1, f2, f3)), rate)  # K'f . x' = f . K x'
            assert power == pytest.approx(force @ leg_speed(gains, rate), abs=1e-10)
            if measures.type_ii[i] > 0.05:
                again = force_of_wrench(gains, wrench_of_force(gains, (f1, f2, f3)))
                np.testing.assert_allclose(again, force, rtol=0, atol=1e-10)

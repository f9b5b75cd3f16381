"""Scalar gains against the library's singular values, also where they coincide."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rps_pin.control.exponential_map import coefficients
from rps_pin.control.scalar_rates import LeastGain, leg_gains, platform_twist, pose_rate
from rps_pin.rps import rates
from rps_pin.rps.scalar_tracking import direction_of_legs
from rps_pin.rps.singularity import singularity_measures
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

"""Jacobian of the legs, and the twist, against the library's arrays and the ball joints' speeds."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin.control.estimator.leg_geometry import leg_geometry
from rps_pin.control.estimator.leg_jacobian import (
    LeastSingularValue,
    force_of_wrench,
    leg_jacobian,
    leg_speed,
    pose_rate,
    wrench_of_force,
)
from rps_pin.control.estimator.state_estimate import platform_twist, state_estimate
from rps_pin.rps.kinematics import rates
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.kinematics.pose import rotation
from rps_pin.rps.singularity.measures import singularity_measures
from tests import strategies
from tests.reference import newton_euler as ne


@pytest.mark.parametrize("largest_tilt", [0.0, 1e-9, 1.0, 3.1])
def test_singular_values_rates_and_twists_are_the_library_s(largest_tilt: float) -> None:
    rng, least = np.random.default_rng(0), LeastSingularValue()
    for _ in range(10):
        p = strategies.random_parameters(rng)
        g, h = p.base_radius, p.platform_radius
        poses, speeds, _ = strategies.random_motions(rng, p, 40, largest_tilt)
        measures = singularity_measures(p, poses)
        legs = rates.leg_jacobians(p, poses)
        twists = rates.platform_twist(p, poses, speeds).total
        for i, row in enumerate(poses):
            pose = (float(row[0]), float(row[1]), float(row[2]))
            rate = (float(speeds[i, 0]), float(speeds[i, 1]), float(speeds[i, 2]))
            geometry = leg_geometry(pose, g, h)
            assert geometry is not None
            jacobian = leg_jacobian(geometry, h)
            assert least.of(jacobian) == pytest.approx(measures.type_ii[i], abs=1e-13)
            assert jacobian.determinant == pytest.approx(measures.determinant[i], abs=1e-13)
            np.testing.assert_allclose(jacobian.K, legs.length_jacobian[i], rtol=0, atol=1e-13)
            twist = platform_twist(geometry, rate, h)
            np.testing.assert_allclose(twist, twists[i], rtol=1e-12, atol=1e-12)
            if measures.type_ii[i] > 0.05:
                d1, d2, d3 = (legs.length_jacobian[i] @ speeds[i]).tolist()
                back = pose_rate(jacobian, (d1, d2, d3))
                np.testing.assert_allclose(back, rate, rtol=0, atol=1e-10 * np.abs(rate).max())
                state = state_estimate(geometry.length, geometry.direction, (d1, d2, d3), g, h)
                assert state is not None
                scale = np.abs(twists[i]).max()
                np.testing.assert_allclose(state[1], twists[i], rtol=0, atol=1e-9 * scale)
            arms = h * RADIAL @ rotation(row).T
            balls = twists[i, :3] + np.cross(twists[i, 3:], arms)  # v + w x r
            l_xx, l_yx, l_yy = jacobian.L
            L = np.array([[np.sqrt(3.0), 0.0, 0.0], [0.0, l_xx, 0.0], [0.0, l_yx, l_yy]])
            found = L.T @ rate
            assert found @ found == pytest.approx((balls**2).sum(), rel=1e-10)
            force = rng.normal(size=3)
            f1, f2, f3 = force.tolist()
            power = np.dot(wrench_of_force(jacobian, (f1, f2, f3)), rate)  # K'f . x' = f . K x'
            assert power == pytest.approx(force @ leg_speed(jacobian, rate), abs=1e-10)
            if measures.type_ii[i] > 0.05:
                again = force_of_wrench(jacobian, wrench_of_force(jacobian, (f1, f2, f3)))
                np.testing.assert_allclose(again, force, rtol=0, atol=1e-10)


@pytest.mark.parametrize("largest_tilt", [0.0, 1e-9, 1.0, 3.1, 6.0])
def test_twist_is_the_reference_s(largest_tilt: float) -> None:
    rng = np.random.default_rng(3)
    p = strategies.random_parameters(rng)
    poses, speeds, _ = strategies.random_motions(rng, p, 200, largest_tilt)
    moving = ne.kinematics(p, poses, speeds, np.zeros_like(poses))
    expected = np.concatenate([moving.velocity, moving.angular_velocity], axis=-1)
    for pose, speed, twist in zip(poses.tolist(), speeds.tolist(), expected, strict=True):
        geometry = leg_geometry(tuple(pose), p.base_radius, p.platform_radius)
        assert geometry is not None
        found = platform_twist(geometry, tuple(speed), p.platform_radius)
        np.testing.assert_allclose(found, twist, rtol=1e-12, atol=1e-12)

"""Axes of the ellipsoids of forces and speeds: by the maps of forces and speeds themselves."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import SingularityError
from tests.task.robots import compiled, poses, task
from tests.task.test_parallel_robots import five_bar_with_its_arms_in_line
from tests.worst import worst


@pytest.mark.parametrize(
    "name", ["five_bar", "delta", "stewart", "rrs", "planar_rrr", "ankle", "micro"]
)
def test_axes_are_forces_and_speeds_at_unit_ones_of_the_actuators(name: str) -> None:
    one, rng = task(name), np.random.default_rng(0)
    mechanism, (_, q) = one.mechanism, poses(name, 4)
    scale = mechanism.velocity_scale[mechanism.actuated_indices]
    found = one.ellipsoids(q)
    assert found.forces.shape == found.speeds.shape == (4, one.size, one.size)
    for k, each in enumerate(q):
        K, forces, speeds = one.jacobian(each), found.forces[k], found.speeds[k]
        for axis, rate in zip(forces, speeds, strict=True):
            tau = one.forces_to_actuators(each, axis) * scale
            assert np.linalg.norm(tau) == pytest.approx(1, abs=1e-9)
            assert np.linalg.norm(K @ rate / scale) == pytest.approx(1, abs=1e-9)
        # A force along one axis does no work at a speed along another one.
        assert worst(forces @ speeds.T - np.eye(one.size)) < 1e-9
        # The widths of both in random directions.
        for d in rng.normal(size=(5, one.size)):
            assert np.linalg.norm(forces @ d) == pytest.approx(np.linalg.norm(K @ d / scale))
            inverse = np.linalg.norm(one.forces_to_actuators(each, d) * scale)
            assert np.linalg.norm(speeds @ d) == pytest.approx(inverse)
        sizes = np.linalg.norm(forces / one.scale, axis=-1)
        assert (np.diff(sizes) <= 0).all()
        assert worst(sizes * np.linalg.norm(speeds * one.scale, axis=-1) - 1) < 1e-9


def test_both_engines_have_the_same() -> None:
    _, q = poses("delta", 4)
    for slow, fast in zip(
        task("delta").ellipsoids(q), compiled("delta").ellipsoids(q), strict=True
    ):
        outer = [np.einsum("nij,nik->njk", axes, axes) for axes in (slow, fast)]
        assert worst(outer[0] - outer[1]) < 1e-9 * worst(outer[0])


def test_a_singular_configuration_has_no_ellipsoid_of_speeds() -> None:
    one = task("five_bar")
    q = one.configuration(np.array(five_bar_with_its_arms_in_line()), within_limits=False)
    with pytest.raises(SingularityError, match="no end in some direction"):
        one.ellipsoids(q)

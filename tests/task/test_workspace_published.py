"""Workspaces that others have computed: a published Delta, and Gosselin's geometry of a Stewart."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rps_pin.task.workspace import task_grid, volume, workspace
from rps_pin.task.workspace.reasons import SINGULAR
from tests.reference import stewart
from tests.task import published
from tests.task.robots import compiled


def test_the_published_volume_of_the_surgiscopes_delta_is_met(tmp_path) -> None:
    """1.48 m^3, rounded; by a grid of 0.05 m, in the published limits alone."""
    one = published.surgiscope(tmp_path).compile(functions=("kinematics", "closing"))
    sides = np.arange(-1.3, 1.3001, 0.05)
    over = {"x": sides, "y": sides, "z": np.arange(-1.7, -0.2999, 0.05)}
    found = workspace(one, task_grid(one, over), min_conditioning=0.0)
    assert not (found.mask(SINGULAR) & (found.stroke_left > 0)).any()
    size = volume(found)
    assert not size.cut  # the height does not bind
    assert abs(size.value - published.VOLUME) < 0.005 + 2 * size.error
    assert size.error < 0.02 * size.value


@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0), (0.15, -0.1, 0.2)])
def test_a_stewart_platform_has_the_volume_of_gosselins_annuli(rotation) -> None:
    one = compiled("stewart")
    turned = Rotation.from_rotvec(rotation).apply(stewart.BALLS)
    low, high = np.array([-0.8, -0.8, 0.3]), np.array([0.8, 0.8, 1.0])
    held = dict(zip(("rx", "ry", "rz"), rotation, strict=True))
    names = "x", "y", "z"
    axes = {n: np.linspace(a, b, 45) for n, a, b in zip(names, low, high, strict=True)}
    found = workspace(one, task_grid(one, axes, held))
    legs = [n for n in found.reasons if "rod_joint" in n]
    inside = ~np.any([found.mask(n) for n in legs], axis=0)
    assert np.array_equal(inside, found.inside)  # nothing else ends it there
    size = volume(found)
    centres = np.array(stewart.ANCHORS) - turned
    exact = published.volume_of_shells(centres, (0.45, 0.95), (low[2], high[2]), 200)
    assert abs(size.value - exact) < 2 * size.error
    assert size.least < exact < size.most
    assert size.error < 0.02 * exact


def test_areas_of_annuli_are_those_of_random_points() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        centres, outer = rng.normal(size=(4, 2)) * 0.3, rng.uniform(0.7, 1.2, 4)
        inner = rng.uniform(0.0, 0.6, 4) * (rng.uniform(size=4) > 0.3)
        points = rng.uniform(-2, 2, (40_000, 2))
        away = np.linalg.norm(points[:, None] - centres, axis=-1)
        share = ((away >= inner) & (away <= outer)).all(axis=-1).mean()
        deviation = 16 * np.sqrt(share * (1 - share) / len(points))
        assert abs(published.area_of_annuli(centres, inner, outer) - 16 * share) < 5 * deviation

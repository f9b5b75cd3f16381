"""Volumes of workspaces against random points in closed forms, and of bodies that have formulas."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from rps_pin import InputError
from rps_pin.arrays import Array
from rps_pin.task.workspace import task_grid, volume, workspace
from tests.task.robots import compiled
from tests.task.workspaces import conditioning, delta_arms, five_bar, of_body, stewart_legs

COUNT = 100_000


def random_axis(rng: np.random.Generator, count: int) -> Array:
    """From below -1.3 to above 1.3, somewhat uneven."""
    steps = 1 + 0.3 * rng.uniform(size=count)
    places = np.cumsum(steps) / steps.sum()
    return -1.35 - 0.2 * rng.uniform() + 3.1 * places


@pytest.mark.parametrize("dimensions", [2, 3, 4])
def test_balls_and_boxes_have_their_volumes_within_error_and_bounds(dimensions: int) -> None:
    """Balls of radius 1, boxes along the axes (whose faces all err one way), boxes turned by 45."""
    rng = np.random.default_rng(dimensions)
    ball = math.pi ** (dimensions / 2) / math.gamma(dimensions / 2 + 1)
    ratios, scale = [], [(2, 40), (3, 24), (4, 12)][dimensions - 2][1]
    for k, kind in product(range(20), ("ball", "box", "turned")):
        axes = tuple(random_axis(rng, scale + k % 5) for _ in range(dimensions))
        middle = rng.uniform(-0.1, 0.1, dimensions)

        def inside(points: Array, kind=kind, middle=middle):
            d = points - middle
            if kind == "ball":
                return np.linalg.norm(d, axis=-1) < 1
            if kind == "turned":
                first = (d[..., 0] + d[..., 1]) / np.sqrt(2), (d[..., 0] - d[..., 1]) / np.sqrt(2)
                d = np.concatenate([np.stack(first, axis=-1), d[..., 2:]], axis=-1)
            return (np.abs(d) < 0.7).all(axis=-1)

        true = ball if kind == "ball" else 1.4**dimensions
        found = volume(of_body(axes, inside))
        assert found.least <= true <= found.most
        assert found.least < found.value < found.most
        assert not found.cut
        ratios.append(abs(found.value - true) / found.error)
        assert found.error < 0.25 * true
    assert np.quantile(ratios, 0.95) < 2
    assert max(ratios) < 4
    assert np.median(ratios) > 0.05  # an error that is no idle bound


def test_units_and_ends_of_the_grid() -> None:
    axes = (
        np.linspace(0, 1, 5),
        np.linspace(-2, 2, 9),
        np.linspace(-2, 2, 9),
        np.linspace(-2, 2, 9),
    )
    found = volume(of_body(axes, lambda points: np.linalg.norm(points, axis=-1) < 1))
    assert found.unit == "m^3 rad"
    assert found.cut == ("x below",)
    whole = volume(of_body(axes, lambda points: points[..., 0] >= 0))
    assert whole.value == pytest.approx(64.0, rel=1e-14)
    assert whole[:4] == pytest.approx((64.0, 0.0, 64.0, 64.0), rel=1e-14, abs=1e-12)
    assert volume(of_body(axes[:2], lambda points: points[..., 0] > -1)).unit == "m^2"
    with pytest.raises(InputError, match="a volume needs 2 points along each axis"):
        volume(of_body((axes[0][:1], axes[1]), lambda points: points[..., 0] > -1))


def shares_of_points(inside, low: Array, high: Array, seed: int) -> tuple[float, float]:
    """Volume by random points in a box, and its standard deviation."""
    points = np.random.default_rng(seed).uniform(low, high, (COUNT, len(low)))
    share, box = float(np.mean(inside(points))), float(np.prod(high - low))
    return box * share, box * math.sqrt(share * (1 - share) / COUNT)


def of_five_bar(points: Array):
    found = five_bar(points)
    measure, side = conditioning(found.gain, 1.0)
    return found.exists & (measure >= 1e-3) & (side == HOME_SIDES["five_bar"])


def of_delta(points: Array):
    found = delta_arms(points)
    measure, side = conditioning(found.gain, 1.0)
    a = np.nan_to_num(found.actuators, nan=9.0)
    kept = ((a >= -1.2) & (a <= 1.5)).all(axis=-1)
    return found.exists & kept & (measure >= 1e-3) & (side == HOME_SIDES["delta"])


def of_stewart(points: Array):
    legs = stewart_legs(points, np.zeros(3))
    return ((legs >= 0.45) & (legs <= 0.95)).all(axis=-1)


#: Signs of the determinants at home.
HOME_SIDES = {"five_bar": -1.0, "delta": -1.0}


@pytest.mark.parametrize(
    ("name", "inside", "low", "high", "points"),
    [
        ("five_bar", of_five_bar, (-0.8, -0.8), (0.9, 0.9), 201),
        ("delta", of_delta, (-0.6, -0.6, -0.95), (0.6, 0.6, -0.1), 35),
        ("stewart", of_stewart, (-0.75, -0.75, 0.3), (0.75, 0.75, 1.0), 31),
    ],
)
def test_volumes_are_those_of_random_points_in_closed_form(name, inside, low, high, points) -> None:
    """Of the Stewart platform: where six spherical shells overlap; its other limits are wide."""
    one, low, high = compiled(name), np.array(low), np.array(high)
    names = [c for c in one.coordinates if not c.startswith("r")]
    axes = {c: np.linspace(a, b, points) for c, a, b in zip(names, low, high, strict=True)}
    found = volume(workspace(one, task_grid(one, axes)))
    wanted, deviation = shares_of_points(inside, low, high, seed=1)
    assert abs(found.value - wanted) < 2 * found.error + 4 * deviation
    assert found.error < 0.03 * wanted
    assert deviation < 0.01 * wanted
    assert found.least - 4 * deviation < wanted < found.most + 4 * deviation
    assert found.cut == (("z below",) if name == "stewart" else ())

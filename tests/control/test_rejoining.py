"""The way back to a target: smooth at both ends, and as slow as is asked for."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from rps_pin.control.loop.rejoining import SHORTEST, Rejoining, rejoining_time

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("_", range(20))
def test_it_is_the_polynomial_of_degree_five_between_its_ends(_: int) -> None:
    """Whose six coefficients follow from six conditions, by a linear solve."""
    start, duration = RNG.normal(size=(3, 3)), RNG.uniform(0.1, 3.0)
    power = np.arange(6)
    ends = np.array(
        [
            *(Polynomial.basis(k).deriv(d)(0.0) for k in power for d in range(3)),
            *(Polynomial.basis(k).deriv(d)(duration) for k in power for d in range(3)),
        ]
    )
    rows = np.vstack([ends[:18].reshape(6, 3).T, ends[18:].reshape(6, 3).T])
    coefficients = np.linalg.solve(rows, np.vstack([start, np.zeros((3, 3))]))
    back = Rejoining(*map(tuple, start), duration)  # type: ignore[arg-type]
    time = 0.0
    for step in RNG.uniform(0.0, duration / 4, size=4):
        time += step
        found = back.after(step)
        assert found is not None
        for axis in range(3):
            wanted = Polynomial(coefficients[:, axis])
            for order in range(3):
                value = found[order][axis]
                scale = 1.0 + np.abs(start).max() / duration**2
                assert value == pytest.approx(wanted.deriv(order)(time), abs=1e-10 * scale)
    assert back.left == pytest.approx(duration - time)
    assert back.after(duration) is None
    assert back.left == 0.0


def test_half_the_speed_is_left() -> None:
    assert rejoining_time(0.0, 0.2) == SHORTEST
    assert rejoining_time(1.0, np.inf) == SHORTEST
    way, limit = 0.08, 0.2
    back = Rejoining((way, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3, rejoining_time(way, limit))
    speeds = []
    while (found := back.after(1e-4)) is not None:
        speeds.append(abs(found[1][0]))
    assert max(speeds) == pytest.approx(limit / 2, rel=1e-6)

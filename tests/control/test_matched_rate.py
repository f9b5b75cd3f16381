"""The target's rate is filtered as measured speeds are."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin.control.loop.matched_rate import MatchedRate
from rps_pin.control.loop.speed_filter import SpeedFilter


@pytest.mark.parametrize("cut_off", [5.0, 50.0, np.inf])
def test_of_a_parabola_it_is_what_the_filter_makes_of_positions(cut_off: float) -> None:
    """The mean of two rates is the difference of positions, exactly while rates are straight."""
    rng = np.random.default_rng(0)
    pull = rng.normal(size=3)
    rates, positions = MatchedRate(cut_off), SpeedFilter(cut_off)
    t = 0.0
    rates.after((0.0, 0.0, 0.0), 1e-3)
    positions.follow((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for step in rng.uniform(2e-4, 2e-3, 300):
        t += step
        x1, x2, x3 = (pull * t**2 / 2).tolist()
        v1, v2, v3 = (pull * t).tolist()
        found = rates.after((v1, v2, v3), step)
        expected = positions.after((x1, x2, x3), step)
        positions.follow((x1, x2, x3), expected)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(pull).max())
    assert np.abs(found).max() > 0
    rates.reset()
    assert rates.after((0.0, 0.0, 0.0), 1e-3) == (0.0, 0.0, 0.0)

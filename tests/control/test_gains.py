"""Gains: poles where they were placed, shapes, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rps_pin import InputError
from rps_pin.control import Gains


@given(st.floats(0.1, 200), st.floats(0.2, 3), st.floats(0.01, 0.9))
def test_placed_gains_have_the_poles_asked_for(hertz: float, damping: float, share: float) -> None:
    w = 2 * np.pi * hertz
    gains = Gains.placed(hertz, damping=damping)
    kp, kd, ki = (row[0] for row in gains.rows)
    assert ki == 0
    np.testing.assert_allclose(
        np.poly(np.roots([1, kd, kp])), [1, 2 * damping * w, w**2], rtol=1e-9
    )
    kp, kd, ki = (row[1] for row in Gains.placed(hertz, damping=damping, integral=share).rows)
    stable = (np.roots([1, kd, kp, ki]).real < 0).all()
    # Routh: s^3 + kd s^2 + kp s + ki is stable if kd kp > ki, so while share < 2 damping.
    if abs(share - 2 * damping) > 1e-6:
        assert stable == (share < 2 * damping)


def test_gains_are_three_numbers_each_and_fixed() -> None:
    gains = Gains(1.0, [2.0, 3.0, 4.0], 4.0)
    assert gains.rows == ((1.0, 1.0, 1.0), (2.0, 3.0, 4.0), (4.0, 4.0, 4.0))
    assert gains.tracking_time[0] == pytest.approx(np.sqrt(0.5))
    assert Gains(1.0, 0.0).tracking_time == (np.inf,) * 3
    with pytest.raises(ValueError, match="read-only"):
        np.asarray(gains.proportional)[0] = 2.0
    twice = gains.times([1.0, 2.0, 3.0])
    assert twice.rows[1] == (2.0, 6.0, 12.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((-1.0, 1.0), "gain proportional"),
        ((1.0, np.nan), "gain derivative"),
        (([1.0, 2.0, 3.0], [1.0, 2.0]), "shape"),
        (([[1.0]], 2.0), "shape"),
        ((1.0, 0.0, 1.0), "needs a derivative"),
        (("x", 0.0), "gain proportional"),
    ],
)
def test_nonsense_is_refused(arguments: tuple[object, ...], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Gains(*arguments)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="bandwidth"):
        Gains.placed(0.0)

"""The scalar coefficients against the library's arrays, SciPy and central differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rps_pin.control.estimator.exponential_map import coefficients
from rps_pin.rps.kernels.tilt_functions import tilt_functions

SQUARES = [0.0, 1e-300, 1e-12, 1e-3, 0.3, 1 - 1e-15, 1.0, 1.5, 4.0, math.pi**2, 30.0]


@pytest.mark.parametrize("s", SQUARES)
def test_coefficients_and_slopes_are_those_of_the_library(s: float) -> None:
    a, b, c, d, a_s, b_s, d_s, a_ss, b_ss = coefficients(s)
    kernel = tilt_functions(s)
    np.testing.assert_allclose((a, b, c, d, a_s, b_s, d_s, a_ss, b_ss), kernel, rtol=1e-12)
    assert c == pytest.approx(math.cos(math.sqrt(s)), abs=1e-15)
    assert a_s == pytest.approx((d - b) / 2, rel=1e-13)
    assert a_ss == pytest.approx((d_s - b_s) / 2, rel=1e-12)


@pytest.mark.parametrize("s", [0.2, 0.9, 1.1, 5.0])
def test_slopes_are_central_differences(s: float) -> None:
    step = 1e-5
    low, mid, high = (np.array(coefficients(s + k * step)) for k in (-1, 0, 1))
    first = (high - low) / (2 * step)
    np.testing.assert_allclose(first[[0, 1, 3]], mid[[4, 5, 6]], rtol=1e-8)
    np.testing.assert_allclose(first[[4, 5]], mid[[7, 8]], rtol=1e-8)

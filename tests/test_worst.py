"""`worst` sees NaN wherever it stands, and does not call nothing a small error."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import ArrayLike

from tests.worst import worst


def test_the_largest_of_numbers_and_arrays() -> None:
    assert worst(1.0, [[-3.0, 2.0]], np.float64(0.5)) == 3.0


@pytest.mark.parametrize(
    "errors", [(0.0, math.nan), (math.nan, 0.0), ([1.0, math.nan], 5.0), (), ([],)]
)
def test_nan_and_nothing_are_no_small_error(errors: tuple[ArrayLike, ...]) -> None:
    found = worst(*errors)
    assert math.isnan(found)
    assert not found < 1.0

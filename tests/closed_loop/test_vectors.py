"""Vectors from outside."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import InputError
from rps_pin.closed_loop.vectors import checked_vector


def test_arrays_of_floats_pass_uncopied() -> None:
    vector = np.array([1.0, 2.0])
    assert checked_vector(vector, 2, "q") is vector


@pytest.mark.parametrize("value", [[1, 2], (1.0, 2.0), np.array([1, 2]), np.float32([1, 2])])
def test_other_numbers_become_floats(value: object) -> None:
    found = checked_vector(value, 2, "q")
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, [1.0, 2.0])


@pytest.mark.parametrize("shape", [(), (1,), (3,), (1, 2), (2, 1), (0,)])
def test_wrong_shapes_are_told(shape: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match=r"^q has shape .*; it must be ") as caught:
        checked_vector(np.zeros(shape), 2, "q")
    assert f"has shape {shape}; it must be (2,)" in str(caught.value)


@pytest.mark.parametrize("value", ["ab", ["a", "b"], [[1], [1, 2]], [1j, 2], {}])
def test_things_that_are_no_numbers_are_told(value: object) -> None:
    with pytest.raises(InputError, match=r"^q must be 2 numbers"):
        checked_vector(value, 2, "q")


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_first_entry_that_is_not_finite_is_told(bad: float) -> None:
    with pytest.raises(InputError, match=f"q is not finite: entry 1 is {bad}"):
        checked_vector([0.0, bad, bad], 3, "q")

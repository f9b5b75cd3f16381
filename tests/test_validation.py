"""Arguments from callers."""

from __future__ import annotations

import math
import re
from fractions import Fraction

import numpy as np
import pytest

from rps_pin import InputError
from rps_pin.validation import (
    LARGEST,
    choice,
    finite_number,
    fixed_array,
    inertia_fault,
    non_negative_number,
    one_shape,
    positive_number,
    read_only,
    real,
    real_array,
    real_vector,
    whole_number,
)
from tests.each import each


def test_arrays_of_floats_pass_uncopied() -> None:
    vector = np.array([1.0, 2.0])
    assert real_vector(vector, 2, "q") is vector
    assert real_array(vector, "q") is vector


@pytest.mark.parametrize("value", [[1, 2], (1.0, 2.0), np.array([1, 2]), np.float32([1, 2])])
def test_other_numbers_become_floats(value: object) -> None:
    for found in (real_vector(value, 2, "q"), real_array(value, "q", (2,))):
        assert found.dtype == np.float64
        np.testing.assert_array_equal(found, [1.0, 2.0])


@pytest.mark.parametrize("shape", [(), (1,), (3,), (1, 2), (2, 1), (0,)])
def test_wrong_shapes_are_told(shape: tuple[int, ...]) -> None:
    with pytest.raises(InputError) as caught:
        real_vector(np.zeros(shape), 2, "q")
    assert str(caught.value) == f"q has shape {shape}; it must be (2,)"


@pytest.mark.parametrize("value", ["ab", ["a", "b"], [[1], [1, 2]], [1j, 2], {}, [True, False]])
def test_values_that_are_not_numbers_are_told(value: object) -> None:
    with pytest.raises(InputError, match=r"^q = .*: it must be 2 numbers"):
        real_vector(value, 2, "q")
    with pytest.raises(
        InputError, match=r"^q = .*: it must be numbers of shape \(\.\.\., 2\): x, y"
    ):
        real_array(value, "q", (2,), "x, y")


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_first_entry_that_is_not_finite_is_told(bad: float) -> None:
    with pytest.raises(InputError, match=f"q is not finite: entry 1 is {bad}"):
        real_vector([0.0, bad, bad], 3, "q")
    with pytest.raises(InputError, match=rf"q is not finite: entry \(0, 1\) is {bad}"):
        real_array([[0.0, bad], [bad, 0.0]], "q", (2,))
    with pytest.raises(InputError, match=f"q is not finite: it is {bad}"):
        real_array(bad, "q")


def test_only_the_last_dimensions_are_told() -> None:
    assert real_array(np.zeros((4, 5, 3)), "pose", (3,)).shape == (4, 5, 3)
    for shape in ((), (4,), (3, 4)):
        with pytest.raises(InputError) as caught:
            real_array(np.zeros(shape), "pose", (3,))
        assert str(caught.value) == f"pose has shape {shape}; it must be (..., 3)"


def test_real_numbers() -> None:
    assert real(2) == real(2.0) == real(np.float32(2)) == real(np.int8(2)) == real(Fraction(4, 2))
    for other in (True, np.True_, "2", None, [2.0], 2j, 10**400):
        assert math.isnan(real(other))


def test_numbers_in_their_range() -> None:
    wrong = {
        finite_number: (math.nan, math.inf, 2 * LARGEST, -2 * LARGEST, True, "1", None),
        positive_number: (0.0, -1.0, math.nan, math.inf, True, "1", None),
        non_negative_number: (-1e-300, math.nan, math.inf, True, "1", None),
    }
    right = {finite_number: (-1.0, 0, LARGEST), positive_number: (1,), non_negative_number: (0, 2)}
    for check, values in wrong.items():
        for value in values:
            with pytest.raises(InputError, match=r"^force = .*: it must be a .* of N, "):
                check(value, "force", "N")
        for value in right[check]:
            found = check(value, "force")
            assert found == value
            assert type(found) is float


def test_whole_numbers_and_choices() -> None:
    assert whole_number(np.int64(3), "count") == 3
    assert whole_number(0, "count", least=0) == 0
    for value in (0, 2.0, True, "3", None):
        with pytest.raises(InputError, match=r"count = .*whole number, at least 1"):
            whole_number(value, "count")
    assert choice("b", "side", ("a", "b")) == "b"
    for value in ("c", None, 1):
        with pytest.raises(InputError, match=r"side = .*: it must be 'a' or 'b'"):
            choice(value, "side", ("a", "b"))


def test_shapes_that_go_together() -> None:
    one, other = one_shape(a=np.zeros((4, 1)), b=np.zeros(3))
    assert one.shape == other.shape == (4, 3)
    with pytest.raises(InputError, match=r"a \(4,\), b \(3,\)"):
        one_shape(a=np.zeros(4), b=np.zeros(3))


def test_read_only_copies() -> None:
    given = np.zeros(2)
    kept = read_only(given)
    given[0] = 1.0
    assert kept[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 1.0


def test_a_fixed_array_is_a_read_only_copy() -> None:
    given = np.array([0.2, 0.1, -0.1])
    pose = fixed_array(given, "start", (3,))
    given[:] = 9
    np.testing.assert_array_equal(pose, [0.2, 0.1, -0.1])
    with pytest.raises(ValueError, match="read-only"):
        pose[0] = 1
    assert fixed_array([1, 0, 0], "start", (3,)).dtype == np.float64
    np.testing.assert_array_equal(fixed_array([1e50, -1e50], "x", (None,)), [1e50, -1e50])


@each(
    ("bad", "message"),
    [
        ([0.2, 0.1], r"start has shape \(2,\); it must be \(3,\): z, tilt_x, tilt_y"),
        ([[0.2, 0.1, 0.0]], r"start has shape \(1, 3\); it must be \(3,\)"),
        (0.2, r"start has shape \(\); it must be \(3,\)"),
        ([0.2, np.nan, 0.0], r"start is not finite: entry 1 is nan"),
        ([0.2, 0.0, -np.inf], r"entry 2 is -inf"),
        ([0.2, 0.0, 1e60], r"start is beyond 1e\+50: entry 2 is 1e\+60"),
        ("abc", "start = 'abc': it must be numbers of shape"),
        (["0.2", "0", "0"], "start = .*: it must be numbers of shape"),
        ([0.2, [0.1], 0.0], "start = .*: it must be numbers of shape"),
        ([True, False, False], "start = .*: it must be numbers of shape"),
        ([0.2, True, 0.0], "start = .*: it must be numbers of shape"),
        ([0.2, 1j, 0], "start = .*: it must be numbers of shape"),
        (None, "start = None: it must be numbers of shape"),
    ],
)
def test_other_shapes_and_values_are_refused(bad: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        fixed_array(bad, "start", (3,), "z, tilt_x, tilt_y")


def test_rigid_bodies_have_their_inertia() -> None:
    """Point masses make up any body; the inertia of each set is accepted."""
    rng = np.random.default_rng(5)
    for count in (0, 1, 2, 3, 10):
        points = rng.normal(size=(count, 3))
        inertia = sum((np.eye(3) * (p @ p) - np.outer(p, p) for p in points), np.zeros((3, 3)))
        assert inertia_fault(inertia) == ""
    for bad, fault in (
        (np.diag([1.0, 1.0, 2.1]), r"principal moments are 1, 1 and 2.1 .* exceed"),
        (np.diag([-0.1, 1.0, 1.0]), r"principal moments are -0.1, 1 and 1 .* negative"),
        (np.eye(3, k=1) + np.eye(3), "must be symmetric"),
    ):
        assert re.search(fault, inertia_fault(bad))
    assert inertia_fault(np.diag([1.0, 1.0, 2.1]), rounding=0.1) == ""

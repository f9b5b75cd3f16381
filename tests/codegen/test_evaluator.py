"""CasADi functions over floats, complex numbers, intervals and slopes, against CasADi's numbers."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.codegen.evaluator import Evaluator
from rps_pin.errors import InputError
from rps_pin.numerics.intervals import Enclosure, Interval
from tests.codegen.machine import every_operation, random_function, reference
from tests.worst import worst


def batch(evaluate: Evaluator, *inputs: np.ndarray) -> list[np.ndarray]:
    """Return the outputs (entries, n) of samples (n, ...)."""
    flat = [one.reshape(len(one), -1).T for one in inputs]
    found = evaluate(*flat)
    return [np.array([np.broadcast_to(e, len(inputs[0])) for e in one]) for one in found]


def test_every_operation_over_arrays() -> None:
    function = every_operation()
    x, y = np.random.default_rng(0).uniform(0.05, 0.95, (2, 64, 4))
    (found,) = batch(Evaluator(function), x, y)
    (expected,) = reference(function, x, y)
    assert worst((found.T - expected) / np.maximum(1e-300, np.abs(expected))) < 2e-15


def smooth_function() -> ca.Function:
    """Return a function of the operations that complex numbers and slopes have."""
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    a = ca.sin(x[0] * y[0]) + ca.cos(x[1]) / (2 + y[1] ** 2)
    b = ca.sqrt(1 + ca.sumsqr(x)) * ca.exp(-y[0]) - ca.atan(x[2])
    c = ca.tan(x[0] / 4) + 1 / (3 + a) + 2 * b + ca.fabs(4 + x[1]) + x[2] ** 3
    matrix = ca.SX(2, 3)
    matrix[0, 1], matrix[1, 2], matrix[1, 0] = a, b * c, 7.0
    return ca.Function("smooth", [x, y], [ca.vertcat(a, b, c), matrix])


def test_random_functions_and_matrices() -> None:
    rng = np.random.default_rng(1)
    function = random_function(rng, 400)
    x, y = rng.standard_normal((13, 5)), rng.standard_normal((13, 3, 2))
    for found, expected in zip(
        batch(Evaluator(function), x, y), reference(function, x, y), strict=True
    ):
        assert worst(found.T - expected.reshape(13, -1)) < 1e-14


def test_complex_numbers_carry_derivatives() -> None:
    function, rng = smooth_function(), np.random.default_rng(2)
    x, y = rng.uniform(-1, 1, (9, 3)), rng.uniform(-1, 1, (9, 2))
    sx = function.sx_in()
    slopes = ca.Function("slopes", sx, [ca.jacobian(function(*sx)[0], sx[0])])
    (expected,) = reference(slopes, x, y)
    for k in range(3):
        found, _ = batch(Evaluator(function), x + 1e-30j * np.eye(3)[k], y)
        assert worst(found.imag.T / 1e-30 - expected[:, :, k]) < 1e-14


def test_intervals_hold_the_numbers_of_their_members() -> None:
    rng = np.random.default_rng(3)
    for function in (smooth_function(), random_function(rng, 60)):
        sizes = [function.numel_in(i) for i in range(2)]
        for width in (0.0, 1e-6, 0.3):
            low = [rng.uniform(-1, 1, (size, 200)) for size in sizes]
            boxes = [Interval(one, one + width) for one in low]
            # tanh has no version for intervals: random functions with it are refused
            try:
                found = Evaluator(function)(*boxes)
            except InputError as error:
                assert "OP_TANH" in str(error)
                continue
            members = [one + width * rng.uniform(0, 1, one.shape) for one in low]
            shapes = [(200, *function.size_in(i)) for i in range(2)]
            given = [one.T.reshape(shape) for one, shape in zip(members, shapes, strict=True)]
            given = [one[..., 0] if one.shape[-1] == 1 else one for one in given]
            for outputs, expected in zip(found, reference(function, *given), strict=True):
                for value, right in zip(outputs, expected.reshape(200, -1).T, strict=True):
                    held = value if isinstance(value, Interval) else Interval(value)
                    slack = 1e-14 * (1 + np.abs(right))  # of casadi's own rounding
                    assert (held.lower <= right + slack).all()
                    assert (held.upper >= right - slack).all()
                    if width == 0.0:
                        assert worst(held.upper - held.lower) < 1e-11


def test_enclosures_hold_the_slopes() -> None:
    function, rng = smooth_function(), np.random.default_rng(4)
    low = rng.uniform(-1, 1, (5, 300))
    box = Interval(low, low + 0.1)
    coordinates = Enclosure.coordinates(box)
    found = Evaluator(function)(coordinates[:3], coordinates[3:])[0]
    sx = function.sx_in()
    slopes = ca.Function("slopes", sx, [ca.jacobian(function(*sx)[0], ca.vertcat(*sx))])
    member = low + 0.1 * rng.uniform(0, 1, low.shape)
    (expected,) = reference(slopes, member[:3].T, member[3:].T)
    for i, one in enumerate(found):
        for k in range(5):
            assert (one.slopes[k].lower <= expected[:, i, k] + 1e-13).all()
            assert (one.slopes[k].upper >= expected[:, i, k] - 1e-13).all()


def test_the_gaps_of_a_mechanism() -> None:
    """Quaternions, distances and angles: over floats, and over boxes of their size."""
    function = ClosedLoopModel.load("urdf/stewart.yaml").to_casadi().gaps
    evaluate, rng = Evaluator(function), np.random.default_rng(5)
    q = rng.uniform(-1, 1, (20, function.numel_in(0)))
    (expected,) = reference(function, q)
    (found,) = batch(evaluate, q)
    assert worst(found.T - expected) < 1e-14
    (boxes,) = evaluate(Interval(q.T - 1e-9, q.T + 1e-9))
    for one, right in zip(boxes, expected.T, strict=True):
        assert (one.lower <= right).all()
        assert (one.upper >= right).all()
        assert worst(one.upper - one.lower) < 1e-6


def test_what_cannot_be_evaluated_is_refused() -> None:
    x = ca.SX.sym("x")
    box = Interval(np.zeros(2), np.ones(2))
    with pytest.raises(InputError, match="OP_TANH, which intervals have not"):
        Evaluator(ca.Function("f", [x], [ca.tanh(x)]))([box])
    with pytest.raises(InputError, match="OP_FMAX, which has no slopes"):
        Evaluator(ca.Function("f", [x], [ca.fmax(x, 0)]))(
            [Enclosure(box, Interval(np.ones((1, 2))))]
        )
    with pytest.raises(InputError, match="takes 1 arguments, not 2"):
        Evaluator(ca.Function("f", [x], [x]))([box], [box])

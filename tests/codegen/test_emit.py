"""C text of SX functions computes what casadi computes, and compilers find nothing to warn of."""

from __future__ import annotations

import platform
import re
import subprocess
import time
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from rps_pin.codegen.emit import OPERATIONS, constant, emit, listing
from rps_pin.codegen.units import Kernel, Unit
from rps_pin.errors import InputError
from tests.codegen.machine import (
    COMPILERS,
    STRICT,
    compiled,
    every_operation,
    loaded,
    random_function,
    reference,
)
from tests.quick import quick
from tests.worst import worst


def unit_of(*functions: ca.Function, chunk: int = 500) -> Unit:
    kernels = tuple(Kernel(one, chunk) for one in functions)
    return Unit("robot", kernels, entries=tuple(one.name for one in kernels))


def test_every_operation_is_tried() -> None:
    assert set(listing(every_operation()).names) >= set(OPERATIONS)


def test_every_operation_in_scalars_and_lanes(tmp_path: Path) -> None:
    """Scalars are casadi's numbers, as both call the C library; lanes have their own sine."""
    function = every_operation()
    f = loaded(unit_of(function), tmp_path)["every"]
    x, y = np.random.default_rng(0).uniform(0.05, 0.95, (2, 64, 4))
    (expected,) = reference(function, x, y)
    scalar = np.array([f(*sample)[0] for sample in zip(x, y, strict=True)])
    z, status = f(x, y)
    assert not status.any()
    assert worst((scalar - expected) / np.maximum(1e-300, np.abs(expected))) < 3e-16
    assert worst((z - expected) / np.maximum(1e-300, np.abs(expected))) < 1e-15


@pytest.mark.skipif(platform.machine() != "x86_64", reason="widths of x86-64")
@pytest.mark.parametrize("march", ["x86-64", "x86-64-v3"])
@pytest.mark.parametrize("flags", [(), ("-DNO_MVEC",)])
def test_two_and_four_lanes(march: str, flags: tuple[str, ...], tmp_path: Path) -> None:
    """And with the sines of the C library where its vectors' are not wanted."""
    function = every_operation()
    f = loaded(unit_of(function), tmp_path, [f"-march={march}", *flags])["every"]
    x, y = np.random.default_rng(0).uniform(0.05, 0.95, (2, 19, 4))
    (expected,) = reference(function, x, y)
    error = worst((f(x, y)[0] - expected) / np.maximum(1e-300, np.abs(expected)))
    assert error == 0 if flags else error < 1e-15


@pytest.mark.parametrize("chunk", quick([500, 37, 4], [37]))
def test_random_functions_in_chunks(chunk: int, tmp_path: Path) -> None:
    """Large and small chunks, sparse outputs, matrices."""
    rng = np.random.default_rng(1)
    function = random_function(rng, 400)
    f = loaded(unit_of(function, chunk=chunk), tmp_path)["drawn"]
    x, y = rng.standard_normal((13, 5)), rng.standard_normal((13, 3, 2))
    expected = reference(function, x, y)
    assert expected[1][0, 1, 3] == 2.5
    for k in range(13):
        *outputs, status = f(x[k], y[k])
        assert status == 0
        for value, right in zip(outputs, expected, strict=True):
            assert worst(value - right[k]) < 1e-14
    *outputs, _ = f(x, y)
    for value, right in zip(outputs, expected, strict=True):
        assert worst(value - right) < 1e-13


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("chunk", [500, 20])
def test_no_warning_in_c99(compiler: str, real: str, chunk: int, tmp_path: Path) -> None:
    unused = ca.SX.sym("u", 3)
    empty = ca.Function("nothing", [unused, ca.SX(0, 1)], [ca.SX(0, 1), ca.SX(4, 9), unused[1]])
    functions = [every_operation(), random_function(np.random.default_rng(2), 200), empty]
    text = unit_of(*functions, chunk=chunk).c99(real)
    source = tmp_path / "unit.c"
    source.write_text(text, "utf-8")
    run = subprocess.run(
        [compiler, *STRICT, "-c", str(source), "-o", str(tmp_path / "unit.o")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stderr) == (0, "")


def test_text_is_the_same_each_time() -> None:
    first, second = (
        emit(random_function(np.random.default_rng(3), 900), chunk=100) for _ in range(2)
    )
    assert first == second


def test_sines_stand_beside_cosines_and_nothing_is_computed_twice() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    late = ca.sin(x) * y + ca.sin(y)
    function = ca.Function("f", [x, y], [ca.vertcat(late, late / ca.cos(x), y * ca.sin(x), x)])
    lines = [line.strip() for line in emit(function).splitlines()]
    at = next(k for k, line in enumerate(lines) if "SIN(v0)" in line or "SIN(v1)" in line)
    calls = [re.search(r"(SIN|COS)\((v\d+)\)", lines[at + k]) for k in range(2)]
    assert calls[0] and calls[1]
    assert calls[0][2] == calls[1][2]
    assert sum("SIN(" in line for line in lines) == 2
    assert sum(" * " in line for line in lines) == 1
    assert sum("= x0[0]" in line for line in lines) == 1


def test_a_value_is_divided_by_once() -> None:
    """Products with 1 / x come from casadi as quotients by x; they share one reciprocal."""
    x, y = ca.SX.sym("x", 4), ca.SX.sym("y")
    inverse = 1 / y
    shared = ca.Function("f", [x, y], [inverse * x, ca.sin(inverse), x[0] / x[1]])
    found = listing(shared)
    names = [found.names[step] for step in found.steps if isinstance(step, int)]
    assert (names.count("INV"), names.count("DIV"), names.count("MUL")) == (1, 1, 4)
    computed: set[int] = set()
    for step in found.steps:
        assert all(k in computed or found.names[k] == "INPUT" for k in found.needs(step))
        computed.update([step] if isinstance(step, int) else [])
    later = ca.Function("f", [x, y], [x[0] / y, x[1] / y, inverse])
    found = listing(later)
    names = [found.names[step] for step in found.steps if isinstance(step, int)]
    assert sorted(names) == ["INV", "MUL", "MUL"]


def test_constants_come_back_exactly(tmp_path: Path) -> None:
    numbers = [0.1, 0.0, 1e-320, -1.7976931348623157e308, 1 / 3, 5.0, np.inf, -np.inf]
    x = ca.SX.sym("x")
    function = ca.Function("numbers", [x], [ca.vertcat(*numbers, x)])
    f = loaded(unit_of(function), tmp_path)["numbers"]
    for values in (f(np.ones(1))[0], f(np.ones((3, 1)))[0][1]):
        np.testing.assert_array_equal(values[:-1], numbers)
        np.testing.assert_array_equal(np.signbit(values[:-1]), np.signbit(numbers))
    assert constant(float("nan")) == "CONST(NAN)"
    assert constant(-0.0) == "(-CONST(0.0))"


def test_float_is_as_near_as_floats_are(tmp_path: Path) -> None:
    import ctypes

    function = every_operation()
    library = ctypes.CDLL(str(compiled(unit_of(function).c99("float"), tmp_path)))
    x, y = np.random.default_rng(4).uniform(0.05, 0.95, (2, 30, 4)).astype(np.float32)
    (expected,) = reference(function, x.astype(float), y.astype(float))
    size = expected.shape[1]
    pointer = np.ctypeslib.ndpointer(np.float32, flags="C")
    library.robot_every.argtypes = [pointer] * 3
    for k in range(30):
        z = np.zeros(size, np.float32)
        assert library.robot_every(x[k].copy(), y[k].copy(), z) == 0
        # fmod jumps by its divisor where floats round over a multiple
        near = np.abs(z - expected[k]) <= 1e-5 * np.maximum(1, np.abs(expected[k]))
        assert near.all(), np.flatnonzero(~near)


def test_what_has_no_text_is_named() -> None:
    x = ca.MX.sym("x")
    with pytest.raises(InputError, match="f is a MXFunction: C is written for functions of SX"):
        emit(ca.Function("f", [x], [x + 1]))
    y = ca.SX.sym("y")
    with pytest.raises(InputError, match=r"function g uses the operation OP_ERFINV"):
        emit(ca.Function("g", [y], [ca.erfinv(y)]))


def test_a_long_function_is_written_fast() -> None:
    """In linear time: 130,000 operations within seconds on a busy machine."""
    x = ca.SX.sym("x", 50)
    value = x
    for k in range(900):
        value = ca.sin(value) * x[k % 50] + value
    function = ca.Function("long", [x], [value])
    start = time.process_time()
    text = emit(function)
    assert time.process_time() - start < 60  # 2 s on a quiet core
    assert text.count("NOINLINE") > 200

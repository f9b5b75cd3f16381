"""Calls of generated machine code on NumPy arrays, one sample or a batch, on several threads."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.validation import numbers, whole_number

_MANY = ctypes.CFUNCTYPE(None, ctypes.c_long, *[ctypes.c_void_p] * 4)  # without the GIL
_ONE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p)
_ONE_HELD = ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p)  # with the GIL
_FLOAT64 = np.dtype(np.float64)

#: Slices of a batch are whole groups of as many samples.
_GROUP = 8


@dataclass(frozen=True)
class Entry:
    """Where the machine code of one entry point is.

    Attributes
    ----------
    one, many : int
        Addresses of NAME_one and NAME_many, see `Unit.library`.
    owner : object
        What keeps the machine code in memory.
    """

    one: int
    many: int
    owner: object = None

    @classmethod
    def of(cls, library: ctypes.CDLL, name: str) -> Entry:
        """Return the entry point NAME of a loaded shared library."""
        places = []
        for end in ("one", "many"):
            try:
                symbol = getattr(library, f"{name}_{end}")
            except AttributeError:
                raise InputError(f"{library} has no entry point {name}") from None
            places.append(ctypes.cast(symbol, ctypes.c_void_p).value or 0)
        return cls(*places, library)


class Argument(NamedTuple):
    """An input or output of an entry point: its name, and the shape of one sample."""

    name: str
    shape: tuple[int, ...]


class CompiledFunction:
    """Generated machine code as a function of NumPy arrays.

    ``outputs[0], ..., status = f(*inputs)``. Every input has the shape (..., *shape of a sample);
    the leading dimensions of all are broadcast to one batch, and the outputs are new arrays of
    shape (batch, *shape of a sample). The status is an int for one sample, else an array of int32
    of the batch's shape: 0, or a sum of 1 (an input or output is not finite), 2 (open) and 4
    (nearly singular). It may be called from any number of threads.

    Parameters
    ----------
    name
        For errors.
    inputs, outputs
        Names and shapes of a sample's arrays.
    entry
        The machine code.
    release
        Whether one sample's call, too, lets other threads of Python run: for functions that take
        longer than about 50 microseconds. Batches always do.
    """

    def __init__(
        self,
        name: str,
        inputs: Sequence[Argument],
        outputs: Sequence[Argument],
        entry: Entry,
        *,
        release: bool = False,
    ) -> None:
        self.name = name
        self.inputs = tuple(inputs)
        self.outputs = tuple(outputs)
        self._sizes = tuple(int(np.prod(one.shape)) for one in (*self.inputs, *self.outputs))
        self._one_type: Callable[[int], Any] = _ONE if release else _ONE_HELD
        self._local = threading.local()
        self._shapes = tuple(one.shape for one in self.inputs)
        self.replace(entry)

    def replace(self, entry: Entry) -> None:
        """Use other machine code of the same function from now on; any thread may do so.

        A call that runs meanwhile finishes in the old code.
        """
        # Each is one assignment; a call reads one of them once, and holds what it reads.
        self.entry = entry
        self._many = _held(_MANY(entry.many), entry)
        self._one = _held(self._one_type(entry.one), entry)

    def __call__(self, *inputs: ArrayLike, threads: int = 1) -> tuple[Any, ...]:
        """Return the outputs and the status.

        Parameters
        ----------
        inputs
            Numbers, each (..., *shape of a sample).
        threads
            A batch is computed by as many threads.

        Raises
        ------
        InputError
            For a wrong number of inputs, a wrong shape, shapes that cannot be broadcast, and
            values that are no real numbers.
        """
        try:
            for value, shape in zip(inputs, self._shapes, strict=True):
                if value.dtype is not _FLOAT64 or value.shape != shape:  # type: ignore[union-attr]
                    return self._batch(inputs, threads)
            # The inputs' memory, one after the other; only C-contiguous arrays give theirs.
            x = b"".join(inputs)  # type: ignore[arg-type]
        except (AttributeError, TypeError, ValueError, BufferError):
            return self._batch(inputs, threads)
        try:
            y, copies = self._local.outputs
        except AttributeError:
            y, copies = self._local.outputs = self._memory()
        status = self._one(x, y)
        return (*[copy() for copy in copies], status)

    def _memory(self) -> tuple[ctypes.c_void_p, list[Callable[[], Array]]]:
        """Return the address of this thread's memory for outputs, and what copies each."""
        shapes = [one.shape for one in self.outputs]
        sizes = self._sizes[len(self.inputs) :]
        memory = np.zeros(sum(sizes))
        parts = np.split(memory, np.cumsum(sizes)[:-1]) if sizes else []
        views = [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]
        return ctypes.c_void_p(memory.ctypes.data), [view.copy for view in views]

    # Batches ------------------------------------------------------------------------------------

    def _batch(self, inputs: Sequence[ArrayLike], threads: int) -> tuple[Any, ...]:
        threads = whole_number(threads, "threads")
        batch, arrays = self._broadcast(inputs)
        n = int(np.prod(batch))
        outputs = [np.empty((n, size)) for size in self._sizes[len(self.inputs) :]]
        status = np.empty(n, dtype=np.int32)
        many = self._many
        strides = [a.strides[0] // 8 if n > 1 else 0 for a in arrays]
        stride = (ctypes.c_long * max(1, len(strides)))(*strides)

        def part(start: int, stop: int) -> None:
            ins = [a.ctypes.data + 8 * start * s for a, s in zip(arrays, strides, strict=True)]
            outs = [a.ctypes.data + start * a.strides[0] for a in outputs]
            many(
                stop - start,
                (ctypes.c_void_p * max(1, len(ins)))(*ins),
                stride,
                (ctypes.c_void_p * max(1, len(outs)))(*outs),
                status.ctypes.data + 4 * start,
            )

        if n:
            _in_slices(part, n, threads)
        shaped = [
            array.reshape(batch + one.shape)
            for array, one in zip(outputs, self.outputs, strict=True)
        ]
        return (*shaped, status.reshape(batch) if batch else int(status[0]))

    def _broadcast(self, inputs: Sequence[ArrayLike]) -> tuple[tuple[int, ...], list[Array]]:
        """Return the batch's shape, and inputs as (n, size): stride 0 where all are the same."""
        if len(inputs) != len(self.inputs):
            names = ", ".join(one.name for one in self.inputs)
            raise InputError(
                f"{self.name} takes {len(self.inputs)} inputs ({names}); {len(inputs)} were given"
            )
        arrays = []
        for value, (name, shape) in zip(inputs, self.inputs, strict=True):
            wanted = f"(..., {', '.join(map(str, shape))})" if shape else "(...)"
            array = numbers(value, name, f"numbers of shape {wanted}")
            if array.ndim < len(shape) or array.shape[array.ndim - len(shape) :] != shape:
                raise InputError(
                    f"{name} of {self.name} has shape {array.shape}; it must be {wanted}"
                )
            arrays.append(array)
        batches = [
            array.shape[: array.ndim - len(one.shape)]
            for array, one in zip(arrays, self.inputs, strict=True)
        ]
        try:
            batch = np.broadcast_shapes(*batches)
        except ValueError:
            given = ", ".join(
                f"{one.name} {array.shape}" for one, array in zip(self.inputs, arrays, strict=True)
            )
            raise InputError(
                f"the leading dimensions of the inputs of {self.name} do not go together: {given}"
            ) from None
        n = int(np.prod(batch))
        return batch, [
            _samples(np.broadcast_to(array, batch + one.shape), n, size)
            for array, one, size in zip(arrays, self.inputs, self._sizes, strict=False)
        ]


def _held(function: Any, entry: Entry) -> Any:
    """Return a ctypes function that keeps its machine code in memory."""
    function.entry = entry
    return function


def _samples(array: Array, n: int, size: int) -> Array:
    """Return an array as (n, size) in which each sample is contiguous; a copy only if needed."""
    flat = array.reshape(n, size)
    if (
        (size > 1 and n and flat.strides[1] != flat.itemsize)
        or flat.strides[0] % flat.itemsize
        or not flat.flags.aligned
    ):
        return np.ascontiguousarray(flat)
    return flat


def _in_slices(part: Callable[[int, int], None], n: int, threads: int) -> None:
    """Call ``part(start, stop)`` over 0 to n, in as many slices as threads, whole groups each."""
    groups = -(-n // _GROUP)
    count = min(threads, groups)
    if count == 1:
        part(0, n)
        return
    cuts = [min(n, _GROUP * (groups * k // count)) for k in range(count + 1)]
    with ThreadPoolExecutor(count - 1) as pool:
        running = [pool.submit(part, *cuts[k : k + 2]) for k in range(1, count)]
        part(*cuts[:2])
        for one in running:
            one.result()


Status = NDArray[np.int32] | int

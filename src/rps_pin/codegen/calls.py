"""Calls of generated machine code on NumPy arrays, one sample or a batch, on several threads."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rps_pin.arrays import Array
from rps_pin.codegen.build.library import MANY, Library
from rps_pin.codegen.python_calls import BuiltinFunction, addresses
from rps_pin.errors import InputError
from rps_pin.validation import FLOAT64, numbers, whole_number

#: A batch from which on code for several samples at once is worth its building.
LARGE_BATCH = 64
#: Slices of a batch are whole groups of as many samples.
_GROUP = 8


@dataclass(frozen=True)
class Entry:
    """Where the machine code of one entry point is.

    Attributes
    ----------
    call, many : int
        Addresses of NAME_call and NAME_many, see `Unit.library`.
    owner : object
        What keeps the machine code in memory.
    """

    call: int
    many: int
    owner: object = None

    @classmethod
    def of(cls, library: Library, name: str) -> Entry:
        """Return the entry point NAME of a library; InputError if it has none."""
        return cls(library.address(f"{name}_call"), library.address(f"{name}_many"), library)


class Argument(NamedTuple):
    """An input or output of an entry point: its name, and the shape of one sample."""

    name: str
    shape: tuple[int, ...]

    @property
    def wanted(self) -> str:
        """Return the shape of a batch, for errors."""
        return f"(..., {', '.join(map(str, self.shape))})" if self.shape else "(...)"


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
        #: Called before a batch of at least `LARGE_BATCH` samples.
        self.before_batch: Callable[[], None] = lambda: None
        self._sizes = tuple(math.prod(one.shape) for one in (*self.inputs, *self.outputs))
        #: The same as calling this object, 0.1 microseconds faster where no keyword is given.
        self.call: Callable[..., tuple[Any, ...]] = self._general
        #: The same for float64 arrays of one sample, contiguous and aligned; None for all others.
        self.one: Callable[..., tuple[Any, ...] | None] = _nothing
        self._builtins: tuple[BuiltinFunction, ...] = ()
        if addresses() is not None:
            given, results = ([one.shape for one in part] for part in (self.inputs, self.outputs))
            self._builtins = tuple(
                BuiltinFunction(name, given, results, general, release)
                for general in (self._general, _nothing)
            )
            self.call, self.one = (builtin.call for builtin in self._builtins)
        self.replace(entry)

    def replace(self, entry: Entry) -> None:
        """Use other machine code of the same function from now on; any thread may do so.

        A call that runs meanwhile finishes in the old code.
        """
        many = MANY(entry.many)
        many.entry = entry  # type: ignore[attr-defined]
        # Each is one assignment; a call reads one of them once, and holds what it reads.
        self.entry, self._many = entry, many
        for builtin in self._builtins:
            builtin.replace(entry.call, entry.owner)

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
        return self.call(*inputs) if threads == 1 else self._general(*inputs, threads=threads)

    def _general(self, *inputs: ArrayLike, threads: int = 1) -> tuple[Any, ...]:
        """Return the outputs and the status for any inputs: one sample is a batch too."""
        return self._batch(inputs, threads)

    # Batches ------------------------------------------------------------------------------------

    def _batch(self, inputs: Sequence[ArrayLike], threads: int) -> tuple[Any, ...]:
        threads = whole_number(threads, "threads")
        batch, arrays = self._broadcast(inputs)
        n = math.prod(batch)
        sizes = self._sizes
        samples = [
            _samples(array, batch, one.shape, size)
            for array, one, size in zip(arrays, self.inputs, sizes, strict=False)
        ]
        if n >= LARGE_BATCH:
            self.before_batch()
        outputs = [np.empty((*batch, *one.shape)) for one in self.outputs]
        status = np.empty(batch, dtype=np.int32)
        places = [(_address(array), 8 * stride) for array, stride in samples]
        steps = [8 * size for size in sizes[len(arrays) :]]
        results = [(_address(array), step) for array, step in zip(outputs, steps, strict=True)]
        marks = _address(status)
        strides = (ctypes.c_long * max(1, len(samples)))(*(stride for _, stride in samples))
        many = self._many

        def part(start: int, stop: int) -> None:
            ins = [place + start * step for place, step in places]
            outs = [place + start * step for place, step in results]
            many(
                stop - start,
                (ctypes.c_void_p * max(1, len(ins)))(*ins),
                strides,
                (ctypes.c_void_p * max(1, len(outs)))(*outs),
                marks + 4 * start,
            )

        if n:
            _in_slices(part, n, threads)
        return (*outputs, status if batch else int(status))

    def _broadcast(self, inputs: Sequence[ArrayLike]) -> tuple[tuple[int, ...], list[Array]]:
        """Return the batch's shape, and the inputs as arrays of right shapes."""
        if len(inputs) != len(self.inputs):
            names = ", ".join(one.name for one in self.inputs)
            raise InputError(
                f"{self.name} takes {len(self.inputs)} inputs ({names}); {len(inputs)} were given"
            )
        arrays = []
        batches = []
        for value, one in zip(inputs, self.inputs, strict=True):
            array = value
            if type(array) is not np.ndarray or array.dtype is not FLOAT64:
                array = numbers(value, one.name, f"numbers of shape {one.wanted}")
            leading = array.ndim - len(one.shape)
            if leading < 0 or array.shape[leading:] != one.shape:
                raise InputError(
                    f"{one.name} of {self.name} has shape {array.shape}; it must be {one.wanted}"
                )
            arrays.append(array)
            batches.append(array.shape[:leading])
        if len(set(batches)) == 1:
            return batches[0], arrays
        try:
            return np.broadcast_shapes(*batches), arrays
        except ValueError:
            given = ", ".join(
                f"{one.name} {array.shape}" for one, array in zip(self.inputs, arrays, strict=True)
            )
            raise InputError(
                f"the leading dimensions of the inputs of {self.name} do not go together: {given}"
            ) from None


def _nothing(*_inputs: Any, **_options: Any) -> None:
    """Answer what `CompiledFunction.one` does not."""


def _address(array: NDArray[Any]) -> int:
    """Return where an array's memory begins; faster than ``array.ctypes.data``."""
    address: int = array.__array_interface__["data"][0]
    return address


def _samples(
    array: Array, batch: tuple[int, ...], shape: tuple[int, ...], size: int
) -> tuple[Array, int]:
    """Return an array whose samples are contiguous, and the step between them in numbers.

    The step is 0 if all samples are the same. The array is copied only if it must be.
    """
    if array.size == size:  # one sample
        flat = array.reshape(1, size)
        return (flat if flat.flags.aligned and flat.flags.c_contiguous else flat.copy()), 0
    if array.size != math.prod(batch) * size:
        array = np.broadcast_to(array, batch + shape)
    flat = array.reshape(-1, size)
    if (size > 1 and flat.strides[1] != 8) or flat.strides[0] % 8 or not flat.flags.aligned:
        flat = flat.copy()
    return flat, flat.strides[0] // 8


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

"""Launches of generated CUDA on arrays of CuPy, compiled by NVRTC for the card that is there."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from rps_pin.errors import CompileError, InputError
from rps_pin.validation import numbers

#: Threads of a block: with 255 registers each, four such blocks fill a multiprocessor.
THREADS = 64
#: Of NVRTC. A product and a sum that it joins are rounded once instead of twice. CuPy adds
#: -ftz=true: in single precision numbers below 1.2e-38 count as zero.
OPTIONS = ("--std=c++17", "--fmad=true")
#: Most blocks of a launch; each thread computes more samples beyond them.
_MOST_BLOCKS = 2**31 - 1
#: C's names of the types of numbers.
REALS = {"float64": "double", "float32": "float"}
#: Inputs and outputs that are one number a sample: () or (n,).
_SCALARS = frozenset({"h", "count", "residual", "missing", "work"})


def load_cupy() -> Any:
    """Return the module CuPy.

    Raises
    ------
    CompileError
        If it is not installed, or finds no card.
    """
    try:
        cupy = import_module("cupy")
    except ImportError as error:
        raise CompileError(
            f"device='cuda' needs CuPy: pip install 'rps-pin[cuda]' ({error})", "NVRTC"
        ) from error
    try:
        count = cupy.cuda.runtime.getDeviceCount()
    except cupy.cuda.runtime.CUDARuntimeError as error:
        raise CompileError(
            f"device='cuda' needs an NVIDIA card; CuPy finds none: {error}", "NVRTC"
        ) from error
    if not count:
        raise CompileError("device='cuda' needs an NVIDIA card; CuPy finds none", "NVRTC")
    return cupy


class _Places(NamedTuple):
    """An array as a kernel takes it: with its steps from entry to entry and sample to sample."""

    array: Any
    entry: int
    sample: int


class DeviceFunction:
    """An entry point of a unit on the device.

    ``outputs, status = f(inputs)`` with inputs of shape (size,), the same for all samples, or
    (n, size), in any memory layout; numbers of `_SCALARS` have shape () or (n,). Arrays on the
    device of other libraries (``__cuda_array_interface__``) are taken as they are, everything else
    is copied to it. Outputs have shape (n, size), or (size,) if no input has
    samples; their entries lie apart and neighbouring samples side by side, as is fastest.

    Parameters
    ----------
    cupy
        The module.
    name
        Of the entry point.
    dtype
        "float64" or "float32".
    text
        The text of a unit with this entry point, see `Unit.cuda`.
    inputs, outputs
        Their names and sizes.

    Raises
    ------
    CompileError
        If NVRTC refuses the text.
    """

    def __init__(
        self,
        cupy: Any,
        name: str,
        dtype: str,
        text: str,
        inputs: Sequence[tuple[str, int]],
        outputs: Sequence[tuple[str, int]],
    ) -> None:
        self.name, self.dtype, self._cupy = name, np.dtype(dtype), cupy
        self.inputs, self.outputs = tuple(inputs), tuple(outputs)
        try:
            module = cupy.RawModule(code=text, options=OPTIONS, backend="nvrtc")
            self._kernel = module.get_function(f"{name}_cuda")
        except cupy.cuda.compiler.CompileException as error:
            first = str(error).strip().partition("\n")[0]
            raise CompileError(f"NVRTC refuses {name}: {first}", "NVRTC", str(error)) from error

    def __call__(self, given: Sequence[Any], out: Sequence[Any] = ()) -> tuple[list[Any], Any]:
        """Return the outputs and the status, an array of int32, shape (n,) or ().

        Parameters
        ----------
        given
            The inputs.
        out
            Arrays for the outputs and the status, or None for new ones. An output may be an input.

        Raises
        ------
        InputError
            For a wrong shape or type of numbers.
        """
        arrays = [self._given(value, *one) for value, one in zip(given, self.inputs, strict=True)]
        counts = {len(a) for a, one in zip(arrays, self.inputs, strict=True) if _many(a, one[0])}
        if len(counts - {1}) > 1:
            raise InputError(
                f"{self.name}: the inputs have {', '.join(map(str, sorted(counts)))} samples; "
                "they must have as many, or one"
            )
        n = next(iter(counts - {1}), 1)
        places = [self._places(a, one[0], n) for a, one in zip(arrays, self.inputs, strict=True)]
        wanted = [*out, *[None] * (len(self.outputs) + 1 - len(out))]
        results = [
            self._result(array, *one, n)
            for array, one in zip(wanted[:-1], self.outputs, strict=True)
        ]
        places += [self._places(a, one[0], n) for a, one in zip(results, self.outputs, strict=True)]
        status = self._status(wanted[-1], n)
        if n:
            self._launch(n, places, status)
        if counts:
            return results, status
        return [array[0] for array in results], status[0]

    def _launch(self, n: int, places: Sequence[_Places], status: Any) -> None:
        arguments: list[Any] = [np.int64(n)]
        for array, entry, sample in places:
            arguments += [array, np.int64(entry), np.int64(sample)]
        blocks = min(-(-n // THREADS), _MOST_BLOCKS)
        self._kernel((blocks,), (THREADS,), (*arguments, status))

    def _given(self, value: Any, name: str, size: int) -> Any:
        if hasattr(value, "__cuda_array_interface__"):
            value = self._cupy.asarray(value)
        else:
            value = self._cupy.asarray(numbers(value, name, _shape(name, size)), dtype=self.dtype)
        self._check_type(value, name)
        alone: tuple[int, ...] = () if name in _SCALARS else (size,)
        if value.shape != alone and (value.ndim != len(alone) + 1 or value.shape[1:] != alone):
            raise InputError(f"{name} has shape {value.shape}; expected {_shape(name, size)}")
        return value

    def _check_type(self, array: Any, name: str) -> None:
        if array.dtype != self.dtype:
            raise InputError(
                f"{name} is an array of {array.dtype}, and the code is of {self.dtype}: give "
                f"{name}.astype('{self.dtype}'), or compile with dtype='{array.dtype}'"
            )
        if any(step % array.itemsize for step in array.strides):
            raise InputError(f"{name}: its steps of {array.strides} bytes are no whole numbers")

    def _places(self, array: Any, name: str, n: int) -> _Places:
        """Return an array with its steps, counted in numbers."""
        steps = [step // array.itemsize for step in array.strides]
        many = _many(array, name)
        sample = steps.pop(0) if many and len(array) == n and n != 1 else 0
        return _Places(array, steps[-1] if steps and name not in _SCALARS else 0, sample)

    def _result(self, array: Any, name: str, size: int, n: int) -> Any:
        shape = (n,) if name in _SCALARS else (n, size)
        if array is None:
            return self._cupy.empty(shape[::-1], dtype=self.dtype).T
        if not isinstance(array, self._cupy.ndarray):
            raise InputError(f"out: {name} must be an array of CuPy, not {type(array).__name__}")
        self._check_type(array, f"out: {name}")
        if array.shape != shape:
            raise InputError(f"out: {name} has shape {array.shape}; expected {shape}")
        if any(step == 0 and m > 1 for step, m in zip(array.strides, shape, strict=True)):
            raise InputError(f"out: {name} has several numbers in one place")
        return array

    def _status(self, array: Any, n: int) -> Any:
        if array is None:
            return self._cupy.empty((n,), dtype=np.int32)
        if not isinstance(array, self._cupy.ndarray) or array.dtype != np.int32:
            raise InputError("out: status must be an array of CuPy of int32")
        if array.shape != (n,) or not array.flags.c_contiguous:
            raise InputError(f"out: status must be contiguous, of shape {(n,)}")
        return array


def _many(array: Any, name: str) -> bool:
    """Return whether an array has samples."""
    return bool(array.ndim == (1 if name in _SCALARS else 2))


def _shape(name: str, size: int) -> str:
    return "() or (n,)" if name in _SCALARS else f"({size},) or (n, {size})"

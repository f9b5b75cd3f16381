"""A stand-in for CuPy and its card: arrays of NumPy, and generated CUDA compiled for the host."""

from __future__ import annotations

import ctypes
import shutil
from collections.abc import Sequence
from pathlib import Path
from tempfile import mkdtemp
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from tests.codegen.machine import compiled

#: What makes a host compiler take the text: one block of one thread.
HOST = """
#define __device__
#define __global__
#define __noinline__ __attribute__((noinline))
struct host_index { int x; };
static const host_index blockIdx = {0}, blockDim = {1}, threadIdx = {0}, gridDim = {1};
"""
WARNINGS = ["-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-std=gnu++17"]


def host_library(text: str, folder: Path, flags: Sequence[str] = ()) -> ctypes.CDLL:
    """Return CUDA text compiled for the host."""
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("no g++")
    library = compiled(HOST + text, folder, [*WARNINGS, *flags], compiler, ".cpp")
    return ctypes.CDLL(str(library))


class DeviceArray(np.ndarray[Any, Any]):
    """An array on the card: no array of NumPy's own type passes for it."""

    __cuda_array_interface__: ClassVar[dict[str, Any]] = {}


class CompileException(Exception):  # noqa: N818
    """What NVRTC refuses."""


class CUDARuntimeError(RuntimeError):
    """What CuPy raises where there is no card."""


class FakeCuPy:
    """What is used of CuPy; `launches` are the blocks and threads of all launches."""

    ndarray = DeviceArray

    def __init__(self, folder: Path, cards: int | None = 1) -> None:
        self._folder, self._cards = folder, cards
        self.launches: list[tuple[Any, Any]] = []
        self.texts: list[str] = []
        self.cuda = SimpleNamespace(
            runtime=SimpleNamespace(getDeviceCount=self._count, CUDARuntimeError=CUDARuntimeError),
            compiler=SimpleNamespace(CompileException=CompileException),
        )

    def _count(self) -> int:
        if self._cards is None:
            raise CUDARuntimeError("cudaErrorInsufficientDriver: no driver")
        return self._cards

    def asarray(self, value: Any, dtype: Any = None) -> DeviceArray:
        return np.asarray(value, dtype=dtype).view(DeviceArray)

    def empty(self, shape: Any, dtype: Any) -> DeviceArray:
        return np.full(shape, 99, dtype=dtype).view(DeviceArray)

    def asnumpy(self, array: Any) -> np.ndarray[Any, Any]:
        return np.array(array, subok=False)

    def RawModule(self, *, code: str, options: Any, backend: str) -> SimpleNamespace:  # noqa: N802
        assert backend == "nvrtc"
        assert all(isinstance(option, str) for option in options)
        self.texts.append(code)

        def get_function(name: str) -> Any:
            if "refuse" in code:
                raise CompileException("unit.cu(3): error: what is this\nand more")
            folder = Path(mkdtemp(dir=self._folder))
            function = getattr(host_library(code, folder, ["-O0"]), name)

            def launch(grid: Any, block: Any, arguments: Sequence[Any]) -> None:
                self.launches.append((grid, block))
                function(*map(_as_c, arguments))

            return launch

        return SimpleNamespace(get_function=get_function)


def _as_c(value: Any) -> Any:
    if isinstance(value, DeviceArray):
        return ctypes.c_void_p(value.ctypes.data)
    assert isinstance(value, np.int64)
    return ctypes.c_longlong(int(value))

"""Small C texts with what they should compute, and compilers that fail, for tests of builds."""

from __future__ import annotations

import ctypes
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rps_pin.arrays import Array
from rps_pin.codegen.build import Library, Source

#: A real one, for those that pretend.
REAL = next(filter(None, map(shutil.which, ("gcc", "clang", "cc"))), None)

SINE = """
#include <math.h>
static double scaled(const double *restrict x) { return FACTOR*sin(x[0]); }
void sine_many(long n, const double *const *in, const long *stride, double *const *out, int *status)
{
  for (long i = 0; i < n; ++i) {
    out[0][i] = scaled(in[0] + i*stride[0]);
    if (status) status[i] = out[0][i] != out[0][i];
  }
}
"""


def sine(factor: float = 2.0, **options: Any) -> Source:
    text = SINE.replace("FACTOR", repr(factor))
    return Source("sine", ("sine_many",), (text,), **options)


def called(library: Library, x: Array, name: str = "sine_many") -> Array:
    """Return a function's results for samples, each of one number."""
    y = np.full_like(x, np.nan)
    status = np.full(len(x), 7, dtype=np.intc)
    ins, outs = (ctypes.c_void_p * 1)(x.ctypes.data), (ctypes.c_void_p * 1)(y.ctypes.data)
    stride = (ctypes.c_long * 1)(1)
    library[name](len(x), ins, stride, outs, status.ctypes.data)
    assert not status.any()
    return y


class Proof:
    """A proof of `sine` that counts its calls."""

    def __init__(self, factor: float = 2.0) -> None:
        self.calls = 0
        self.factor = factor

    def __call__(self, library: Library) -> Mapping[str, Any]:
        self.calls += 1
        x = np.linspace(-3.0, 3.0, 101)
        np.testing.assert_allclose(called(library, x), self.factor * np.sin(x), rtol=1e-14)
        return {"samples": len(x)}


class FakeCompiler:
    """A program that notes its calls, and does what it is told before gcc does its work."""

    def __init__(self, folder: Path, does: str = "", name: str = "gcc") -> None:
        if REAL is None:
            pytest.skip("no C compiler is here")
        self.log = folder / f"{name}.log"
        self.path = folder / name
        lines = (
            "#!/bin/sh",
            'if [ "$1" = -v ]; then echo "fake version 1.0"; exit 0; fi',
            f'echo "$@" >> "{self.log}"',
            does,
            f'PATH="{Path(REAL).parent}:$PATH" exec {REAL} "$@"',
        )
        self.path.write_text("\n".join(lines) + "\n")
        self.path.chmod(0o755)

    @property
    def compiled(self) -> int:
        """How many texts it was given."""
        lines = self.log.read_text().splitlines() if self.log.exists() else []
        return sum(" -c " in line for line in lines)

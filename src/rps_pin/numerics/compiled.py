"""Functions compiled by Numba where that is installed: pip install rps-pin[fast].

A *kernel* is a function of numbers that runs unchanged on floats, NumPy arrays, complex numbers and
CasADi expressions. `kernel` marks it, so that compiled functions can call it; it stays the Python
function that it is. `compiled` returns a function of plain floats and tuples of floats as machine
code. Without Numba, or with RPS_PIN_COMPILE=0 in the environment, compiled functions are the Python
they are written in; the results are the same to rounding error.

Machine code is stored beside the sources, or in NUMBA_CACHE_DIR, so that only the first call on a
machine waits for the compiler. It is stored under a digest of all modules that the function uses:
a change in a kernel compiles anew what calls it. Real-time objects make the first calls when they
are made, not in the loop.
"""

from __future__ import annotations

import os
import sys
import zlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])


def _numba() -> ModuleType | None:
    if os.environ.get("RPS_PIN_COMPILE", "1") == "0":
        return None
    try:
        import numba.extending  # noqa: PLC0415
    except ImportError:
        return None
    return numba


_NUMBA = _numba()
COMPILES = _NUMBA is not None
"""Whether functions are compiled here."""

#: Modules that hold kernels or compiled functions.
_MODULES: set[str] = set()


def kernel(function: _Function) -> _Function:
    """Mark a function as one that compiled functions may call; return it unchanged."""
    return _replaced(function, function)


def kernel_for_floats(on_floats: Callable[..., Any]) -> Callable[[_Function], _Function]:
    """Mark a function that dispatches on types; `on_floats` is what compiled functions call."""
    return lambda function: _replaced(function, on_floats)


def compiled(function: _Function) -> _Function:
    """Return a function of floats and tuples of floats, compiled where that can be done."""
    if _NUMBA is None:
        return function
    _MODULES.add(function.__module__)
    # Numba names a function's stored code after it.
    function.__qualname__ = f"{function.__name__}_{_digest(function.__module__):08x}"
    faster: _Function
    try:
        faster = _NUMBA.njit(cache=True)(function)
    except RuntimeError:  # there is no place to store machine code
        faster = _NUMBA.njit(function)
    return faster


def _replaced(function: _Function, on_floats: Callable[..., Any]) -> _Function:
    _MODULES.add(function.__module__)
    if _NUMBA is not None:
        # As `numba.extending.register_jitable`, which has no place for another function.
        _NUMBA.extending.overload(function, strict=False)(lambda *_: on_floats)
    return function


def _digest(module: str) -> int:
    """Return a digest of the sources of a module and of all whose functions it uses."""
    waiting, used = [module], {module}
    while waiting:
        values = list(vars(sys.modules[waiting.pop()]).values())
        found = _MODULES.intersection(getattr(value, "__module__", "") for value in values)
        waiting += found - used
        used |= found
    digest = 0
    for name in sorted(used):
        digest = zlib.crc32(_source(str(sys.modules[name].__file__)), digest)
    return digest


@lru_cache
def _source(path: str) -> bytes:
    return Path(path).read_bytes()

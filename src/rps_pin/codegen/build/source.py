"""C texts to build, and the key under which the result is kept."""

from __future__ import annotations

import functools
import hashlib
import json
import os
import platform
import subprocess
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rps_pin import __version__

#: Counts changes of how libraries are built, called and kept; the cache holds each apart.
ABI = 2


@dataclass(frozen=True)
class Source:
    """C texts that make one library.

    Parameters
    ----------
    name : str
        What the library is, for files and messages.
    functions : tuple of str
        The names of the functions that Python calls.
    texts : tuple of str, or function that returns them one by one
        The translation units. Each is compiled on its own, on as many cores as there are. The
        macro ``__TINYC__`` is defined where there are no vector types.
    vectors : bool
        Whether glibc's libmvec is linked where there is one; else ``NO_MVEC`` is defined.
    flags : tuple of str
        More flags for the compiler, such as macros.
    determined_by : str
        All that determines the texts, if they come from a function: the key is then made of this,
        and the function is called only if nothing suitable is in the cache. Otherwise anything
        else that the key has to depend on, such as the version of the proof.
    count : int
        How many texts there are, if they come from a function; it is called at once otherwise.
    """

    name: str
    functions: tuple[str, ...]
    texts: tuple[str, ...] | Callable[[], Iterable[str]]
    vectors: bool = False
    flags: tuple[str, ...] = ()
    determined_by: str = ""
    count: int = 0

    @functools.cached_property
    def units(self) -> tuple[str, ...]:
        """The translation units."""
        return tuple(self.texts()) if callable(self.texts) else self.texts

    def each(self) -> Iterator[str]:
        """Return the translation units one by one; each is made when it is asked for."""
        if "units" in vars(self) or not callable(self.texts):
            yield from self.units
            return
        made = []
        for text in self.texts():
            made.append(text)
            yield text
        vars(self)["units"] = tuple(made)

    @functools.cached_property
    def key(self) -> str:
        """A digest of the texts, the flags, this processor, the C library and this package."""
        return digest(
            ABI,
            __version__,
            self.name,
            self.functions,
            None if callable(self.texts) and self.determined_by else self.units,
            self.determined_by,
            self.vectors,
            self.flags,
            processor(),
            c_library(),
        )

    def recall(self, units: tuple[str, ...]) -> None:
        """Take the translation units from the cache; they need not be made then."""
        vars(self)["units"] = units


def digest(*parts: object) -> str:
    """Return the first 32 digits of the SHA-256 of values that JSON can hold."""
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:32]


def c_library() -> str:
    """Return name and version of the C library of Linux, such as "glibc 2.36", or nothing."""
    try:
        return os.confstr("CS_GNU_LIBC_VERSION") or ""
    except (AttributeError, ValueError, OSError):
        return ""


@functools.cache
def processor() -> str:
    """Return the processor's name and abilities: code made for this one runs on its equals."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8", "replace").partition("\n\n")[0].split("\n")
    except OSError:
        lines = _of_macos()
    telling = ("vendor_id", "model", "cpu family", "flags", "Features", "CPU ", "machdep", "hw.")
    return "\n".join([platform.machine(), *(one for one in lines if one.startswith(telling))])


def _of_macos() -> list[str]:
    command = ["sysctl", "machdep.cpu.brand_string", "machdep.cpu.features", "hw.optional"]
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return [f"hw. {platform.processor()}"]
    return run.stdout.splitlines()

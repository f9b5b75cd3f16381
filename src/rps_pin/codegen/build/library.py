"""A loaded library: functions in machine code, with the proof that they are right."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from rps_pin.errors import CompileError, InputError, RPSPinError, did_you_mean

#: ``void NAME_many(long n, const double *const *in, const long *stride, double *const *out,
#: int *status)``; pointers are passed as addresses. Python's lock is released while it runs.
MANY = ctypes.CFUNCTYPE(None, ctypes.c_long, *[ctypes.c_void_p] * 4)


#: The name of its file.
FILE = "library.so"


class Library:
    """Functions in machine code; ``library[name]`` calls one of the form `MANY`.

    Attributes
    ----------
    compiler : str
        What compiled it.
    proof : dict
        What the proof recorded; empty while it is being proven.
    better : Future of Library, or None
        The library of a system compiler that is being built in the background. Its `result` waits
        for it, and raises if that build failed.
    """

    better: Future[Library] | None = None

    def __init__(self, compiler: str, addresses: Mapping[str, int], owner: object) -> None:
        self.compiler = compiler
        self.proof: dict[str, Any] = {}
        self._addresses = dict(addresses)
        self._owner = owner  # the code is there as long as this is

    def address(self, name: str) -> int:
        """Return the address of a function; keep the library while it is used."""
        if name not in self._addresses:
            near = did_you_mean(name, self._addresses)
            raise InputError(f"the library has no function {name}{near}")
        return self._addresses[name]

    def __getitem__(self, name: str) -> Any:
        """Return a function of the form `MANY`; it keeps the library."""
        function = MANY(self.address(name))
        function.library = self  # type: ignore[attr-defined]
        return function

    def __copy__(self) -> Library:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Library:
        """Return this one: code does not change, and has no memory of its own."""
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Refuse to be sent: an address means nothing in another process."""
        raise RPSPinError(
            "what has machine code cannot be pickled: make another one with the same arguments, "
            "or, of a control loop, pickle one with compiled=False"
        )

    def __repr__(self) -> str:
        return f"<Library of {', '.join(self._addresses)}, by {self.compiler}>"


def load(path: Path, functions: Iterable[str], compiler: str) -> Library:
    """Load a shared library; OSError if the system refuses it."""
    loaded = ctypes.CDLL(str(path))  # never unloaded: functions of it may be anywhere
    addresses = {}
    for name in functions:
        try:
            addresses[name] = ctypes.cast(getattr(loaded, name), ctypes.c_void_p).value or 0
        except AttributeError:
            raise CompileError(f"{compiler} made a library without {name}", compiler) from None
    return Library(compiler, addresses, loaded)

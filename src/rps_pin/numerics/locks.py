"""Locks between processes: files that one process at a time has."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rps_pin.errors import InputError


def locked(path: Path, taken: str) -> int:
    """Return a file, made if need be and locked until it is closed, also by the process's end.

    Parameters
    ----------
    path
        The file; its folder is made too.
    taken
        What the error says if another process has it.

    Raises
    ------
    InputError
        If another process has it.
    """
    while True:
        path.parent.mkdir(exist_ok=True)
        found = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(found, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if path.exists() and os.path.samestat(path.stat(), os.fstat(found)):
                return found
        except BlockingIOError:
            os.close(found)
            raise InputError(taken) from None
        except BaseException:
            os.close(found)
            raise
        os.close(found)  # removed meanwhile by the process that had it


@contextmanager
def only_writer(target: Path) -> Iterator[None]:
    """Refuse other processes that write the same file while the block lasts.

    By a hidden file beside it, which is removed at the end; what a killed process left of it is no
    hindrance.

    Raises
    ------
    InputError
        If another process writes it.
    """
    path = target.with_name(f".{target.name}.lock")
    taken = f"another process is writing {target}; wait for it, or give another file"
    lock = locked(path, taken)
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(lock)

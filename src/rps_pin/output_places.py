"""Where results go: what is written to, what is written through, and what is never replaced."""

from __future__ import annotations

import functools
import os
import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from pathlib import Path

from rps_pin.errors import InputError
from rps_pin.interruption import scratch_folder

#: Devices and numbers of the files that were read; None where nobody asks.
FILES_READ: ContextVar[set[tuple[int, int]] | None] = ContextVar("FILES_READ", default=None)
_SYSTEM_FOLDERS = ("/dev/", "/proc/")


def is_stream(path: Path) -> bool:
    """Return whether a path is written through: a terminal, /dev/null and the like, or a FIFO.

    Raises
    ------
    InputError
        If it is something that no file can be written to: a folder, a disk, a socket, or the name
        of an open file in /dev or /proc.
    """
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return False
    if stat.S_ISREG(mode):
        if str(path.absolute()).startswith(_SYSTEM_FOLDERS) and path.is_symlink():
            raise InputError(f"{path} leads to {path.resolve()}: name that file itself")
        return False
    if stat.S_ISCHR(mode) or stat.S_ISFIFO(mode):
        return True
    what = "a folder" if stat.S_ISDIR(mode) else "a disk or a socket"
    raise InputError(f"{path} is {what}: no file can be written there")


def was_read(path: Path) -> bool:
    """Return whether an existing file is one of `FILES_READ`."""
    found = path.stat()
    return (found.st_dev, found.st_ino) in (FILES_READ.get() or ())


def through_links_and_streams(
    whole: Callable[[Path], AbstractContextManager[Path]],
) -> Callable[[str | os.PathLike[str]], AbstractContextManager[Path]]:
    """Let a writer of whole files leave links and streams in their places.

    Of a link, the file that it leads to is replaced. A device or FIFO is written to when the file
    is finished.
    """

    @functools.wraps(whole)
    @contextmanager
    def written(path: str | os.PathLike[str]) -> Iterator[Path]:
        target = Path(path)
        if not is_stream(target):
            with whole(Path(os.path.realpath(target)) if target.is_symlink() else target) as place:
                yield place
            return
        with scratch_folder() as folder:
            finished = folder / f"finished{target.suffix}"
            with whole(finished) as place:
                yield place
            _copy(finished, target)

    return written


def _copy(finished: Path, stream: Path) -> None:
    try:  # without waiting for a reader that may never come
        descriptor = os.open(stream, os.O_WRONLY | os.O_NONBLOCK)
    except OSError as error:
        reason = "nobody reads from this FIFO" if stream.is_fifo() else error.strerror
        raise InputError(f"cannot write to {stream}: {reason}") from None
    os.set_blocking(descriptor, True)
    with finished.open("rb") as source, os.fdopen(descriptor, "wb") as target:
        shutil.copyfileobj(source, target)

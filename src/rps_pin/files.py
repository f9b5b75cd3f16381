"""Files: read with errors that name them, written whole or not at all.

Regular files alone are read: a FIFO would be waited for without end, and a device may have none.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from rps_pin.errors import InputError, shown
from rps_pin.interruption import remove_leftovers, scratch_name, signals_as_ctrl_c
from rps_pin.output_places import FILES_READ, through_links_and_streams


@contextmanager
def opened(path: str | os.PathLike[str], what: str) -> Iterator[BinaryIO]:
    """Open a file for reading.

    Parameters
    ----------
    path
        The file.
    what
        Its kind, for messages: ``"trajectory file"``.

    Raises
    ------
    InputError
        If it cannot be read, is no regular file, or the block finds that it is not UTF-8.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"a {what} is given by its path, not by {shown(path)}")
    try:
        with open(path, "rb", opener=_opener) as file:
            found = os.fstat(file.fileno())
            if (read := FILES_READ.get()) is not None:
                read.add((found.st_dev, found.st_ino))
            kind = found.st_mode
            if not stat.S_ISREG(kind):
                raise InputError(
                    f"cannot read the {what} {os.fspath(path)}: it is {_kind(kind)}, not a regular "
                    "file"
                )
            yield file
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        if isinstance(error, UnicodeDecodeError):
            reason = "not a UTF-8 text"
        raise InputError(f"cannot read the {what} {os.fspath(path)}: {reason}") from None


def _opener(path: str, flags: int) -> int:
    """Open without waiting for the other end of a FIFO."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def _kind(mode: int) -> str:
    kinds = {stat.S_IFIFO: "a FIFO", stat.S_IFSOCK: "a socket", stat.S_IFDIR: "a folder"}
    return kinds.get(stat.S_IFMT(mode), "a device")


@through_links_and_streams
@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path next to `path`; rename it to `path` if the block ends without error.

    An exception, Ctrl-C, SIGTERM or SIGHUP removes the temporary file and leaves `path` unchanged.
    What a process that was killed left in the folder is removed by the next call there.
    A device or FIFO is written to, and of a link the file that it leads to is replaced.

    Parameters
    ----------
    path
        Path of the finished file. Its folder must exist.

    Yields
    ------
    Path
        A path in the same folder, with the same suffix, to write to.
    """
    target = Path(path)
    scratch = target.with_name(scratch_name(target))
    with signals_as_ctrl_c():
        try:
            remove_leftovers(target.parent)
            try:
                os.close(os.open(scratch, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
            except OSError as error:  # name the file that was asked for
                raise type(error)(error.errno, error.strerror, str(target)) from None
            with _errors_name(target, scratch):
                yield scratch
            scratch.chmod(0o666 & ~_umask())
            scratch.replace(target)
        finally:
            with suppress(FileNotFoundError, NotADirectoryError):
                scratch.unlink()


@contextmanager
def _errors_name(target: Path, scratch: Path) -> Iterator[None]:
    """Let errors of writing, which may name no file or the temporary one, name the target."""
    try:
        yield
    except OSError as error:
        if error.errno is not None and error.filename in (None, str(scratch), scratch):
            error.filename = str(target)
        raise


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file in UTF-8, whole or not at all; see `whole_file`."""
    with whole_file(path) as scratch:
        scratch.write_text(text, "utf-8")


def _umask() -> int:
    """Return the process's umask (which can only be read by setting it)."""
    mask = os.umask(0)
    os.umask(mask)
    return mask

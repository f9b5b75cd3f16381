"""Files: read with errors that name them, written whole or not at all.

Regular files alone are read: a FIFO would be waited for without end, and a device may have none.
What a file is that was taken for another is told by how it begins.
"""

from __future__ import annotations

import csv
import io
import os
import re
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from rps_pin.errors import InputError, shown
from rps_pin.interruption import remove_leftovers, scratch_name, signals_as_ctrl_c
from rps_pin.output_places import FILES_READ, through_links_and_streams

_USD = "a USD file; convert it with Isaac Sim's URDF exporter"
_BEGINNINGS: tuple[tuple[bytes, str], ...] = (
    (b"\x1f\x8b", "a gzip archive; unpack it first"),
    (b"PK\x03\x04", "a zip archive; unpack it first"),
    (b"BZh", "a bzip2 archive; unpack it first"),
    (b"\xfd7zXZ\0", "an xz archive; unpack it first"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive; unpack it first"),
    (b"\x89HDF", "an HDF5 file"),
    (b"\x89PNG", "a PNG image"),
    (b"%PDF", "a PDF"),
    (b"\x7fELF", "a program or library"),
    (b"PXR-USDC", _USD),
    (b"#usda", _USD),
    (
        b"version https://git-lfs.github.com/spec/",
        "a pointer of Git LFS, which stands for the file; fetch the file with 'git lfs pull'",
    ),
)
_BEFORE_ROOT = re.compile(rb"<!--.*?-->|<\?[^>]*\?>", re.DOTALL)
_HTML = re.compile(rb"\s*<(!doctype\s+html|html)\b", re.I)
_ROOT = re.compile(rb"\s*<([A-Za-z_][\w:.-]*)")
_TITLE = re.compile(rb"<title[^>]*>\s*([^<]{1,80}?)\s*</title>", re.I)
#: Bytes that are looked at.
_ENOUGH = 10000
_MARK = b"\xef\xbb\xbf"


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


def is_there(path: str | os.PathLike[str]) -> bool:
    """Return whether a file or folder exists; unlike `Path`, False where no name can be so long."""
    return os.path.exists(path)  # noqa: PTH110


def is_file(path: str | os.PathLike[str]) -> bool:
    """Return whether a path is a regular file, False as `is_there`."""
    return os.path.isfile(path)  # noqa: PTH113


def is_folder(path: str | os.PathLike[str]) -> bool:
    """Return whether a path is a folder, False as `is_there`."""
    return os.path.isdir(path)  # noqa: PTH112


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


def write_rows(path: str | os.PathLike[str], rows: Iterable[Iterable[object]]) -> None:
    """Write rows of cells as CSV, with commas, whole or not at all; see `whole_file`."""
    write_text(path, csv_of(rows))


def csv_of(rows: Iterable[Iterable[object]]) -> str:
    """Return rows of cells as CSV, with commas."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _umask() -> int:
    """Return the process's umask (which can only be read by setting it)."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def known_format(content: bytes) -> str:
    """Return what a file is that no reader of robots takes, with its article; or nothing.

    Parameters
    ----------
    content
        The file's content, or its first bytes.
    """
    start = _start(content)
    for beginning, what in _BEGINNINGS:
        if start.startswith(beginning):
            return what
    if _HTML.match(_BEFORE_ROOT.sub(b"", start)):
        title = _TITLE.search(start)
        named = f" ({title[1].decode('utf-8', 'replace')!r})" if title else ""
        return f"an HTML page{named}, as a server sends in place of a file"
    return ""


def xml_root_tag(content: bytes) -> str:
    """Return the tag of the root element if a file begins as XML, or nothing."""
    root = _ROOT.match(_BEFORE_ROOT.sub(b"", _start(content)))
    return root[1].decode() if root and b"\0" not in content else ""


def _start(content: bytes) -> bytes:
    return content[:_ENOUGH].removeprefix(_MARK).lstrip()

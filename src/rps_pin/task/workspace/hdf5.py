"""HDF5 files that can always be closed, and data that are in the file itself.

The first write that fails is kept and raised when the file was closed.

HDF5 writes its tables when a file is closed. Where it cannot, on a full disk, it keeps the file
open, and its library crashes at the end of the process. So HDF5 writes through a Python object that
reports success in any case.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py

from rps_pin.errors import InputError
from rps_pin.files import whole_file
from rps_pin.interruption import interruptions_wait
from rps_pin.numerics.locks import only_writer


class LastingFile:
    """A binary file, open for HDF5; after a write that failed it drops what is written."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("r+b", buffering=0)
        self._failure: OSError | None = None
        self.seek, self.tell = self._file.seek, self._file.tell
        self.read, self.readinto = self._file.read, self._file.readinto
        self.close = self._file.close

    def write(self, data: memoryview) -> int:
        """Write all of `data`, or keep the error."""
        rest = data
        try:
            while rest and self._failure is None:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self._failure = error
        return len(data)

    def truncate(self, size: int) -> int:
        """Set the file's size, or keep the error."""
        try:
            if self._failure is None:
                self._file.truncate(size)
        except OSError as error:
            self._failure = error
        return size

    def flush(self) -> None:
        """Do nothing: nothing is buffered."""

    def check(self) -> None:
        """Raise the error that was kept, if there is one."""
        if self._failure is not None:
            raise self._failure


@contextmanager
def workspace_file(
    path: str | os.PathLike[str], overwrite: bool, size: str = ""
) -> Iterator[tuple[h5py.File, LastingFile]]:
    """Give a workspace's file to write, which appears at `path`, whole, when the block ends well.

    Any interruption leaves no file, and what stood at `path` before untouched.

    Parameters
    ----------
    path
        Where.
    overwrite
        Whether a file that exists is replaced.
    size
        How large it will be, for messages: ``" (3 GB)"``.

    Raises
    ------
    InputError
        If the file exists and `overwrite` is false, its folder does not, or another process is
        writing it.
    OSError
        If the disk has no room for it, or a write fails.
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise InputError(f"{target.parent} is not a folder: {target.name} cannot be written there")
    if target.exists() and not overwrite:
        raise InputError(f"{target} exists; overwrite=True replaces it")
    try:
        with only_writer(target), whole_file(target) as scratch, new_hdf5_file(scratch) as opened:
            yield opened
    except OSError as error:
        code = error.errno or errno.EIO
        raise OSError(
            code,
            f"the workspace{size} could not be written, and no part of it was kept: "
            f"{os.strerror(code)}",
            str(target),
        ) from error


@contextmanager
def new_hdf5_file(path: Path) -> Iterator[tuple[h5py.File, LastingFile]]:
    """Give an HDF5 file to write, in place of a file that is there, and what it writes through.

    Calls of HDF5 in the block belong into `interruptions_wait`.

    Raises
    ------
    OSError
        At the end of the block, if a write has failed.
    """
    disk = LastingFile(path)
    try:
        with interruptions_wait():
            file = h5py.File(disk, "w")
        try:
            yield file, disk
        finally:
            with interruptions_wait():
                file.close()
    finally:
        disk.close()
    disk.check()


def own_dataset(file: h5py.File, name: str) -> h5py.Dataset:
    """Return a dataset of a file that is in the file itself.

    A link, and storage elsewhere, would read any file that the file names.

    Raises
    ------
    InputError
        If it is not there, or not so.
    """
    link, item = file.get(name, getlink=True), None
    if isinstance(link, h5py.HardLink):
        item = file[name]
    if not isinstance(item, h5py.Dataset) or item.external or item.is_virtual:
        raise InputError(f"{name} must be a dataset of the file itself, not a link or elsewhere")
    return item

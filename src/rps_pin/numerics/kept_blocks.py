"""Blocks of a long computation, kept beside the file that they are for, so that it can go on.

They stand in a hidden folder, one file each, written whole or not at all, with the description of
the computation: blocks of another one are refused. Only one process at a time has the folder.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from rps_pin.errors import InputError
from rps_pin.files import whole_file
from rps_pin.numerics.locks import locked

_NAME, _LOCK = "computation.txt", "lock"


class KeptBlocks:
    """The blocks that a computation has kept, for this process alone while the context lasts.

    The folder is removed when the context ends without error, or holds no block.

    Parameters
    ----------
    target
        The file that the blocks are for.
    description
        What decides their numbers: what JSON has, and arrays.

    Raises
    ------
    InputError
        If blocks of another computation are there, or another process computes them.
    OSError
        If the folder cannot be made or read.
    """

    def __init__(self, target: str | os.PathLike[str], description: Mapping[str, Any]) -> None:
        path = Path(target)
        self.folder = path.with_name(f".{path.name}.blocks")
        key = hashlib.sha256(
            json.dumps(description, sort_keys=True, default=_of_array).encode()
        ).hexdigest()
        self._lock = locked(
            self.folder / _LOCK,
            f"another process computes the blocks in {self.folder}; wait for it, or give another "
            "file",
        )
        try:
            self._refuse_others(key)
        except BaseException:
            os.close(self._lock)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None or not any(self.folder.glob("*.npz")):
                shutil.rmtree(self.folder)
        finally:
            os.close(self._lock)

    def _refuse_others(self, key: str) -> None:
        name = self.folder / _NAME
        if not name.exists():
            with whole_file(name) as scratch:
                scratch.write_text(key, encoding="ascii")
        elif name.read_text(encoding="ascii") != key:
            raise InputError(
                f"{self.folder} holds blocks of another computation (other robot, grid, options or "
                "version); remove the folder, or give another file"
            )

    def has(self, index: int) -> bool:
        """Return whether a block is there."""
        return self._path(index).exists()

    def get(self, index: int) -> dict[str, NDArray[Any]] | None:
        """Return a block's arrays by name; none if it is not there, or spoilt."""
        try:
            path = self._path(index)
            with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
                return {name: stored[name] for name in stored.files}
        except (FileNotFoundError, ValueError, zipfile.BadZipFile, EOFError, KeyError):
            return None

    def put(self, index: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Keep a block's arrays."""
        with whole_file(self._path(index)) as scratch, scratch.open("wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]

    def _path(self, index: int) -> Path:
        return self.folder / f"{index}.npz"


def _of_array(value: Any) -> str:
    array = np.ascontiguousarray(value)
    return hashlib.sha256(f"{array.dtype.str} {array.shape}".encode() + array.tobytes()).hexdigest()

"""Blocks of a long computation, kept beside the file that they are for, so that it can go on.

They stand in a hidden folder, one file each, written whole or not at all, with the description of
the computation: blocks of another one are refused. The folder is removed when the file is written.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rps_pin.errors import InputError
from rps_pin.files import whole_file

_NAME = "computation.txt"


class KeptBlocks:
    """The blocks that a computation has kept.

    Parameters
    ----------
    target
        The file that the blocks are for.
    description
        What decides their numbers: what JSON has, and arrays.

    Raises
    ------
    InputError
        If blocks of another computation are there.
    OSError
        If the folder cannot be made or read.
    """

    def __init__(self, target: Path, description: Mapping[str, Any]) -> None:
        self.folder = target.with_name(f".{target.name}.blocks")
        key = hashlib.sha256(
            json.dumps(description, sort_keys=True, default=_of_array).encode()
        ).hexdigest()
        self.folder.mkdir(exist_ok=True)
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

    def remove(self) -> None:
        """Remove all blocks."""
        shutil.rmtree(self.folder)

    def _path(self, index: int) -> Path:
        return self.folder / f"{index}.npz"


def _of_array(value: Any) -> str:
    array = np.ascontiguousarray(value)
    return hashlib.sha256(f"{array.dtype.str} {array.shape}".encode() + array.tobytes()).hexdigest()

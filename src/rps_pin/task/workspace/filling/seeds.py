"""Configurations from which blocks are filled, in memory or on a disk until they are needed."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Protocol

import numpy as np

from rps_pin.arrays import Array


class Store(Protocol):
    """Rows (n, nq) of configurations for each of many blocks, which are added in portions."""

    def add(self, block: int, q: Array) -> None:
        """Add rows of a block."""
        ...

    def get(self, block: int) -> Array:
        """Return all rows of a block, in the order in which they were added."""
        ...

    def drop(self, block: int) -> None:
        """Forget a block's rows."""
        ...


class InMemory:
    """Rows in memory."""

    def __init__(self) -> None:
        self._rows: dict[int, list[Array]] = defaultdict(list)

    def add(self, block: int, q: Array) -> None:
        """Add rows of a block."""
        self._rows[block].append(q)

    def get(self, block: int) -> Array:
        """Return all rows of a block, in the order in which they were added."""
        return np.concatenate(self._rows[block])

    def drop(self, block: int) -> None:
        """Forget a block's rows."""
        del self._rows[block]


class OnDisk:
    """Rows in files of a folder, one of each block.

    Parameters
    ----------
    folder
        Where; files of these names are replaced.
    name
        What the files' names begin with.
    size
        Numbers of a row, nq.
    """

    def __init__(self, folder: Path, name: str, size: int) -> None:
        self._folder, self._name, self._size = folder, name, size
        self._begun: set[int] = set()

    def add(self, block: int, q: Array) -> None:
        """Add rows of a block."""
        with self._path(block).open("ab" if block in self._begun else "wb") as file:
            file.write(np.ascontiguousarray(q, dtype=np.float64).tobytes())
        self._begun.add(block)

    def get(self, block: int) -> Array:
        """Return all rows of a block, in the order in which they were added."""
        return np.fromfile(self._path(block), dtype=np.float64).reshape(-1, self._size)

    def drop(self, block: int) -> None:
        """Forget a block's rows."""
        self._path(block).unlink()
        self._begun.remove(block)

    def _path(self, block: int) -> Path:
        return self._folder / f"{self._name}_{block}.bin"

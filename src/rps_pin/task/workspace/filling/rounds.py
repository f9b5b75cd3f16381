"""A grid filled in rounds: in each, every block that has new seeds, independently of the others.

What a block is filled from is what was known at the end of the round before, and what the blocks
find is put together in their order. So the result does not depend on who computes them, and when.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from rps_pin.arrays import Array, Indices
from rps_pin.task.workspace.filling.division import Bits, Division, flags_of, marked, no_flags
from rps_pin.task.workspace.filling.flood import Seeds, Work
from rps_pin.task.workspace.filling.seeds import Store


class Rounds:
    """What is known of a grid's blocks while they are filled.

    Memory: a bit for each point of a block that is begun, and four bytes for each seed.

    Parameters
    ----------
    division
        The blocks.
    make
        Makes a store of configurations: twice, for the seeds of this round and of the next.
    first, q
        Flat index of the grid's point to begin at, and the closed configuration there, (nq,).
    """

    def __init__(
        self, division: Division, make: Callable[[str], Store], first: int, q: Array
    ) -> None:
        self._division = division
        self._reached: dict[int, Bits] = {}
        self._new: dict[int, Bits] = {}
        self._now, self._next = make("this"), make("next")
        #: Seeds of the next round: their indices in the block, in the order of the store's rows.
        self._found: dict[int, list[NDArray[np.int32]]] = defaultdict(list)
        #: Seeds of this round: indices, and which rows of the store these are.
        self._seeds: dict[int, tuple[NDArray[np.int32], Indices]] = {}
        block, at = division.find(first)
        self._add(block, np.array([at], dtype=np.int32), q[None])

    def __iter__(self) -> Iterator[list[int]]:
        """Give the blocks of each round; `take` wants the results of all before the next."""
        while blocks := self._begin():
            yield blocks
            for block in blocks:
                self._now.drop(block)
            for block, bits in self._new.items():
                self._reached[block] |= bits
            self._new.clear()

    def work(self, block: int) -> Work:
        """Return what a block of this round is filled from."""
        division = self._division
        at, rows = self._seeds[block]
        beside: list[Bits | None] = []
        for axis, way in division.faces:
            other = division.beside(block, (axis, way))
            beside.append(None if other is None else self._layer(other, (axis, -way)))
        seeds = Seeds(at, self._now.get(block)[rows])
        return Work(block, seeds, self._reached[block], tuple(beside))

    def take(self, block: int, at: NDArray[np.int32], beside: tuple[Seeds, ...]) -> None:
        """Take over what was found in a block of this round; in the order of the blocks."""
        size = int(np.prod(self._division.shape(block)))
        self._new[block] = marked(no_flags(size), at, size)
        for (axis, way), seeds in zip(self._division.faces, beside, strict=True):
            other = self._division.beside(block, (axis, way))
            if other is not None and len(seeds.at):
                self._add(other, self._division.in_layer(other, (axis, -way), seeds.at), seeds.q)

    def _add(self, block: int, at: NDArray[np.int32], q: Array) -> None:
        self._found[block].append(at)
        self._next.add(block, q)

    def _begin(self) -> list[int]:
        """Begin a round and return its blocks: those with seeds that were not reached before."""
        self._now, self._next = self._next, self._now
        self._seeds = {}
        for block in sorted(self._found):
            at = np.concatenate(self._found[block])
            shape = self._division.shape(block)
            reached = self._reached.setdefault(block, no_flags(int(np.prod(shape))))
            at, rows = np.unique(at, return_index=True)  # of each point, the first row
            new = ~flags_of(reached, shape).reshape(-1)[at]
            if new.any():
                self._seeds[block] = at[new], rows[new]
                self._reached[block] = marked(reached, at[new], int(np.prod(shape)))
            else:
                self._now.drop(block)
        self._found.clear()
        return list(self._seeds)

    def _layer(self, block: int, face: tuple[int, int]) -> Bits:
        """Return the flags of a block's layer at a face; none is set in one not begun."""
        division = self._division
        reached = self._reached.get(block)
        if reached is None:
            shape = division.shape(block)
            return no_flags(int(np.prod(shape)) // shape[face[0]])
        return division.layer(block, face, reached)

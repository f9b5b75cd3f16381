"""A grid divided into blocks: boxes of about as many points along each axis."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rps_pin.arrays import Indices

#: Points of a block: enough to amortise calls on its fronts, few enough for flat memory.
LEAST_POINTS, MOST_POINTS = 32_768, 131_072
#: Blocks at least of a grid whose blocks would be larger than the least.
_FEWEST = 64

#: A face of a block: its axis, and -1 (the lower) or 1.
Face = tuple[int, int]
#: Flags of points, eight a byte, in the order of the points.
Bits = NDArray[np.uint8]


class Division:
    """The blocks of a grid, numbered in the order of their places.

    It depends on the grid's shape alone, so that results do not depend on who computes them.

    Parameters
    ----------
    shape
        Points along each axis of the grid.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.grid = shape
        most = min(max(math.prod(shape) // _FEWEST, LEAST_POINTS), MOST_POINTS)
        counts = [1] * len(shape)
        while math.prod(sides := _sides(shape, counts)) > most:
            counts[sides.index(max(sides))] += 1
        #: Points along each axis of a block that no end of the grid cuts off.
        self.sides = _sides(shape, counts)
        #: Blocks along each axis.
        self.counts = tuple(-(-n // side) for n, side in zip(shape, self.sides, strict=True))
        self.faces: tuple[Face, ...] = tuple(
            (axis, way) for axis in range(len(shape)) for way in (-1, 1)
        )

    def slices(self, block: int) -> tuple[slice, ...]:
        """Return where a block is in the grid."""
        place = np.unravel_index(block, self.counts)
        return tuple(
            slice(int(k) * side, min((int(k) + 1) * side, n))
            for k, side, n in zip(place, self.sides, self.grid, strict=True)
        )

    def shape(self, block: int) -> tuple[int, ...]:
        """Return how many points a block has along each axis."""
        return tuple(one.stop - one.start for one in self.slices(block))

    def places(self, block: int, at: NDArray[np.int32]) -> tuple[Indices, ...]:
        """Return where points of a block are in the grid, along each axis."""
        place = np.unravel_index(at, self.shape(block))
        return tuple(k + one.start for k, one in zip(place, self.slices(block), strict=True))

    def beside(self, block: int, face: Face) -> int | None:
        """Return the block on the other side of a face; none at the end of the grid."""
        axis, way = face
        place = [int(k) for k in np.unravel_index(block, self.counts)]
        place[axis] += way
        if not 0 <= place[axis] < self.counts[axis]:
            return None
        return int(np.ravel_multi_index(place, self.counts))

    def in_layer(self, block: int, face: Face, at: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return flat indices in a block of points of its outermost layer at a face.

        `at` are their indices in that layer, which has no axis across the face.
        """
        axis, way = face
        shape = self.shape(block)
        place = list(np.unravel_index(at, (*shape[:axis], *shape[axis + 1 :])))
        place.insert(axis, np.full(len(at), 0 if way < 0 else shape[axis] - 1, dtype=np.intp))
        return np.ravel_multi_index(tuple(place), shape).astype(np.int32)

    def layer(self, block: int, face: Face, reached: Bits) -> Bits:
        """Return the flags of a block's outermost layer at a face."""
        axis, way = face
        flags = flags_of(reached, self.shape(block))
        return np.packbits(flags.take(0 if way < 0 else -1, axis=axis))

    def find(self, point: int) -> tuple[int, int]:
        """Return the block of a point of the grid, and the point's flat index in the block."""
        place = [int(k) for k in np.unravel_index(point, self.grid)]
        in_blocks = [k // side for k, side in zip(place, self.sides, strict=True)]
        block = int(np.ravel_multi_index(in_blocks, self.counts))
        local = [k - one.start for k, one in zip(place, self.slices(block), strict=True)]
        return block, int(np.ravel_multi_index(local, self.shape(block)))


def flags_of(bits: Bits, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return packed flags as an array of a shape."""
    size = math.prod(shape)
    return np.unpackbits(bits, count=size).astype(bool).reshape(shape)


def no_flags(size: int) -> Bits:
    """Return packed flags of which none is set."""
    return np.packbits(np.zeros(size, dtype=bool))


def marked(bits: Bits, at: NDArray[np.int32], size: int) -> Bits:
    """Return packed flags of `size` points with some more set."""
    flags = flags_of(bits, (size,))
    flags[at] = True
    return np.packbits(flags)


def _sides(shape: tuple[int, ...], counts: list[int]) -> tuple[int, ...]:
    return tuple(-(-n // count) for n, count in zip(shape, counts, strict=True))

"""Zero level sets of functions on regular grids of three dimensions: marching tetrahedra.

Every cell of the grid is cut into six tetrahedra, and a tetrahedron whose corners differ in sign
is cut by one or two triangles (Doi and Koide 1991). No case is ambiguous, and each vertex is known
by the edge it lies on, so that it can be moved along the edge onto the true level set.
(``marching_cubes`` of scikit-image returns interpolated vertices without their edges.)
"""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np

from rps_pin.arrays import Array, Bools, Indices

#: By the number of negative corners, which come first: triangles, each vertex by its edge's ends.
_CUTS = {
    1: [np.array([[0, 1], [0, 2], [0, 3]])],
    2: [np.array([[0, 2], [0, 3], [1, 2]]), np.array([[1, 2], [0, 3], [1, 3]])],
    3: [np.array([[0, 3], [1, 3], [2, 3]])],
}


def zero_triangles(values: Array, grid: tuple[int, ...]) -> tuple[Indices, Indices]:
    """Return the zero level set of values at a grid's nodes.

    Parameters
    ----------
    values
        At the nodes, in the grid's order, shape (nodes,). Zero counts as positive.
    grid
        Nodes along each of the three axes.

    Returns
    -------
    ends : (n, 2)
        The two nodes between which each vertex lies; the first one's value is negative.
    triangles : (m, 3)
        Indices of vertices.
    """
    negative = values < 0
    corners = []
    for tetrahedron in _tetrahedra(grid):
        below = negative[tetrahedron]
        count = below.sum(axis=1)
        # The negative nodes first; the order within a kind does not matter.
        nodes = np.take_along_axis(tetrahedron, np.argsort(~below, axis=1, kind="stable"), axis=1)
        for negatives, triangles in _CUTS.items():
            cut = nodes[count == negatives]
            corners += [cut[:, edges] for edges in triangles]  # (k, 3 vertices, 2 ends)
    ends, index = np.unique(np.concatenate(corners).reshape(-1, 2), axis=0, return_inverse=True)
    return ends, index.reshape(-1, 3)


def without_vertices(triangles: Indices, kept: Bools) -> Indices:
    """Return the triangles (m, 3) all of whose vertices are kept, renumbered among those."""
    return np.asarray((np.cumsum(kept) - 1)[triangles[kept[triangles].all(axis=1)]])


def _tetrahedra(grid: tuple[int, ...]) -> list[Indices]:
    """Return the six tetrahedra of every cell, (cells, 4 nodes) each: one for each order of axes.

    Each goes from the cell's first corner to the opposite one along the axes in that order, so that
    neighbouring cells agree on the diagonals of their common faces.
    """
    index = np.arange(math.prod(grid)).reshape(grid)
    found = []
    for order in permutations(range(3)):
        step = np.zeros(3, dtype=int)
        nodes = [index[:-1, :-1, :-1]]
        for axis in order:
            step[axis] = 1
            part = tuple(slice(s, n - 1 + s) for s, n in zip(step, grid, strict=True))
            nodes.append(index[part])
        found.append(np.stack([node.ravel() for node in nodes], axis=1))
    return found

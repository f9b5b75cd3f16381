"""The boundary of the points inside of a grid of three axes, as a closed mesh, and mesh files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.errors import InputError
from rps_pin.files import whole_file
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.workspace.result import Region
from rps_pin.task.workspace.volume import cells, refuse_slices

if TYPE_CHECKING:
    import trimesh

MESH_FORMATS = (".stl", ".ply", ".obj", ".glb")


@refuses_other_kinds
def boundary(workspace: Region) -> trimesh.Trimesh:
    """Return the boundary of a workspace over three axes as a closed triangle mesh, normals out.

    A cell of the grid belongs to the workspace if its eight corners are inside; the mesh is made of
    the cells' outer faces. So the workspace itself goes up to a grid step further.

    Returns
    -------
    trimesh.Trimesh
        Vertices in the grid's axes, in their order, m and rad. Its volume is the least of `volume`.

    Raises
    ------
    InputError
        If the grid has not three axes, one of them has a single value, or no cell is inside.
    """
    grid = workspace.grid
    refuse_not_three(grid.over)
    refuse_slices(grid.shape)
    points = grid.points()[..., list(grid.columns)]
    return surface(workspace.inside, points)


@refuses_other_kinds
def save_mesh(
    mesh: trimesh.Trimesh, path: str | os.PathLike[str], *, overwrite: bool = False
) -> None:
    """Write a mesh as STL, PLY, OBJ or GLB, by the file's suffix, whole or not at all; in m.

    Raises
    ------
    InputError
        If the suffix is another one, or the file exists and `overwrite` is false.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in MESH_FORMATS:
        raise InputError(f"{target.name}: a mesh is written as one of {', '.join(MESH_FORMATS)}")
    if target.exists() and not overwrite:
        raise InputError(f"{target} exists; overwrite=True replaces it")
    with whole_file(target) as scratch:
        mesh.export(scratch, file_type=suffix[1:])


def surface(inside: Bools, points: Array) -> trimesh.Trimesh:
    """Return the outer faces of the cells whose corners are inside, as a mesh, normals outwards.

    Parameters
    ----------
    inside
        Of the grid's points, shape (n_1, n_2, n_3).
    points
        Their places, shape (n_1, n_2, n_3, 3).

    Raises
    ------
    InputError
        If no cell is inside.
    """
    quads = _outer_faces(cells(inside), inside.shape)
    if not len(quads):
        raise InputError("no cell of the grid is inside the workspace: it has no boundary")
    used, corners = np.unique(quads, return_inverse=True)
    corners = corners.reshape(-1, 4)
    faces = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    import trimesh  # noqa: PLC0415 (takes long to load)

    mesh = trimesh.Trimesh(points.reshape(-1, 3)[used], faces, process=False)
    if mesh.volume < 0:  # the map from the grid turns the orientation round
        mesh.faces = mesh.faces[:, ::-1]
    return mesh


def refuse_not_three(axes: tuple[str, ...]) -> None:
    """Raise `InputError` unless there are three axes."""
    if len(axes) != 3:
        raise InputError(
            f"the grid has {len(axes)} axes ({', '.join(axes)}); three are needed: take slices "
            "(`plane`), or fewer coordinates"
        )


def _outer_faces(cell: Bools, shape: tuple[int, ...]) -> Indices:
    """Return the outer faces of cells, shape (n, 4): flat indices of grid points.

    Their order is anticlockwise seen from outside in the grid's own coordinates.
    """
    index = np.arange(np.prod(shape)).reshape(shape)
    quads = []
    for axis in range(3):
        padded = np.pad(np.moveaxis(cell, axis, 0), [(1, 1), (0, 0), (0, 0)])
        before, after = padded[:-1], padded[1:]
        layer = np.moveaxis(index, axis, 0)  # axes (axis, axis + 1, axis + 2), or mirrored for 1
        square = np.stack(
            [layer[:, :-1, :-1], layer[:, 1:, :-1], layer[:, 1:, 1:], layer[:, :-1, 1:]], axis=-1
        )
        upwards, downwards = square[before & ~after], square[after & ~before]
        if axis == 1:  # moveaxis leaves (1, 0, 2), a left-handed order
            upwards, downwards = upwards[:, ::-1], downwards[:, ::-1]
        quads += [upwards, downwards[:, ::-1]]
    return np.concatenate(quads)

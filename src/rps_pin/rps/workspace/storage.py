"""Workspaces in HDF5 files: written whole or not at all, self-describing, opened by any reader.

Layout of a file:

- attributes: ``format``, ``parameters`` (JSON of `RPSParameters`), ``grid`` (``"leg lengths"`` or
  ``"poses"``), ``start`` (m, rad), ``min_conditioning``, ``reason_bits`` (JSON: name to bit), and,
  last of all, ``complete``;
- ``axis_1``, ``axis_2``, ``axis_3``: the grid's axes, float64, with ``unit`` and ``meaning``;
- ``reason`` and the other fields over the grid, each with ``unit`` and ``meaning``.

``reason`` and ``pose`` are always there; the other fields follow from the pose in closed form, and
`load_workspace` computes those that a file leaves out.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from rps_pin.errors import InputError, shown
from rps_pin.interruption import interruptions_wait
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.compute import GridJob
from rps_pin.rps.workspace.evaluate import Fields, evaluate
from rps_pin.rps.workspace.grids import AXES, WHOLE, Block, Grid, checked_grid
from rps_pin.rps.workspace.reasons import Reason
from rps_pin.rps.workspace.result import Workspace
from rps_pin.task.workspace.hdf5 import LastingFile, own_dataset, workspace_file
from rps_pin.validation import choice, non_negative_number, real_array, real_vector

FORMAT = "rps_pin workspace 1"
DType = Literal["float32", "float64"]

#: Unit and meaning of each field.
_FIELDS = {
    "reason": ("1", "bits why a point is out, see reason_bits; 0 inside"),
    "pose": ("m, rad, rad", "z, tilt_x, tilt_y; zeros where unreachable"),
    "position": ("m", "x, y, z of the platform's centre in base axes"),
    "length": ("m", "lengths of legs 1, 2, 3"),
    "angle": ("rad", "angles of legs 1, 2, 3"),
    "determinant": ("1", "of K = d(length)/d(z, h tilt_x, h tilt_y)"),
    "conditioning": ("1", "1/cond(K)"),
    "transmission": ("1", "load carried per unit of actuator force"),
}
ALL_FIELDS = tuple(_FIELDS)
#: Values of one axis at most, in a file that is read.
LONGEST_AXIS = 1_000_000
#: How alike a misspelt name is to the right one, by `difflib`.
_ALIKE = 0.8
_VECTORS = ("pose", "position", "length", "angle")


class WorkspaceFile:
    """A file being written; see `new_workspace_file`."""

    def __init__(self, file: h5py.File, disk: LastingFile, fields: Sequence[str]) -> None:
        self._file, self._disk = file, disk
        self._fields = tuple(fields)

    def write(self, block: Block, values: Fields) -> None:
        """Write the fields of one block of the grid."""
        with interruptions_wait():
            for name in self._fields:
                self._file[name][block] = getattr(values, name)
        self._disk.check()


@contextmanager
def new_workspace_file(
    path: str | os.PathLike[str],
    source: Workspace | GridJob,
    *,
    fields: Sequence[str] = ALL_FIELDS,
    dtype: DType = "float64",
    overwrite: bool = False,
) -> Iterator[WorkspaceFile]:
    """Give a file to write a workspace's blocks to; it appears at `path` when the block ends well.

    Any interruption, as of `whole_file`, leaves no file, and what stood at `path` before untouched.

    Raises
    ------
    InputError
        If the file exists and `overwrite` is false, its folder does not, or a field or type is
        unknown.
    OSError
        If the disk has no room for it, or a write fails; says so, and how large it would be.
    """
    names = checked_fields(fields)
    choice(dtype, "dtype", ("float32", "float64"))
    grid = source.grid
    size = grid.size * bytes_per_point(names, dtype)
    with workspace_file(path, overwrite, f" ({size / 1e9:.3g} GB)") as (file, disk):
        with interruptions_wait():
            _describe(file, source)
            for name in names:
                shape = (*grid.shape, 3) if name in _VECTORS else grid.shape
                data = file.create_dataset(name, shape, "uint16" if name == "reason" else dtype)
                data.attrs["unit"], data.attrs["meaning"] = _FIELDS[name]
        yield WorkspaceFile(file, disk, names)
        with interruptions_wait():
            file.attrs["complete"] = True


def _describe(file: h5py.File, source: Workspace | GridJob) -> None:
    """Write what a workspace is of: attributes and axes."""
    grid = source.grid
    file.attrs["format"] = FORMAT
    file.attrs["parameters"] = json.dumps(source.parameters.model_dump())
    file.attrs["grid"] = grid.kind
    file.attrs["start"] = source.start
    file.attrs["min_conditioning"] = source.min_conditioning
    file.attrs["reason_bits"] = json.dumps({str(one.name): int(one) for one in Reason})
    for i, (axis, (meaning, unit)) in enumerate(zip(grid.axes, AXES[grid.kind], strict=True)):
        data = file.create_dataset(f"axis_{i + 1}", data=axis)
        data.attrs["unit"], data.attrs["meaning"] = unit, meaning


@refuses_other_kinds
def save_workspace(
    workspace: Workspace,
    path: str | os.PathLike[str],
    *,
    fields: Sequence[str] = ALL_FIELDS,
    dtype: DType = "float64",
    overwrite: bool = False,
) -> None:
    """Write a workspace to an HDF5 file, whole or not at all.

    Parameters
    ----------
    workspace
        What to write.
    path
        Where; conventionally ``.h5``.
    fields
        Which fields; ``reason`` and ``pose`` are written in any case.
    dtype
        ``"float64"``, exact, or ``"float32"``, half the size and 6e-8 of each value off.
    overwrite
        Whether a file that exists is replaced.

    Raises
    ------
    InputError, OSError
        As `new_workspace_file`.
    """
    with new_workspace_file(
        path, workspace, fields=fields, dtype=dtype, overwrite=overwrite
    ) as file:
        file.write(WHOLE, workspace.fields)


@refuses_other_kinds
def load_workspace(path: str | os.PathLike[str], block: Block | None = None) -> Workspace:
    """Read a workspace, or a block of its grid, from an HDF5 file.

    Datasets of names that are no field's are not read.

    Parameters
    ----------
    path
        A file that `save_workspace` or `workspace_to_file` wrote.
    block
        Slices of the grid's first and second axes, so that a large file need not fit in memory.

    Raises
    ------
    InputError
        If there is no such file, or it does not hold a complete workspace: shapes that fit the
        axes, finite numbers, no singular point inside, all of them in the file itself, no name of
        a field misspelt.
    """
    planes, rows = block or WHOLE
    try:
        if Path(path).exists() and not Path(path).is_file():
            raise InputError(f"cannot read the workspace {path}: it is not a regular file")
        with h5py.File(path, "r") as file:
            complete = file.attrs.get("complete")
            ended = isinstance(complete, np.bool_) and complete
            if file.attrs.get("format") != FORMAT or not ended:
                raise InputError(f"{path} does not hold a complete '{FORMAT}'")
            kind = str(file.attrs["grid"])
            axes = [_dataset(file, f"axis_{i}", None) for i in (1, 2, 3)]
            shape = tuple(axis.size for axis in axes)
            first, second, third = (axis[...] for axis in axes)
            grid = checked_grid(Grid(kind, (first[planes], second[rows], third)))  # type: ignore[arg-type]
            parameters = RPSParameters(**json.loads(file.attrs["parameters"]))
            start = real_vector(file.attrs["start"], 3, "start")
            least = non_negative_number(file.attrs["min_conditioning"], "min_conditioning")
            missing = {"reason", "pose"} - set(file)
            if missing:
                raise InputError(f"{path} has no dataset {', '.join(sorted(missing))}")
            _refuse_misspelt(file)
            stored = {
                name: _dataset(file, name, shape)[planes, rows]
                for name in ALL_FIELDS
                if name in file
            }
        reason = _checked_reason(stored.pop("reason"))
        floats = {name: real_array(values, name) for name, values in stored.items()}
    except InputError as error:
        if str(path) in str(error):
            raise
        raise InputError(f"cannot read the workspace {path}: {error}") from None
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, MemoryError) as error:
        raise InputError(f"cannot read the workspace {path}: {error}") from None
    if len(floats) == len(ALL_FIELDS) - 1:
        fields = Fields(reason=reason, **floats)
    else:  # the others follow from the pose
        found = np.asarray((reason & np.uint16(Reason.UNREACHABLE)) == 0)
        computed = evaluate(parameters, floats["pose"], 1.0, found=found)
        fields = computed._replace(reason=reason, **floats)
    if (fields.determinant[reason == 0] == 0).any():
        raise InputError(f"cannot read the workspace {path}: determinant is 0 at a point inside")
    return Workspace(parameters, grid, start, least, fields)


def _refuse_misspelt(file: h5py.File) -> None:
    """Refuse a name like that of a field which the file lacks; others are their owner's."""
    lacking = [name for name in ALL_FIELDS if name not in file]
    for name in file:
        meant = get_close_matches(name, lacking, n=1, cutoff=_ALIKE)
        if name not in ALL_FIELDS and meant:
            raise InputError(f"no field {shown(name)} (did you mean {meant[0]}?)")


def _dataset(file: h5py.File, name: str, grid: tuple[int, ...] | None) -> h5py.Dataset:
    """Return a field over a grid, or an axis if there is none."""
    item = own_dataset(file, name)
    if name == "reason":
        right, wanted = item.dtype.newbyteorder("=") == np.uint16, "uint16"
    else:
        right, wanted = item.dtype.kind == "f", "floating-point numbers"
    if not right:
        raise InputError(f"{name} is of type {item.dtype}; it must be {wanted}")
    if grid is None:
        if item.ndim != 1 or not 1 <= item.size <= LONGEST_AXIS:
            raise InputError(f"{name} has shape {item.shape}; it must be (n,), n <= {LONGEST_AXIS}")
        return item
    shape = (*grid, 3) if name in _VECTORS else grid
    if item.shape != shape:
        raise InputError(f"{name} has shape {item.shape}; the axes want {shape}")
    return item


def _checked_reason(reason: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Return reasons of known bits, in this machine's byte order."""
    known = sum(int(one) for one in Reason)
    if (reason & ~np.uint16(known)).any():
        raise InputError(f"reason has bits that no reason has; they are {known:#x} together")
    return reason.astype(np.uint16, copy=False)


def checked_fields(fields: Sequence[str]) -> tuple[str, ...]:
    """Return field names in the file's order, ``reason`` and ``pose`` among them."""
    given = [fields] if isinstance(fields, str) else list(fields)
    unknown = [name for name in given if name not in _FIELDS]
    if unknown:
        raise InputError(f"no field {unknown[0]!r}; there are: {', '.join(_FIELDS)}")
    return tuple(name for name in _FIELDS if name in given or name in ("reason", "pose"))


def bytes_per_point(fields: Sequence[str], dtype: DType) -> int:
    """Return how many bytes of a file one point of the grid takes."""
    numbers = sum(3 if name in _VECTORS else 1 for name in fields if name != "reason")
    return 2 + numbers * np.dtype(dtype).itemsize

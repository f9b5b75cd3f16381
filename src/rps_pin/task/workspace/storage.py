"""Workspaces of tasks in HDF5 files: whole or not at all, self-describing, opened by any reader.

Layout of a file:

- attributes: ``format``; ``version`` (of rps_pin); ``mechanism``, its name; ``description``, text
  that says which robot it is; ``actuated`` and ``reasons`` (JSON lists of names; ``reasons[k]`` is
  bit k of ``reason``); ``coordinates``, ``angular``, ``over`` (JSON lists: the task's coordinates,
  which are angles, and which are the axes); ``at`` (values of the others, m and rad, NaN of the
  axes); ``start`` (m, rad); ``min_conditioning``; and, last of all, ``complete``;
- ``axis_1``, ``axis_2``, ...: the axes' values, float64, with ``name`` and ``unit``;
- the fields over the grid, each with ``unit`` and ``meaning``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import h5py
import numpy as np
from numpy.typing import NDArray

import rps_pin
from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.interruption import interruptions_wait
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.workspace.evaluate import TaskFields
from rps_pin.task.workspace.filling.job import Job
from rps_pin.task.workspace.grids import TaskGrid, checked_axis
from rps_pin.task.workspace.hdf5 import LastingFile, own_dataset, workspace_file
from rps_pin.task.workspace.result import TaskWorkspace
from rps_pin.validation import choice, non_negative_number

FORMAT = "rps_pin task workspace 1"
DType = Literal["float32", "float64"]

#: Unit and meaning of each field.
_FIELDS = {
    "reason": ("1", "bits why a point is out, see reasons; 0 inside"),
    "actuators": ("m or rad", "positions of the actuated joints; zeros where unreachable"),
    "gains": ("1", "singular values of K = d(actuators)/d(task) in one unit, falling"),
    "conditioning": ("1", "1/cond(K)"),
    "determinant": ("1", "of K in one unit"),
    "stroke_left": ("1", "least way of an actuator to its limits over its stroke"),
    "holding": ("N or N m", "forces of the actuators at rest; no columns if not computed"),
    "force_share": ("1", "largest force of each actuator over its limit; no columns if not asked"),
    "speed_share": ("1", "largest speed of each actuator over its limit; no columns if not asked"),
}
#: Fields with a column for each actuator, or none; they may be infinite.
_IF_ASKED = ("holding", "force_share", "speed_share")
#: Of these, those that files of version 0.3.0 lack.
_ADDED = ("force_share", "speed_share")


@refuses_other_kinds
def save_workspace(
    workspace: TaskWorkspace,
    path: str | os.PathLike[str],
    *,
    description: str = "",
    overwrite: bool = False,
) -> None:
    """Write a workspace to an HDF5 file, whole or not at all.

    Parameters
    ----------
    workspace
        What to write.
    path
        Where; conventionally ``.h5``.
    description
        Text that says which robot it is: that of its file, as an example.
    overwrite
        Whether a file that exists is replaced.

    Raises
    ------
    InputError
        If the file exists and `overwrite` is false, or its folder does not.
    OSError
        If the disk has no room for it, or a write fails.
    """
    with workspace_file(path, overwrite) as (file, disk):
        with interruptions_wait():
            _write(file, workspace, description)
        disk.check()


@refuses_other_kinds
def load_workspace(
    path: str | os.PathLike[str], block: Sequence[slice] | None = None
) -> TaskWorkspace:
    """Read a workspace, or a part of its grid, from an HDF5 file.

    Parameters
    ----------
    path
        A file that `save_workspace` or `workspace_to_file` wrote.
    block
        Slices of the grid's axes, so that a large file need not fit in memory:
        ``(slice(0, 50), slice(None), slice(None, None, 4))``; the rest of the axes whole.

    Raises
    ------
    InputError
        If there is no such file, or it does not hold a complete workspace: shapes that fit the
        axes, known bits, finite numbers, all of them in the file itself; if `block` has no point
        of it.
    """
    try:
        if Path(path).exists() and not Path(path).is_file():
            raise InputError("it is not a regular file")
        with h5py.File(path, "r") as file:
            complete = file.attrs.get("complete")
            if file.attrs.get("format") != FORMAT or not bool(complete):
                raise InputError(f"it does not hold a complete '{FORMAT}'")
            return _read(file, tuple(block or ()))
    except InputError as error:
        raise InputError(f"cannot read the workspace {path}: {error}") from None
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, MemoryError) as error:
        raise InputError(f"cannot read the workspace {path}: {error}") from None


class WorkspaceFile:
    """A file being written; see `new_workspace_file`."""

    def __init__(self, file: h5py.File, disk: LastingFile, job: Job) -> None:
        self._file, self._disk, self._job = file, disk, job
        self._begun: set[int] = set()

    def write(self, block: int, at: NDArray[np.int32], fields: Mapping[str, NDArray[Any]]) -> None:
        """Write fields of some points of a block."""
        division, empty = self._job.division, self._job.evaluation.empty(())
        shape, where = division.shape(block), division.slices(block)
        with interruptions_wait():
            for name, of_none in empty._asdict().items():
                data = self._file[name]
                if not data.size:
                    continue
                if block in self._begun:
                    whole = data[where]
                else:
                    whole = np.full((*shape, *of_none.shape), of_none, dtype=data.dtype)
                whole.reshape(-1, *of_none.shape)[at] = fields[name]
                data[where] = whole
        self._begun.add(block)
        self._disk.check()


@contextmanager
def new_workspace_file(
    path: str | os.PathLike[str],
    job: Job,
    *,
    dtype: DType = "float64",
    description: str = "",
    overwrite: bool = False,
) -> Iterator[WorkspaceFile]:
    """Give a file to write a workspace's blocks to; it appears at `path` when the block ends well.

    Blocks are the chunks of the file: those in which no point is reached take no room.

    Raises
    ------
    InputError
        If the file exists and `overwrite` is false, or its folder does not; if the type is unknown.
    OSError
        If the disk has no room for it, or a write fails.
    """
    choice(dtype, "dtype", ("float32", "float64"))
    with workspace_file(path, overwrite) as (file, disk):
        with interruptions_wait():
            _describe(file, _Source.of_job(job), description)
            for name, of_none in job.evaluation.empty(())._asdict().items():
                size = of_none.shape
                wide = not size or size[0]
                data = file.create_dataset(
                    name,
                    (*job.grid.shape, *size),
                    "uint64" if name == "reason" else dtype,
                    chunks=(*job.division.sides, *size) if wide else None,
                    fillvalue=of_none.flat[0] if wide else None,
                )
                data.attrs["unit"], data.attrs["meaning"] = _FIELDS[name]
        yield WorkspaceFile(file, disk, job)
        with interruptions_wait():
            file.attrs["complete"] = True


class _Source(NamedTuple):
    """What a workspace is of."""

    mechanism: str
    actuated: Sequence[str]
    grid: TaskGrid
    start: Array
    min_conditioning: float
    reasons: Sequence[str]

    @classmethod
    def of_job(cls, job: Job) -> Self:
        """Return that of a workspace to be computed."""
        mechanism = job.task.mechanism
        name, reasons = mechanism.name or "mechanism", job.evaluation.reasons
        return cls(name, mechanism.actuated, job.grid, job.start, job.min_conditioning, reasons)


def _write(file: h5py.File, workspace: TaskWorkspace, description: str) -> None:
    source = _Source(*(getattr(workspace, name) for name in _Source._fields))
    _describe(file, source, description)
    for name, values in workspace.fields._asdict().items():
        data = file.create_dataset(name, data=values)
        data.attrs["unit"], data.attrs["meaning"] = _FIELDS[name]
    file.attrs["complete"] = True


def _describe(file: h5py.File, source: _Source, description: str) -> None:
    """Write what a workspace is of: attributes and axes."""
    grid = source.grid
    attributes: dict[str, Any] = {
        "format": FORMAT,
        "version": rps_pin.__version__,
        "mechanism": source.mechanism,
        "description": description,
        "actuated": json.dumps(source.actuated),
        "reasons": json.dumps(source.reasons),
        "coordinates": json.dumps(grid.coordinates),
        "angular": json.dumps(grid.angular),
        "over": json.dumps(grid.over),
        "at": grid.at,
        "start": source.start,
        "min_conditioning": source.min_conditioning,
    }
    for name, value in attributes.items():
        file.attrs[name] = value
    for k, (axis, name, unit) in enumerate(zip(grid.axes, grid.over, grid.units, strict=True)):
        data = file.create_dataset(f"axis_{k + 1}", data=axis)
        data.attrs["name"], data.attrs["unit"] = name, unit


def _read(file: h5py.File, block: tuple[slice, ...]) -> TaskWorkspace:
    coordinates, over, actuated, reasons = (
        _names(file, name) for name in ("coordinates", "over", "actuated", "reasons")
    )
    angular = json.loads(file.attrs["angular"])
    if not (
        len(angular) == len(coordinates)
        and all(isinstance(one, bool) for one in angular)
        and over
        and set(over) <= set(coordinates)
        and len(reasons) <= 64
    ):
        raise InputError("its coordinates, axes or reasons do not go together")
    whole = tuple(
        checked_axis(_numbers(file, f"axis_{k + 1}", 1), name) for k, name in enumerate(over)
    )
    axes = _part(whole, block)
    at, start = (np.asarray(file.attrs[name], dtype=np.float64) for name in ("at", "start"))
    for name, one in (("at", at), ("start", start)):
        if one.shape != (len(coordinates),):
            raise InputError(f"{name} has shape {one.shape}; it must be ({len(coordinates)},)")
    grid = TaskGrid(coordinates, tuple(angular), over, axes, at)
    if not np.array_equal(np.isnan(at), [name in over for name in coordinates]):
        raise InputError("at must be NaN of the axes, and of no other coordinate")
    sizes = {"actuators": (len(actuated),), "gains": (len(coordinates),)}
    fields: dict[str, Any] = {}
    for name in _FIELDS:
        if name in _ADDED and name not in file:
            fields[name] = np.zeros((*grid.shape, 0))
            continue
        item = own_dataset(file, name)
        if name in _IF_ASKED:
            sizes[name] = (len(actuated) if item.shape[-1:] == (len(actuated),) else 0,)
        wanted = tuple(len(axis) for axis in whole) + sizes.get(name, ())
        if item.shape != wanted:
            raise InputError(f"{name} has shape {item.shape}; it must be {wanted}")
        values = item[block]
        fields[name] = _flags(values, reasons) if name == "reason" else _floats(values, name)
    least = non_negative_number(file.attrs["min_conditioning"], "min_conditioning")
    mechanism = str(file.attrs["mechanism"])
    return TaskWorkspace(mechanism, actuated, grid, start, least, reasons, TaskFields(**fields))


def _names(file: h5py.File, name: str) -> tuple[str, ...]:
    found = json.loads(file.attrs[name])
    if not (isinstance(found, list) and all(isinstance(one, str) for one in found)):
        raise InputError(f"{name} must be a list of names")
    if len(set(found)) != len(found):
        raise InputError(f"{name} has a name twice")
    return tuple(found)


def _part(axes: tuple[Array, ...], block: tuple[slice, ...]) -> tuple[Array, ...]:
    """Return the axes of a part of a grid."""
    if len(block) > len(axes) or not all(isinstance(one, slice) for one in block):
        raise InputError(f"block = {shown(block)}; it must be at most {len(axes)} slices of axes")
    rest = (slice(None),) * (len(axes) - len(block))
    found = tuple(axis[one] for axis, one in zip(axes, (*block, *rest), strict=True))
    for axis in found:
        checked_axis(axis, "a part of an axis")
    return found


def _flags(values: NDArray[Any], reasons: tuple[str, ...]) -> Any:
    if values.dtype.newbyteorder("=") != np.uint64:
        raise InputError(f"reason is of type {values.dtype}; it must be uint64")
    found = values.astype(np.uint64, copy=False)
    if len(reasons) < 64 and (found >> np.uint64(len(reasons))).any():
        raise InputError("reason has bits that no reason has")
    return found


def _numbers(file: h5py.File, name: str, dimensions: int) -> Array:
    item = own_dataset(file, name)
    if item.ndim != dimensions:
        raise InputError(f"{name} has shape {item.shape}")
    return _floats(item[...], name)


def _floats(values: Any, name: str) -> Array:
    if values.dtype.kind != "f":
        raise InputError(f"{name} is of type {values.dtype}; it must be floating-point numbers")
    if name not in _IF_ASKED and not np.isfinite(values).all():
        raise InputError(f"{name} holds numbers that are not finite")
    return np.asarray(values, dtype=np.float64)

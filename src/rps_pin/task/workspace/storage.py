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
from pathlib import Path
from typing import Any

import h5py
import numpy as np

import rps_pin
from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.interruption import interruptions_wait
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.workspace.evaluate import TaskFields
from rps_pin.task.workspace.grids import TaskGrid, checked_axis
from rps_pin.task.workspace.hdf5 import own_dataset, workspace_file
from rps_pin.task.workspace.result import TaskWorkspace
from rps_pin.validation import non_negative_number

FORMAT = "rps_pin task workspace 1"

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
def load_workspace(path: str | os.PathLike[str]) -> TaskWorkspace:
    """Read a workspace from an HDF5 file that `save_workspace` wrote.

    Raises
    ------
    InputError
        If there is no such file, or it does not hold a complete workspace: shapes that fit the
        axes, known bits, finite numbers, all of them in the file itself.
    """
    try:
        if Path(path).exists() and not Path(path).is_file():
            raise InputError("it is not a regular file")
        with h5py.File(path, "r") as file:
            complete = file.attrs.get("complete")
            if file.attrs.get("format") != FORMAT or not bool(complete):
                raise InputError(f"it does not hold a complete '{FORMAT}'")
            return _read(file)
    except InputError as error:
        raise InputError(f"cannot read the workspace {path}: {error}") from None
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, MemoryError) as error:
        raise InputError(f"cannot read the workspace {path}: {error}") from None


def _write(file: h5py.File, workspace: TaskWorkspace, description: str) -> None:
    grid = workspace.grid
    attributes: dict[str, Any] = {
        "format": FORMAT,
        "version": rps_pin.__version__,
        "mechanism": workspace.mechanism,
        "description": description,
        "actuated": json.dumps(workspace.actuated),
        "reasons": json.dumps(workspace.reasons),
        "coordinates": json.dumps(grid.coordinates),
        "angular": json.dumps(grid.angular),
        "over": json.dumps(grid.over),
        "at": grid.at,
        "start": workspace.start,
        "min_conditioning": workspace.min_conditioning,
    }
    for name, value in attributes.items():
        file.attrs[name] = value
    for k, (axis, name, unit) in enumerate(zip(grid.axes, grid.over, grid.units, strict=True)):
        data = file.create_dataset(f"axis_{k + 1}", data=axis)
        data.attrs["name"], data.attrs["unit"] = name, unit
    for name, values in workspace.fields._asdict().items():
        data = file.create_dataset(name, data=values)
        data.attrs["unit"], data.attrs["meaning"] = _FIELDS[name]
    file.attrs["complete"] = True


def _read(file: h5py.File) -> TaskWorkspace:
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
    axes = tuple(
        checked_axis(_numbers(file, f"axis_{k + 1}", 1), name) for k, name in enumerate(over)
    )
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
        wanted = grid.shape + sizes.get(name, ())
        if item.shape != wanted:
            raise InputError(f"{name} has shape {item.shape}; it must be {wanted}")
        fields[name] = _flags(item, reasons) if name == "reason" else _floats(item[...], name)
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


def _flags(item: h5py.Dataset, reasons: tuple[str, ...]) -> Any:
    if item.dtype.newbyteorder("=") != np.uint64:
        raise InputError(f"reason is of type {item.dtype}; it must be uint64")
    found = item[...].astype(np.uint64, copy=False)
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

"""Mutants of workspaces in HDF5 files: attributes, datasets, types and links."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np

from rps_pin import RPSRobot
from rps_pin.rps.workspace import leg_grid, save_workspace, workspace
from tests.fuzz import hostile

_ODD: list[Any] = [
    *(np.nan, np.inf, -1.0, 0, 1e300, "", "x", "{}", "[1]", '{"a": 1}', b"\xff", True, 10**18),
    *(np.zeros(0), np.zeros(3), np.full(3, np.nan), np.zeros((2, 2)), h5py.Empty("f8")),
]
_TYPES = ["f2", "f4", ">f8", "i4", "u2", ">u2", "i8", "S3", "c16", "bool", "u1"]


@cache
def _start() -> bytes:
    robot = RPSRobot.from_preset("micro")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "w.h5"
        save_workspace(workspace(robot, leg_grid(robot.parameters, 3)), path)
        return path.read_bytes()


def mutant(rng: Random) -> tuple[bytes, str]:
    """Return a mutant, and why it must be refused, if it must."""
    content = _start()
    if rng.random() < 0.15:
        return hostile.with_bytes_changed(content, rng), ""
    memory, why = io.BytesIO(content), ""
    with h5py.File(memory, "r+") as file:
        for _ in range(rng.choice([0, 1, 1, 1, 2, 3])):
            why = why or rng.choice(_CHANGES)(file, rng)
            if why:
                break
    return memory.getvalue(), why


def _name(file: h5py.File, rng: Random) -> str:
    hard = [name for name in file if file.get(name, getlink=True).__class__ is h5py.HardLink]
    return rng.choice(sorted(name for name in hard if isinstance(file[name], h5py.Dataset)))


def _attribute(file: h5py.File, rng: Random) -> str:
    name = rng.choice(sorted(file.attrs))
    file.attrs[name] = rng.choice(_ODD)
    return ""


def _attribute_gone(file: h5py.File, rng: Random) -> str:
    name = rng.choice(sorted(file.attrs))
    del file.attrs[name]
    return "" if name == "reason_bits" else "an attribute that is missing"


def _dataset_gone(file: h5py.File, rng: Random) -> str:
    name = _name(file, rng)
    del file[name]
    return "a dataset that is missing" if name in ("reason", "pose") or "axis" in name else ""


def _renamed(file: h5py.File, rng: Random) -> str:
    name = _name(file, rng)
    file.move(name, hostile.misspelt(name, rng))
    return "a dataset that is misspelt"


def _other_type(file: h5py.File, rng: Random) -> str:
    name = _name(file, rng)
    values = np.asarray(file[name])
    del file[name]
    with np.errstate(all="ignore"):
        try:
            file[name] = np.asarray(values, dtype=float).astype(rng.choice(_TYPES))
        except (TypeError, ValueError):
            file[name] = h5py.Empty("f8")
    return ""


def _other_shape(file: h5py.File, rng: Random) -> str:
    name = _name(file, rng)
    values = np.asarray(file[name])
    del file[name]
    kind = rng.randrange(4)
    if kind == 0:
        file[name] = values[:-1]
    elif kind == 1:
        file[name] = values[..., None]
    elif kind == 2:
        file[name] = np.concatenate([values, values])
    else:
        file[name] = values.ravel()[0]
    return "a shape that does not fit" if "axis" not in name else ""


def _number(file: h5py.File, rng: Random) -> str:
    name = _name(file, rng)
    values = np.asarray(file[name])
    flat = values.reshape(-1)
    if not values.size or values.dtype.kind != "f":
        return ""
    flat[rng.randrange(values.size)] = bad = rng.choice([np.nan, np.inf, -np.inf, 1e300, -5.0, 0.0])
    if values.dtype != file[name].dtype:
        return ""
    file[name][...] = values
    return "" if np.isfinite(bad) else "a number that is not finite"


def _bits(file: h5py.File, rng: Random) -> str:
    if "reason" not in file or file["reason"].dtype != np.uint16:
        return ""
    file["reason"][...] = np.full(file["reason"].shape, 1 << rng.randrange(16), np.uint16)
    return ""


def _link(file: h5py.File, rng: Random) -> str:
    name = _name(file, rng)
    shape = file[name].shape
    del file[name]
    kind = rng.randrange(4)
    if kind == 0:
        file[name] = h5py.ExternalLink("other.h5", "/x")
    elif kind == 1:
        file[name] = h5py.SoftLink(rng.choice(["/axis_1", "/" + name, "/none"]))
    elif kind == 2:
        file.create_group(name)
    else:
        file.create_dataset(name, shape, "f8", external=[("/etc/passwd", 0, 10**6)])
    return "a link or data elsewhere" if name in ("reason", "pose") or "axis" in name else ""


_CHANGES: list[Callable[[h5py.File, Random], str]] = [
    *(_attribute, _attribute, _attribute_gone, _dataset_gone, _renamed, _other_type),
    *(_other_shape, _number, _number, _bits, _link),
]

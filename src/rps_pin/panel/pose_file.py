"""Named poses in a YAML file, one a line, to be written and read by people too.

    level: {z: 0.225, rx: 0, ry: 0}
    tool change: {z: 0.21, rx: 0.1, ry: 0}

The numbers are the task's coordinates, or where there is no task the actuators' positions; m, rad.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import TypeAdapter, ValidationError

from rps_pin.arrays import Array
from rps_pin.config import Finite, read_yaml
from rps_pin.errors import InputError, shown
from rps_pin.files import whole_file
from rps_pin.panel.panel import Panel
from rps_pin.plain_text import plain
from rps_pin.validation import real_vector

LONGEST_NAME = 60
_LEAST = 1e-12
"""Rounding errors are zero in the file, m and rad."""
_POSE: TypeAdapter[dict[str, float]] = TypeAdapter(dict[str, Finite])


class PoseFile:
    """Named poses of a mechanism, kept in a file; saving one leaves the others as they are.

    Parameters
    ----------
    path
        A YAML file. It need not exist: it is written when the first pose is saved.
    panel
        The mechanism's panel.

    Attributes
    ----------
    path : Path
        As given.
    group : str
        The panel's group of sliders that the poses are values of.
    poses : dict of str to ndarray
        The poses by name, m and rad.

    Raises
    ------
    InputError
        If the file cannot be read, or holds something else; with the line.
    """

    def __init__(self, path: str | os.PathLike[str], panel: Panel) -> None:
        if not isinstance(path, (str, os.PathLike)):
            raise InputError(f"a file of poses is given by its path, not by {shown(path)}")
        self.path = Path(path)
        self.group = panel.actuator_group if panel.task is None else panel.task_group
        self._names = panel.mechanism.actuated if panel.task is None else panel.task.coordinates
        self.poses: dict[str, Array] = {}
        self.read()

    def read(self) -> None:
        """Read the file again, which someone may have changed.

        Raises
        ------
        InputError
            As for the whole class.
        """
        self.poses = self._read() if self.path.exists() else {}

    def save(self, name: str, values: ArrayLike, *, replace: bool = False) -> None:
        """Save a pose under a name.

        Parameters
        ----------
        name
            One line of text.
        values
            As the panel's `values` of `group`.
        replace
            Whether a pose of this name may be replaced.

        Raises
        ------
        InputError
            If the name is taken or none, or the file cannot be read or written.
        """
        if not isinstance(name, str) or not 0 < len(name.strip()) <= LONGEST_NAME:
            raise InputError(f"a pose has a name of 1 to {LONGEST_NAME} characters")
        name = name.strip()
        if plain(name) != name or not name.isprintable():
            raise InputError(f"the name {shown(name)} holds characters that are no text")
        row = real_vector(values, len(self._names), "values")
        self.read()
        if name in self.poses and not replace:
            raise InputError(f"{self.path} has a pose {name!r} already: it is not replaced")
        lines = self.path.read_text("utf-8").splitlines() if self.path.exists() else [_HEADING]
        if name in self.poses:
            lines = self._without(name, lines)
        rounded = [0.0 if abs(value) < _LEAST else float(f"{value:.12g}") for value in row.tolist()]
        numbers = ", ".join(
            f"{_quoted(one)}: {value!r}" for one, value in zip(self._names, rounded, strict=True)
        )
        lines.append(f"{_quoted(name)}: {{{numbers}}}")
        try:
            with whole_file(self.path) as file:
                file.write_text("\n".join([*lines, ""]), "utf-8")
        except OSError as error:
            raise InputError(f"cannot write {self.path}: {error.strerror or error}") from None
        self.read()

    def _read(self) -> dict[str, Array]:
        file = read_yaml(self.path, "file of poses")
        return {name: self._pose(file, name, given) for name, given in file.values.items()}

    def _pose(self, file: Any, name: str, given: Any) -> Array:
        told = ", ".join(self._names)
        try:
            values = _POSE.validate_python(given, strict=True)
        except ValidationError:
            raise InputError(
                f"{file.place((name,))}: {shown(name)} is no pose: one has the numbers {told}"
            ) from None
        if set(values) != set(self._names):
            raise InputError(
                f"{file.place((name,))}: the pose {shown(name)} has "
                f"{', '.join(values) or 'nothing'}; one of this mechanism has {told}"
            )
        return np.array([values[one] for one in self._names])

    def _without(self, name: str, lines: list[str]) -> list[str]:
        """Return the file's lines without a pose: its key's line, and those indented below it."""
        place = read_yaml(self.path, "file of poses").place((name,))
        first = int(place.rpartition(" ")[2]) - 1
        last = first + 1
        while last < len(lines) and lines[last][:1] in (" ", "\t", "}"):
            last += 1
        return lines[:first] + lines[last:]


_HEADING = "# Poses of rps-pin view --interactive --poses; m and rad."


def _quoted(name: str) -> str:
    """Return a name as a YAML key: as it is where it is plain words."""
    words = name.replace(" ", "").replace("_", "").replace("-", "")
    reserved = name.lower() in ("y", "n", "yes", "no", "on", "off", "true", "false", "null", "none")
    if words.isalnum() and words.isascii() and name[0].isalpha() and not reserved:
        return name
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'

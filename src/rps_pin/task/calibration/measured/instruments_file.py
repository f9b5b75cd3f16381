"""Instruments from a YAML file.

    trackers:
      laser:                                  # reads A_x, A_y, A_z, B_x, ...
        frame: platform
        targets: {A: [0.1, 0, 0.02], B: [-0.05, 0.09, 0.02], C: [-0.05, -0.09, 0.02]}
        placement: {xyz: [2, 0, 1], rpy: [0, 0, 3.1]}     # about; left out: from the readings
    ball_bars:
      bar: {frame: platform, target: [0, 0, 0], centre: [0.2, 0, 0]}
    heights:
      gauge: {frame: platform, point: [0.1, 0, 0], direction: [0, 0, 1]}
    inclinometers:
      level: {frame: platform, axis: [1, 0, 0]}

Keys are the arguments of `Tracker`, `BallBar`, `Height` and `Inclinometer`; m and rad.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pinocchio as pin
from pydantic import Field

from rps_pin.closed_loop.constraints.closures import frame_id
from rps_pin.closed_loop.io.mechanism_schema import PlacementEntry
from rps_pin.config import Entry, Text, Three, read_config
from rps_pin.task.calibration.measured.instruments import (
    BallBar,
    Height,
    Inclinometer,
    Instrument,
    Tracker,
    sensors_of,
)
from rps_pin.task.task import Task


class _Tracker(Entry):
    frame: Text
    targets: dict[Text, Three]
    placement: PlacementEntry | None = None
    known: bool = False
    unknown_targets: bool = False


class _BallBar(Entry):
    frame: Text
    target: Three
    centre: Three
    known: bool = False


class _Height(Entry):
    frame: Text
    point: Three = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    direction: Three = Field(default_factory=lambda: [0.0, 0.0, 1.0])


class _Inclinometer(Entry):
    frame: Text
    axis: Three
    direction: Three = Field(default_factory=lambda: [0.0, 0.0, 1.0])


class _Instruments(Entry):
    trackers: dict[Text, _Tracker] = Field(default_factory=dict)
    ball_bars: dict[Text, _BallBar] = Field(default_factory=dict)
    heights: dict[Text, _Height] = Field(default_factory=dict)
    inclinometers: dict[Text, _Inclinometer] = Field(default_factory=dict)


_KINDS: dict[str, Any] = {
    "trackers": Tracker,
    "ball_bars": BallBar,
    "heights": Height,
    "inclinometers": Inclinometer,
}


def load_instruments(path: str | os.PathLike[str], task: Task) -> tuple[Instrument, ...]:
    """Return the instruments of a YAML file; see the module's text.

    Parameters
    ----------
    path
        The file.
    task
        The task of the mechanism that was measured.

    Raises
    ------
    InputError
        If the file cannot be read, or does not describe instruments; with file and line.
    MechanismError
        If a frame is unknown.
    """
    file, described = read_config(path, "instruments", _Instruments)
    found: list[Instrument] = []
    for kind, make in _KINDS.items():
        for name, entry in getattr(described, kind).items():
            given = entry.model_dump() | {"name": name}
            if given.get("placement") is not None:
                at = entry.placement
                given["placement"] = pin.SE3(pin.rpy.rpyToMatrix(*at.rpy), np.array(at.xyz))
            with file.at(kind, name):
                frame_id(task.mechanism.model, entry.frame, name)
                one = make(**given)
                sensors_of([*found, one])
            found.append(one)
    return tuple(found)

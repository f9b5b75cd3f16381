"""Robots by the name of a preset or the path of a parameter file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from rps_pin.bounds import YAML, most
from rps_pin.errors import InputError
from rps_pin.files import is_file, is_there
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot

Kind = Literal["mechanism", "trajectory", "scenario", "parameters"]
_KEY = re.compile(rb"^([A-Za-z_]+)\s*:", re.MULTILINE)
#: Keys of which a file of a kind has one.
_KEYS: dict[Kind, set[str]] = {
    "mechanism": {"urdf", "mjcf", "closed_loop", "name_mot"},
    "trajectory": {"kind"},
    "scenario": {"trajectory", "controller", "plant"},
    "parameters": set(RPSParameters.model_fields) - {"name", "gravity"},
}


def load_robot(name_or_file: str, folder: Path = Path()) -> RPSRobot:
    """Return the robot of a preset's name or of a parameter file's path.

    Parameters
    ----------
    name_or_file
        The name or the path.
    folder
        The folder that a relative path is relative to.

    Raises
    ------
    InputError
        If it is neither, or the file is a mechanism's.
    """
    if name_or_file in RPSParameters.presets():
        return RPSRobot.from_preset(name_or_file)
    if not is_there(folder / name_or_file):
        raise InputError(
            f"{name_or_file!r} is not a file or a preset; the presets are: "
            f"{', '.join(RPSParameters.presets())}"
        )
    file = folder / name_or_file
    if kind_of_file(file) == "mechanism":
        raise InputError(
            f"{name_or_file} is the file of a mechanism, not of the parameters of a 3-RPS; "
            "mechanisms are for ClosedLoopModel, for --mechanism of a command, and for rps-pin "
            "describe, simulate, convert and export c"
        )
    return RPSRobot(RPSParameters.from_yaml(file))


def kind_of_file(file: Path) -> Kind | None:
    """Return what a file describes, told by its name's ending and by its first keys.

    Nothing is checked: the reader of that kind says what is wrong. None: it cannot be told.
    """
    suffix = file.suffix.lower()
    if suffix in (".urdf", ".xml", ".mjcf"):
        return "mechanism"
    if suffix == ".csv":
        return "trajectory"
    if not is_file(file) or file.stat().st_size > most(YAML):
        return None
    keys = {key.decode() for key in _KEY.findall(file.read_bytes())}
    return next((kind for kind, telling in _KEYS.items() if keys & telling), None)

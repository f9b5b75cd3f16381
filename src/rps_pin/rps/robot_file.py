"""Robots by the name of a preset or the path of a parameter file."""

from __future__ import annotations

import re
from pathlib import Path

from rps_pin.bounds import YAML, most
from rps_pin.errors import InputError
from rps_pin.files import is_there
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot


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
    if _is_mechanism(file):
        raise InputError(
            f"{name_or_file} is the file of a mechanism, not of the parameters of a 3-RPS; "
            "mechanisms are for ClosedLoopModel, and for rps-pin describe, simulate, convert and "
            "export c"
        )
    return RPSRobot(RPSParameters.from_yaml(file))


def _is_mechanism(file: Path) -> bool:
    """Return whether a file is a URDF, a MuJoCo file, or a description that names one."""
    if file.suffix.lower() in (".urdf", ".xml", ".mjcf"):
        return True
    if not file.is_file() or file.stat().st_size > most(YAML):
        return False
    return re.search(rb"^(urdf|mjcf)\s*:", file.read_bytes(), re.MULTILINE) is not None

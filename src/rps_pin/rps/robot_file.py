"""Robots by the name of a preset or the path of a parameter file."""

from __future__ import annotations

from pathlib import Path

from rps_pin.errors import InputError
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
        If it is neither.
    """
    if name_or_file in RPSParameters.presets():
        return RPSRobot.from_preset(name_or_file)
    if not (folder / name_or_file).exists():
        raise InputError(
            f"{name_or_file!r} is not a file or a preset; the presets are: "
            f"{', '.join(RPSParameters.presets())}"
        )
    return RPSRobot(RPSParameters.from_yaml(folder / name_or_file))

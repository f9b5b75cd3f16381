"""Sizes up to which work is begun, told before memory or time run out; and the switch for more.

The environment variable `SWITCH` multiplies them all: ``RPS_PIN_BOUNDS=10``. The stack must then be
large enough for links in a row (``ulimit -s``), and the memory for the rest.
"""

from __future__ import annotations

import math
import os

from rps_pin.errors import InputError, MechanismError

SWITCH = "RPS_PIN_BOUNDS"

#: Pinocchio's scratch memory grows as the cube of the velocities: 300 take 1.8 GB, 1000 20 GB.
MOST_VELOCITIES = 400
#: Pinocchio's parser calls itself once a link of a row: 4000 end the process.
LINKS_IN_A_ROW = 1000
#: Links of a URDF, which take 4 s.
LINKS = 20_000
#: Steps of a simulation; rows that it keeps, of some kB each; ticks of a control loop, likewise.
STEPS, ROWS, TICKS = 10_000_000, 2_000_000, 2_000_000
#: Bytes of a URDF or MJCF, without its meshes; and of a YAML file, which takes 20 s a megabyte.
XML, YAML = 64 * 2**20, 200_000
#: Values of a YAML file, its aliases expanded.
VALUES = 100_000
#: Points of an axis of a workspace's grid.
POINTS = 1_000_000
#: Integration steps in a tick, and ticks between a command and its effect.
SUBSTEPS, DELAY = 1000, 100_000


def most(bound: int) -> int:
    """Return a bound, multiplied as the environment says.

    Raises
    ------
    InputError
        If the variable is not a number from 1 to 1e6.
    """
    text = os.environ.get(SWITCH, "1")
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not 1 <= factor <= 1e6:
        raise InputError(f"the environment variable {SWITCH} = {text!r} must be from 1 to 1e6")
    return round(factor * bound)


#: What to say of a bound that a reader met.
FOR_MORE = f"the environment variable {SWITCH}=10 takes ten times as many"


def beyond(size: float, bound: int) -> str:
    """Return what to say of a size beyond a bound; or nothing: ``"at most 400 are taken ..."``."""
    if size <= bound or size <= (limit := most(bound)):
        return ""
    return f"at most {limit} are taken; {FOR_MORE}"


def check_size(size: float, bound: int, what: str) -> None:
    """Raise `InputError` if a size is beyond a bound: ``"duration / step = ... steps"``."""
    if why := beyond(size, bound):
        raise InputError(f"{what}: {why}")


def check_velocities(count: int, where: str) -> None:
    """Raise `MechanismError` if a mechanism has too many velocities."""
    if why := beyond(count, MOST_VELOCITIES):
        raise MechanismError(
            f"{where} has {count} velocities; the memory for them grows as their cube, and {why}"
        )

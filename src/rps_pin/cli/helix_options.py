"""Options of a helix, for the commands that take one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from typing import Annotated, Any

import numpy as np
import typer

from rps_pin.cli.printing import say
from rps_pin.errors import InputError, UnreachableError
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.helix import PAPER_DURATION, HelixPath, helix

#: Chosen for the robot: see `chosen_helix`.
DEFAULT_RADIUS: float | None = None
DEFAULT_PITCH: float | None = None
DEFAULT_DURATION = PAPER_DURATION
PAPER_RADIUS, PAPER_PITCH = 0.75e-3, 0.5e-3
#: z_0 of Table 1 as interpreted here, and its base radius g, m.
_PAPER_HEIGHT, _PAPER_BASE_RADIUS = 0.4, 0.46
#: h of Table 1, and platforms' radii between which the paper's helix is neither large nor small, m.
_PAPER_PLATFORM_RADIUS, _ALIKE = 0.23, (0.1, 0.5)
#: Samples of a helix that is looked whether it fits, and steps to the largest radius.
_SAMPLES, _STEPS = 361, 40


class Branch(StrEnum):
    """The two tilts that carry the centre along the same helix."""

    PLUS = "+"
    MINUS = "-"


RadiusOption = Annotated[
    float | None,
    typer.Option(
        help="Radius r_h of the helix, m. Default: the paper's 0.00075, in proportion for robots "
        "of other sizes; without --height at most what the robot's limits allow.",
        show_default=False,
    ),
]
PitchOption = Annotated[
    float | None,
    typer.Option(
        help="Pitch p_h: the climb in one turn, m. Default: the paper's 0.0005, or two thirds of a "
        "radius that was chosen.",
        show_default=False,
    ),
]
HeightOption = Annotated[
    float | None,
    typer.Option(
        help="Height z_0 of the platform at the start, m. Default: the middle of the legs' "
        "stroke; without limits, the paper's 0.4 m in proportion to the base.",
        show_default=False,
    ),
]
BranchOption = Annotated[
    Branch,
    typer.Option(help="Which tilt: **+** the paper's (alpha, beta), **-** its (alpha, -beta)."),
]
DurationOption = Annotated[
    float, typer.Option(help="Duration, s. Eq. 29 as corrected lasts 5.2388 s.")
]


def chosen_helix(
    robot: RPSRobot,
    radius: float | None,
    pitch: float | None,
    height: float | None,
    branch: Branch,
    duration: float,
) -> HelixPath:
    """Return the helix that the options describe; sizes that are not given fit the robot."""
    if radius is None:
        radius, pitch = _chosen_sizes(robot, pitch, height is None, branch)
    if pitch is None:
        pitch = PAPER_PITCH
    if height is None:
        height = middle_height(robot.parameters, pitch)
    sizes = {"radius": radius, "pitch": pitch, "height": height, "duration": duration}
    return helix(robot, branch=branch.value, **sizes)


def _chosen_sizes(
    robot: RPSRobot, pitch: float | None, fitted: bool, branch: Branch
) -> tuple[float, float]:
    """Return radius and pitch: the paper's in proportion, or, if `fitted`, what limits allow."""
    h = robot.parameters.platform_radius
    alike = _ALIKE[0] <= h <= _ALIKE[1]
    wanted = PAPER_RADIUS * (1.0 if alike else h / _PAPER_PLATFORM_RADIUS)

    def climb(radius: float) -> float:
        return PAPER_PITCH / PAPER_RADIUS * radius if pitch is None else pitch

    radius = largest_radius(robot, climb, None, branch, wanted) if fitted else wanted
    if 0.0 < radius < PAPER_RADIUS:
        radius = _rounded_down(radius)
    if 0.0 < radius < wanted * (1 - 1e-2):
        say(
            f"note: a helix of radius {1e3 * radius:g} mm, which this robot's limits allow",
            err=True,
        )
    return radius or wanted, climb(radius or wanted)


def largest_radius(
    robot: RPSRobot,
    climb: Callable[[float], float],
    height: float | None,
    branch: Branch,
    most: float,
) -> float:
    """Return the largest radius (m) up to `most` whose helix is within limits; 0 if none is.

    Parameters
    ----------
    climb
        The pitch of a radius, m.
    """

    def fits(radius: float) -> bool:
        rise = climb(radius)
        start = middle_height(robot.parameters, rise) if height is None else height
        path = helix(robot, radius=radius, pitch=rise, height=start, branch=branch.value)
        pose = path.sample(np.linspace(0.0, path.duration, _SAMPLES)).pose
        return bool(robot.inverse_kinematics(pose, errors="mask").reachable.all())

    if fits(most):
        return most
    low, high = 0.0, most
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


@contextmanager
def telling_largest(robot: Any, path: Any) -> Iterator[None]:
    """Name the largest radius that fits where a helix of a 3-RPS is out of reach."""
    try:
        yield
    except UnreachableError as error:
        if not isinstance(path, HelixPath):
            raise
        branch = Branch(path.branch)
        largest = largest_radius(robot, lambda _: path.pitch, path.height, branch, path.radius)
        if not largest:
            raise
        told = f"{error}; the largest radius that fits is {_rounded_down(largest):g} m"
        raise UnreachableError(told, error.violations) from None


def _rounded_down(number: float) -> float:
    """Return the next lower number of three digits."""
    digits = 2 - math.floor(math.log10(number))
    scale: float = 10.0**digits
    return math.floor(number * scale * (1 + 1e-12)) / scale


def middle_height(parameters: RPSParameters, pitch: float) -> float:
    """Return a height (m) from which a robot can climb by `pitch`, if it can at all.

    A level platform then passes the middle of the legs' stroke half-way.
    """
    g, h = parameters.base_radius, parameters.platform_radius
    length = sum(parameters.leg_length_limits) / 2
    if math.isinf(length):
        return _PAPER_HEIGHT * g / _PAPER_BASE_RADIUS
    if length <= abs(g - h):
        raise InputError(
            f"legs of {length:.6g} m, the middle of their stroke, do not reach from a base of "
            f"radius {g} m to a level platform of radius {h} m; give --height"
        )
    return math.sqrt(length**2 - (g - h) ** 2) - pitch / 2

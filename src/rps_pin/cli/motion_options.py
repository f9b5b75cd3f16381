"""Options of motions that several commands take: the shortest time, payload and wrench."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import typer
from rich.console import Console

from rps_pin.cli import console as common
from rps_pin.errors import InputError, RPSPinError
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.task import RPSTask
from rps_pin.task.loads import Payload
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits
from rps_pin.task.task import Task
from rps_pin.trajectories.path import Trajectory
from rps_pin.validation import finite_number

#: What the shortest time needs of a task in generated code.
_FUNCTIONS = "kinematics", "closing", "dynamics"
Six = tuple[float, float, float, float, float, float]

FastestOption = Annotated[
    bool,
    typer.Option(
        "--fastest",
        help="Follow the same curve in the shortest time within the actuator limits.",
    ),
]
PayloadOption = Annotated[
    float | None, typer.Option(metavar="KG", help="Mass of a payload on the platform, kg.")
]
PayloadCentreOption = Annotated[
    common.Three,
    typer.Option(metavar="X Y Z", help="Its centre of mass in platform axes, m."),
]
WrenchOption = Annotated[
    Six | None,
    typer.Option(
        metavar="FX FY FZ MX MY MZ",
        help="On the platform, N and N m, base axes, about the platform's centre.",
    ),
]


def payload_of(mass: float | None, centre: common.Three, wrench: Six | None) -> Payload | None:
    """Return the payload of the options, after a check of these and of the wrench.

    Raises
    ------
    InputError
        If a centre is given without a mass, or a number is not finite.
    """
    if mass is None and any(centre):
        raise InputError("--payload-centre is the place of a payload: give its mass with --payload")
    for force in wrench or ():
        finite_number(force, "--wrench", "N or N m")
    return None if mass is None else Payload(mass, centre)


def fastest_of_task(console: Console, task: Task, path: Trajectory, **loads: Any) -> Trajectory:
    """Return the shortest motion along a path of a task, within its model's limits; tell it."""
    from rps_pin.task import time_optimal

    fast, engine = in_generated_code(task)
    return _told(console, path, lambda: time_optimal(fast, path, **loads), engine)


def in_generated_code(task: Task) -> tuple[Task, str]:
    """Return a task in generated code, if that can be had, and what computes its motions.

    It is built in one or two seconds, and kept; the shortest time then takes a tenth of the time.
    """
    if isinstance(task, RPSTask):
        return task, "by closed forms"
    try:
        return task.compile(functions=_FUNCTIONS), "in generated code"
    except (RPSPinError, ImportError) as error:
        return task, f"by the Pinocchio engine, ten times as long as in generated code: {error}"


def fastest_of_robot(
    console: Console,
    robot: RPSRobot,
    path: Trajectory,
    limits: ActuatorLimits | None = None,
    wrench: Six | None = None,
) -> Trajectory:
    """Return the shortest motion along a path of a 3-RPS; tell it."""
    from rps_pin.rps.motion.time_optimal import time_optimal

    return _told(console, path, lambda: time_optimal(robot, path, limits=limits, wrench=wrench))


def _told(
    console: Console,
    given: Trajectory,
    find: Callable[[], Trajectory],
    engine: str = "by closed forms",
) -> Trajectory:
    with console.status("computing the shortest time"):
        path = find()
    console.print(
        f"shortest time {path.duration:.6g} s (as given: {given.duration:.6g} s), computed {engine}"
    )
    return path

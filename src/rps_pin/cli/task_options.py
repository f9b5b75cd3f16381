"""Options and output of commands for any mechanism with a task: coordinates by name, angles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from rps_pin.arrays import Array
from rps_pin.cli import console as common
from rps_pin.cli import mechanism_options as options
from rps_pin.cli.completion import mechanism_names, names_or_files
from rps_pin.cli.motion_options import in_generated_code
from rps_pin.cli.printing import say
from rps_pin.config import read_yaml
from rps_pin.errors import InputError
from rps_pin.files import opened
from rps_pin.plain_text import ROUNDING
from rps_pin.rps.motion.trajectory_file import load_trajectory
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.robot_file import kind_of_file
from rps_pin.rps.task import RPSTask
from rps_pin.task.paths.findings import GRAZE
from rps_pin.validation import real_vector

if TYPE_CHECKING:
    from rps_pin.task import SingularityMeasures, Task
    from rps_pin.trajectories.path import Trajectory

#: Most bytes of a header.
_HEADER = 10_000

MechanismOption = Annotated[
    Path | None,
    typer.Option(
        "--mechanism",
        "-m",
        metavar="FILE|NAME",
        help="In place of a 3-RPS, a mechanism with a task: its description (**.yaml**), or the "
        "name of one that comes with the package, such as **stewart**.",
        autocompletion=names_or_files(mechanism_names),
    ),
]


def needed_mechanism(told: str) -> Any:
    """Return the option ``--mechanism`` of a command that needs one; `told` says which."""
    return typer.Option(
        "--mechanism",
        "-m",
        metavar="FILE|NAME",
        help=f"The mechanism with a task{told}: a description, or parameters of a 3-RPS.",
        show_default=False,
        autocompletion=names_or_files(mechanism_names),
    )


def load_task(file: Path, ignore_limits: bool = False, accuracy: float | None = None) -> Task:
    """Return the task of a mechanism's file, or of the parameters of a 3-RPS.

    Raises
    ------
    MechanismError
        If it has none.
    """
    return load_task_and_file(file, ignore_limits, accuracy)[0]


def load_task_and_file(
    file: Path,
    ignore_limits: bool = False,
    accuracy: float | None = None,
    gravity: Sequence[float] | None = None,
) -> tuple[Task, Path]:
    """Return such a task, and the file: that of the package, of a name.

    With other gravity, m/s^2 in world axes, if it is given.
    """
    if kind_of_file(file) == "parameters":
        robot = options.robot_of_parameters(file, ignore_limits, accuracy)
        if gravity is not None:
            robot = RPSRobot(robot.parameters.replace(gravity=gravity))
        return robot.task, file
    mechanism, found = options.load_mechanism(file, ignore_limits, accuracy)
    if gravity is not None:  # of this mechanism, which nobody else has
        mechanism.model.gravity.linear = real_vector(gravity, 3, "gravity")
    task: Task = mechanism.task
    return task, found


def load_path(trajectory: Path, task: Task, **loads: Any) -> Trajectory:
    """Return the trajectory of a file, of the coordinates of a task.

    Of a 3-RPS also its own kinds of trajectories, and columns ``tilt_x``, ``tilt_y``.

    Raises
    ------
    InputError
        As `load_task_trajectory`.
    """
    from rps_pin.task.trajectory_file import load_task_trajectory

    if isinstance(task, RPSTask) and _is_of_robots(trajectory):
        return load_trajectory(trajectory, task.robot)
    if _keys(trajectory).get("fastest") is not None:
        task, engine = in_generated_code(task)
        say(f"note: {trajectory}: its shortest time is computed {engine}", err=True)
    return load_task_trajectory(trajectory, task, **loads)


def _is_of_robots(trajectory: Path) -> bool:
    """Return whether a trajectory is one that a 3-RPS alone has."""
    if trajectory.suffix.lower() == ".csv":
        with opened(trajectory, "trajectory file") as file:
            return b"tilt_" in file.readline(_HEADER)
    return _keys(trajectory).get("kind") in ("helix", "circle", "lissajous")


def _keys(trajectory: Path) -> Mapping[str, Any]:
    """Return the values of a YAML file; of others none."""
    if trajectory.suffix.lower() not in (".yaml", ".yml"):
        return {}
    return read_yaml(trajectory, "trajectory file").values


def given(
    pairs: Sequence[str] | None,
    option: str,
    names: Sequence[str],
    angular: Sequence[bool],
    otherwise: Array,
    degrees: bool,
) -> Array:
    """Return values of options like ``--at z=0.6``, by name; those left out are kept.

    Raises
    ------
    InputError
        If there is no such name, or a value is no number.
    """
    values = otherwise.copy()
    for name, value in options.by_joint(pairs or (), option).items():
        if name not in names:
            raise InputError(f"{option}: no {name!r}; there are: {', '.join(names)}")
        index = list(names).index(name)
        values[index] = math.radians(value) if degrees and angular[index] else value
    return values


def of_actuators(task: Task) -> tuple[tuple[str, ...], tuple[bool, ...]]:
    """Return the names of the actuators, and which are angles."""
    mechanism = task.mechanism
    angular = mechanism.angular_velocities[mechanism.actuated_indices]
    return mechanism.actuated, tuple(bool(one) for one in angular)


def in_unit(value: float, angular: bool, degrees: bool) -> float:
    """Return a value in the unit that is printed; rounding errors are zero."""
    value = 0.0 if abs(value) < ROUNDING else float(value)
    return math.degrees(value) if angular and degrees else value


def unit_of(angular: bool, degrees: bool) -> str:
    """Return that unit."""
    return ("deg" if degrees else "rad") if angular else "m"


def units(degrees: bool) -> dict[str, str]:
    """Return the units of lengths and angles, for JSON."""
    return {"length": "m", "angle": unit_of(True, degrees)}


def table(
    names: Sequence[str],
    values: Array,
    angular: Sequence[bool],
    degrees: bool,
    limits: tuple[Array, Array] | None = None,
    forces: Array | None = None,
) -> Any:
    """Return a table of values by name, of actuators with their limits and forces."""
    rows = []
    for i, (name, value, turns) in enumerate(zip(names, values, angular, strict=True)):
        cells = [name, f"{in_unit(value, turns, degrees):.6g}"]
        if limits is not None:
            ends = (in_unit(end[i], turns, degrees) for end in limits)
            cells.append(" to ".join(f"{end:.4g}" for end in ends))
        cells.append(unit_of(turns, degrees))
        if forces is not None:
            cells += [f"{forces[i]:.6g}", "N m" if turns else "N"]
        rows.append(tuple(cells))
    headers = ("", "value", *(("limits",) if limits is not None else ()), "unit")
    if forces is not None:
        headers = (*headers, "force", "unit")
    return common.table_of(rows, *headers, right=slice(1, 2))


def limits_of(task: Task) -> tuple[Array, Array]:
    """Return the actuators' position limits, shape (na,) each."""
    model = task.mechanism.model
    joints = [model.joints[model.getJointId(name)] for name in task.mechanism.actuated]
    at = [joint.idx_q for joint in joints]
    return model.lowerPositionLimit[at], model.upperPositionLimit[at]


def measures(task: Task, q: Array) -> dict[str, float | None]:
    """Return the singularity measures of a configuration; None where one does not exist."""
    return plain_measures(task.singularities(q))


def plain_measures(found: SingularityMeasures) -> dict[str, float | None]:
    """Return singularity measures by name; None where one does not exist."""
    measured = found._asdict().items()
    return {name: float(value) if np.isfinite(value) else None for name, value in measured}


#: What is so at a singularity of a kind.
_SINGULAR = {
    "type_i": "the platform does not move in some direction, however the actuators move",
    "type_ii": "the actuators do not hold the platform",
    "constraint": "the legs do not guide the platform",
}


def singular(found: dict[str, float | None]) -> list[str]:
    """Return a sentence for each singularity that a pose is at, or within `GRAZE` of."""
    told = []
    for name, words in _SINGULAR.items():
        value = found.get(name)
        if value is not None and abs(value) < GRAZE:
            told.append(
                f"singular ({name} {value:.2g}; 0 is singular, below {GRAZE:g} near): {words}"
            )
    return told


def in_words(found: dict[str, float | None]) -> str:
    """Return the measures in one line."""
    shown = {name: value for name, value in found.items() if name != "determinant"}
    parts = [
        f"{name} {'-' if value is None else format(value, '.4g')}" for name, value in shown.items()
    ]
    return f"distance to singularities (0 at one): {', '.join(parts)}"


def print_answer(
    task: Task,
    x: Array,
    a: Array,
    q: Array,
    *,
    first: str,
    degrees: bool,
    as_json: bool,
    forces: Array | None = None,
) -> None:
    """Print a pose: the task's coordinates and the actuators' positions, asked for or found."""
    names, angular = of_actuators(task)
    found = measures(task, q)
    if as_json:
        sides = {
            "task": (task.coordinates, task.angular, x),
            "actuators": (names, angular, a),
        }
        answer: dict[str, Any] = {"mechanism": task.mechanism.name}
        for side, (of_side, turns, values) in sides.items():
            answer[side] = {
                name: in_unit(value, is_angle, degrees)
                for name, is_angle, value in zip(of_side, turns, values, strict=True)
            }
        answer["units"] = units(degrees)
        if forces is not None:
            answer["forces"] = dict(zip(names, forces.tolist(), strict=True))
        common.print_json(answer | {"singularities": found, "configuration": q.tolist()})
        return
    console = common.text_console(soft_wrap=True)
    tables = {
        "task": table(task.coordinates, x, task.angular, degrees),
        "actuators": table(names, a, angular, degrees, limits_of(task), forces),
    }
    other = "actuators" if first == "task" else "task"
    for name in (first, other):
        console.print(f"{name}:")
        console.print(tables[name])
    console.print(in_words(found))
    for words in singular(found):
        console.print(words)

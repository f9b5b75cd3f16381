"""Arguments of the commands for any mechanism: its file, and values by joint name."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import pinocchio as pin
import typer

from rps_pin.cli.completion import MECHANISMS, mechanism_names, names_or_files
from rps_pin.cli.decimal_numbers import decimal
from rps_pin.cli.printing import say
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.io.gepetto import FILE
from rps_pin.errors import InputError
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.robot_file import kind_of_file, load_robot

_FILE = typer.Argument(
    metavar="FILE|NAME",
    help="A mechanism's description (**.yaml**), a MuJoCo file (**.xml**), a URDF, parameters of a "
    "3-RPS, a folder of Gepetto's example-parallel-robots, or the name of one that comes with the "
    "package, such as **delta**.",
    show_default=False,
    autocompletion=names_or_files(mechanism_names),
)
FileArgument = Annotated[Path, _FILE]
OptionalFileArgument = Annotated[Path | None, _FILE]


#: Values by joint name, each as ``--tau crank=1.5``; see `by_joint`.
JointValues = list[str] | None


_OF_URDF = (
    "a URDF names no actuated joints, and loops only in its dialects; for more, name it in a .yaml "
    "file: urdf: {name}, closures: [...], actuated: [...]"
)


def joint_values(words: str) -> Any:
    """Return an option that takes values by joint name."""
    return typer.Option(metavar="JOINT=VALUE", help=words)


IgnoreLimitsOption = Annotated[
    bool,
    typer.Option("--ignore-limits", help="Ignore the position limits of the joints."),
]
AccuracyOption = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        help="Largest error of the file's numbers, in characteristic lengths and rad: rows of the "
        "closures that are redundant but for such errors count as redundant. 0: the numbers are "
        "exact. Default: as the file says, or found out, at most 0.001.",
    ),
]
PackagePathOption = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="FOLDER",
        help="A ROS package, or a folder that holds some, where meshes of **package://** are "
        "looked for; can be given several times.",
    ),
]


def load_mechanism(
    file: Path, ignore_limits: bool = False, accuracy: float | None = None
) -> tuple[ClosedLoopModel, Path]:
    """Return the mechanism of a file, told by its suffix, or of a name; and its file.

    Of a URDF nothing is driven, and only the loops that it states itself are closed. A folder is
    one of Gepetto's example-parallel-robots. The parameters of a 3-RPS are a mechanism, too.

    Raises
    ------
    InputError
        If there is no mechanism of that name (lists those there are), or the suffix is of no kind
        that is read.
    """
    if file.is_dir() and ((file / FILE).exists() or str(file) not in mechanism_names()):
        file /= FILE
    if not (file.suffix or file.is_file()):
        names = mechanism_names()
        if str(file) not in names:
            raise InputError(
                f"{str(file)!r} is not a file or a mechanism of the package; those are: "
                f"{', '.join(names)}"
            )
        file = MECHANISMS / f"{file}.yaml"
    suffix = file.suffix.lower()
    within_limits = False if ignore_limits else None
    if kind_of_file(file) == "parameters":
        return robot_of_parameters(file, ignore_limits, accuracy).mechanism, file
    if suffix in (".yaml", ".yml"):
        return ClosedLoopModel.load(file, within_limits=within_limits, accuracy=accuracy), file
    if suffix == ".xml":
        limits = not ignore_limits
        return ClosedLoopModel.from_mjcf(file, within_limits=limits, accuracy=accuracy), file
    if suffix == ".urdf":
        mechanism = ClosedLoopModel.from_urdf(
            file, [], [], within_limits=not ignore_limits, accuracy=accuracy
        )
        mechanism.notes += (_OF_URDF.format(name=file.name),)
        return mechanism, file
    raise InputError(
        f"{file}: a mechanism's file ends in .yaml (a description), .xml (MuJoCo) or .urdf"
    )


def robot_of_parameters(
    file: Path, ignore_limits: bool = False, accuracy: float | None = None
) -> RPSRobot:
    """Return the robot of a parameter file."""
    if accuracy is not None:
        raise InputError(f"{file}: the numbers of a 3-RPS are exact: leave out --accuracy")
    robot = load_robot(str(file))
    return RPSRobot(robot.parameters.without_limits()) if ignore_limits else robot


def require_masses(mechanism: ClosedLoopModel) -> None:
    """Refuse forces of a mechanism without any mass.

    Raises
    ------
    InputError
        If no link has one.
    """
    if not any(inertia.mass for inertia in mechanism.model.inertias):
        raise InputError(
            f"no link of {mechanism.name or 'the mechanism'} has a mass: forces need the "
            "<inertial> elements of its file"
        )


def shapes_of(
    file: Path, mechanism: ClosedLoopModel, package_path: Sequence[Path] | None = None
) -> tuple[pin.GeometryModel | None, list[str]]:
    """Return the shapes of a mechanism's links, and what is not drawn, in sentences.

    Where there is nothing to draw, and of a MuJoCo file, the shapes are None, for a skeleton.
    """
    from rps_pin.closed_loop.visuals import visual_model

    if file.suffix.lower() == ".xml":
        return None, []
    if kind_of_file(file) == "parameters":
        return load_robot(str(file)).visual_model(), []
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        shapes = visual_model(file, mechanism.model, package_path or ())
    if shapes is None:
        mechanism.file = None  # the viewer need not look again
    return shapes, [str(one.message) for one in told]


def written_with_shapes(
    file: Path, mechanism: ClosedLoopModel, write: Callable[[pin.GeometryModel | None], object]
) -> list[str]:
    """Write a mechanism with the shapes of a file; return what the formats do not have."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        shapes, notes = shapes_of(file, mechanism)
        write(shapes)
    return list(dict.fromkeys([*notes, *(str(one.message) for one in told)]))


def print_notes(notes: Iterable[str]) -> None:
    """Print notes to standard error."""
    for note in notes:
        say(f"note: {note}", err=True)


def by_joint(pairs: Sequence[str], option: str) -> dict[str, float]:
    """Return the values of options like ``--tau crank=1.5``, by joint name.

    Raises
    ------
    InputError
        If one is not of that form, or a joint comes twice.
    """
    values: dict[str, float] = {}
    for pair in pairs:
        name, _, number = pair.rpartition("=")
        try:
            value = decimal(number)
        except ValueError:
            name = ""
        if not name:
            raise InputError(f"{option} {pair!r}: it must be JOINT=NUMBER, such as crank=1.5")
        if name in values:
            raise InputError(f"{option}: joint {name!r} is named twice")
        values[name] = value
    return values

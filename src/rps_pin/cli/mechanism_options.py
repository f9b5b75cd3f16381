"""Arguments of the commands for any mechanism: its file, and values by joint name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import pinocchio as pin
import typer

from rps_pin.cli.completion import MECHANISMS, mechanism_names, names_or_files
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError

_FILE = typer.Argument(
    metavar="FILE|NAME",
    help="A mechanism's description (**.yaml**), a MuJoCo file (**.xml**), or the name of one "
    "that comes with the package, such as **delta**.",
    show_default=False,
    autocompletion=names_or_files(mechanism_names),
)
FileArgument = Annotated[Path, _FILE]
OptionalFileArgument = Annotated[Path | None, _FILE]


#: Values by joint name, each as ``--tau crank=1.5``; see `by_joint`.
JointValues = list[str] | None


def joint_values(words: str) -> Any:
    """Return an option that takes values by joint name."""
    return typer.Option(metavar="JOINT=VALUE", help=words)


def load_mechanism(file: Path) -> tuple[ClosedLoopModel, Path]:
    """Return the mechanism of a file, told by its suffix, or of a name; and its file.

    Raises
    ------
    InputError
        If there is no mechanism of that name (lists those there are), or the suffix is of neither
        kind; says what a URDF lacks.
    """
    if not (file.suffix or file.is_file()):
        names = mechanism_names()
        if str(file) not in names:
            raise InputError(
                f"{str(file)!r} is not a file or a mechanism of the package; those are: "
                f"{', '.join(names)}"
            )
        file = MECHANISMS / f"{file}.yaml"
    suffix = file.suffix.lower()
    if suffix in (".yaml", ".yml"):
        return ClosedLoopModel.load(file), file
    if suffix == ".xml":
        return ClosedLoopModel.from_mjcf(file), file
    if suffix == ".urdf":
        raise InputError(
            f"{file}: a URDF has no closures; name it in a description: urdf: {file.name}, "
            "closures: [...], actuated: [...] in a .yaml file"
        )
    raise InputError(f"{file}: a mechanism's file ends in .yaml (a description) or .xml (MuJoCo)")


def shapes_of(file: Path, mechanism: ClosedLoopModel) -> pin.GeometryModel | None:
    """Return the shapes of a mechanism's links; None, for a skeleton, of a MuJoCo file."""
    from rps_pin.closed_loop.visuals import visual_model

    return None if file.suffix.lower() == ".xml" else visual_model(file, mechanism.model)


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
            value = float(number)
        except ValueError:
            name = ""
        if not name:
            raise InputError(f"{option} {pair!r}: it must be JOINT=NUMBER, such as crank=1.5")
        if name in values:
            raise InputError(f"{option}: joint {name!r} is named twice")
        values[name] = value
    return values

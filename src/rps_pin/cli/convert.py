"""``rps-pin convert``: any mechanism as a URDF with its description, or as a MuJoCo file."""

from __future__ import annotations

import warnings
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from rps_pin.cli.mechanism_options import (
    AccuracyOption,
    FileArgument,
    IgnoreLimitsOption,
    PackagePathOption,
    load_mechanism,
    print_notes,
    shapes_of,
)
from rps_pin.cli.outputs import OverwriteOption, check_outputs
from rps_pin.cli.printing import say


class Format(StrEnum):
    """What to write."""

    URDF = "urdf"
    MJCF = "mjcf"


_SUFFIXES = {Format.URDF: (".urdf", ".yaml"), Format.MJCF: (".xml",)}


def convert_command(
    file: FileArgument,
    to: Annotated[
        Format,
        typer.Option(help="A URDF with its description (**urdf**), or a MuJoCo file (**mjcf**)."),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for the files; it is made.")
    ] = Path(),
    least_mass: Annotated[
        float, typer.Option(help="MuJoCo: mass of moving links that have less, kg.")
    ] = 0.0,
    least_inertia: Annotated[
        float,
        typer.Option(help="MuJoCo: moments of inertia of moving links that have less, kg m^2."),
    ] = 0.0,
    mend_inertia: Annotated[
        bool,
        typer.Option(
            "--mend-inertia",
            help="MuJoCo: lower a moment of inertia that exceeds the sum of the other two.",
        ),
    ] = False,
    overwrite: OverwriteOption = False,
    package_path: PackagePathOption = None,
    ignore_limits: IgnoreLimitsOption = False,
    accuracy: AccuracyOption = None,
) -> None:
    """Write any mechanism for other programs, exactly: closures, joints, inertias, losses, home.

    What the format does not have is written as what it has, or refused with its name. In MuJoCo
    nothing touches until you add shapes.

    Exit status: 0; 1 if it cannot be read or written; 2 wrong usage.

    Examples:

    - `rps-pin convert delta --to mjcf` writes *delta.xml*

    - `rps-pin convert robot.xml --to urdf -o out` writes *out/robot.urdf* and *out/robot.yaml*
    """
    mechanism, found = load_mechanism(file, ignore_limits, accuracy)
    stem = file.resolve().name if file.is_dir() else found.stem
    targets = [output / f"{stem}{suffix}" for suffix in _SUFFIXES[to]]
    check_outputs(targets, overwrite, inputs=[file])
    output.mkdir(parents=True, exist_ok=True)
    notes: list[str] = []
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        if to is Format.URDF:
            shapes, notes = shapes_of(found, mechanism, package_path)
            mechanism.to_urdf(targets[0], shapes=shapes, overwrite=True)
        else:
            mechanism.to_mjcf(
                targets[0],
                least_mass=least_mass,
                least_inertia=least_inertia,
                mend_inertia=mend_inertia,
                overwrite=True,
            )
    say(f"wrote {' and '.join(map(str, targets))}")
    print_notes([*mechanism.notes, *notes, *(str(one.message) for one in told)])

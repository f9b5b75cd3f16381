"""``rps-pin convert``: any mechanism as a URDF with its description, or as a MuJoCo file."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from rps_pin.cli.mechanism_options import (
    FileArgument,
    IgnoreLimitsOption,
    PackagePathOption,
    load_mechanism,
    shapes_of,
)


class Format(StrEnum):
    """What to write."""

    URDF = "urdf"
    MJCF = "mjcf"


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
    package_path: PackagePathOption = None,
    ignore_limits: IgnoreLimitsOption = False,
) -> None:
    """Write any mechanism for other programs, exactly: closures, joints, inertias, losses, home.

    What the format does not have is written as what it has, or refused with its name. In MuJoCo
    nothing touches until you add shapes.

    Exit status: 0; 1 if it cannot be read or written; 2 wrong usage.

    Examples:

    - `rps-pin convert delta --to mjcf` writes *delta.xml*

    - `rps-pin convert robot.xml --to urdf -o out` writes *out/robot.urdf* and *out/robot.yaml*
    """
    mechanism, found = load_mechanism(file, ignore_limits)
    stem = file.resolve().name if file.is_dir() else found.stem
    output.mkdir(parents=True, exist_ok=True)
    if to is Format.URDF:
        shapes, missing = shapes_of(found, mechanism, package_path)
        target = output / f"{stem}.urdf"
        description = mechanism.to_urdf(target, shapes=shapes)
        typer.echo(f"wrote {target} and {description}")
        for note in missing:
            typer.echo(f"note: {note}", err=True)
        return
    target = mechanism.to_mjcf(
        output / f"{stem}.xml",
        least_mass=least_mass,
        least_inertia=least_inertia,
        mend_inertia=mend_inertia,
    )
    typer.echo(f"wrote {target}")

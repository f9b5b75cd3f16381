"""``rps-pin export c``: a mechanism as C99 for another machine."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from rps_pin.cli import console as common
from rps_pin.cli import mechanism_options as options
from rps_pin.cli.completion import names_or_files, preset_names
from rps_pin.cli.outputs import check_outputs
from rps_pin.cli.printing import say
from rps_pin.errors import RPSPinError


class Real(StrEnum):
    """Type of all numbers."""

    DOUBLE = "double"
    FLOAT = "float"


def export_c_command(
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for the files; it is made.")
    ],
    file: options.OptionalFileArgument = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            "-r",
            metavar="PRESET|FILE",
            help="Instead of a mechanism: a 3-RPS by preset or parameter file, with its kinematics "
            "and computed torque.",
            show_default=False,
            autocompletion=names_or_files(preset_names),
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(
            help="What names of files and functions begin with; default: the mechanism's name, or "
            "its file's.",
            show_default=False,
        ),
    ] = None,
    real: Annotated[Real, typer.Option(help="Type of all numbers.")] = Real.DOUBLE,
    functions: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A function to export, such as **inverse_dynamics**; repeat it. Default: all but "
            "the derivatives.",
        ),
    ] = None,
    frames: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FRAME", help="A frame whose placement and Jacobian are exported; repeat it."
        ),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            metavar="GROUP",
            help="Numbers that become an argument: **gravity**, **mass:JOINT**, **inertia:JOINT**, "
            "**placement:JOINT**, **closure:NAME**, **distance:NAME**, **payload:FRAME**; repeat "
            "it.",
        ),
    ] = None,
    wrench_frames: Annotated[
        list[str] | None,
        typer.Option(metavar="FRAME", help="A frame at which an external wrench acts; repeat it."),
    ] = None,
    ignore_limits: options.IgnoreLimitsOption = False,
    accuracy: options.AccuracyOption = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace files that were not exported, too.")
    ] = False,
    as_json: common.JsonOption = False,
) -> None:
    """Write a mechanism's kinematics and dynamics as C99 for a controller.

    Output: **NAME.h** (all functions; shape, unit and order of every argument), **NAME.c** (no
    allocation, no globals, C's mathematics only), **NAME_test.c** (self-test with the answers of
    the Pinocchio engine), **CMakeLists.txt**, **README.md**.

    Exit status: 0 done; 1 it cannot be exported, or a file is in the way; 2 wrong usage.

    Examples:

    - `rps-pin export c delta --output delta_c`

    - `rps-pin export c --robot micro --output micro_c`

    - `rps-pin export c stewart -o stewart_c --real float --parameters payload:platform`
    """
    try:
        from rps_pin.codegen.export.c_files import c_files, write_c_files
        from rps_pin.codegen.export.mechanism import mechanism_package
        from rps_pin.codegen.export.names import identifier
    except ModuleNotFoundError as error:
        raise RPSPinError(
            f"code is generated with {error.name}: pip install 'rps-pin[compile]'"
        ) from None

    if (file is None) == (robot is None):
        raise typer.BadParameter("one of FILE|NAME and --robot is to be given")
    if file is not None:
        mechanism, path = options.load_mechanism(file, ignore_limits, accuracy)
        title = mechanism.name
        package = mechanism_package(
            mechanism,
            name=identifier(title, path.stem) if name is None else identifier(name),
            real=real.value,
            functions=functions or (),
            frames=frames or (),
            parameters=parameters or (),
            wrench_frames=wrench_frames or (),
        )
    else:
        if parameters or wrench_frames:
            raise typer.BadParameter(
                "--parameters and --wrench-frames are a mechanism's: rps-pin export c rps"
            )
        from rps_pin.rps.generated.export import robot_package

        machine = common.load_robot(str(robot))
        title = f"3-RPS {machine.parameters.name}"
        package = robot_package(
            machine,
            name=identifier(machine.parameters.name, Path(str(robot)).stem)
            if name is None
            else identifier(name),
            real=real.value,
            functions=functions or (),
            frames=frames or (),
        )
    texts = c_files(package)
    # Files that were exported before are replaced, others with --overwrite: `write_c_files`.
    check_outputs([output / one for one in texts], overwrite=True, inputs=[file] if file else [])
    files = write_c_files(texts, output, overwrite=overwrite)
    summary = {
        "mechanism": title,
        "name": package.name,
        "real": package.real,
        "functions": [one.name for one in package.functions],
        "constants": {one.key: one.value for one in package.constants},
        "parameters": dict(package.parameters),
    }
    if as_json:
        common.print_json(summary | {"files": files})
        return
    console = common.text_console(soft_wrap=True)
    precision = "single" if package.real == "float" else "double"
    console.print(
        f"{title}: {len(package.functions)} functions in C99, {precision} precision, "
        f"each with {len(package.functions[0].cases)} states in its self-test",
    )
    common.print_files(console, files)
    say(
        f"Test: cmake -S {output} -B {output}/build && cmake --build {output}/build && "
        f"ctest --test-dir {output}/build"
    )

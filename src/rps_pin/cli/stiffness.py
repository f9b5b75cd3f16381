"""``rps-pin stiffness``: how a mechanism with a task gives way under a load."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rps_pin.cli import console as common
from rps_pin.cli.given_options import refuse
from rps_pin.cli.outputs import OverwriteOption
from rps_pin.cli.stiffness_map import MapAsked, write_maps
from rps_pin.cli.task_options import given, load_task_and_file, needed_mechanism
from rps_pin.cli.task_workspace import HeldOption, OverOption, grid_of
from rps_pin.plain_text import short
from rps_pin.task.stiffness import Deflection, StiffnessModel, load_compliances

#: Frequencies, and springs of the largest energy, that are printed at most.
_FREQUENCIES, _SPRINGS = 6, 12
_WRENCH = ("force_x_N", "force_y_N", "force_z_N", "moment_x_Nm", "moment_y_Nm", "moment_z_Nm")


def stiffness_command(
    context: typer.Context,
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="What gives way: drives, bearings and beams; YAML."),
    ],
    mechanism: Annotated[Path, needed_mechanism("")],
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Coordinates of the task, m or rad; those not named are those of home.",
            show_default=False,
        ),
    ] = None,
    wrench: Annotated[
        tuple[float, float, float, float, float, float] | None,
        typer.Option(
            metavar="FX FY FZ MX MY MZ",
            help="Load on the output frame in world axes, N and N m. Default: none.",
            show_default=False,
        ),
    ] = None,
    frame: Annotated[
        str | None,
        typer.Option(
            help="The output: a frame of the mechanism. Default: the task's.", show_default=False
        ),
    ] = None,
    gravity: Annotated[bool, typer.Option(help="Whether weight counts.")] = True,
    over: OverOption = None,
    held: HeldOption = None,
    degrees: Annotated[
        bool, typer.Option("--degrees", help="Angles of --at, --over and --held in degrees.")
    ] = False,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for the maps of --over; it is made.")
    ] = Path("stiffness"),
    overwrite: OverwriteOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Compute a mechanism's deflection under a load and its weight, stiffness and frequencies.

    The file names what gives way, with units in the keys; whatever it does not name is rigid. The
    actuators hold the pose. Printed are the output's displacement and stiffness in all directions,
    the actuators' forces, the wrenches in the loops' closures, the springs that hold the most
    energy, and the lowest frequencies.

    With --over, the same at each point of a grid: the least stiffness against a force in any
    direction, displacement, compliance and frequencies (**map.csv**), with two axes as figures
    (**stiffness.png**, **frequency.png**).

    Exit status: 0 done; 1 an error, or nothing holds the output; 2 wrong usage.

    Examples:

    - `rps-pin stiffness compliances.yaml -m four_bar --frame coupler_tip`

    - `rps-pin stiffness drives.yaml -m five_bar --over x=0.1:0.3:9 --over z=0.4:0.6:9`
    """
    task, described = load_task_and_file(mechanism)
    compliances = load_compliances(file, task.mechanism)
    model = StiffnessModel(task, compliances, frame=frame, gravity=gravity)
    if over:
        refuse(context, "--at is of one pose; with --over, --held names coordinates", "at")
        grid = grid_of(task, over, held or (), degrees).holding(task.home)
        asked = MapAsked(model, grid, wrench, output, [file, described])
        write_maps(asked, overwrite, as_json)
        return
    refuse(context, "it is of a grid: give --over, too", "held", "output", "overwrite")
    x = given(at, "--at", task.coordinates, task.angular, task.home, degrees)
    q = task.configuration(x) if at else task.mechanism.home
    found = model.deflection(q, wrench)
    if as_json:
        common.print_json(_summary(found))
        return
    console = common.text_console()
    console.print(_output(found))
    console.print(_forces(found))
    console.print(_springs(found))
    told = ", ".join(short(one) for one in found.frequencies[:_FREQUENCIES])
    told = f"{told} Hz" if told else "none, nothing that has a mass moves"
    console.print(f"Frequencies: {told}")
    if found.undetermined:
        names = ", ".join(found.undetermined)
        console.print(f"Not determined, too little gives way: the wrenches in {names}")


def _units(name: str, found: Deflection) -> tuple[str, str]:
    """Return the units of a displacement of the output, and of its stiffness."""
    angular = found.angular[found.output.index(name)]
    return ("mrad", "N m/rad") if angular else ("mm", "N/m")


def _output(found: Deflection) -> Any:
    rows = []
    with np.errstate(divide="ignore"):
        stiffness = 1 / np.diag(found.compliance)
    for name, moved, k in zip(found.output, found.displacement, stiffness, strict=True):
        unit, of_stiffness = _units(name, found)
        told = "rigid" if not np.isfinite(k) else f"{short(float(k))} {of_stiffness}"
        rows.append((name, f"{short(1e3 * float(moved))} {unit}", told))
    return common.table_of(rows, "output", "displacement", "load / its own displacement")


def _forces(found: Deflection) -> Any:
    rows = [(name, short(force)) for name, force in found.actuator_forces.items()]
    rows += [
        (name, " ".join(short(float(one)) for one in wrench))
        for name, wrench in found.closure_wrenches.items()
    ]
    return common.table_of(rows, "actuator or closure", "N and N m, world axes")


def _springs(found: Deflection) -> Any:
    energy = found.stretch * found.spring_forces / 2
    order = np.argsort(-energy, kind="stable")[:_SPRINGS]
    rows = [
        (found.springs[k], *(short(float(one[k])) for one in (found.stretch, found.spring_forces)))
        for k in order
    ]
    return common.table_of(rows, "spring", "stretch, m or rad", "force, N or N m")


def _summary(found: Deflection) -> dict[str, Any]:
    return {
        "output": list(found.output),
        "displacement": found.displacement.tolist(),
        "compliance": found.compliance.tolist(),
        "actuator_forces": found.actuator_forces,
        "closures": {
            name: dict(zip(_WRENCH, wrench.tolist(), strict=True))
            for name, wrench in found.closure_wrenches.items()
        },
        "undetermined": list(found.undetermined),
        "springs": {
            name: {"stretch": float(stretch), "force": float(force)}
            for name, stretch, force in zip(
                found.springs, found.stretch, found.spring_forces, strict=True
            )
        },
        "frequencies_Hz": found.frequencies[np.isfinite(found.frequencies)].tolist(),
    }

"""``rps-pin identify``: masses, inertias and friction from logs, and the new description."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from rps_pin.cli import console as common
from rps_pin.cli import mechanism_options as options
from rps_pin.cli.outputs import OverwriteOption, check_outputs
from rps_pin.cli.task_options import load_task_and_file, needed_mechanism
from rps_pin.files import write_rows
from rps_pin.plain_text import short

if TYPE_CHECKING:
    from rps_pin.task.identification import Identification, Prediction

#: Rows of the printed table of base parameters, at most.
_ROWS = 40


def identify_command(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG.csv...", help="Time, the actuators' positions and forces; one or more."
        ),
    ],
    mechanism: Annotated[Path, needed_mechanism(", as it is believed to be")],
    bodies: Annotated[
        list[str] | None,
        typer.Option(
            "--body",
            metavar="JOINT",
            help="A joint whose body is unknown; several times. Default: all that have a mass.",
            show_default=False,
        ),
    ] = None,
    friction: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT",
            help="A joint whose damping and dry friction are unknown; several times. Default: the "
            "actuators.",
            show_default=False,
        ),
    ] = None,
    armature: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT",
            help="A joint whose rotor's inertia is unknown; several times.",
            show_default=False,
        ),
    ] = None,
    constants: Annotated[
        list[str] | None,
        typer.Option(
            "--constant",
            metavar="JOINT=VALUE",
            help="Force of one ampere, N/A or N m/A, where the logs have currents.",
            show_default=False,
        ),
    ] = None,
    unknown_constants: Annotated[
        list[str] | None,
        typer.Option(
            "--unknown-constant",
            metavar="JOINT",
            help="An actuator whose --constant is a first guess, and found; several times. Needs a "
            "known body: see --body.",
            show_default=False,
        ),
    ] = None,
    cut_off: Annotated[
        float | None,
        typer.Option(
            min=0.0, help="Of the filter, Hz. Default: well above the motion.", show_default=False
        ),
    ] = None,
    held: Annotated[
        bool,
        typer.Option(
            "--held", help="Forces act from their sample to the next, as those of commands do."
        ),
    ] = False,
    validate: Annotated[
        Path | None,
        typer.Option(metavar="LOG.csv", help="Another log, whose forces are predicted."),
    ] = None,
    output: common.FolderOption = Path("identification"),
    overwrite: OverwriteOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Find masses, inertias and friction of a mechanism from logs of its forces.

    Columns of a log: **time_s**, **JOINT_position_rad** (or m, mm, deg), **JOINT_force_Nm** (or N;
    or **JOINT_current_A** with --constant) of each actuator.

    Output: **base_parameters.csv** (with standard deviations), **parameters.csv** (the physically
    possible ones), and the mechanism with them (**NAME_identified.urdf** and **.yaml**, with a
    comment on what changed), which every other command takes.

    Exit status: 0 done; 1 an error; 2 wrong usage.

    Examples:

    - `rps-pin identify log.csv --mechanism five_bar --validate other.csv`
    """
    from rps_pin.task import identification as of_tasks

    task, file = load_task_and_file(mechanism)
    name = f"{file.stem}_identified"
    files = [
        *(output / f"{name}{suffix}" for suffix in (".urdf", ".yaml")),
        *(output / f"{one}.csv" for one in ("base_parameters", "parameters")),
    ]
    inputs = [*logs, file, *([validate] if validate else [])]
    check_outputs(files, overwrite, inputs=inputs)
    model = of_tasks.DynamicsModel(
        task, bodies=bodies, damping=friction, friction=friction, armature=armature
    )
    given: dict[str, Any] = {"held": held}
    if constants:
        given["constants"] = options.by_joint(constants, "--constant")
    read = [of_tasks.read_log(one, model, **given) for one in logs]
    other = of_tasks.read_log(validate, model, **given) if validate else None
    console = common.text_console(as_json)
    bar = common.progress_bar(console, "identification")
    found = of_tasks.identify(
        model, read, unknown_constants=unknown_constants or (), cut_off=cut_off, progress=bar
    )
    predicted = found.predict(other) if other is not None else None
    output.mkdir(parents=True, exist_ok=True)
    notes = _write(found, files, file)
    summary = _summary(found, predicted)
    written = files if found.possible is not None else files[2:3]
    if as_json:
        common.print_json(summary | {"notes": notes, "files": written})
        return
    _print(console, found, summary)
    options.print_notes([*found.doubts, *(predicted.doubts if predicted else ()), *notes])
    common.print_files(console, written)


def _write(found: Identification, files: Sequence[Path], source: Path) -> list[str]:
    """Write all files; return what the formats do not have."""
    from rps_pin.task.identification import write_identified

    urdf, _, base, parameters = files
    rows = zip(found.labels, found.believed, found.values, found.deviations, strict=True)
    _csv(base, ("base_parameter", "believed", "found", "deviation"), [*rows, *_factors(found)])
    if found.possible is None:
        return []
    model = found.model
    _csv(
        parameters,
        ("parameter", "believed", "possible"),
        zip(model.labels, model.nominal, found.possible.parameters, strict=True),
    )
    return options.written_with_shapes(
        source,
        model.mechanism,
        lambda shapes: write_identified(found, urdf, shapes=shapes, overwrite=True),
    )


def _factors(found: Identification) -> list[tuple[str, float, float, float]]:
    """Return the factors of unknown constants, as rows of the base parameters' table."""
    return [
        (f"constant_factor:{name}", 1.0, float(value), float(deviation))
        for name, value, deviation in zip(
            found.model.actuators, found.factors, found.factor_deviations, strict=True
        )
        if deviation > 0
    ]


def _csv(path: Path, header: Sequence[str], rows: Any) -> None:
    written = [(label, *(repr(float(one)) for one in values)) for label, *values in rows]
    write_rows(path, [header, *written])


def _summary(found: Identification, predicted: Prediction | None) -> dict[str, Any]:
    model = found.model
    answer: dict[str, Any] = {
        "mechanism": model.mechanism.name,
        "samples": found.samples,
        "cut_off": found.cut_off,
        "condition": found.condition,
        "noise": dict(zip(model.actuators, found.noise.tolist(), strict=True)),
        "base_parameters": [
            {
                "parameter": label,
                "believed": float(before),
                "found": float(value),
                "deviation": float(deviation) if np.isfinite(deviation) else None,
            }
            for label, before, value, deviation in zip(
                found.labels, found.believed, found.values, found.deviations, strict=True
            )
        ],
        "constant_factors": {
            label.partition(":")[2]: {"found": value, "deviation": deviation}
            for label, _, value, deviation in _factors(found)
        },
        "doubts": found.doubts,
    }
    if found.possible is not None:
        answer["distance_of_possible"] = found.possible.distance
        answer["parameters"] = dict(
            zip(model.labels, found.possible.parameters.tolist(), strict=True)
        )
    if predicted is not None:
        kinds = ["believed", "free", *(["possible"] if found.possible is not None else [])]
        answer["validation"] = {
            name: {
                of: {
                    "error": float(predicted.errors(of)[k]),
                    "percent": float(predicted.percent(of)[k]),
                }
                for of in kinds
            }
            for k, name in enumerate(model.actuators)
        }
    return answer


def _print(console: Any, found: Identification, summary: dict[str, Any]) -> None:
    rows = [
        (
            one["parameter"],
            short(one["believed"]),
            short(one["found"]),
            "not seen" if one["deviation"] is None else f"{one['deviation']:.2g}",
        )
        for one in summary["base_parameters"][:_ROWS]
    ]
    console.print(common.table_of(rows, "base parameter", "believed", "found", "deviation"))
    if len(summary["base_parameters"]) > _ROWS:
        more = len(summary["base_parameters"]) - _ROWS
        console.print(f"and {more} more: see base_parameters.csv")
    console.print(
        f"{found.samples} samples, filtered at {found.cut_off:.4g} Hz; condition number "
        f"{found.condition:.3g}"
    )
    for name, factor in summary["constant_factors"].items():
        console.print(
            f"{name}: constant {factor['found']:.5g} +- {factor['deviation']:.2g} times that given"
        )
    units = [
        "N m" if turns else "N"
        for turns in found.model.mechanism.angular_velocities[
            found.model.mechanism.actuated_indices
        ]
    ]
    for (name, noise), unit in zip(summary["noise"].items(), units, strict=True):
        told = f"{name}: noise {noise:.3g} {unit}"
        for of, one in summary.get("validation", {}).get(name, {}).items():
            told += f"; error of {of} {one['error']:.3g} {unit} ({one['percent']:.2g} %)"
        console.print(told)

"""``rps-pin calibrate``: a mechanism's geometry from readings, and its new description."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rps_pin.cli import console as common
from rps_pin.cli import mechanism_options as options
from rps_pin.cli.calibration_plan import RANGE, Chosen, PlanAsked, model_of, plan_calibration
from rps_pin.cli.given_options import given as given_options
from rps_pin.cli.given_options import refuse
from rps_pin.cli.outputs import OverwriteOption, check_outputs
from rps_pin.cli.task_options import load_task_and_file, needed_mechanism
from rps_pin.errors import InputError, RPSPinError, few
from rps_pin.files import write_rows
from rps_pin.plain_text import short
from rps_pin.task import calibration as of_tasks
from rps_pin.task.calibration.measured.instruments import sensors_of
from rps_pin.task.calibration.words import units_of

#: Rows of the printed table of parameters, and of other lists, at most.
_ROWS, _LISTED = 40, 12
#: Correlations from here on are told.
_CORRELATED = 0.9


def calibrate_command(
    context: typer.Context,
    mechanism: Annotated[Path, needed_mechanism(", as it is believed to be")],
    data: Annotated[
        Path | None,
        typer.Argument(
            metavar="DATA.csv",
            help="Readings, a row for each pose; with --plan only if there are some.",
            show_default=False,
        ),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            metavar="GROUP",
            help="What may be wrong: **placement:JOINT**, **closure:NAME**, **distance:NAME**; "
            "several times. Default: all.",
            show_default=False,
        ),
    ] = None,
    offsets: Annotated[
        list[str] | None,
        typer.Option(
            "--offset",
            metavar="SENSOR",
            help="A sensor whose offset is a parameter; several times. Default: the actuators' "
            "that are read. **none**: no sensor's.",
            show_default=False,
        ),
    ] = None,
    scales: Annotated[
        list[str] | None,
        typer.Option(
            "--scale",
            metavar="SENSOR",
            help="A sensor whose scale is a parameter; several times. Default: none.",
            show_default=False,
        ),
    ] = None,
    deviations: Annotated[
        list[str] | None,
        typer.Option(
            "--deviation",
            metavar="SENSOR=VALUE",
            help="A sensor's standard deviation, m or rad, if the file has no column of it.",
            show_default=False,
        ),
    ] = None,
    priors: Annotated[
        list[str] | None,
        typer.Option(
            "--prior",
            metavar="PARAMETER=VALUE",
            help="Standard deviation of a parameter, or of a group of them, about what is "
            "believed, m or rad: that of a tolerance.",
            show_default=False,
        ),
    ] = None,
    instruments: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="What else was read: trackers, ball bars, heights, inclinometers; YAML.",
        ),
    ] = None,
    widest: Annotated[
        float | None,
        typer.Option(
            help="A combination of parameters whose deviation would be larger, m, stays as "
            "believed. Default: a hundredth of the characteristic length.",
            show_default=False,
        ),
    ] = None,
    plan: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            help="Choose N poses to measure (next) in place of a calibration; sensors are those of "
            "the file and of --deviation.",
            show_default=False,
        ),
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar=RANGE,
            help="A coordinate of the task that may vary in a plan, m or rad: **z=0.4:0.6**; "
            "several times. Those that are not named stay at home.",
            show_default=False,
        ),
    ] = None,
    folds: Annotated[
        int, typer.Option(min=0, help="Parts of the poses for cross-validation; 0: none.")
    ] = 5,
    output: common.FolderOption = Path("calibration"),
    overwrite: OverwriteOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Find a mechanism's lengths, placements and sensors' offsets from readings at many poses.

    A column of the file is a sensor with its unit, **left_joint_deg** or **x_mm**: a joint, or a
    coordinate of the task. Its standard deviation is a column **x_deviation_um**, or given with
    --deviation. An empty cell was not read.

    Output: the calibrated mechanism (**NAME_calibrated.urdf** and **.yaml**, with a comment on what
    changed), which every other command takes; **parameters.csv** and **residuals.csv**. What the
    readings cannot tell is printed, and stays as it was.

    With --plan, **poses.csv** has poses in the workspace, clear of singularities, that tell most of
    the parameters: where to go, and empty columns for the readings. Filled in, it is a DATA.csv.

    Exit status: 0 done; 1 an error; 2 wrong usage.

    Examples:

    - `rps-pin calibrate readings.csv --mechanism five_bar --parameters placement:right_joint`

    - `rps-pin calibrate --plan 12 --mechanism five_bar --over x=0.1:0.3 --over z=0.4:0.6
    --deviation left_joint=1e-4 --deviation right_joint=1e-4 --deviation x=3e-5 --deviation z=3e-5`
    """
    chosen = Chosen(parameters, offsets, scales)
    if plan is not None:
        refuse(context, "a --plan calibrates nothing", "folds")
        plan_calibration(
            PlanAsked(plan, mechanism, data, tuple(over or ()), instruments, output),
            options.by_joint(deviations or (), "--deviation"),
            options.by_joint(priors or (), "--prior"),
            chosen,
            widest,
            overwrite,
            as_json,
        )
        return
    if over:
        raise typer.BadParameter("--over is of a --plan", param_hint="--over")
    if data is None:
        raise typer.BadParameter("give a file of readings, or a --plan", param_hint="DATA.csv")
    task, file = load_task_and_file(mechanism)
    name = f"{file.stem}_calibrated"
    files = [
        *(output / f"{name}{suffix}" for suffix in (".urdf", ".yaml")),
        *(output / f"{one}.csv" for one in ("parameters", "residuals")),
    ]
    check_outputs(files, overwrite, inputs=[data, file, *([instruments] if instruments else [])])
    others = of_tasks.load_instruments(instruments, task) if instruments else ()
    given = options.by_joint(deviations or (), "--deviation")
    read = of_tasks.read_readings(data, task, given, sensors_of(others))
    poses = len(read.values)
    if not given_options(context, "folds"):
        folds = min(folds, poses)
    elif folds and not 2 <= folds <= poses:
        raise InputError(f"--folds {folds}: 2 to {poses}, the poses; 0: none")
    model = model_of(task, read.sensors, chosen, others)
    console = common.text_console(as_json)
    known = options.by_joint(priors or (), "--prior")
    with console.status("calibrating"):
        found = of_tasks.calibrate(model, read, priors=known, widest=widest)
    crossed, notes = None, []
    if folds:
        bar = common.progress_bar(console, "cross-validation")
        try:
            crossed = of_tasks.cross_validate(
                model, read, folds=folds, priors=known, widest=widest, progress=bar
            )
        except RPSPinError as error:  # the calibration itself is done
            notes.append(f"no cross-validation, from the poses of all parts but one: {error}")
    output.mkdir(parents=True, exist_ok=True)
    notes += _write(model, found, files, file)
    summary = _summary(model, found, crossed)
    if as_json:
        common.print_json(summary | {"notes": notes, "files": files})
        return
    _print(console, model, found, summary)
    options.print_notes([*found.doubts, *notes])
    common.print_files(console, files)


def _write(
    model: of_tasks.CalibrationModel,
    found: of_tasks.Calibration,
    files: Sequence[Path],
    source: Path,
) -> list[str]:
    """Write all files; return what the formats do not have."""
    urdf, _, parameters, residuals = files
    notes = options.written_with_shapes(
        source,
        model.task.mechanism,
        lambda shapes: of_tasks.write_calibrated(model, found, urdf, shapes=shapes, overwrite=True),
    )
    units = units_of(model)
    rows = [
        (label, units[k] or "1", *map(repr, map(float, values)), "yes" if found.alone[k] else "no")
        for k, (label, *values) in enumerate(
            zip(found.labels, found.before, found.parameters, found.deviations, strict=True)
        )
    ]
    header = ("parameter", "unit", "before", "after", "deviation", "known_alone")
    write_rows(parameters, [header, *rows])
    names = [f"{name}_{what}" for name in model.sensors for what in ("residual", "outlier")]
    cells = [
        [
            str(pose),
            *(
                cell
                for k in range(len(model.sensors))
                for cell in (
                    "" if math.isnan(row[k]) else repr(float(row[k])),
                    str(int(found.outliers[pose, k])),
                )
            ),
        ]
        for pose, row in enumerate(found.residuals)
    ]
    write_rows(residuals, [["pose", *names], *cells])
    return notes


def _summary(
    model: of_tasks.CalibrationModel,
    found: of_tasks.Calibration,
    crossed: of_tasks.CrossValidation | None,
) -> dict[str, Any]:
    units = units_of(model)
    return {
        "poses": len(found.x),
        "readings": found.read.total,
        "outliers": [
            {"pose": int(i), "sensor": model.sensors[k], "residual": float(found.residuals[i, k])}
            for i, k in np.argwhere(found.outliers)
        ],
        "parameters": len(found.labels),
        "identifiable": found.identifiable.rank + found.identifiable.weak,
        "fitted": found.identifiable.rank,
        "condition": found.identifiable.condition,
        "unseen": of_tasks.unseen_in_words(model, found.identifiable),
        "changes": [
            {
                "parameter": label,
                "unit": units[k],
                "before": float(found.before[k]),
                "after": float(found.parameters[k]),
                "deviation": float(found.deviations[k]) if found.alone[k] else None,
            }
            for k, label in enumerate(found.labels)
            if found.alone[k] or abs(found.parameters[k] - found.before[k]) > 1e-12
        ],
        "correlated": [
            {"parameters": [found.labels[i], found.labels[k]], "correlation": float(value)}
            for i, k, value in _correlated(found)
        ],
        "residual_ratio": math.sqrt(found.chi_squared / found.freedom),
        "by_sensor": [_told(one) for one in of_tasks.by_sensor(model, found)],
        "by_kind": [_told(one) for one in of_tasks.by_kind(model, found)],
        "by_pose": [None if math.isnan(x) else float(x) for x in of_tasks.by_pose(found)],
        "cross_validation_ratio": None if crossed is None else crossed.ratio,
        "doubts": found.doubts,
    }


def _told(one: of_tasks.Explained) -> dict[str, Any]:
    return {
        name: None if isinstance(value, float) and math.isnan(value) else value
        for name, value in one._asdict().items()
    }


def _correlated(found: of_tasks.Calibration) -> list[tuple[int, int, float]]:
    """Return pairs of parameters that are known alone and strongly correlated, the most first."""
    C = np.triu(np.nan_to_num(found.correlations), 1)
    pairs = [(int(i), int(k), float(C[i, k])) for i, k in np.argwhere(np.abs(C) > _CORRELATED)]
    return sorted(pairs, key=lambda one: -abs(one[2]))


def _print(
    console: Any,
    model: of_tasks.CalibrationModel,
    found: of_tasks.Calibration,
    summary: dict[str, Any],
) -> None:
    changes = summary["changes"]
    rows = [
        (
            one["parameter"],
            short(one["after"] - one["before"]),
            "not known alone" if one["deviation"] is None else f"{one['deviation']:.2g}",
            one["unit"],
        )
        for one in changes[:_ROWS]
    ]
    console.print(common.table_of(rows, "parameter", "change", "deviation", "unit"))
    if len(changes) > _ROWS:
        console.print(f"and {len(changes) - _ROWS} more: see parameters.csv")
    for key, head in (("by_kind", "kind of sensor"), ("by_sensor", "sensor")):
        console.print(common.table_of(_explained(summary[key]), head, *_EXPLAINED))
    console.print(common.table_of(_rows(model, found, summary)))
    if summary["unseen"]:
        console.print("What the readings do not tell:")
    for one in summary["unseen"]:
        console.print(f"- {one}")


_EXPLAINED = "readings", "outliers", "residual over deviation", "residual"


def _explained(given: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    return [
        (
            one["name"],
            str(one["readings"]),
            str(one["outliers"]),
            "" if one["ratio"] is None else f"{one['ratio']:.3g}",
            "" if one["size"] is None else f"{one['size']:.3g} {one['unit']}",
        )
        for one in given
    ]


def _rows(
    model: of_tasks.CalibrationModel, found: of_tasks.Calibration, summary: dict[str, Any]
) -> list[tuple[str, str]]:
    told = [f"pose {one['pose']}: {one['sensor']}" for one in summary["outliers"]]
    by_pose = of_tasks.by_pose(found)
    worst = [int(i) for i in np.argsort(-np.nan_to_num(by_pose))[:3]]
    correlated = [
        f"{one['parameters'][0]} and {one['parameters'][1]} ({one['correlation']:+.3f})"
        for one in summary["correlated"]
    ]
    crossed = summary["cross_validation_ratio"]
    return [
        ("poses, readings", f"{summary['poses']}, {summary['readings']}"),
        ("outliers, left out", few(told, _LISTED) or "none"),
        (
            "combinations known",
            f"{summary['fitted']} of {summary['parameters']} parameters, condition "
            f"{summary['condition']:.3g}",
        ),
        ("residuals over what deviations say", f"{summary['residual_ratio']:.3g}"),
        *([] if crossed is None else [("the same of poses left out", f"{crossed:.3g}")]),
        (
            "poses with the largest residuals",
            ", ".join(f"{i} ({by_pose[i]:.3g})" for i in worst),
        ),
        ("strongly correlated", few(correlated, _LISTED) or "none"),
    ]

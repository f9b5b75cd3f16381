"""Certified boxes on the command line: ``rps-pin workspace --certify``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rps_pin.arrays import Array
from rps_pin.cli import console as common
from rps_pin.cli import mechanism_options as options
from rps_pin.cli.degrees import as_asked
from rps_pin.cli.outputs import check_outputs
from rps_pin.cli.region_options import cones_of, round_parts
from rps_pin.cli.task_options import in_unit, unit_of
from rps_pin.cli.task_workspace import grid_of
from rps_pin.errors import InputError
from rps_pin.files import write_rows
from rps_pin.numerics.boxes import CertifiedBoxes
from rps_pin.rps.robot_file import kind_of_file
from rps_pin.rps.workspace import certify as certify_rps
from rps_pin.task import Task, certify
from rps_pin.trajectories.csv_columns import table_in_degrees

CertifyOption = Annotated[
    bool,
    typer.Option(
        "--certify",
        help="Prove of the box that **--over** spans which parts are inside, and which outside.",
    ),
]
UndecidedOption = Annotated[
    float,
    typer.Option(help="Undecided part of the volume inside at which **--certify** ends."),
]
MostBoxesOption = Annotated[
    int, typer.Option(help="Undecided boxes at which **--certify** ends in any case.")
]


def certify_boxes(
    robot: str,
    mechanism: Path | None,
    over: Sequence[str],
    held: Sequence[str],
    degrees: bool,
    output: Path,
    overwrite: bool,
    as_json: bool,
    *,
    cones: Sequence[str] = (),
    round: Sequence[str] = (),
    undecided: float,
    most_boxes: int,
    ignore_limits: bool = False,
    accuracy: float | None = None,
) -> None:
    """Prove boxes, write and print them; see `rps_pin.cli.workspace`."""
    inputs = []
    demands: dict[str, Any] = {"undecided": undecided, "most_boxes": most_boxes}
    prove: Any
    if mechanism is None:
        machine = common.load_robot(robot)
        task, prove = machine.task, certify_rps
        name, of = machine.parameters.name, machine
    else:
        model, file = options.load_mechanism(mechanism, ignore_limits, accuracy)
        if kind_of_file(file) == "parameters":
            raise InputError(f"{file} is a 3-RPS, which has boxes of its own: --robot {file}")
        task, prove = model.task, certify
        name, of = model.name, task
        demands["cones"] = cones_of(cones, degrees)
        inputs = [file]
    grid = grid_of(task, over, held, degrees)
    if mechanism is None and len(grid.over) < task.size:
        raise InputError("boxes of a 3-RPS are of z, rx and ry: give --over of each")
    grid = grid.holding(task.home)
    lower, upper = grid.at.copy(), grid.at.copy()
    for column, axis in zip(grid.columns, grid.axes, strict=True):
        lower[column], upper[column] = axis[0], axis[-1]
    demands["round"] = round_parts(round, task, lower, upper, degrees)
    file = output / "boxes.csv"
    check_outputs([file], overwrite, inputs=inputs)
    output.mkdir(parents=True, exist_ok=True)
    console = common.text_console(as_json)
    with console.status("proving boxes"):
        found = prove(of, lower, upper, **demands)
        write_rows(file, _table(found, task, degrees))
    summary = _summary(found, task, name or "mechanism", degrees)
    if as_json:
        common.print_json(summary | {"files": [file]})
        return
    console.print(common.table_of(_rows(summary)))
    common.print_files(console, [file])


def _table(found: CertifiedBoxes, task: Task, degrees: bool) -> list[list[str]]:
    """Return the boxes as a table: what each is, and its least and largest coordinates.

    Of an undecided box, two columns are the parts of it that are proven inside and outside; of one
    outside, the last column has the reasons, with semicolons between them.
    """
    columns = zip(task.coordinates, task.angular, strict=True)
    names = [f"{one}_{end}_{unit_of(turns, False)}" for one, turns in columns
             for end in ("least", "most")]  # fmt: skip
    names += ["part_inside", "part_outside"]
    rows = [_rows_of(found, verdict) for verdict in ("inside", "outside", "undecided")]
    told = [*[""] * len(rows[0]), *_told(found), *[""] * len(rows[2])]
    verdicts = np.repeat(["inside", "outside", "undecided"], [len(one) for one in rows])
    numbers = np.concatenate(rows)
    if degrees:
        names, numbers = table_in_degrees(names, numbers)
    rows_of_text = [
        [str(verdict), *map(repr, row), reasons]
        for verdict, row, reasons in zip(verdicts, numbers.tolist(), told, strict=True)
    ]
    return [["verdict", *names, "reasons"], *rows_of_text]


def _rows_of(found: CertifiedBoxes, verdict: str) -> Array:
    """Return ends of boxes and parts that are proven, shape (n, 2 m + 2)."""
    boxes = getattr(found, verdict)
    numbers = np.moveaxis(boxes, 1, 2).reshape(len(boxes), 2 * boxes.shape[2])
    whole = {"inside": (1.0, 0.0), "outside": (0.0, 1.0)}
    parts = found.parts if verdict == "undecided" else np.tile(whole[verdict], (len(boxes), 1))
    return np.hstack([numbers, parts])


def _told(found: CertifiedBoxes) -> list[str]:
    """Return the reasons of each box outside."""
    flags, which = np.unique(found.reason, return_inverse=True)
    words = [
        "; ".join(as_asked(one) for k, one in enumerate(found.reasons) if int(flag) >> k & 1)
        for flag in flags
    ]
    return [words[k] for k in which]


def _summary(found: CertifiedBoxes, task: Task, name: str, degrees: bool) -> dict[str, Any]:
    volumes = np.array(found.volumes)
    free = found.upper > found.lower
    ends = zip(task.coordinates, task.angular, found.lower, found.upper, strict=True)
    return {
        "mechanism": name,
        "box": {
            one: [in_unit(float(low), turns, degrees), in_unit(float(high), turns, degrees)]
            for one, turns, low, high in ends
        },
        "units": {
            one: unit_of(turns, degrees)
            for one, turns in zip(task.coordinates, task.angular, strict=True)
        },
        "over": [one for one, here in zip(task.coordinates, free, strict=True) if here],
        "verdict": found.verdict,
        "shares": dict(
            zip(
                ("inside", "outside", "undecided"),
                (volumes / volumes.sum()).tolist(),
                strict=True,
            )
        ),
        "boxes": {one: len(getattr(found, one)) for one in ("inside", "outside", "undecided")},
        "out": {as_asked(name): share for name, share in found.reason_shares().items()},
    }


def _rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    units = summary["units"]
    ends = summary["box"].items()
    counts = summary["boxes"]
    return [
        *((name, f"{low:.6g} to {high:.6g} {units[name]}") for name, (low, high) in ends),
        ("the whole box", summary["verdict"]),
        *(
            (name, f"{100 * share:.4g} % of the volume, {counts[name]} boxes")
            for name, share in summary["shares"].items()
        ),
        *(
            ("of the boxes outside", f"{100 * share:.4g} %: {name}")
            for name, share in summary["out"].items()
        ),
    ]

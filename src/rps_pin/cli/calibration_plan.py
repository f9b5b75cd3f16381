"""Which poses to measure for a calibration: what ``rps-pin calibrate --plan`` does."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rps_pin.cli import console as common
from rps_pin.cli.decimal_numbers import decimal
from rps_pin.cli.outputs import check_outputs
from rps_pin.cli.task_options import load_task_and_file
from rps_pin.errors import InputError, few
from rps_pin.plain_text import short
from rps_pin.task import calibration as of_tasks
from rps_pin.task.calibration.measured.instruments import Instrument, sensors_of
from rps_pin.task.calibration.measured.measured_file import measured_sensors
from rps_pin.task.task import Task

#: How ``--over`` is typed.
RANGE = "NAME=FROM:TO"
#: Random poses that are tried, at least, and for each pose of the plan.
_TRIED, _TRIED_EACH = 300, 10


class Chosen(NamedTuple):
    """Which parameters there are, as options say it; None: those by default."""

    parameters: Sequence[str] | None
    offsets: Sequence[str] | None
    scales: Sequence[str] | None


class PlanAsked(NamedTuple):
    """What a plan is made for."""

    poses: int
    mechanism: Path
    data: Path | None
    over: tuple[str, ...]
    instruments: Path | None
    output: Path


def plan_calibration(
    asked: PlanAsked,
    deviations: dict[str, float],
    priors: dict[str, float],
    chosen: Chosen,
    widest: float | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Choose poses, write and print them; see `rps_pin.cli.calibrate`."""
    task, file = load_task_and_file(asked.mechanism)
    path = asked.output / "poses.csv"
    inputs = [file, *(one for one in (asked.data, asked.instruments) if one is not None)]
    check_outputs([path], overwrite, inputs=inputs)
    ranges = _ranges(task, asked.over)
    others = of_tasks.load_instruments(asked.instruments, task) if asked.instruments else ()
    read = _measured(asked.data, task, deviations, others)
    spread = _deviations(task, read, deviations, others)
    model = model_of(task, tuple(spread), chosen, others)
    console = common.text_console(as_json)
    with console.status("looking for poses in the workspace"):
        tried = max(_TRIED, _TRIED_EACH * asked.poses)
        candidates = of_tasks.candidate_poses(task, ranges, tried)
    if len(candidates) < asked.poses:
        raise InputError(
            f"--plan {asked.poses}: {len(candidates)} of {tried} random poses are in the workspace "
            "and clear of singularities: give narrower ranges"
        )
    plan = of_tasks.plan_poses(
        model,
        candidates,
        asked.poses,
        spread,
        priors=priors,
        measured=None if read is None else _of_all(read, model.sensors),
        widest=widest,
        progress=common.progress_bar(console, "choosing poses"),
    )
    asked.output.mkdir(parents=True, exist_ok=True)
    of_tasks.write_plan(path, model, plan.x, spread)
    summary = _summary(model, plan, len(candidates), 0 if read is None else len(read.values))
    if as_json:
        common.print_json(summary | {"files": [path]})
        return
    console.print(common.table_of(_rows(summary)))
    if summary["unseen"]:
        console.print("What readings at such poses do not tell:")
    for one in summary["unseen"]:
        console.print(f"- {one}")
    common.print_files(console, [path])
    more = f" --instruments {asked.instruments}" if asked.instruments else ""
    console.print("Fill in its empty columns with readings, and calibrate:")
    console.print(f"  rps-pin calibrate {path} -m {asked.mechanism}{more}", soft_wrap=True)


def model_of(
    task: Task, sensors: Sequence[str], chosen: Chosen, others: Sequence[Instrument]
) -> of_tasks.CalibrationModel:
    """Return the model of a calibration; by default of all geometry and the actuators' offsets."""
    return of_tasks.CalibrationModel(
        task,
        chosen.parameters or of_tasks.geometric_groups(task),
        sensors,
        _offsets(task, sensors, chosen.offsets),
        chosen.scales or (),
        others,
    )


def _offsets(task: Task, sensors: Sequence[str], given: Sequence[str] | None) -> Sequence[str]:
    """Return the sensors of ``--offset``; by default the actuators' that are read."""
    if given is None:
        return [name for name in task.mechanism.actuated if name in sensors]
    if "none" in given and len(given) > 1:
        raise InputError("--offset none: leave out the others")
    return [] if "none" in given else given


def _ranges(task: Task, over: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the ranges of ``--over``, by coordinate."""
    home = ", ".join(
        f"{name} {short(float(value))}"
        for name, value in zip(task.coordinates, task.home, strict=True)
    )
    if not over:
        raise InputError(
            f"--plan needs ranges in which poses may be measured: --over {RANGE}, of one "
            f"coordinate or more (home: {home})"
        )
    found: dict[str, tuple[float, float]] = {}
    for text in over:
        name, _, ends = text.partition("=")
        first, _, last = ends.partition(":")
        try:
            low, high = decimal(first), decimal(last)
        except ValueError:
            raise InputError(f"--over {text}: it must be {RANGE}, such as z=0.4:0.6") from None
        if name not in task.coordinates:
            raise InputError(f"--over {text}: no coordinate {name!r} (home: {home})")
        if name in found:
            raise InputError(f"--over: {name} is given twice")
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError(f"--over {text}: FROM must be below TO, both finite")
        found[name] = low, high
    return found


def _measured(
    data: Path | None,
    task: Task,
    deviations: Mapping[str, float],
    others: Sequence[Instrument],
) -> of_tasks.Readings | None:
    """Return what is measured already; deviations of other sensors are those to come."""
    if data is None:
        return None
    more = sensors_of(others)
    there = measured_sensors(data, task, more)
    own = {name: value for name, value in deviations.items() if name in there}
    return of_tasks.read_readings(data, task, own, more)


def _deviations(
    task: Task,
    read: of_tasks.Readings | None,
    given: dict[str, float],
    others: Sequence[Instrument],
) -> dict[str, float]:
    """Return the deviation of each sensor: as given, or else the median of the file's."""
    found: dict[str, float] = {}
    if read is not None:
        known = np.where(np.isfinite(read.values), read.deviations, np.nan)
        found = dict(zip(read.sensors, np.nanmedian(known, axis=0).tolist(), strict=True))
    found |= given
    if not found:
        names = few([*task.coordinates, *task.mechanism.actuated, *sensors_of(others)])
        raise InputError(
            "--plan: say what will be read, and how well: --deviation SENSOR=VALUE of each sensor, "
            f"m or rad; sensors are {names} and other joints"
        )
    return found


def _of_all(read: of_tasks.Readings, sensors: Sequence[str]) -> of_tasks.Readings:
    """Return readings with columns of all sensors, NaN of those that were not read."""
    values = np.full((len(read.values), len(sensors)), np.nan)
    spread = np.ones_like(values)
    at = [list(sensors).index(name) for name in read.sensors]
    values[:, at], spread[:, at] = read.values, read.deviations
    return of_tasks.Readings(tuple(sensors), values, spread)


def _summary(
    model: of_tasks.CalibrationModel, plan: of_tasks.Plan, candidates: int, before: int
) -> dict[str, Any]:
    pose = plan.pose_deviation
    return {
        "poses": plan.x.tolist(),
        "candidates": candidates,
        "measured_before": before,
        "parameters": len(model.labels),
        "fitted": plan.identifiable.rank,
        "deviation": plan.deviation,
        "pose_deviation": None if math.isnan(pose) else pose,
        "random_over_planned": {
            "deviation": plan.factors[0],
            "pose_deviation": None if math.isnan(pose) else plan.factors[1],
        },
        "unseen": of_tasks.unseen_in_words(model, plan.identifiable),
    }


def _rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    before, pose = summary["measured_before"], summary["pose_deviation"]
    worse = summary["random_over_planned"]
    rows = [
        ("poses", f"{len(summary['poses'])} of {summary['candidates']} random ones"),
        *([("poses measured before", str(before))] if before else []),
        ("combinations known", f"{summary['fitted']} of {summary['parameters']} parameters"),
        ("their deviation, root mean square", f"{1e3 * summary['deviation']:.3g} mm"),
        ("the same of random poses", f"{worse['deviation']:.3g} times"),
    ]
    if pose is not None:
        rows += [
            ("deviation of a pose by the actuators", f"{1e3 * pose:.3g} mm"),
            ("the same of random poses", f"{worse['pose_deviation']:.3g} times"),
        ]
    return rows

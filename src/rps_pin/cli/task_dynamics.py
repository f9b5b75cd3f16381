"""The inverse dynamics of any mechanism with a task along a trajectory: what `dynamics` writes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rps_pin.arrays import Array
from rps_pin.cli import console as common
from rps_pin.cli.layer_options import write_page
from rps_pin.cli.mechanism_options import require_masses, shapes_of
from rps_pin.cli.motion_options import fastest_of_task
from rps_pin.cli.outputs import check_outputs, figures_in
from rps_pin.cli.task_options import load_path, load_task_and_file, units
from rps_pin.files import whole_file, write_text
from rps_pin.plain_text import plain
from rps_pin.task import run_motion
from rps_pin.task.sizing.motion_run import TaskMotion
from rps_pin.task.sizing.sizing import limits_of, sheet_of
from rps_pin.task.task import Task
from rps_pin.trajectories.csv_columns import table_in_degrees


def dynamics_of_task(
    mechanism: Path,
    trajectory: Path,
    output: Path | None,
    *,
    rate: float,
    fastest: bool,
    overwrite: bool,
    as_json: bool,
    ignore_limits: bool,
    accuracy: float | None,
    degrees: bool,
    gravity: Sequence[float] | None,
    power: float | None,
    **loads: Any,
) -> None:
    """Compute, write and print the motion; see `rps_pin.cli.dynamics`."""
    task, file = load_task_and_file(mechanism, ignore_limits, accuracy, gravity)
    model = task.mechanism
    require_masses(model)
    limits = limits_of(task)
    if power is not None:
        limits = tuple(replace(one, power=power) for one in limits)
    path = load_path(trajectory, task, **loads)
    folder = output or Path(f"{trajectory.stem}-dynamics")
    files = [folder / name for name in ("dynamics.csv", "sizing.json", "viewer.html")]
    files += figures_in(folder, "force_over_speed")
    check_outputs(files, overwrite, inputs=[trajectory, mechanism], renewed=True)
    console = common.text_console(as_json)
    if fastest:
        path = fastest_of_task(console, task, path, **loads)
    names = columns(task)
    common.tell_size("dynamics.csv", path.duration * rate, len(names))
    progress = common.progress_bar(console, "inverse dynamics")
    run = run_motion(task, path, rate, progress=progress, **loads)
    sheet = sheet_of(task, run, limits)
    if degrees:
        sheet = sheet.in_degrees()
    folder.mkdir(parents=True, exist_ok=True)
    with console.status("writing the results"):
        from rps_pin.plots import save_figure
        from rps_pin.plots.dynamics import plot_sizing
        from rps_pin.viewer import Motion

        write_table(files[0], names, run, degrees)
        write_text(files[1], json.dumps(sheet.as_dict(), indent=2) + "\n")
        shapes, _ = shapes_of(file, model)
        title = f"{model.name} along {trajectory.name}"
        motion = Motion(model.model, run.time, *run.state, forces=run.force)
        write_page(folder, model, motion, title, visual=shapes)
        save_figure(plot_sizing(sheet), folder, "force_over_speed")
    if as_json:
        answer = {"mechanism": model.name, "trajectory": trajectory, "duration": path.duration}
        answer["units"] = units(degrees)
        common.print_json(answer | {"sizing": sheet.as_dict(), "files": files})
        return
    console.print(plain(f"{model.name}, {trajectory}: {path.duration:.6g} s"))
    for table in sheet.tables():
        console.print(table)
    common.print_files(console, files)


def columns(task: Task) -> list[str]:
    """Return the names of the table's columns; the first are those of a trajectory file."""
    names = ["time_s"]
    for what, unit in (("", ""), ("_rate", "_per_s"), ("_acceleration", "_per_s2")):
        for name, turns in zip(task.coordinates, task.angular, strict=True):
            names.append(f"{name}{what}_{'rad' if turns else 'm'}{unit}")
    return [*names, *task.actuator_columns]


def write_table(path: Path, names: list[str], run: TaskMotion, degrees: bool = False) -> None:
    """Write every sample of a motion as CSV."""
    motion = (run.pose, run.rate, run.acceleration)
    parts: list[Array] = [run.time[:, None], *motion, run.position, run.speed, run.force]
    rows = np.hstack(parts)
    if degrees:
        names, rows = table_in_degrees(names, rows)
    with whole_file(path) as scratch:
        np.savetxt(scratch, rows, fmt="%.17g", delimiter=",", header=",".join(names), comments="")

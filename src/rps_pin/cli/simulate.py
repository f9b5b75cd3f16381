"""``rps-pin simulate``: a mechanism's motion in time."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from rps_pin.arrays import Array
from rps_pin.cli.console import JsonOption, NamedFolderOption, print_files, print_json
from rps_pin.cli.layer_options import LayersOption, chosen_layers
from rps_pin.cli.mechanism_options import (
    FileArgument,
    by_joint,
    load_mechanism,
    mechanism_file,
)
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.simulation.result import Simulation
from rps_pin.errors import InputError

_MOST_NOTES = 3


class Method(StrEnum):
    """How the time steps are taken."""

    RK4 = "rk4"
    ADAPTIVE = "adaptive"


def simulate_command(
    file: FileArgument,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 1.0,
    step: Annotated[float, typer.Option(help="Time step, and time between two rows, s.")] = 1e-3,
    method: Annotated[
        Method,
        typer.Option(help="Fixed steps of order 4, or adaptive with an error of 1e-12."),
    ] = Method.RK4,
    start: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=VALUE",
            help="Initial position of a joint, rad or m; the others start from home.",
        ),
    ] = None,
    speed: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=VALUE",
            help="Initial speed of an actuated joint, rad/s or m/s; default: 0.",
        ),
    ] = None,
    tau: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=VALUE",
            help="Constant force of an actuated joint, N m or N; default: 0.",
        ),
    ] = None,
    hold: Annotated[
        bool, typer.Option("--hold", help="Add the forces that hold the initial position.")
    ] = False,
    output: NamedFolderOption = None,
    layers: LayersOption = None,
    as_json: JsonOption = False,
) -> None:
    """Simulate a mechanism from rest or a given state, with its loops closed at every step.

    Output: **simulation.csv** (every step), **simulation.png** and **.svg** (joints, energy, gap),
    and **viewer.html**, the motion in 3D (a skeleton if the description names no URDF), with
    layers: forces, reactions, joint limits and others.

    Exit status: 0 done; 1 it cannot be simulated (the error says when and why); 2 wrong usage.

    Examples:

    - `rps-pin simulate four_bar --duration 3`

    - `rps-pin simulate delta --hold --speed arm_1_joint=0.5`
    """
    from rps_pin.closed_loop.simulation.simulate import simulate

    file = mechanism_file(file)
    mechanism = load_mechanism(file)
    q, v, forces = _start(mechanism, start, speed, tau, hold)
    console = Console(quiet=as_json, soft_wrap=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("simulating", total=1.0)
        motion = simulate(
            mechanism,
            q,
            v,
            duration=duration,
            step=step,
            method=method.value,
            tau=forces,
            progress=lambda done: bar.update(task, completed=done),
        )
    folder = output or Path(f"{file.stem}-simulation")
    folder.mkdir(parents=True, exist_ok=True)
    files = write_results(folder, file, mechanism, motion, layers)
    summary = _summary(motion)
    if as_json:
        print_json({"mechanism": mechanism.name} | summary | {"files": files})
    else:
        _print(console, mechanism, motion, summary)
        print_files(console, files)


def write_results(
    folder: Path,
    file: Path,
    mechanism: ClosedLoopModel,
    motion: Simulation,
    layers: str | None = None,
) -> list[Path]:
    """Write a simulation's table, figure and animation into a folder; return the files."""
    from rps_pin.closed_loop.visuals import visual_model
    from rps_pin.plots import save_figure
    from rps_pin.plots.simulation import plot_simulation
    from rps_pin.viewer import fitting_layers, save_html

    table = folder / "simulation.csv"
    motion.to_csv(table)
    files = [table, *save_figure(plot_simulation(motion, mechanism), folder, "simulation")]
    described = file.suffix.lower() in (".yaml", ".yml")
    page = folder / "viewer.html"
    shown, at_hand = chosen_layers(layers, fitting_layers(mechanism))
    save_html(
        page,
        mechanism,
        motion,
        visual=visual_model(file, mechanism.model) if described else None,
        layers=shown,
        hidden=at_hand,
        title=f"{mechanism.name}, simulated",
    )
    files.append(page)
    return files


def _start(
    mechanism: ClosedLoopModel,
    start: list[str] | None,
    speed: list[str] | None,
    tau: list[str] | None,
    hold: bool,
) -> tuple[Array, Array, Array]:
    """Return the configuration, velocity and actuator forces that the options ask for."""
    q = mechanism.close(mechanism.home)
    if start:
        q = mechanism.complete(by_joint(start, "--start"), q)
    speeds = _of_actuated(mechanism, speed, "--speed")
    v = mechanism.velocity(q, speeds) if speeds.any() else np.zeros(mechanism.model.nv)
    forces = _of_actuated(mechanism, tau, "--tau")
    if hold:
        still = np.zeros(mechanism.model.nv)
        forces = forces + mechanism.inverse_dynamics(q, still, still).tau
    return q, v, forces


def _of_actuated(mechanism: ClosedLoopModel, pairs: list[str] | None, option: str) -> Array:
    """Return values given by joint name in the order of the actuated joints, zero if not given."""
    values = by_joint(pairs or [], option)
    names = list(mechanism.actuated)
    if mechanism.actuated_indices.size != len(names):
        raise InputError(f"{option}: the actuated joints have several coordinates each")
    for name in values:
        if name not in names:
            raise InputError(f"{option}: no actuated joint {name!r}; there are: {', '.join(names)}")
    return np.array([values.get(name, 0.0) for name in names])


def _summary(motion: Simulation) -> dict[str, object]:
    energy, work = motion.energy, np.abs(motion.work).max()
    scale = max(float(motion.kinetic.max()), float(np.ptp(motion.potential)), float(work), 1e-300)
    return {
        "duration": float(motion.time[-1]),
        "rows": len(motion.time),
        "largest_gap": float(motion.gap.max()),
        "kinetic_peak": float(motion.kinetic.max()),
        "energy_change": float(energy[-1] - energy[0]),
        "work": float(motion.work[-1]),
        "energy_balance": float(np.abs(motion.energy_balance).max() / scale),
        "limits_passed": [str(passed) for passed in motion.limits_passed],
    }


def _print(
    console: Console,
    mechanism: ClosedLoopModel,
    motion: Simulation,
    summary: dict[str, object],
) -> None:
    table = Table(title=f"{mechanism.name}, simulated", title_justify="left", show_header=False)
    rows = {
        "duration": f"{summary['duration']:.6g} s ({summary['rows']} rows)",
        "largest loop gap": f"{summary['largest_gap']:.2g} m",
        "largest kinetic energy": f"{summary['kinetic_peak']:.6g} J",
        "change of the energy": f"{summary['energy_change']:.6g} J",
        "work of actuators, friction and wrenches": f"{summary['work']:.6g} J",
        "energy balance (change less work)": f"{summary['energy_balance']:.2g} of the energy",
    }
    for name, value in rows.items():
        table.add_row(name, value)
    console.print(table)
    for passed in motion.limits_passed[:_MOST_NOTES]:
        console.print(f"note: {passed}", highlight=False)
    if len(motion.limits_passed) > _MOST_NOTES:
        console.print(f"note: so did {len(motion.limits_passed) - _MOST_NOTES} more joints later")

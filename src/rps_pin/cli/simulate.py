"""``rps-pin simulate``: a mechanism's motion in time."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rps_pin.arrays import Array
from rps_pin.cli import console as common
from rps_pin.cli import mechanism_options as options
from rps_pin.cli.layer_options import LayersOption, write_page
from rps_pin.cli.outputs import OverwriteOption, check_outputs, figures_in
from rps_pin.cli.printing import say
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.column_names import joint_coordinates
from rps_pin.closed_loop.dynamics.not_held import NotHeld, not_held
from rps_pin.closed_loop.simulation.result import Simulation
from rps_pin.errors import InputError

_MOST_NOTES = 3
#: Error of the energy, of its largest part, above which the step is told to be too long.
_BALANCED = 1e-3
#: Rows of the printed table, by the names of the summary.
_ROWS = {
    "duration": "{duration:.6g} s ({rows} rows)",
    "largest loop gap": "{largest_gap:.2g} m",
    "largest kinetic energy": "{kinetic_peak:.6g} J",
    "change of the energy": "{energy_change:.6g} J",
}


class Method(StrEnum):
    """How the time steps are taken."""

    RK4 = "rk4"
    ADAPTIVE = "adaptive"


def simulate_command(
    file: options.FileArgument,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 1.0,
    step: Annotated[float, typer.Option(help="Time step, and time between two rows, s.")] = 1e-3,
    method: Annotated[
        Method,
        typer.Option(help="Fixed steps of order 4, or adaptive with an error of 1e-12."),
    ] = Method.RK4,
    start: Annotated[
        options.JointValues,
        options.joint_values("Initial position of a joint, rad or m; the others start from home."),
    ] = None,
    jump: Annotated[
        bool, typer.Option("--jump", help="Let --start leave the assembly mode of home.")
    ] = False,
    speed: Annotated[
        options.JointValues,
        options.joint_values("Initial speed of an actuated joint, rad/s or m/s; default: 0."),
    ] = None,
    tau: Annotated[
        options.JointValues,
        options.joint_values("Constant force of an actuated joint, N m or N; default: 0."),
    ] = None,
    hold: Annotated[
        bool,
        typer.Option(
            "--hold",
            help="Add the forces that hold the initial position; what they cannot hold is told.",
        ),
    ] = False,
    ignore_limits: options.IgnoreLimitsOption = False,
    accuracy: options.AccuracyOption = None,
    package_path: options.PackagePathOption = None,
    output: common.NamedFolderOption = None,
    overwrite: OverwriteOption = False,
    layers: LayersOption = None,
    as_json: common.JsonOption = False,
) -> None:
    """Simulate a mechanism from rest or a given state, with its loops closed at every step.

    Output: **simulation.csv** (every step), **simulation.png** and **.svg** (joints, energy, gap),
    and **viewer.html**, the motion in 3D (a skeleton if the file has no shapes that can be drawn),
    with layers: forces, reactions, joint limits and others.

    Exit status: 0 done; 1 it cannot be simulated (the error says when and why); 2 wrong usage.

    Examples:

    - `rps-pin simulate four_bar --duration 3`

    - `rps-pin simulate delta --hold --speed arm_1_joint=0.5`
    """
    from rps_pin.closed_loop.simulation.integrators import check_times
    from rps_pin.closed_loop.simulation.simulate import simulate

    check_times(duration, step, 1)
    mechanism, file = options.load_mechanism(file, ignore_limits, accuracy)
    folder = output or Path(f"{file.stem}-simulation")
    files = [folder / "simulation.csv"]
    results = [*files, *figures_in(folder, "simulation"), folder / "viewer.html"]
    check_outputs(results, overwrite, inputs=[file], renewed=True)
    q = mechanism.close(mechanism.home)
    if start:
        q = mechanism.complete(options.by_joint(start, "--start"), q, jump=jump)
    still, speeds = np.zeros(mechanism.model.nv), _of_actuated(mechanism, speed, "--speed")
    v = mechanism.velocity(q, speeds) if speeds.any() else still
    forces = _of_actuated(mechanism, tau, "--tau")
    unheld: tuple[NotHeld, ...] = ()
    if hold:
        holding = mechanism.inverse_dynamics(q, still, still)
        forces += holding.tau
        needed = mechanism.generalised_force(q, still, still)
        unheld = not_held(mechanism.system, holding.unproduced, needed)
    if unheld:
        say(f"note: --hold: {_phrase(unheld)}", err=True)
    console = common.text_console(as_json, soft_wrap=True)
    times: dict[str, Any] = {"duration": duration, "step": step, "method": method.value}
    common.tell_size("simulation.csv", duration / step, 5 + q.size + 2 * v.size + forces.size)
    with common.share_bar(console, "simulating") as progress:
        motion = simulate(mechanism, q, v, tau=forces, progress=progress, **times)
    folder.mkdir(parents=True, exist_ok=True)
    from rps_pin.plots import save_figure
    from rps_pin.plots.simulation import plot_simulation

    title = f"{mechanism.name}, simulated"
    motion.to_csv(files[0])
    files += save_figure(plot_simulation(motion, mechanism), folder, "simulation")
    shapes, missing = options.shapes_of(file, mechanism, package_path)
    balance = _error_of_energy(motion)
    notes = [*mechanism.notes, *missing, *_too_long(balance, step, method)]
    files.append(write_page(folder, mechanism, motion, title, layers, shapes))
    summary: dict[str, Any] = {
        "duration": float(motion.time[-1]),
        "rows": len(motion.time),
        "largest_gap": float(motion.gap.max()),
        "kinetic_peak": float(motion.kinetic.max()),
        "energy_change": float(motion.energy[-1] - motion.energy[0]),
        "work": float(motion.work[-1]),
        "energy_balance": balance,
        "not_held": [part._asdict() for part in unheld],
        "limits_passed": [str(passed) for passed in motion.limits_passed],
        "notes": notes,
    }
    if as_json:
        common.print_json({"mechanism": mechanism.name} | summary | {"files": files})
        return
    rows = _rows(mechanism, summary)
    if unheld:
        rows["not held by the actuators"] = "; ".join(map(str, unheld))
    console.print(common.table_of(rows.items(), title=title, title_justify="left"))
    for passed in motion.limits_passed[:_MOST_NOTES]:
        console.print(f"note: {passed}")
    if len(motion.limits_passed) > _MOST_NOTES:
        console.print(f"note: so did {len(motion.limits_passed) - _MOST_NOTES} more joints later")
    for note in notes:
        console.print(f"note: {note}")
    common.print_files(console, files)


def _rows(mechanism: ClosedLoopModel, summary: dict[str, Any]) -> dict[str, str]:
    """Return the rows of the table; the work is of what there is in the mechanism."""
    rows = {name: text.format(**summary) for name, text in _ROWS.items()}
    effects = mechanism.effects
    there = {
        "actuators": len(mechanism.actuated) > 0,
        "damping": effects is not None and effects.damping.any(),
        "friction": effects is not None and effects.friction.any(),
    }
    names = [name for name, is_there in there.items() if is_there]
    error = f"{summary['energy_balance']:.2g} of the energy"
    if not names:
        return rows | {"energy balance (nothing does work)": error}
    work = f"work of {' and '.join([', '.join(names[:-1]), names[-1]] if names[1:] else names)}"
    return rows | {work: f"{summary['work']:.6g} J", "energy balance (change less work)": error}


def _error_of_energy(motion: Simulation) -> float:
    """Return the largest error of the energy balance, over the largest part of the energy."""
    work = float(np.abs(motion.work).max())
    largest = max(float(motion.kinetic.max()), float(np.ptp(motion.potential)), work, 1e-300)
    return float(np.abs(motion.energy_balance).max() / largest)


def _too_long(balance: float, step: float, method: Method) -> list[str]:
    """Return a note if the energy shows that the steps are too long."""
    if balance <= _BALANCED or method is Method.ADAPTIVE:
        return []
    return [
        f"the energy is wrong by {balance:.2g}: steps of {step:g} s are too long for this motion "
        "(stiff springs?); take a shorter --step, or --method adaptive"
    ]


def _phrase(unheld: tuple[NotHeld, ...]) -> str:
    return "the actuators cannot hold this position, and it will move: not held are " + "; ".join(
        map(str, unheld)
    )


def _of_actuated(mechanism: ClosedLoopModel, pairs: options.JointValues, option: str) -> Array:
    """Return values given by name in the order of tau, zero if not given.

    Of joints with several velocities, by the names of these: ``ball.x``.
    """
    values, model = options.by_joint(pairs or [], option), mechanism.model
    names: list[str] = []
    for joint in mechanism.actuated:
        whole = model.existJointName(joint)
        names += (joint_coordinates(model, joint) if whole else ()) or (joint,)
    for name in values:
        if name not in names:
            there = f"there are: {', '.join(names)}" if names else "nothing is driven"
            raise InputError(f"{option}: no actuated joint {name!r}; {there}")
    return np.array([values.get(name, 0.0) for name in names])

"""Write the tables and pictures of docs/control.md.

Run it from the checkout, on an idle machine, in an environment with the
development dependencies (about two minutes):

    .venv/bin/python docs/control_tables.py

The tables of times are made from docs/control_latency.json and docs/control_profile.json. The first
takes about ten minutes, for a million ticks per stage:

    export OPENBLAS_NUM_THREADS=1
    .venv/bin/python -m benchmarks.latency --json docs/control_latency.json
    .venv/bin/python -m benchmarks.tick_profile --json docs/control_profile.json
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from marked import replaced
from matplotlib.figure import Figure

from rps_pin import RPSParameters, RPSRobot, helix
from rps_pin.control import ComputedTorque, Controller, Gains, PDControl, effective_inertia
from rps_pin.control.margins import loop_margins
from rps_pin.control.simulation.encoders import Encoders
from rps_pin.control.simulation.loop_run import LoopRun, run_loop
from rps_pin.control.simulation.loop_summary import LoopSummary, TrackingErrors, status_name
from rps_pin.control.simulation.plant import Plant
from rps_pin.control.simulation.scenario import load_scenario
from rps_pin.control.simulation.wrong_parameters import wrong_parameters
from rps_pin.plots import COLOURS, LEG_STYLES, plot_loop_forces, styled
from rps_pin.plots.curves import legend_above
from rps_pin.plots.style import figure_of, panels
from rps_pin.trajectories import Trajectory

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "control.md"
SCENARIOS = ROOT / "docs" / "scenarios"
LATENCY = ROOT / "docs" / "control_latency.json"
PROFILE = ROOT / "docs" / "control_profile.json"
IMAGES = ROOT / "docs" / "images"

BANDWIDTH, INTEGRAL = 15.0, 0.2
SETTLE = 1.0
#: The friction that the controller knows of where it knows any: N, N s/m.
FRICTION = {"prismatic_friction": 0.5, "prismatic_damping": 5.0}
ENCODERS = Encoders(resolution=50e-9, noise=20e-9)

#: Columns of docs/control_latency.json: of the whole run, and of its quietest tenth.
TAILS = ("p99.9", "quiet")

Make = Callable[[RPSRobot], Controller]


def main() -> None:
    """Write all tables and pictures."""
    parts: dict[str, Callable[[], str]] = {
        "micro": micro,
        "margins": margins,
        "robustness": robustness,
        "faults": faults,
        "saturation": saturation,
        "latency": latency,
        "profile": profile,
    }
    text = PAGE.read_text("utf-8")
    for name, make in parts.items():
        text = replaced(text, name, make())
    PAGE.write_text(text, "utf-8")
    picture()


def controllers(start: Any, robot: RPSRobot) -> dict[str, Make]:
    """Return the compared controllers, with equal initial stiffness."""
    placed, pd = Gains.placed(BANDWIDTH, integral=INTEGRAL), Gains.placed(BANDWIDTH)
    legs = effective_inertia(robot, start)
    pose = effective_inertia(robot, start, space="task")
    return {
        "PD, gravity compensated (actuator)": lambda r: PDControl(r, start, pd.times(legs)),
        "PD, gravity compensated (task)": lambda r: PDControl(
            r, start, pd.times(pose), space="task"
        ),
        "PID, gravity compensated (actuator)": lambda r: PDControl(r, start, placed.times(legs)),
        "PID, feed-forward (actuator)": lambda r: PDControl(
            r, start, placed.times(legs), compensation="feed_forward"
        ),
        "computed torque, no integral (task)": lambda r: ComputedTorque(r, start, pd),
        "computed torque (actuator)": lambda r: ComputedTorque(r, start, placed, space="actuator"),
        "computed torque (task)": lambda r: ComputedTorque(r, start, placed),
    }


def plants(p: RPSParameters) -> dict[str, tuple[RPSRobot, RPSRobot, dict[str, Any]]]:
    """Return the robot of the model, that of the plant, and the plant's options, by name."""
    robot = RPSRobot(p)
    with_friction = wrong_parameters(p, **FRICTION)
    more = {name: 1.2 * value for name, value in FRICTION.items()}
    heavy = RPSRobot(wrong_parameters(p, masses=1.2))
    all_wrong = RPSRobot(wrong_parameters(p, masses=1.2, **more))
    return {
        "correct model": (robot, robot, {}),
        "delay of one tick": (robot, robot, {"delay": 1}),
        "encoders": (robot, robot, {"encoders": ENCODERS}),
        "masses +20 %": (robot, heavy, {}),
        "unknown friction": (robot, RPSRobot(with_friction), {}),
        "all, friction known to 20 %": (
            RPSRobot(with_friction),
            all_wrong,
            {"delay": 1, "encoders": ENCODERS},
        ),
        "all, friction unknown": (robot, all_wrong, {"delay": 1, "encoders": ENCODERS}),
    }


def compared(robot: RPSRobot, path: Trajectory) -> str:
    """Return the errors of every controller on every plant, and their ratio."""
    start = path.sample(0.0).pose
    machines = plants(robot.parameters)
    lines = [f"| | {' | '.join(machines)} |", "|---|" + "---:|" * len(machines)]
    found: dict[str, list[LoopSummary]] = {}
    for name, make in controllers(start, robot).items():
        found[name] = [
            LoopSummary.of(
                run_loop(make(believed), Plant(true, start, **faults), path, settle=SETTLE),
                begin=SETTLE,
            )
            for believed, true, faults in machines.values()
        ]
        cells = [f"{s.centre_rms:.3g} / {s.turn_rms:.3g}" for s in found[name]]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    pd, ct = found["PD, gravity compensated (actuator)"], found["computed torque (task)"]
    ratios = [
        f"{a.centre_rms / b.centre_rms:.3g} / {a.turn_rms / b.turn_rms:.3g}"
        for a, b in zip(pd, ct, strict=True)
    ]
    lines.append(f"| **first row over last** | {' | '.join(ratios)} |")
    return "\n".join(lines)


def micro() -> str:
    """Return the comparison for the micro robot."""
    robot = RPSRobot.from_preset("micro")
    return compared(robot, helix(robot, radius=0.5e-3, pitch=0.33e-3, height=0.223, duration=1.0))


def margins() -> str:
    """Return the margins of these and other gains."""
    lines = [
        "| bandwidth | integral | cut-off | delay | gain margins | phase margin | delay margin | "
        "modulus margin |",
        "|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for bandwidth, cut_off in ((10.0, 50.0), (15.0, 100.0), (20.0, 200.0), (30.0, None)):
        gains = Gains.placed(bandwidth, integral=INTEGRAL)
        (kp, *_), (kd, *_), (ki, *_) = gains.rows
        for delay in (0, 1):
            m = loop_margins(kp, kd, ki, delay=delay, cut_off=cut_off)
            filtered = f"{cut_off:g} Hz" if cut_off else "speeds measured"
            lines.append(
                f"| {bandwidth:g} Hz | {INTEGRAL:g} | {filtered} | {delay} ticks | "
                f"{m.gain_down:.2f} to {m.gain_up:.2f} | {np.degrees(m.phase):.0f} deg | "
                f"{1e3 * m.delay:.1f} ms | {m.modulus:.2f} |"
            )
    return "\n".join(lines)


def robustness() -> str:
    """Return the errors of a simulated robot near its stability limits."""
    robot = RPSRobot.from_preset("micro")
    path = helix(robot, radius=0.5e-3, pitch=0.33e-3, height=0.223, duration=1.0)
    start = path.sample(0.0).pose
    placed = Gains.placed(BANDWIDTH, integral=INTEGRAL)
    (kp, *_), (kd, *_), (ki, *_) = placed.rows
    m = loop_margins(kp, kd, ki, delay=1, cut_off=100.0)
    lines = ["| loop gain relative to the design | final error: centre (um) / orientation (urad) |"]
    lines.append("|---:|---:|")
    for factor in (1.05 * m.gain_down, 1.0, 0.95 * m.gain_up, 1.05 * m.gain_up):
        believed = RPSRobot(wrong_parameters(robot.parameters, masses=factor))
        controller = ComputedTorque(believed, start, placed)
        run = run_loop(controller, Plant(robot, start, delay=1), path, settle=SETTLE, duration=4.0)
        s = LoopSummary.of(run, begin=3.9)
        said = [name for name in s.statuses if name == "stopped"]
        errors = "stopped" if said else f"{s.centre_max:.2g} / {s.turn_max:.2g}"
        lines.append(f"| {factor:.3g} | {errors} |")
    return "\n".join(lines)


def faults() -> str:
    """Return the controller's status in the scenario of faults."""
    scenario = load_scenario(SCENARIOS / "faults.yaml")
    run = scenario.run()
    errors = TrackingErrors.of(run)
    centre = 1e6 * np.linalg.norm(errors.centre, axis=1)
    lines = ["| fault | status | message | error of the centre |", "|---|---|---|---:|"]
    for fault in scenario.faults:
        here = (run.time >= fault.start - 1e-9) & (run.time < fault.start + 0.3)
        names = list(dict.fromkeys(status_name(int(one)) for one in run.status[here] if one))
        words = next(
            (e.text for e in run.events if e.status and e.time >= fault.start - 1e-9), "ok"
        )
        lines.append(
            f"| {fault} | {'; '.join(names) or 'ok'} | {words.split(';')[0]} | "
            f"{centre[here].max():.3g} um |"
        )
    worst = np.abs(run.command).max()
    lines += ["", f"Largest force of the run: {worst:.4g} N; all finite: "]
    lines[-1] += f"{bool(np.isfinite(run.command).all())}."
    save_named(plot_loop_forces(run), "control_faults")
    return "\n".join(lines)


def saturation() -> str:
    """Return the path error of a saturated robot, with and without a paced setpoint."""
    scenario = load_scenario(SCENARIOS / "weak.yaml")
    path = scenario.trajectory
    dense = path.sample(np.linspace(0.0, path.duration, 20_001)).pose
    lines = [
        "| setpoint | largest distance from the path | arrival | saturated ticks |",
        "|---|---:|---:|---:|",
    ]
    for name, paced in (("at constant pace", False), ("at the controller's pace", True)):
        entry = scenario.entry
        changed = entry.model_copy(
            update={"controller": entry.controller.model_copy(update={"paced": paced})}
        )
        run = replace(scenario, entry=changed).run()
        far = distance_from(run, dense, scenario.model.parameters.platform_radius)
        s = LoopSummary.of(run)
        errors = np.linalg.norm(run.pose - path.sample(path.duration).pose, axis=1)
        late = run.time[np.flatnonzero(errors > 1e-5)[-1]] - entry.settle
        lines.append(f"| {name} | {1e6 * far:.0f} um | {late:.2f} s | {s.saturated:.0%} |")
    return "\n".join(lines)


def distance_from(run: LoopRun, path: Any, h: float) -> float:
    """Return the largest distance of the tips from the curve of the path, RMS of three, m.

    Tilts are weighted by the motion of the tips: h / sqrt(2).
    """
    scale = np.array([1.0, h / np.sqrt(2), h / np.sqrt(2)])
    apart = [np.linalg.norm((pose - path) * scale, axis=1).min() for pose in run.pose[::2]]
    return float(np.max(apart))


def latency() -> str:
    """Return the table of measured latencies."""
    measured = json.loads(LATENCY.read_text("utf-8"))
    lines = [
        "| stage | ticks | median | p99 | p99.9 | p99.9, quietest tenth | maximum | memory grew |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for name, row in measured["stages"].items():
        figures = [row[key] for key in ("median", "p99", "p99.9", "quiet", "maximum")]
        cells = " | ".join(f"{value:.2f}" for value in figures)
        lines.append(f"| {name} | {row['ticks']:,} | {cells} | {row['grew_kB']:.0f} kB |")
    tick, machine = (
        measured["stages"][name]
        for name in ("whole tick, computed torque", "the same sum each tick: the machine's tail")
    )
    tails = [f"{row[key] / row['median']:.1f}" for row in (tick, machine) for key in TAILS]
    return "\n".join(
        [
            *lines,
            "",
            f"us per tick; {measured['machine']}. p99.9 of a tick is {tails[0]} times its median, "
            f"and {tails[1]} times in the quietest tenth of the run; for a constant sum of equal "
            f"duration {tails[2]} and {tails[3]} times. The machine is a virtual one with shared "
            "cores; the load says how many programs wanted them.",
        ]
    )


def profile() -> str:
    """Return the table of the measured parts of a tick."""
    measured = json.loads(PROFILE.read_text("utf-8"))
    lines = []
    for name in ("generated", "interpreted"):
        times = measured[name]
        lines += [f"| part of a tick, {name} | us | share |", "|---|---:|---:|"]
        lines += [
            f"| {part} | {value:.2f} | {value / times['whole tick']:.0%} |"
            for part, value in times.items()
        ]
        lines.append("")
    return "\n".join([*lines, f"{measured['machine']}."])


def save_named(figure: Figure, name: str) -> None:
    """Write a figure as PNG."""
    figure.savefig(IMAGES / f"{name}.png")


def picture() -> None:
    """Plot the errors of PD and computed torque in one figure."""
    scenario = load_scenario(SCENARIOS / "micro_helix.yaml")
    start = scenario.begin
    pd = Gains.placed(BANDWIDTH).times(effective_inertia(scenario.model, start))
    runs = {
        "PD, gravity compensated": run_loop(
            PDControl(scenario.model, start, pd), scenario.plant(), scenario.trajectory, settle=1.0
        ),
        "computed torque": scenario.run(),
    }
    save_named(tracking_errors(runs), "control_errors")


@styled
def tracking_errors(runs: dict[str, LoopRun]) -> Figure:
    """Return the errors of centre and orientation of several runs, from 1 s on."""
    axes = panels(None, 2, 3.4)
    for (name, run), colour, style in zip(runs.items(), COLOURS, LEG_STYLES, strict=False):
        errors, here = TrackingErrors.of(run), run.time >= 1.0
        values = np.linalg.norm(errors.centre, axis=1), errors.turn
        for own, error in zip(axes, values, strict=True):
            shown = 1e6 * error[here]
            shown[shown < 1e-2 * np.median(shown)] = np.nan  # at the start it is 0
            own.semilogy(run.time[here], shown, style, color=colour, label=name)
    for own, label in zip(axes, ("centre error (µm)", "turn error (µrad)"), strict=True):
        own.set(xlim=(1.0, 2.0), ylabel=label)
    axes[-1].set_xlabel("time (s)")
    legend_above(axes[0])
    return figure_of(axes[0])


if __name__ == "__main__":
    main()

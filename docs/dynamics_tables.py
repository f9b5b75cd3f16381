"""Write the tables and the picture of docs/dynamics.md.

Run it from the checkout, on a machine with nothing else to do, in an environment with the
development dependencies (about two minutes):

    .venv/bin/python docs/dynamics_tables.py
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from marked import block, replaced

from rps_pin import RPSRobot, helix
from rps_pin.paper import lagrange_forces, virtual_work_forces
from rps_pin.plots import plot_force_causes
from rps_pin.rps import Payload, force_causes, time_optimal
from rps_pin.rps.dynamics.motion_run import MotionRun, run_motion
from rps_pin.rps.motion.trajectory_file import load_trajectory
from rps_pin.trajectories import Trajectory, circle

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "dynamics.md"
TRAJECTORIES = sorted((ROOT / "docs" / "trajectories").glob("*.yaml"))
RATE = 500.0
WAYS = ("closed form", "Lagrange, first kind", "virtual work")


def main() -> None:
    """Write all tables and pictures."""
    parts: dict[str, Callable[[], str]] = {
        "agreement": agreement,
        "trajectories": trajectories,
        "refused": refused,
        "sheet": sheet,
        "cost": cost,
    }
    text = PAGE.read_text("utf-8")
    for name, make in parts.items():
        text = replaced(text, name, make())
    PAGE.write_text(text, "utf-8")
    picture()


def shown() -> dict[str, tuple[RPSRobot, Trajectory]]:
    """Return every trajectory of the README and of this page, with its robot."""
    sokolov, micro = RPSRobot.from_preset("sokolov"), RPSRobot.from_preset("micro")
    numbers: dict[str, Any] = {"radius": 0.75e-3, "pitch": 0.5e-3, "height": 0.4}
    paths: dict[str, tuple[RPSRobot, Trajectory]] = {
        f"the paper's helix, branch {branch}": (sokolov, helix(sokolov, **numbers, branch=branch))
        for branch in ("+", "-")
    }
    for file in TRAJECTORIES:
        path = load_trajectory(file, micro)
        paths[file.name] = (micro, path)
        paths[f"{file.name}, fastest"] = (micro, time_optimal(micro, path))
    return paths


def agreement() -> str:
    """Return the differences of the methods from the constraint models, by trajectory."""
    lines = [f"| trajectory | samples | {' | '.join(WAYS)} |", "|---|---|---|---|---|"]
    for name, (robot, path) in shown().items():
        run = run_motion(robot, path, RATE)
        found = force_differences(robot, run)
        cells = [f"{found[way]:.1e}" for way in WAYS]
        lines.append(f"| {name} | {len(run.time)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def force_differences(robot: RPSRobot, run: MotionRun) -> dict[str, float]:
    """Return the largest difference to the constraint models' forces, by the way to compute them.

    Relative to the largest force of the same sample.
    """
    motion = run.pose, run.rate, run.acceleration
    limit = robot.mechanism.max_condition
    forces = (
        robot.actuator_forces(*motion),
        lagrange_forces(robot.parameters, *motion, max_gain=limit).force,
        virtual_work_forces(robot.parameters, *motion, max_gain=limit),
    )
    scale = np.abs(run.force).max(axis=-1)
    differences = [(np.abs(force - run.force).max(axis=-1) / scale).max() for force in forces]
    return dict(zip(WAYS, map(float, differences), strict=True))


def trajectories() -> str:
    """Return durations and peaks of the trajectories, as given and time-optimal."""
    micro = RPSRobot.from_preset("micro")
    head = "| file | duration (s) | peak force (N) | peak speed (m/s) "
    lines = [f"{head}| shortest (s) | peak force (N) | peak speed (m/s) |", "|---" * 7 + "|"]
    for file in TRAJECTORIES:
        path = load_trajectory(file, micro)
        cells = [*peaks(micro, path), *peaks(micro, time_optimal(micro, path))]
        lines.append(f"| {file.name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def peaks(robot: RPSRobot, path: Trajectory) -> list[str]:
    """Return duration, peak force and peak speed as text."""
    motion = path.sample(np.linspace(0.0, path.duration, 20_001))
    force = robot.actuator_forces(*motion)
    speed = robot.motion(*motion)[1].speed
    largest = (float(np.abs(values).max()) for values in (force, speed))
    return [f"{path.duration:.4g}", *(f"{value:.4g}" for value in largest)]


def refused() -> str:
    """Return the command's errors for infeasible trajectories."""
    with tempfile.TemporaryDirectory() as folder:
        texts = {
            "tilted.yaml": "kind: circle\nheight: 0.227\ntilt: 0.2\nduration: 2.0\n",
            "through.yaml": "kind: helix\nradius: 0.075\npitch: 0.05\nheight: 0.4\n",
        }
        for name, text in texts.items():
            (Path(folder) / name).write_text(text, "utf-8")
        answers = []
        for name, robot in (("tilted.yaml", "micro"), ("through.yaml", "sokolov")):
            arguments = ["dynamics", name, "--robot", robot]
            run = rps_pin(arguments, folder)
            answers += [f"$ rps-pin {' '.join(arguments)}", *wrapped(run.stderr)]
    return block(answers)


def sheet() -> str:
    """Return the sizing sheet of a circle with a payload, as the command prints it."""
    arguments = ["dynamics", str(TRAJECTORIES[0]), "--robot", "micro", "--payload", "0.5"]
    with tempfile.TemporaryDirectory() as folder:
        printed = rps_pin(arguments, folder).stdout
    table = printed.partition("Actuator sizing")[2].partition("┌")[0]
    shown_as = " ".join(["docs/trajectories/" + TRAJECTORIES[0].name, *arguments[2:]])
    return block([f"$ rps-pin dynamics {shown_as}", *table.strip("\n").splitlines()[0:]])


def cost() -> str:
    """Return the benchmark's minimum times per sample."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        bench = str(ROOT / "benchmarks" / "bench_actuator_forces.py")
        command = [sys.executable, "-m", "pytest", bench, "--benchmark-only", "-q"]
        single = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
        subprocess.run([*command, f"--benchmark-json={report}"], cwd=ROOT, check=True, env=single)
        benches = json.loads(report.read_text("utf-8"))["benchmarks"]
    times: dict[str, dict[str, float]] = {}
    for one in benches:
        role = one["extra_info"]["role"]
        times.setdefault(one["group"], {})[role] = 1e6 * one["stats"]["min"] / 100_000
    roles = list(next(iter(times.values())))
    lines = [f"| | {' | '.join(f'{role} (µs a sample)' for role in roles)} | ours / RNEA |"]
    lines.append("|---" * (len(roles) + 2) + "|")
    for group, found in times.items():
        cells = [f"{found[role]:.3g}" for role in roles]
        ratio = found["ours"] / found[roles[1]]
        lines.append(f"| {group.partition(',')[0]} | {' | '.join(cells)} | {ratio:.2g} |")
    return "\n".join(lines)


def picture() -> None:
    """Draw the forces by cause on a fast circle."""
    rubbing = RPSRobot.from_preset("micro").parameters.replace(prismatic_friction=1.0)
    robot = RPSRobot(rubbing).with_payload(Payload(0.5, (0.0, 0.0, 0.05)))
    run: MotionRun = run_motion(robot, circle(height=0.223, tilt=0.1, duration=0.6), 1000.0)
    causes = force_causes(robot, run.pose, run.rate, run.acceleration)
    figure = plot_force_causes(run.time, causes)
    figure.savefig(ROOT / "docs" / "images" / "forces_by_cause.png")


# Inner workings -----------------------------------------------------------------------------------


def rps_pin(arguments: list[str], folder: str) -> subprocess.CompletedProcess[str]:
    """Run the command and return its output."""
    command = [sys.executable, "-c", "from rps_pin.cli import main; main()", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def wrapped(line: str, width: int = 96) -> list[str]:
    """Return a long line broken into several."""
    return re.findall(rf".{{1,{width}}}(?:\s+|$)", line.strip())


if __name__ == "__main__":
    main()

"""Write the tables of docs/tolerances.md: PYTHONPATH=. .venv/bin/python docs/tolerance_table.py.

Machines at random against first order, at tolerances of a workshop and larger ones, and near a
singularity.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from marked import replaced

from rps_pin import ClosedLoopModel, RPSRobot, UnreachableError
from rps_pin.task.tolerances import ToleranceAnalysis, monte_carlo, sobol, tolerance

PAGE = Path(__file__).parent / "tolerances.md"
MACHINES, POSES, SAMPLES = 4000, 5, 1024
#: Lengths, axes and encoders of a workshop, three sigma.
LENGTH, ANGLE, LINEAR, ROTARY = "0.05 mm", "0.2 mrad", "0.01 mm", "0.1 mrad"
FACTORS = (1, 30, 300)

ROBOTS: dict[str, tuple[Any, dict[str, str]]] = {
    "five-bar": (
        "five_bar",
        {"placement:*joint.[xz]": LENGTH, "closure:*.[xz]": LENGTH, "offset:*": ROTARY},
    ),
    "Delta": (
        "delta",
        {
            "placement:arm_*.[xyz]": LENGTH,
            "placement:arm_*.??*": ANGLE,
            "closure:*.[xyz]": LENGTH,
            "distance:*": LENGTH,
            "offset:*": ROTARY,
        },
    ),
    "Stewart": (
        "stewart",
        {
            "placement:leg_*_cross_joint.[xyz]": LENGTH,
            "placement:leg_*_cross_joint.??*": ANGLE,
            "closure:*.a.[xyz]": LENGTH,
            "offset:*": LINEAR,
        },
    ),
    "3-RPS": (
        None,
        {
            "placement:leg_*.[xyz]": LENGTH,
            "placement:leg_*.??*": ANGLE,
            "closure:*.a.[xyz]": LENGTH,
            "offset:*": LINEAR,
        },
    ),
}


def robots() -> dict[str, ToleranceAnalysis]:
    """Return first-order errors of each robot's whole pose, at random poses about home."""
    found = {}
    for name, (file, given) in ROBOTS.items():
        of = ClosedLoopModel.load(f"urdf/{file}.yaml") if file else RPSRobot.from_preset("sokolov")
        task, rng = of.task, np.random.default_rng(0)
        home = np.array([0.4, 0.0, 0.0]) if file is None else task.home
        away = 0.1 * task.characteristic_length / task.scale
        x = home + rng.uniform(-1, 1, (POSES, task.size)) * away
        whole = None if name == "five-bar" else "pose"
        found[name] = tolerance(task, given, x, coordinates=whole)
        print(name, len(found[name].labels), flush=True)
    return found


def of_factors(found: dict[str, ToleranceAnalysis]) -> str:
    """Return the table of machines at random over first order, by factors of the tolerances."""
    lines = [
        "| robot | numbers | part | 3 sigma | "
        + " | ".join(f"x {factor}: exact / first order | left" for factor in FACTORS)
        + " |",
        "|---|---|---|---|" + "---|---|" * len(FACTORS),
    ]
    for name, one in found.items():
        exact = {factor: monte_carlo(one.scaled(factor), MACHINES) for factor in FACTORS}
        for part in one.parts:
            cells = []
            for machines in exact.values():
                ratio = f"{machines.ratio(part.name):.3f} +- {machines.spread(part.name):.3f}"
                lost = f" ({machines.failures} not closed)" if machines.failures else ""
                cells += [ratio + lost, f"{machines.remainder(part.name):.2%}"]
            unit = "mm" if part.name == "position" else "mrad"
            size = f"{3e3 * one.rms(part.name):.3g} {unit}"
            row = [name, str(len(one.labels)), part.name, size, *cells]
            lines.append(f"| {' | '.join(row)} |")
    return "\n".join(lines)


def near_singularity() -> str:
    """Return the table of a five-bar whose two free arms come into line."""
    task = ClosedLoopModel.load("urdf/five_bar.yaml").task
    lines = [
        "| z of the tip, m | conditioning | 3 sigma, mm | exact / first order | left | "
        "x 10: exact / first order | left | not closed | "
        "x 10: largest difference of Sobol's total from the share |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for z in (0.5, 0.3, 0.25, 0.22, 0.2, 0.19, 0.185, 0.18):
        one = tolerance(task, ROBOTS["five-bar"][1], [[0.19, z]])
        K = task.in_one_unit(task.jacobian(one.poses.q[0]))
        plain, ten = (monte_carlo(one.scaled(factor), MACHINES) for factor in (1, 10))
        try:
            indices = sobol(one.scaled(10.0), samples=SAMPLES)
            off = f"{np.abs(indices.total - one.shares('position')).max():.3f}"
        except UnreachableError:
            off = "some are not closed"
        cells = [
            f"{z:g}",
            f"{1 / np.linalg.cond(K):.4f}",
            f"{3e3 * one.rms('position'):.3g}",
            f"{plain.ratio('position'):.3f}",
            f"{plain.remainder('position'):.2%}",
            f"{ten.ratio('position'):.3f}",
            f"{ten.remainder('position'):.1%}",
            f"{ten.failures / MACHINES:.1%}",
            off,
        ]
        lines.append(f"| {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    return "\n".join(lines)


def main() -> None:
    """Write both tables."""
    text = PAGE.read_text("utf-8")
    text = replaced(text, "factors", of_factors(robots()))
    text = replaced(text, "singularity", near_singularity())
    PAGE.write_text(text, "utf-8")


if __name__ == "__main__":
    main()

"""Write the tables of docs/stiffness.md: PYTHONPATH=. .venv/bin/python docs/stiffness_table.py.

A uniform cantilever by segments against Euler and Bernoulli's formulas, and the overconstrained
four-bar against a frame assembled by direct stiffness (tests/task/frame_elements.py) and Exudyn.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from marked import replaced

from rps_pin.task.stiffness import Beam, Compliances, Material, Section, StiffnessModel
from tests.task.test_stiffness import assembled, cantilever, four_bar, four_bar_task
from tests.task.test_stiffness_exudyn import InExudyn

PAGE = Path(__file__).parent / "stiffness.md"
SEGMENTS = (1, 2, 4, 8, 16)


def cantilevers() -> str:
    """Return errors of own weight's deflection and of the first frequency, by segments."""
    length, E, density = 1.0, 210e9, 1000.0
    whole = Section.rectangle(0.02, 0.01)
    Iy = whole.second_moment_y
    section = Section(whole.area, Iy, whole.second_moment_z, whole.torsion_constant)
    line = density * section.area
    sag = line * 9.81 * length**4 / (8 * E * Iy)
    first = 1.8751040687**2 * np.sqrt(E * Iy / line) / length**2 / (2 * np.pi)
    rows = ["| segments | deflection by its own weight | first frequency |", "|---|---|---|"]
    for segments in SEGMENTS:
        material = Material(E, 81e9, density)
        beam = Beam("slide", "slide", "tip", section, material, [0, 0, 1], segments)
        task = cantilever({"section": section}, np.eye(3), length, line * length)
        model = StiffnessModel(task, Compliances(beams={"arm": beam}))
        found = model.deflection(task.mechanism.home)
        errors = -found.displacement[2] / sag - 1, found.frequencies[0] / first - 1
        rows.append(f"| {segments} | {100 * errors[0]:+.2f} % | {100 * errors[1]:+.2f} % |")
    return "\n".join(rows)


def four_bars() -> str:
    """Return the largest differences of shift and knee's force, by the crank's angle."""
    rng = np.random.default_rng(6)
    mechanism = four_bar_task().mechanism
    head = (
        "| crank, rad | compliance, direct stiffness | shift, Exudyn | force in the knee, Exudyn |"
    )
    rows = [head, "|---|---|---|---|"]
    for angle in (0.4, 1.0, 2.2, 4.0):
        case, q = four_bar(rng), mechanism.complete([angle], mechanism.home)
        load = rng.normal(size=6) * [50, 50, 50, 5, 5, 5]
        found, (C, _) = case.model.deflection(q, load), assembled(case, q)
        free = case.model.deflection(q).compliance
        moved, pushed = InExudyn(case, q).solve(load)
        errors = [
            np.abs(one - other).max() / np.abs(other).max()
            for one, other in (
                (free, C),
                (found.displacement[:3], moved),
                (found.closure_wrenches["knee"][:3], pushed),
            )
        ]
        told = f"{errors[0]:.0e} | {100 * errors[1]:.2f} % | {100 * errors[2]:.2f} %"
        rows.append(f"| {angle} | {told} |")
    return "\n".join(rows)


def main() -> None:
    """Compute, and write the page."""
    text = PAGE.read_text("utf-8")
    text = replaced(text, "cantilevers", cantilevers())
    PAGE.write_text(replaced(text, "four-bars", four_bars()), "utf-8")


if __name__ == "__main__":
    main()

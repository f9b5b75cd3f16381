"""Write the table of docs/identify.md: .venv/bin/python docs/identification_table.py.

Robots, and a number of logs of each, as arguments run these only, and print them. Each robot makes
an exciting motion, with standstill before and after it, and its forces have noise of 2 % of their
root mean square, its encoders one of 1e-7 m or rad. Needs generated code.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from marked import replaced

from rps_pin import ClosedLoopModel, RPSRobot, Task
from rps_pin.task.identification import (
    DynamicsModel,
    Identification,
    exciting_motion,
    force_log,
    identify,
    with_parameters,
)
from rps_pin.task.identification.filtering import REACH

DOCS = Path(__file__).parent
PAGE = DOCS / "identify.md"
ROBOTS = ("3-RPS", "stewart", "delta", "five_bar")
#: Logs of each robot, samples a second, cut-off frequency, Hz, and noise.
LOGS, RATE, CUT_OFF, NOISE, ENCODER = 200, 50.0, 8.0, 0.02, 1e-7
#: Standstill before and after the motion, s: what the filter leaves out of a log.
REST = REACH / CUT_OFF
#: Logs for which the physically possible parameters are found too, and of the second motion.
POSSIBLE = 20


def task_of(name: str) -> Any:
    """Return a robot's task in generated code."""
    if name == "3-RPS":
        robot = RPSRobot.from_preset("sokolov")
        task = Task(robot.mechanism, **robot.task.options)
    else:
        task = ClosedLoopModel.load(DOCS.parent / "urdf" / f"{name}.yaml").task
    return task.compile()


def truth(model: DynamicsModel, rng: np.random.Generator) -> Any:
    """Return parameters of a machine: bodies lighter or heavier by up to 30 %, and friction."""
    p = model.nominal.copy()
    for k, label in enumerate(model.labels):
        if label.endswith(".mass"):
            p[k : k + 10] *= rng.uniform(0.7, 1.3)
        elif not label.startswith("inertia:"):
            p[k] = rng.uniform(0.5, 2.0)
    return p


def exact(model: DynamicsModel, p: Any, seed: int) -> tuple[Any, Any, Any, Any]:
    """Return times, positions and forces of an exciting motion, and its base regressor."""
    motion = exciting_motion(model, iterations=5, starts=10, seed=seed).trajectory
    t = np.arange(-REST, motion.duration + REST, 1 / RATE)
    x, rate, acceleration = motion.sample(np.clip(t, 0.0, motion.duration))
    moves = ((t >= 0.0) & (t <= motion.duration))[:, None]
    state = model.task.state(x, rate * moves, acceleration * moves)
    mechanism = with_parameters(model, p)
    force = np.array([mechanism.inverse_dynamics(*one).tau for one in zip(*state, strict=True)])
    position = state.q[:, model.task.of_actuators]
    actuated = model.mechanism.actuated_indices
    states = model.states(position, state.v[:, actuated], state.a[:, actuated])
    return t, position, force, model.regressor(states)[0][..., model.base.independent]


def row(name: str, logs: int) -> str:
    """Return the row of a robot."""
    model, rng = DynamicsModel(task_of(name)), np.random.default_rng(1)
    p = truth(model, rng)
    t, position, force, rows = exact(model, p, 1)
    t2, position2, force2, _ = exact(model, p, 2)
    deviation = NOISE * np.sqrt((force**2).mean(axis=0))

    def log(time: Any, a: Any, tau: Any) -> Any:
        noisy = a + ENCODER * rng.normal(size=a.shape)
        return force_log(model, time, noisy, tau + deviation * rng.normal(size=tau.shape))

    # Cramer-Rao: of all samples, unfiltered, and of the positions without noise.
    weighed = (rows / deviation[:, None]).reshape(-1, rows.shape[2])
    lengths = np.linalg.norm(weighed, axis=0)
    inverse = np.linalg.inv((weighed / lengths).T @ (weighed / lengths))
    bound = np.sqrt(np.diag(inverse)) / lengths
    found: list[Identification] = []
    errors, within, least, second = [], [], np.inf, []
    for k in range(logs):
        one = identify(model, log(t, position, force), cut_off=CUT_OFF, physical=k < POSSIBLE)
        error = one.values - model.base.matrix @ p
        errors.append(error)
        within.append(np.abs(error) < 1.96 * one.deviations)
        if k < POSSIBLE:
            assert one.possible is not None
            least = min(least, *one.possible.least)
            other = one.predict(log(t2, position2, force2))
            second.append(other.errors() / other.expected)
            found.append(one)
    ratios = np.sqrt(np.mean(np.square(errors), axis=0)) / bound
    together = float(np.sqrt(np.mean(ratios**2)))
    ratio = float(np.sqrt(np.mean(np.square(second))))
    percent = float(np.mean(found[0].predict(log(t2, position2, force2)).percent()))
    return (
        f"| {name} | {bound.size} of {p.size} | {found[0].condition:.0f} | {logs} | "
        f"{together:.3f} | {ratios.max():.2f} | {100 * np.mean(within):.1f} % | {least:.1e} | "
        f"{ratio:.3f} | {percent:.2g} % |"
    )


def main() -> None:
    """Write the table, or print some rows."""
    names = [one for one in sys.argv[1:] if not one.isdigit()]
    logs = next((int(one) for one in sys.argv[1:] if one.isdigit()), LOGS)
    if names:
        for name in names:
            print(row(name, logs), flush=True)
        return
    lines = [
        "| robot | base parameters | condition | logs | error / bound | largest | within 1.96 "
        "deviations | least eigenvalue | second log / expected | error |",
        "|---|---|---|---|---|---|---|---|---|---|",
        *(row(name, logs) for name in ROBOTS),
    ]
    PAGE.write_text(replaced(PAGE.read_text("utf-8"), "logs", "\n".join(lines)), "utf-8")


if __name__ == "__main__":
    main()

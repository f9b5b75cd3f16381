"""Write the table of docs/calibrate.md: PYTHONPATH=. .venv/bin/python docs/calibration_table.py.

With the name of a robot, and how many runs (200), it simulates that many calibrations of machines
that are known, with noise and 20 outliers each, and keeps the figures in calibration_runs.json:

    docs/calibration_table.py five_bar 200

Without, it writes the table of all that are kept.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from marked import replaced
from scipy.special import chdtri

from rps_pin import ClosedLoopModel
from rps_pin.arrays import Array
from rps_pin.task import Task
from rps_pin.task.calibration import (
    CalibrationModel,
    Readings,
    calibrate,
    candidate_poses,
    geometric_groups,
    plan_poses,
    readings,
)
from rps_pin.task.calibration.information import Identifiable, reduced
from rps_pin.task.calibration.problem import Problem

FOLDER = Path(__file__).parent
PAGE, KEPT = FOLDER / "calibrate.md", FOLDER / "calibration_runs.json"
#: The region of each robot's poses, and how many are measured.
ROBOTS: dict[str, dict[str, tuple[float, float]]] = {
    "rps": {"z": (0.42, 0.58), "rx": (-0.35, 0.35), "ry": (-0.35, 0.35)},
    "stewart": {
        **{"x": (-0.1, 0.1), "y": (-0.1, 0.1), "z": (0.55, 0.7)},
        **dict.fromkeys(("rx", "ry", "rz"), (-0.3, 0.3)),
    },
    "delta": {"x": (-0.2, 0.2), "y": (-0.2, 0.2), "z": (-0.6, -0.42)},
    "five_bar": {"x": (0.02, 0.38), "z": (0.38, 0.6)},
}
NAMES = {"rps": "3-RPS", "stewart": "Stewart", "delta": "Delta", "five_bar": "five-bar"}
POSES, UNUSED, OUTLIERS, RUNS, PLANNED = 100, 40, 20, 200, 20
#: Deviations of lengths, m, and of angles, rad, that are read; and of the parameters' errors, m.
LENGTH, ANGLE, WRONG = 2e-5, 1e-4, 2e-4
#: Deviation beyond which a combination is left as believed, over the characteristic length.
WIDEST = 0.002
#: Poses and step of the independent count, and its least singular value that counts.
COUNTED, STEP, LEAST = 14, 1e-5, 1e-7
#: Chance with which the worst combination is within what is called chance.
SURE = 0.95


class Case(NamedTuple):
    """A robot, its parameters, and the poses at which it is measured."""

    task: Task
    model: CalibrationModel
    x: Array
    q: Array
    deviations: dict[str, float]
    seen: Identifiable
    unused: Array
    """Poses that are not used."""


def case_of(name: str) -> Case:
    """Return a robot with all of its geometry, and its actuators' offsets, as parameters."""
    task = ClosedLoopModel.load(FOLDER.parent / "urdf" / f"{name}.yaml").task
    actuators = task.mechanism.actuated
    sensors = (*actuators, *task.coordinates)
    model = CalibrationModel(task, geometric_groups(task), sensors, actuators)
    deviations = {
        one: ANGLE if turns else LENGTH for one, turns in zip(sensors, model.angular, strict=True)
    }
    poses = candidate_poses(task, ROBOTS[name], 2 * (POSES + UNUSED), seed=1)
    x, unused = poses[:POSES], poses[POSES : POSES + UNUSED]
    q = model.home(x, model.nominal)
    exact = read(task, model, model.predict(x, q, model.nominal).readings, deviations)
    problem = Problem(model, exact, np.full(model.nominal.size, np.inf))
    problem.begin(x)
    return Case(task, model, x, q, deviations, problem.identifiable(), unused)


def read(
    task: Task, model: CalibrationModel, values: Array, deviations: dict[str, float]
) -> Readings:
    """Return an array (poses, sensors) as readings."""
    return readings(task, dict(zip(model.sensors, values.T, strict=True)), deviations)


# One run ------------------------------------------------------------------------------------------


class Run(NamedTuple):
    """What one calibration found of a machine that is known."""

    over_bound: Array
    """Errors of the combinations that were fitted, over their bounds, (c,)."""
    within: Array
    """Whether each is within its 95 % interval, (c,)."""
    known: int
    """How many combinations are identifiable."""
    before: float
    """Root mean square of the pose's error at poses not used, m, before the calibration."""
    after: float
    """And after."""
    missed: int
    """Outliers that were not found."""
    wrong: int
    """Readings that were called outliers and are none."""


def run(case: Case, alone: CalibrationModel, seed: int) -> Run:
    """Return one; `alone` is the model of the actuators' readings alone."""
    model, units = case.model, case.model.units
    rng = np.random.default_rng(seed)
    kept = case.seen.seen
    truth = model.nominal + kept @ (WRONG * rng.normal(size=kept.shape[1])) / units
    exact = model.predict(case.x, case.q, truth)
    spread = np.array(list(case.deviations.values()))
    values = exact.readings + spread * rng.normal(size=exact.readings.shape)
    spoilt = np.zeros(values.shape, dtype=bool)
    spoilt.flat[rng.choice(values.size, OUTLIERS, replace=False)] = True
    size = rng.uniform(20, 100, values.shape) * rng.choice([-1, 1], values.shape)
    values = np.where(spoilt, values + size * spread, values)
    widest = WIDEST * case.task.characteristic_length
    found = calibrate(model, read(case.task, model, values, case.deviations), widest=widest)
    turn = found.identifiable.seen
    weights = (~spoilt / spread)[..., None]
    rows = reduced(exact.by_pose * weights / case.task.scale, exact.by_parameters * weights / units)
    R = np.vstack([*rows]) @ turn
    bound = np.sqrt(np.diag(np.linalg.inv(R.T @ R)))
    off = turn.T @ ((found.parameters - truth) * units)
    own = (turn.T * units) @ found.covariance @ (turn.T * units).T
    return Run(
        off / bound,
        np.abs(off) < 1.959964 * np.sqrt(np.diag(own)),
        found.identifiable.rank + found.identifiable.weak,
        pose_error(case, alone, truth, model.nominal),
        pose_error(case, alone, truth, found.parameters),
        int((spoilt & ~found.outliers).sum()),
        int((~spoilt & found.outliers).sum()),
    )


def pose_error(case: Case, alone: CalibrationModel, truth: Array, believed: Array) -> float:
    """Return the error of the poses that parameters give for the machine's exact readings, m.

    Root mean square of the coordinates, in one unit.
    """
    q = alone.home(case.unused, alone.nominal)
    values = alone.predict(case.unused, q, truth).readings
    deviations = {name: case.deviations[name] for name in alone.sensors}
    problem = Problem(
        alone, read(case.task, alone, values, deviations), np.full(truth.size, np.inf)
    )
    problem.begin(case.unused, believed)
    return float(np.sqrt(np.mean(((problem.x - case.unused) * case.task.scale) ** 2)))


# The independent count ----------------------------------------------------------------------------


def counted(case: Case) -> int:
    """Return how many combinations can be known, by differences of the Pinocchio engine's gaps.

    Unknown are the parameters and a motion of all joints at each of some poses. Combinations of
    parameters that open no loop are those of the solutions of L = [dg/dp, dg/dq]; those that are
    not seen are of the solutions in which no reading changes.
    """
    model, mechanism = case.model, case.model.mechanism
    own = len(model.engine.parameters)
    nominal = model.nominal[:own]
    nv, p = mechanism.model.nv, model.nominal.size
    gaps, still, seen, still_seen = [], 0, [], 0
    changed = [
        [
            model.engine.reference(nominal + s * STEP * np.eye(own)[k]).system.equations
            for s in (1, -1)
        ]
        for k in range(own)
    ]
    plain = mechanism.system.equations
    sensors = np.zeros((len(model.sensors), nv))
    sensors[np.arange(len(model.sensors)), model._moved] = 1.0
    offsets = np.zeros((len(model.sensors), p))
    for k, label in enumerate(model.labels):
        if label.startswith("offset:"):
            offsets[model.sensors.index(label.removeprefix("offset:")), k] = -1.0
    for i, q in enumerate(case.q[:COUNTED]):
        G = np.zeros((plain.size, p))
        for k, (more, less) in enumerate(changed):
            G[:, k] = (more.gaps(q) - less.gaps(q)) / (2 * STEP)
        J = np.zeros((plain.size, nv))
        for k in range(nv):
            step = STEP * np.eye(nv)[k]
            sides = [plain.gaps(pin.integrate(mechanism.model, q, s * step)) for s in (1, -1)]
            J[:, k] = (sides[0] - sides[1]) / (2 * STEP)
        block = np.zeros((plain.size, COUNTED * nv))
        block[:, i * nv : (i + 1) * nv] = J
        gaps.append(np.hstack([G, block]))
        block = np.zeros((len(sensors), COUNTED * nv))
        block[:, i * nv : (i + 1) * nv] = sensors
        seen.append(np.hstack([offsets, block]))
        still += nv - _rank(J)
        still_seen += nv - _rank(np.vstack([J, sensors]))
    L = np.vstack(gaps)
    both = np.vstack([L, *seen])
    closing = L.shape[1] - _rank(L) - still
    return closing - (both.shape[1] - _rank(both) - still_seen)


def _rank(matrix: Array) -> int:
    values = np.linalg.svd(matrix, compute_uv=False)
    return int(np.count_nonzero(values > LEAST * values[0]))


# The table ----------------------------------------------------------------------------------------


def figures(name: str, runs: int) -> dict[str, Any]:
    """Return the figures of a robot."""
    case = case_of(name)
    actuators = case.task.mechanism.actuated
    alone = CalibrationModel(case.task, case.model.groups, actuators, actuators)
    plan = plan_poses(
        case.model,
        candidate_poses(case.task, ROBOTS[name], 300, seed=2),
        PLANNED,
        case.deviations,
        widest=WIDEST * case.task.characteristic_length,
    )
    found, failed = [], 0
    for seed in range(runs):
        try:
            found.append(run(case, alone, seed))
        except Exception as error:
            failed += 1
            print(f"{name}, run {seed}: {error}", file=sys.stderr)
    least = min(len(one.over_bound) for one in found)
    ratios = np.array([one.over_bound[:least] for one in found])
    by_combination = np.sqrt((ratios**2).mean(axis=0))
    return {
        "runs": len(found),
        "failed": failed,
        "parameters": len(case.model.labels),
        "known": sorted({one.known for one in found}),
        "counted": counted(case),
        "fitted": [least, max(len(one.over_bound) for one in found)],
        "over_bound": float(np.sqrt((ratios**2).mean())),
        "worst_over_bound": float(by_combination.max()),
        "worst_by_chance": worst_by_chance(len(found), least),
        "within": float(np.mean(np.concatenate([one.within for one in found]))),
        "before": float(np.sqrt(np.mean([one.before**2 for one in found]))),
        "after": float(np.sqrt(np.mean([one.after**2 for one in found]))),
        "missed": float(np.mean([one.missed for one in found])),
        "wrong": float(np.mean([one.wrong for one in found])),
        "planned": plan.factors,
    }


def worst_by_chance(runs: int, combinations: int) -> float:
    """Return what the worst combination's error over bound exceeds in 5 % of such tables.

    If errors are normal, independent and at the bound: a quantile of chi squared.
    """
    each = SURE ** (1 / combinations)
    return float(np.sqrt(chdtri(runs, 1 - each) / runs))


def table(kept: dict[str, dict[str, Any]]) -> str:
    """Return the table of all robots."""
    head = (
        "robot",
        "runs",
        "parameters",
        "known (counted)",
        "fitted",
        "error / bound (worst; by chance)",
        "in 95 % intervals",
        "pose error before, after",
        "outliers missed, wrong",
        "planned poses better by",
    )
    rows = [head, ["---"] * len(head)]
    for name in ROBOTS:
        if name not in kept:
            continue
        one = kept[name]
        fitted = dict.fromkeys(one["fitted"])
        rows.append(
            [
                NAMES[name],
                f"{one['runs']}" + (f" ({one['failed']} failed)" if one["failed"] else ""),
                f"{one['parameters']}",
                f"{', '.join(map(str, one['known']))} ({one['counted']})",
                " to ".join(map(str, fitted)),
                f"{one['over_bound']:.2f} ({one['worst_over_bound']:.2f}; "
                f"{one['worst_by_chance']:.2f})",
                f"{one['within']:.1%}",
                f"{1e6 * one['before']:.0f} um, {1e6 * one['after']:.1f} um",
                f"{one['missed']:.1f}, {one['wrong']:.1f}",
                f"{one['planned'][0]:.2f}, {one['planned'][1]:.2f}",
            ]
        )
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def main() -> None:
    """Run a robot, or write the table."""
    kept = json.loads(KEPT.read_text("utf-8")) if KEPT.exists() else {}
    if len(sys.argv) > 1:
        name = sys.argv[1]
        one = figures(name, int(sys.argv[2]) if len(sys.argv) > 2 else RUNS)
        kept = json.loads(KEPT.read_text("utf-8")) if KEPT.exists() else {}
        KEPT.write_text(json.dumps(kept | {name: one}, indent=1) + "\n", "utf-8")
        print(json.dumps(one))
    else:
        PAGE.write_text(replaced(PAGE.read_text("utf-8"), "runs", table(kept)), "utf-8")


if __name__ == "__main__":
    main()

"""Maps of a task, beside the same maps written by hand: one run, one core, measured in turns.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.tasks [--markdown]

By hand is Newton's method in NumPy on the points that the closures hold together, with placements
and Jacobians by Pinocchio's C++ functions, and one solution of the same linear system for
d(actuators)/d(task). Both start 1 mm or 1 mrad away, and end at gaps of 1e-12 m. Times are the
processor's, medians, in us; those of a batch are of one of its 4000 samples.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from benchmarks.timing import medians
from rps_pin import ClosedLoopModel, Task

Array = NDArray[np.float64]

URDF = Path(__file__).parent.parent / "urdf"
NAMES = ("ankle", "five_bar", "delta", "stewart")
SAMPLES, AWAY = 4000, 1e-3
GOALS = {"ankle": 1.0, "stewart": 5.0}
"""us a sample, of `to_actuators`, as was asked."""


class ByHand:
    """Newton's method on closures of points and rods, and on the task's coordinates.

    Coordinates of the task are those of its joints, or of the free-flyer or frame that has them.
    """

    def __init__(self, task: Task) -> None:
        self.task, self.model = task, task.mechanism.model
        self.data = self.model.createData()
        of = self.model.getFrameId
        self.pairs = [
            (of(one.frame_a), of(one.frame_b), one.distance) for one in task.mechanism.closures
        ]
        frame = task._options["frame"]
        self.frame = None if frame is None else of(frame)
        self.actuated = task.mechanism.actuated_indices
        names = task.mechanism.actuated
        self.of_actuators = [self.model.joints[self.model.getJointId(n)].idx_q for n in names]
        self.axes = ["xyz".find(name) for name in task.coordinates]

    def rows(self, q: Array) -> tuple[list[Any], list[Any]]:
        """Gaps and Jacobian of the closures."""
        model, data, world = self.model, self.data, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        gaps, jacobian = [], []
        for a, b, distance in self.pairs:
            e = data.oMf[a].translation - data.oMf[b].translation
            J = pin.getFrameJacobian(model, data, a, world)[:3]
            J = J - pin.getFrameJacobian(model, data, b, world)[:3]
            if distance is not None:
                length = np.linalg.norm(e)
                e, J = np.array([length - distance]), (e / length)[None] @ J
            gaps.append(e)
            jacobian.append(J)
        return gaps, jacobian

    def of_task(self, q: Array, x: Array) -> tuple[Array, Array]:
        """Gaps and Jacobian of the task's coordinates, after `rows`."""
        model, data = self.model, self.data
        if self.frame is None:
            joints = [model.joints[model.getJointId(name)] for name in self.task.coordinates]
            jacobian = np.zeros((len(joints), model.nv))
            jacobian[range(len(joints)), [joint.idx_v for joint in joints]] = 1.0
            return q[[joint.idx_q for joint in joints]] - x, jacobian
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        J = pin.getFrameJacobian(model, data, self.frame, world)
        placed = data.oMf[self.frame]
        if len(x) < 6:
            return placed.translation[self.axes] - x, J[self.axes]
        turn = pin.log3(placed.rotation @ pin.exp3(x[3:]).T)
        return np.concatenate([placed.translation - x[:3], turn]), J

    def newton(self, x: Array, near: Array) -> Array:
        """Return the configuration of coordinates x."""
        q = near
        for _ in range(20):
            gaps, jacobian = self.rows(q)
            gap, J = self.of_task(q, x)
            error = np.concatenate([*gaps, gap])
            if np.abs(error).max() < 1e-12:
                return q
            step = np.linalg.lstsq(np.vstack([*jacobian, J]), -error, rcond=None)[0]
            q = pin.integrate(self.model, q, step)
        raise RuntimeError("Newton's method does not end")

    def to_actuators(self, x: Array, near: Array) -> Array:
        """Return actuators' positions."""
        return self.newton(x, near)[self.of_actuators]

    def rates(self, q: Array, rate: Array) -> Array:
        """Return the actuators' speeds of coordinates' rates."""
        _, jacobian = self.rows(q)
        _, J = self.of_task(q, self.task.at(q) if self.frame is None else np.zeros(len(rate)))
        right = np.concatenate([np.zeros(sum(map(len, jacobian))), rate])
        return np.linalg.lstsq(np.vstack([*jacobian, J]), right, rcond=None)[0][self.actuated]


def row(name: str) -> tuple[list[str], float]:
    """Return a row of the table, and the time of a sample of `to_actuators` in a batch."""
    task = ClosedLoopModel.load(URDF / f"{name}.yaml").task
    code, hand, rng = task.compile(batches=True), ByHand(task), np.random.default_rng(0)
    near = task.mechanism.home
    xs = task.home + AWAY * rng.uniform(-1, 1, size=(SAMPLES, task.size))
    x, many = xs[0], np.broadcast_to(near, (SAMPLES, near.size)).copy()
    rate, a = rng.normal(size=task.size), code.to_actuators(xs)
    q = code.configuration(xs)
    for one in (code.to_actuators(x, near), hand.to_actuators(x, near)):
        assert np.abs(one - task.to_actuators(x, near)).max() < 1e-11
    if task.size < 6:  # of a rotation vector, rates are not the angular velocity
        found = hand.rates(q[0], rate)
        assert np.abs(found - task.jacobian(q[0]) @ rate).max() < 1e-9
    times = medians(
        {
            "positions": lambda: code.to_actuators(xs, many),
            "back": lambda: code.to_task(a, many),
            "jacobian": lambda: code.jacobian(q),
            "one": lambda: code.to_actuators(x, near),
            "engine": lambda: task.to_actuators(x, near),
            "hand": lambda: hand.to_actuators(x, near),
            "K": lambda: hand.rates(q[0], rate),
        }
    )
    batch = {key: times[key] / SAMPLES for key in ("positions", "back", "jacobian")}
    cells = [name, *(f"{batch[key]:.2f}" for key in batch)]
    cells += [f"{times[key]:.3g}" for key in ("one", "engine", "hand", "K")]
    cells += [f"{times['hand'] / batch['positions']:.0f}", f"{times['K'] / batch['jacobian']:.0f}"]
    return cells, batch["positions"]


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--markdown", action="store_true", help="print the table alone")
    only = parser.parse_args().markdown
    head = ["", "to_actuators", "to_task", "jacobian", "one to_actuators", "Pinocchio engine"]
    head += ["Newton by hand", "rates by hand", "hand / batch", "hand / batch of rates"]
    print("| " + " | ".join(head) + " |")
    print("|:-" + "|-:" * (len(head) - 1) + "|")
    found = {}
    for name in NAMES:
        cells, found[name] = row(name)
        print("| " + " | ".join(cells) + " |", flush=True)
    if not only:
        for name, goal in GOALS.items():
            met = "yes" if found[name] <= goal else "no"
            print(f"{name}: to_actuators {found[name]:.2f} us a sample, goal {goal:g}: {met}")


if __name__ == "__main__":
    main()

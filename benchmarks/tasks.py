"""Maps of a task, beside the same maps written by hand: one run, one core, measured in turns.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.tasks [--page]

By hand is Newton's method on the closures' points and rods (see `benchmarks.task_peers`), with the
tree's kinematics by Pinocchio's functions, by MuJoCo's, or in plain NumPy. All start 1 mm or 1 mrad
away, as from the last pose of a motion of 1 m/s at 1 kHz, and end at gaps of 1e-12 m. Times are the
processor's, medians, in us; those of a batch are of one of its 4000 samples. With ``--page`` the
table is written to docs/tasks.md. Needs the packages mujoco and casadi, and a C compiler.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.task_peers import ByHand, Mujoco, NumPy, Pinocchio
from benchmarks.timing import medians
from rps_pin import ClosedLoopModel

Array = NDArray[np.float64]

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "tasks.md"
NAMES = {"rps": "3-RPS", "ankle": "ankle", "delta": "Delta", "stewart": "Stewart"}
SAMPLES, AWAY = 4000, 1e-3
GOALS = {"ankle": 1.0, "stewart": 5.0}
"""us a sample of a batch, of `to_actuators`, as was asked."""
MARKS = "<!-- made by benchmarks/tasks.py -->\n", "<!-- end -->"


class Row(NamedTuple):
    """Times of one map of one robot, us."""

    robot: str
    call: str
    batch: float
    one: float
    engine: float
    by_hand: dict[str, float]

    def cells(self) -> list[str]:
        """Return the row of the table."""
        times = [self.batch, self.one, self.engine, *self.by_hand.values()]
        least = min(self.by_hand.values())
        ratios = (f"{least / of:.1f}" for of in (self.batch, self.one, self.engine))
        return [NAMES[self.robot], f"`{self.call}`", *(f"{t:.3g}" for t in times), *ratios]


HEAD = ["", "", "generated, batch", "generated, one", "Pinocchio engine"]
HEAD += ["by hand: Pinocchio", "by hand: MuJoCo", "by hand: NumPy"]
HEAD += ["fastest by hand / batch", "/ one", "/ engine"]


def rows(name: str) -> list[Row]:
    """Return the rows of a robot."""
    task = ClosedLoopModel.load(ROOT / "urdf" / f"{name}.yaml").task
    code, rng = task.compile(batches=True), np.random.default_rng(0)
    for built in (code._by_task, code._by_actuators):
        built.wait()  # for the best compiler's code, which is built in the background
    peers = {kind.__name__: ByHand(task, kind) for kind in (Pinocchio, Mujoco, NumPy)}
    near = task.mechanism.home
    own = {kind: peer.tree.start(near) for kind, peer in peers.items()}
    xs = task.home + AWAY * rng.uniform(-1, 1, size=(SAMPLES, task.size))
    x, many = xs[0], np.broadcast_to(near, (SAMPLES, near.size)).copy()
    actuators, q = code.to_actuators(xs), code.configuration(xs)
    a, one = actuators[0], q[0]
    there = {kind: peer.tree.start(one) for kind, peer in peers.items()}
    found = []
    for call, batch, single, given, start in (
        ("to_actuators", (xs, many), (x, near), x, own),
        ("to_task", (actuators, many), (a, near), a, own),
        ("jacobian", (q,), (one,), None, there),
    ):
        calls = {
            "batch": lambda call=call, to=batch: getattr(code, call)(*to),
            "one": lambda call=call, to=single: getattr(code, call)(*to),
            "engine": lambda call=call, to=single: getattr(task, call)(*to),
        }
        for kind, peer in peers.items():
            to = (start[kind],) if given is None else (given, start[kind])
            calls[kind] = lambda call=call, peer=peer, to=to: getattr(peer, call)(*to)
        wanted = calls["engine"]()
        for kind in ("one", *peers):
            assert np.abs(calls[kind]() - wanted).max() < 1e-9, (name, call, kind)
        times = medians(calls)
        by_hand = {kind: times[kind] for kind in peers}
        found.append(
            Row(name, call, times["batch"] / SAMPLES, times["one"], times["engine"], by_hand)
        )
    return found


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", action="store_true", help="write the table to docs/tasks.md")
    to_page = parser.parse_args().page
    lines = ["| " + " | ".join(HEAD) + " |", "|:-|:-" + "|-:" * (len(HEAD) - 2) + "|"]
    print("\n".join(lines))
    found: dict[tuple[str, str], Row] = {}
    for name in NAMES:
        for row in rows(name):
            found[name, row.call] = row
            lines.append("| " + " | ".join(row.cells()) + " |")
            print(lines[-1], flush=True)
    for name, goal in GOALS.items():
        took = found[name, "to_actuators"].batch
        met = "yes" if took <= goal else "no"
        print(f"{name}: to_actuators {took:.2f} us a sample of a batch, goal {goal:g}: {met}")
    last = found["stewart", "to_task"]
    print(f"stewart: to_task from the last pose at 1 kHz: {last.one:.3g} us of 1000 in generated "
          f"code, {last.engine:.3g} us by the Pinocchio engine")  # fmt: skip
    if to_page:
        before, _, rest = PAGE.read_text("utf-8").partition(MARKS[0])
        after = rest.partition(MARKS[1])[2]
        table = "\n".join(lines)
        PAGE.write_text(f"{before}{MARKS[0]}\n{table}\n\n{MARKS[1]}{after}", "utf-8")


if __name__ == "__main__":
    main()

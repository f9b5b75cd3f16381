"""Inverse dynamics of underdriven mechanisms, and of the same ones with an actuator each freedom.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.underdriven

Both are measured in turns in one run. The regular one has, beside the actuators, one on each
passive velocity that the mechanism needs to be determined: of the floating base, of passive joints,
and of the spins of rods between two balls. Times are the processor's, medians, in us.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.legged import biped, humanoid, leg
from benchmarks.timing import ROUNDS, medians
from rps_pin import ClosedLoopModel
from rps_pin.closed_loop.column_names import joint_coordinates
from rps_pin.closed_loop.constraints.completion import choose
from rps_pin.numerics.linear_algebra import RANK_TOLERANCE, Decomposition

URDF = Path(__file__).parent.parent / "urdf"
MECHANISMS: dict[str, Callable[[], ClosedLoopModel]] = {
    "leg with cranks, floating": leg,
    "Cassie-like biped, floating": lambda: ClosedLoopModel.load(URDF / "cassie_biped.yaml"),
    "biped with cranks, floating": biped,
    "Digit-like humanoid, floating": humanoid,
}


def regular(mechanism: ClosedLoopModel) -> ClosedLoopModel:
    """Return the mechanism, whose actuators are independent, with one on each other freedom."""
    jacobian = mechanism.system.scaled(mechanism.jacobian(mechanism.home))
    chosen = choose(Decomposition(jacobian), mechanism.actuated_indices, RANK_TOLERANCE)
    names = [
        coordinate
        for joint in list(mechanism.model.names)[1:]
        for coordinate in joint_coordinates(mechanism.model, joint) or (joint,)
    ]
    return mechanism.with_actuated([*mechanism.actuated, *(names[i] for i in chosen.passive)])


def row(name: str, rounds: int = ROUNDS) -> tuple[str, float]:
    """Return a row of the table, and how many times as long the underdriven one takes."""
    under = MECHANISMS[name]()
    full, q, rng = regular(under), under.home, np.random.default_rng(0)
    v = full.velocity(q, rng.normal(size=full.actuated_indices.size))
    a = full.acceleration(q, v, rng.normal(size=full.actuated_indices.size))
    calls = {
        "under": lambda: under.inverse_dynamics(q, v, a),
        "full": lambda: full.inverse_dynamics(q, v, a),
    }
    times = medians(calls, rounds)
    ratio, actuators = times["under"] / times["full"], under.actuated_indices.size
    cells = [name, under.model.nv, full.actuated_indices.size, actuators]
    cells += [f"{times[key]:.3g}" for key in calls] + [f"{ratio:.2f}"]
    return "| " + " | ".join(map(str, cells)) + " |", ratio


def table(rounds: int = ROUNDS) -> str:
    """Return the table."""
    head = "| mechanism | nv | mobility | actuators | underdriven (us) | regular (us) | ratio |"
    return "\n".join([head, "|---" * 7 + "|", *(row(name, rounds)[0] for name in MECHANISMS)])


if __name__ == "__main__":
    print(table())

"""Functions of the 3-RPS in NumPy and in generated code, measured in turns: rows of a table.

    python -m benchmarks.rps_table

Times are the processor's, medians, in us a sample, one thread, the call from Python included.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.timing import medians
from rps_pin import RPSRobot
from rps_pin.rps.dynamics.actuator_forces import actuator_forces
from rps_pin.rps.kinematics.forward_kinematics import forward_kinematics
from rps_pin.rps.kinematics.inverse_kinematics import inverse_kinematics

COUNTS = (1, 1000, 100_000)
MIDDLE, SIZE = np.array([0.225, 0.0, 0.0]), np.array([0.005, 0.05, 0.05])
NEARBY = np.array([0.005, 0.02, 0.02])


def calls(robot: RPSRobot, count: int) -> dict[str, dict[str, Callable[[], object]]]:
    """Return both engines' calls of each function, of so many samples."""
    rng = np.random.default_rng(0)
    p, terms, limit = robot.parameters, robot.force_terms, robot.mechanism.max_condition
    shape = (3,) if count == 1 else (count, 3)
    pose = MIDDLE + SIZE * rng.uniform(-1, 1, shape)
    motion = pose, rng.normal(size=shape), 10 * rng.normal(size=shape)
    length = robot.inverse_kinematics(pose).length
    near = pose + NEARBY * rng.uniform(-1, 1, shape)
    radii = p.base_radius, p.platform_radius
    found: dict[str, dict[str, Callable[[], object]]] = {
        "inverse_kinematics": {
            "NumPy": lambda: inverse_kinematics(p, pose),
            "generated": lambda: robot.inverse_kinematics(pose),
        },
        "forward_kinematics": {
            "NumPy": lambda: forward_kinematics(length, near, *radii),
            "generated": lambda: robot.forward_kinematics(length, near),
        },
        "actuator_forces": {
            "NumPy": lambda: actuator_forces(p, terms, limit, motion),
            "generated": lambda: robot.actuator_forces(*motion),
        },
    }
    if count == 1:
        q, v, a = robot.state(*motion)
        found["inverse_dynamics"] = {
            "NumPy": lambda: robot.mechanism.inverse_dynamics(q, v, a),
            "generated": lambda: robot.inverse_dynamics(q, v, a),
        }
    return found


def main() -> None:
    """Print a row for each function."""
    robot = RPSRobot.from_preset("micro").compile()
    print(f"{robot.engine}\n\n| | {' | '.join(f'{count} samples' for count in COUNTS)} |")
    rows: dict[str, list[str]] = {}
    for count in COUNTS:
        for name, work in calls(robot, count).items():
            times = medians(work)
            one, other = (times[engine] / count for engine in ("NumPy", "generated"))
            rows.setdefault(name, []).append(f"{one:.3g}, {other:.2g}")
    for name, cells in rows.items():
        print(f"| `{name}` | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()

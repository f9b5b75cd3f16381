"""A four-bar in PlaCo: the crank's torque of a motion, from its QP with a hard loop task.

Run by docs/comparison_runs.py in an environment of its own, with a task on standard input.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import placo


def main() -> None:
    """Solve, and print the torque (N m) and the time of a call (s)."""
    task = json.load(sys.stdin)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.urdf"
        file.write_text(task["urdf"], "utf-8")
        robot = placo.RobotWrapper(str(file), placo.Flags.ignore_collisions)
    for name in task["q"]:
        robot.set_joint(name, task["q"][name])
        robot.set_joint_velocity(name, task["v"][name])
    robot.update_kinematics()
    solver = placo.DynamicsSolver(robot)
    solver.mask_fbase(True)
    solver.damping = 0.0
    a, b = task["closure"]
    loop = solver.add_relative_position_task(a, b, np.zeros(3))
    loop.configure("loop", "hard", 1.0)
    loop.mask.set_axises("xz")  # the third row is redundant in the plane
    solver.add_task_contact(loop)  # the closure's force
    passive = solver.add_torque_task()
    for name in task["passive"]:
        passive.set_torque(name, 0.0)
    passive.configure("passive", "hard", 1.0)
    crank = solver.add_joints_task()
    name = task["actuated"]
    crank.set_joint(name, task["q"][name], task["v"][name], task["a"][name])
    crank.configure("crank", "hard", 1.0)
    result = solver.solve(False)
    start = time.perf_counter()
    for _ in range(1000):
        result = solver.solve(False)
    spent = (time.perf_counter() - start) / 1000
    torque = result.tau[robot.get_joint_v_offset(name)]
    print(json.dumps({"torque": torque, "time": spent}))


if __name__ == "__main__":
    main()

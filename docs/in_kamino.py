"""The 3-RPS in Newton's Kamino solver: the gap of its spherical joints under constant forces.

Run by docs/comparison_runs.py in an environment of its own, with a task on standard input. Newton
computes in single precision.
"""

from __future__ import annotations

import json
import sys

import newton
import numpy as np
import warp as wp


def main() -> None:
    """Simulate, and print the largest gap (m) and the largest motion of the platform (m)."""
    task = json.load(sys.stdin)
    wp.config.quiet = True
    builder = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=(0.0, 0.0, -9.81))
    newton.solvers.SolverKamino.register_custom_attributes(builder)
    bodies = {"base": -1}
    for name, body in task["bodies"].items():
        bodies[name] = builder.add_link(
            xform=transform(body["centre"], body["rotation"]),
            mass=body["mass"],
            inertia=wp.mat33(np.array(body["inertia"]).ravel()),
            com=wp.vec3(0.0, 0.0, 0.0),
        )
    add = {
        "revolute": builder.add_joint_revolute,
        "prismatic": builder.add_joint_prismatic,
        "spherical": builder.add_joint_ball,
    }
    joints = []
    for joint in task["joints"]:
        frames = {}
        for side, body in (("parent", joint["parent"]), ("child", joint["child"])):
            turn, centre = np.eye(3), np.zeros(3)
            if body != "base":
                turn = np.array(task["bodies"][body]["rotation"])
                centre = np.array(task["bodies"][body]["centre"])
            point = turn.T @ (np.array(joint["point"]) - centre)
            frames[f"{side}_xform"] = transform(point, turn.T)
        if joint["kind"] != "spherical":
            frames["axis"] = wp.vec3(*joint["axis"])
        joints.append(add[joint["kind"]](bodies[joint["parent"]], bodies[joint["child"]], **frames))
    builder.add_articulation([j for j, one in zip(joints, task["joints"]) if one["tree"]])
    model = builder.finalize(skip_validation_joints=True)
    solver = newton.solvers.SolverKamino(model=model)
    now, then, control = model.state(), model.state(), model.control()
    forces = np.zeros((len(task["bodies"]), 6), np.float32)  # force and moment at the centre, world
    names = list(task["bodies"])
    for joint in task["joints"]:
        for body, sign in ((joint["child"], 1.0), (joint["parent"], -1.0)):
            if "force" in joint:
                force = sign * joint["force"] * np.array(joint["axis"])
                arm = np.array(joint["point"]) - task["bodies"][body]["centre"]
                forces[names.index(body)] += [*force, *np.cross(arm, force)]
    gap = moved = 0.0
    for _ in range(task["ticks"]):
        now.body_f.assign(forces)
        solver.step(now, then, control, None, task["step"])
        now, then = then, now
    placed = now.body_q.numpy().astype(float)

    def point(body: str, start: list[float]) -> np.ndarray:
        """Where a point of a body is now that was at `start` at the start, m."""
        first = task["bodies"][body]
        local = np.array(first["rotation"]).T @ (np.array(start) - first["centre"])
        x, y, z, *turn = placed[names.index(body)]
        return np.array([x, y, z]) + matrix(turn) @ local

    for joint in task["joints"]:
        if joint["kind"] == "spherical":
            pair = (point(joint[side], joint["point"]) for side in ("parent", "child"))
            gap = max(gap, float(np.linalg.norm(np.subtract(*pair))))
    centre = task["bodies"]["platform"]["centre"]
    moved = float(np.linalg.norm(point("platform", centre) - centre))
    print(json.dumps({"gap": gap, "moved": moved}))


def transform(position: list[float], rotation: list[list[float]]) -> wp.transform:
    """Return a placement of Warp's: position and quaternion (x, y, z, w)."""
    return wp.transform(wp.vec3(*position), wp.quat_from_matrix(wp.mat33(np.ravel(rotation))))


def matrix(quaternion: list[float]) -> np.ndarray:
    """Return the rotation matrix of a quaternion (x, y, z, w)."""
    *xyz, w = quaternion
    x = np.cross(np.eye(3), xyz)  # minus the cross-product matrix
    return np.eye(3) - 2 * w * x + 2 * x @ x


if __name__ == "__main__":
    main()

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
    builder.add_articulation(
        [j for j, one in zip(joints, task["joints"], strict=True) if one["tree"]]
    )
    model = builder.finalize(skip_validation_joints=True)
    solver = newton.solvers.SolverKamino(model=model)
    now, then, control = model.state(), model.state(), model.control()
    names = list(task["bodies"])

    def point(body: str, start: list[float]) -> np.ndarray:
        """Where a point of a body is now that was at `start` at the start, m."""
        return placed[names.index(body), :3] + turned(body, np.subtract(start, centre_of(body)))

    def turned(body: str, vector: np.ndarray) -> np.ndarray:
        """How a vector of a body stands now that was `vector` at the start."""
        start = np.array(task["bodies"][body]["rotation"])
        return matrix(placed[names.index(body), 3:]) @ start.T @ vector

    def centre_of(body: str) -> np.ndarray:
        return np.array(task["bodies"][body]["centre"])

    for _ in range(task["ticks"]):
        placed = now.body_q.numpy().astype(float)
        wrenches = np.zeros((len(names), 6), np.float32)  # force, moment at the centre; world axes
        for joint in task["joints"]:
            for body, sign in ((joint["child"], 1.0), (joint["parent"], -1.0)):
                if "force" in joint:  # along the axis, which turns with the leg
                    force = sign * joint["force"] * turned(body, np.array(joint["axis"]))
                    arm = turned(body, np.subtract(joint["point"], centre_of(body)))
                    wrenches[names.index(body)] += [*force, *np.cross(arm, force)]
        now.body_f.assign(wrenches)
        solver.step(now, then, control, None, task["step"])
        now, then = then, now
    placed = now.body_q.numpy().astype(float)
    balls = [joint for joint in task["joints"] if joint["kind"] == "spherical"]
    pairs = ([point(one[side], one["point"]) for side in ("parent", "child")] for one in balls)
    gap = max(float(np.linalg.norm(np.subtract(*pair))) for pair in pairs)
    centre = task["bodies"]["platform"]["centre"]
    moved = float(np.linalg.norm(point("platform", centre) - centre))
    print(json.dumps({"gap": gap, "moved": moved}))


def transform(position: list[float], rotation: list[list[float]]) -> wp.transform:
    """Return a placement of Warp's: position and quaternion (x, y, z, w)."""
    return wp.transform(wp.vec3(*position), wp.quat_from_matrix(wp.mat33(np.ravel(rotation))))


def matrix(quaternion: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of a quaternion (x, y, z, w)."""
    *xyz, w = quaternion / np.linalg.norm(quaternion)
    cross = np.cross(np.eye(3), xyz)
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


if __name__ == "__main__":
    main()

"""The 3-RPS in Exudyn: the gap of its spherical joints while constant forces hold it.

Run by docs/comparison_runs.py in an environment of its own, with a task on standard input.
"""

from __future__ import annotations

import json
import sys

import exudyn as exu
import numpy as np
from exudyn.utilities import RigidBodyInertia


def main() -> None:
    """Simulate, and print the largest gap (m) and the largest motion of the platform (m)."""
    task = json.load(sys.stdin)
    system = exu.SystemContainer().AddSystem()
    ground = system.CreateGround()
    bodies = {"base": ground}
    for name, body in task["bodies"].items():
        bodies[name] = system.CreateRigidBody(
            referencePosition=body["centre"],
            referenceRotationMatrix=np.array(body["rotation"]),
            inertia=RigidBodyInertia(mass=body["mass"], inertiaTensor=np.array(body["inertia"])),
            gravity=[0.0, 0.0, -9.81],
        )
    create = {
        "revolute": system.CreateRevoluteJoint,
        "prismatic": system.CreatePrismaticJoint,
        "spherical": system.CreateSphericalJoint,
    }
    for joint in task["joints"]:
        axis = {} if joint["kind"] == "spherical" else {"axis": joint["axis"]}
        pair = [bodies[joint["parent"]], bodies[joint["child"]]]
        create[joint["kind"]](itemNumbers=pair, position=joint["point"], **axis)
        if "force" in joint:  # along the axis, on the child and back on the parent
            for body, sign in ((joint["child"], 1.0), (joint["parent"], -1.0)):
                turn = np.array(task["bodies"][body]["rotation"])
                load = sign * joint["force"] * turn.T @ np.array(joint["axis"])
                at = turn.T @ (np.array(joint["point"]) - task["bodies"][body]["centre"])
                system.CreateForce(
                    itemNumber=bodies[body], loadVector=load, localPosition=at, bodyFixed=True
                )
    system.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime = task["ticks"] * task["step"]
    settings.timeIntegration.numberOfSteps = task["ticks"]
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    system.SolveDynamic(settings)

    def placed(body: str, point: list[float]) -> np.ndarray:
        """Where a point of a body is now that was at `point` at the start, m."""
        start = task["bodies"][body]
        local = np.array(start["rotation"]).T @ (np.array(point) - start["centre"])
        kind = exu.OutputVariableType.Position
        return np.array(system.GetObjectOutputBody(bodies[body], kind, localPosition=local))

    balls = [joint for joint in task["joints"] if joint["kind"] == "spherical"]
    gap = max(
        np.linalg.norm(placed(b["parent"], b["point"]) - placed(b["child"], b["point"]))
        for b in balls
    )
    centre = task["bodies"]["platform"]["centre"]
    moved = np.linalg.norm(placed("platform", centre) - centre)
    print(json.dumps({"gap": gap, "moved": moved}))


if __name__ == "__main__":
    main()

"""The 3-RPS in Drake: the gap of its ball constraints, and its inverse dynamics.

Run by docs/comparison_runs.py in an environment of its own, with a task on standard input.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.analysis import Simulator

#: A closure in Drake's extension of URDF.
BALL = """<drake:ball_constraint>
<drake:ball_constraint_body_A name="{}"/><drake:ball_constraint_body_B name="{}"/>
<drake:ball_constraint_p_AP value="0 0 0"/><drake:ball_constraint_p_BQ value="0 0 0"/>
</drake:ball_constraint>"""


def main() -> None:
    """Simulate, and print the largest gap (m) and the platform's motion (m).

    Printed too is the largest generalised force on the platform that `CalcInverseDynamics` returns
    at rest (N): it would be zero if the loops were in the equations.
    """
    task = json.load(sys.stdin)
    plant, pairs = closed_plant(task)
    context = plant.CreateDefaultContext()
    place(plant, context, task)
    gravity = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, gravity)
    held = plant.CalcInverseDynamics(context, np.zeros(plant.num_velocities()), gravity)
    plant.get_actuation_input_port().FixValue(context, list(task["forces"].values()))
    platform = plant.GetBodyByName("platform")
    begin = platform.floating_velocities_start_in_v()
    start = plant.EvalBodyPoseInWorld(context, platform).translation()
    simulator, largest = Simulator(plant, context), gap(plant, context, pairs)
    for k in range(task["ticks"]):
        simulator.AdvanceTo((k + 1) * task["step"])
        largest = float(np.max([largest, gap(plant, context, pairs)]))
    moved = np.linalg.norm(plant.EvalBodyPoseInWorld(context, platform).translation() - start)
    force = np.abs(held[begin : begin + 6]).max()
    print(json.dumps({"gap": largest, "moved": moved, "platform": force}))


def closed_plant(task: dict[str, Any]) -> tuple[MultibodyPlant, list[Any]]:
    """Return the plant, with ball constraints read from the URDF, and the bodies they join."""
    plant = MultibodyPlant(task["step"])
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    balls = "".join(BALL.format(*pair) for pair in task["closures"])
    Parser(plant).AddModelsFromString(task["urdf"].replace("</robot>", f"{balls}</robot>"), "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    pairs = [[plant.GetBodyByName(name) for name in pair] for pair in task["closures"]]
    for name in task["forces"]:
        plant.AddJointActuator(name, plant.GetJointByName(name))
    plant.Finalize()
    assert plant.num_constraints() == len(pairs)
    return plant, pairs


def place(plant: MultibodyPlant, context: Any, task: dict[str, Any]) -> None:
    """Set the joints and the platform to the task's configuration."""
    for name, value in task["values"].items():
        joint = plant.GetJointByName(name)
        turns = joint.type_name() == "revolute"
        (joint.set_angle if turns else joint.set_translation)(context, value)
    x, y, z, *quaternion = task["platform"]  # Pinocchio's: the real part last
    turn = RotationMatrix(Quaternion(np.roll(quaternion, 1)))
    plant.SetFreeBodyPose(context, plant.GetBodyByName("platform"), RigidTransform(turn, [x, y, z]))


def gap(plant: MultibodyPlant, context: Any, pairs: list[Any]) -> float:
    """Return the largest distance between two points that should coincide, m."""
    between = [
        plant.CalcRelativeTransform(context, a.body_frame(), b.body_frame()) for a, b in pairs
    ]
    return float(np.max([np.linalg.norm(one.translation()) for one in between]))


if __name__ == "__main__":
    main()

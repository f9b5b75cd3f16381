"""Write what was run for the comparison page: peers that install here, on this repository's robots.

Run it from the checkout, in an environment with the development dependencies:

    .venv/bin/python docs/comparison_runs.py
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from lxml import etree
from marked import block, replaced
from simulation_table import comparable_robot

from rps_pin import RPSRobot

PAGE = Path(__file__).parent / "comparison.md"
POSE, RATE, ACCELERATION = [0.4, 0.05, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.0]
DRAKE = "drake==1.51.1"
TOOLBOX = "toolbox-parallel-robots==1.2.0"


def main() -> None:
    """Run everything and write the page."""
    lines = [*pinocchio_alone(), *mujoco_reads(), *drake(), *toolbox()]
    text = PAGE.read_text("utf-8")
    PAGE.write_text(replaced(text, "runs", block(lines)), "utf-8")


def pinocchio_alone() -> list[str]:
    """Whether constraintDynamics finds the acceleration that the forces were made for."""
    kinds = [name for name in pin.ContactType.names if name != "CONTACT_UNDEFINED"]
    lines = [f"Pinocchio {pin.__version__}: RigidConstraintModel is of {' or '.join(kinds)}"]
    robot = RPSRobot.from_preset("sokolov")
    heavy = RPSRobot(robot.parameters.replace(rod_mass=0.03, rod_com=0.1, rod_inertia=1e-4))
    for words, tried in (("massless rods", robot), ("rods of 30 g", heavy)):
        mechanism, model = tried.mechanism, tried.mechanism.model
        q, v, a = tried.state(POSE, RATE, ACCELERATION)
        tau = tried.inverse_dynamics(q, v, a).tau
        models = pin.StdVec_RigidConstraintModel()
        datas = pin.StdVec_RigidConstraintData()
        for closure in mechanism.closures:
            models.append(closure.constraint_model(model))
        for constraint in models:
            datas.append(constraint.createData())
        data = model.createData()
        pin.initConstraintDynamics(model, data, models, datas)
        forces = np.zeros(model.nv)
        forces[mechanism.actuated_indices] = tau
        theirs = pin.constraintDynamics(model, data, q, v, forces, models, datas)
        ours = mechanism.forward_dynamics(q, v, tau)
        answers = f"constraintDynamics {verdict(theirs, a)}, ours {verdict(ours, a)}"
        lines.append(f"  forward dynamics of the 3-RPS with {words}: {answers}")
    return lines


def verdict(found: np.ndarray, right: np.ndarray) -> str:
    """Return whether accelerations are the right ones, in words."""
    if not np.isfinite(found).all():
        return "returns NaN"
    return "is right" if np.allclose(found, right, atol=1e-9) else "is wrong"


def mujoco_reads() -> list[str]:
    """Whether MuJoCo takes the preset's URDF as it stands."""
    try:
        mujoco.MjModel.from_xml_string(without_shapes(RPSRobot.from_preset("sokolov").urdf))
        answer = "is read"
    except ValueError as error:
        answer = f"is refused: {str(error).splitlines()[0]}"
    return [
        f"MuJoCo {mujoco.__version__}: the URDF of the 3-RPS sokolov (the paper's inertias)",
        f"  {answer}",
    ]


def without_shapes(urdf: str) -> str:
    """Return a URDF without what is only drawn or collided with."""
    tree = etree.fromstring(urdf.encode())
    for shape in list(tree.iter("visual", "collision")):
        shape.getparent().remove(shape)
    return str(etree.tostring(tree, encoding="unicode"))


def drake() -> list[str]:
    """How far the 3-RPS's loops gap in Drake, and whether its inverse dynamics knows of them."""
    robot = comparable_robot()
    mechanism, model = robot.mechanism, robot.mechanism.model
    q, v, a = robot.state(POSE, [0.0] * 3, [0.0] * 3)
    task = {
        "step": 1e-3,
        "ticks": 1000,
        "urdf": without_shapes(robot.urdf),
        "closures": [[c.frame_a, c.frame_b] for c in mechanism.closures],
        "forces": dict(
            zip(mechanism.actuated, mechanism.inverse_dynamics(q, v, a).tau.tolist(), strict=True)
        ),
        "joints": {
            name: float(q[joint.idx_q])
            for name, joint in zip(model.names, model.joints, strict=True)
            if joint.nq == 1 and name != "universe"
        },
        "platform": q[-7:].tolist(),
    }
    with tempfile.TemporaryDirectory() as folder:
        venv.create(folder, with_pip=True)
        python = str(Path(folder) / "bin" / "python")
        subprocess.run([python, "-m", "pip", "install", "--quiet", DRAKE], check=True)
        told = subprocess.run(
            [python, str(Path(__file__).with_name("in_drake.py"))],
            input=json.dumps(task),
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
    found = json.loads(told.stdout)
    return [
        f"{DRAKE}: the 3-RPS with ball constraints, SAP, 1 ms, held still for 1 s",
        f"  largest gap of the loops: {found['gap']:.0e} m",
        f"  CalcInverseDynamics pushes the platform with {found['platform']:.2f} N: no loops in it",
    ]


def toolbox() -> list[str]:
    """How an installation of the toolbox from PyPI, beside pin from PyPI, imports."""
    wanted = ("toolbox_parallel_robots", "pinocchio.casadi")
    with tempfile.TemporaryDirectory() as folder:
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", folder]
        subprocess.run([*pip, TOOLBOX], check=True, capture_output=True)
        return [
            f"{TOOLBOX} beside pin from PyPI",
            *(f"  import {name}: {imported(name, folder)}" for name in wanted),
        ]


def imported(name: str, folder: str) -> str:
    """Return what an import says, with a folder on the path."""
    shown = subprocess.run(
        [sys.executable, "-c", f"import {name}"],
        env={**os.environ, "PYTHONPATH": folder},
        capture_output=True,
        text=True,
        check=False,
    )
    return "works" if shown.returncode == 0 else shown.stderr.strip().splitlines()[-1]


if __name__ == "__main__":
    main()

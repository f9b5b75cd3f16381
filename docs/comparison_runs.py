"""Write the runs of the comparison page: other packages on this repository's robots.

Run it from the checkout, in an environment with the development dependencies:

    .venv/bin/python docs/comparison_runs.py

Other packages are installed into environments of their own in build/peers; one that does not
install is named on the page as not run.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from lxml import etree
from marked import block, replaced
from simulation_table import comparable_robot

from rps_pin import ClosedLoopModel, RPSRobot

PAGE = Path(__file__).parent / "comparison.md"
POSE, RATE, ACCELERATION = [0.4, 0.05, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.0]
#: Script and package of each peer that runs in an environment of its own.
PEERS = {
    "drake": ("in_drake.py", "drake==1.51.1"),
    "exudyn": ("in_exudyn.py", "exudyn==1.13.6"),
    "newton": ("in_kamino.py", "newton==1.8.0"),
    "placo": ("in_placo.py", "placo==0.10.2"),
}
EXCESS, TICKS = 1.1, 300
TOOLBOX = "toolbox-parallel-robots==1.2.0"


def main() -> None:
    """Run everything and write the page."""
    lines = [*pinocchio_alone(), *mujoco_reads(), *placo(), *simulators(), *toolbox()]
    text = PAGE.read_text("utf-8")
    PAGE.write_text(replaced(text, "runs", block(lines)), "utf-8")


def pinocchio_alone() -> list[str]:
    """Whether Pinocchio's forward dynamics returns the acceleration that the forces are for."""
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
        pin.computeJointMinimalOrdering(model, data, models)
        proximal = pin.ProximalSettings(1e-12, 1e-4, 100)
        loop_aba = pin.lcaba(model, data, q, v, forces, models, datas, proximal)
        ours = mechanism.forward_dynamics(q, v, tau)
        lines.append(f"  forward dynamics of the 3-RPS with {words}:")
        answers = {"constraintDynamics": theirs, "lcaba": loop_aba, "rps_pin": ours}
        lines += [f"    {name}: {verdict(found, a)}" for name, found in answers.items()]
    return lines


def verdict(found: np.ndarray, right: np.ndarray) -> str:
    """Return how far accelerations are from the right ones, in words."""
    if not np.isfinite(found).all():
        return "returns NaN"
    error = float(np.abs(found - right).max() / np.abs(right).max())
    return "exact to 1e-9" if error < 1e-9 else f"off by {error:.0e}"


def mujoco_reads() -> list[str]:
    """Whether MuJoCo reads the preset's URDF."""
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
    """Return a URDF without visual and collision shapes."""
    tree = etree.fromstring(urdf.encode())
    for shape in list(tree.iter("visual", "collision")):
        shape.getparent().remove(shape)
    return str(etree.tostring(tree, encoding="unicode"))


def held() -> tuple[dict[str, Any], ClosedLoopModel, Any, Any]:
    """Return the 3-RPS as bodies, joints and actuator forces, and its model, state and forces.

    It is at rest, and the forces are those that hold it there times `EXCESS`.
    """
    robot = comparable_robot()
    mechanism, model = robot.mechanism, robot.mechanism.model
    q, v, a = robot.state(POSE, [0.0] * 3, [0.0] * 3)
    forces = EXCESS * mechanism.inverse_dynamics(q, v, a).tau
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    bodies: dict[str, Any] = {}
    joints: list[dict[str, Any]] = []
    for name, inertia, placed in zip(model.names, model.inertias, data.oMi, strict=True):
        if name == "universe":
            continue
        leg, _, kind = name.rpartition("_")
        body = {"revolute": f"{leg}_cylinder", "prismatic": f"{leg}_rod", "free": "platform"}[kind]
        bodies[body] = {
            "mass": inertia.mass,
            "centre": placed.act(inertia.lever).tolist(),
            "rotation": placed.rotation.tolist(),
            "inertia": inertia.inertia.tolist(),
        }
        if kind != "free":
            axis = {"revolute": [0.0, -1.0, 0.0], "prismatic": [1.0, 0.0, 0.0]}[kind]
            one = {"kind": kind, "child": body, "tree": True, "point": placed.translation.tolist()}
            one |= {"axis": (placed.rotation @ axis).tolist(), "parent": "base"}
            if kind == "prismatic":
                force = float(forces[mechanism.actuated.index(name)])
                one |= {"parent": f"{leg}_cylinder", "force": force}
            joints.append(one)
    for leg, closure in enumerate(mechanism.closures, start=1):
        point = data.oMf[model.getFrameId(closure.frame_b)].translation.tolist()
        one = {"kind": "spherical", "parent": f"leg_{leg}_rod", "child": "platform"}
        joints.append(one | {"point": point, "tree": leg == 1})
    task = {
        "step": 1e-3,
        "ticks": TICKS,
        "bodies": bodies,
        "joints": joints,
        "urdf": without_shapes(robot.urdf),
        "closures": [[c.frame_a, c.frame_b] for c in mechanism.closures],
        "forces": dict(zip(mechanism.actuated, forces.tolist(), strict=True)),
        "values": {
            name: float(q[joint.idx_q])
            for name, joint in zip(model.names, model.joints, strict=True)
            if joint.nq == 1 and name != "universe"
        },
        "platform": q[-7:].tolist(),
    }
    return task, mechanism, (q, v), forces


def simulators() -> list[str]:
    """Lift the 3-RPS by its actuators in four engines; return gaps and motions, in lines."""
    task, mechanism, (q, v), forces = held()
    ours = mechanism.simulate(q, v, duration=TICKS * task["step"], tau=forces)
    moved = float(np.linalg.norm(ours.q[-1][-7:-4] - q[-7:-4]))
    lines = [
        "the 3-RPS with rods of 30 g, from rest, "
        f"actuator forces {EXCESS:g} times those that hold it,",
        f"{TICKS} ms in steps of 1 ms: largest gap of the loops; motion of the platform",
    ]
    lines.append(f"  rps_pin: {ours.gap.max():.0e} m; {1e3 * moved:.3f} mm")
    said = {
        "drake": "ball constraints read from URDF, SAP",
        "exudyn": "index 3, redundant coordinates",
    }
    for name in ("drake", "exudyn", "newton"):
        found = in_peer(name, task)
        words = f" ({said[name]})" if name in said else " (Kamino, on a CPU, single precision)"
        if isinstance(found, str):
            lines.append(f"  {PEERS[name][1]}: {found}")
            continue
        result = f"{found['gap']:.0e} m; {1e3 * found['moved']:.3f} mm"
        lines.append(f"  {PEERS[name][1]}{words}: {result}")
        if name == "drake":
            force = found["platform"]
            lines.append(
                f"    CalcInverseDynamics at rest asks for {force:.2f} N on the platform: no loops"
            )
    return lines


def placo() -> list[str]:
    """Compare a four-bar's crank torque by PlaCo's QP with ours, at rest and in motion."""
    four_bar = ClosedLoopModel.load(PAGE.parent.parent / "urdf" / "four_bar.yaml")
    model = four_bar.model
    urdf = (PAGE.parent.parent / "urdf" / "four_bar.urdf").read_text("utf-8")
    q = four_bar.complete({"crank_joint": 1.0})
    lines = [f"{PEERS['placo'][1]}: the four-bar's crank, QP with a hard loop task"]
    for speed, acceleration in ((0.0, 0.5), (2.0, 0.5)):
        v = four_bar.velocity(q, [speed])
        a = four_bar.acceleration(q, v, [acceleration])
        named = {
            key: dict(zip(list(model.names)[1:], map(float, values), strict=True))
            for key, values in (("q", q), ("v", v), ("a", a))
        }
        task = named | {
            "urdf": without_shapes(urdf),
            "closure": ["coupler_tip", "rocker_tip"],
            "actuated": "crank_joint",
            "passive": ["coupler_joint", "rocker_joint"],
        }
        found = in_peer("placo", task)
        if isinstance(found, str):
            return [f"{lines[0]}: {found}"]
        ours = four_bar.inverse_dynamics(q, v, a).tau[0]
        difference = abs(found["torque"] - ours) / ours
        words = "below 1e-9" if difference < 1e-9 else f"{difference:.1%}"
        lines.append(
            f"  {speed:g} rad/s, {acceleration:g} rad/s^2: {found['torque']:.4f} N m, "
            f"ours {ours:.4f} N m; difference {words}"
        )
    return lines


def in_peer(name: str, task: dict[str, Any]) -> dict[str, float] | str:
    """Return what docs/in_NAME.py prints in an environment of its own, or why it was not run."""
    script, package = PEERS[name]
    folder = PAGE.parent.parent / "build" / "peers" / name
    python = folder / "bin" / "python"
    if not python.exists():
        venv.create(folder, with_pip=True)
    install = [str(python), "-m", "pip", "install", "--quiet", package]
    if subprocess.run(install, capture_output=True, check=False).returncode:
        return "does not install here, not run"
    told = subprocess.run(
        [str(python), str(PAGE.with_name(script))],
        input=json.dumps(task),
        capture_output=True,
        text=True,
        check=True,
    )
    found: dict[str, float] = json.loads(told.stdout.strip().splitlines()[-1])
    return found


def toolbox() -> list[str]:
    """Whether the toolbox imports when it and pin are installed from PyPI."""
    wanted = ("toolbox_parallel_robots", "pinocchio.casadi")
    with tempfile.TemporaryDirectory() as folder:
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", folder]
        subprocess.run([*pip, TOOLBOX], check=True, capture_output=True)
        return [
            f"{TOOLBOX} with pin from PyPI",
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
    if shown.returncode == 0:
        return "works"
    return shown.stderr.strip().splitlines()[-1].partition(" (")[0]  # without a path


if __name__ == "__main__":
    main()

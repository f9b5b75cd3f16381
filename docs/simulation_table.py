"""Write the tables of docs/simulation.md: one robot simulated by rps_pin and by MuJoCo.

Run it from the checkout, in an environment with the development dependencies (a few minutes):

    .venv/bin/python docs/simulation_table.py
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from lxml import etree
from marked import replaced
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, JointEffects, RPSParameters, RPSRobot
from rps_pin.closed_loop.simulation.simulate import simulate

Array = NDArray[np.float64]

PAGE = Path(__file__).parent / "simulation.md"
DURATION = 1.0
REPEATS = 5
STIFFNESS = 80.0
LEGS = tuple(f"leg_{i}_prismatic" for i in (1, 2, 3))
START = [0.41, 0.1, -0.05], [0.1, 0.3, -0.2], [0.0, 0.0, 0.0]  # pose, rate, acceleration


class Result(NamedTuple):
    """A row of a table."""

    name: str
    step: float
    gap: float
    """Largest gap between two closed points, m."""
    drift: float
    """Largest change of the energy, relative to the largest kinetic energy."""
    seconds: float
    """Processor time per millisecond simulated, s."""


def main() -> None:
    """Run the simulations and write the tables."""
    robot = comparable_robot()
    mechanism = sprung(robot)
    text = PAGE.read_text("utf-8")
    ours = [
        *(our(mechanism, robot, step, method="rk4") for step in (1e-3, 1e-4)),
        our(mechanism, robot, 1e-3, method="adaptive"),
        *(our(mechanism, robot, step, closing="baumgarte") for step in (1e-3, 1e-4)),
    ]
    theirs = [
        in_mujoco(mechanism, robot, step, integrator, stiff)
        for integrator in ("Euler", "RK4")
        for step in (1e-3, 1e-4)
        for stiff in (False, True)
    ]
    unit = ours[0].seconds
    lines = [
        "| engine | step (ms) | largest gap (m) | energy drift | time per simulated ms |",
        "|---|---|---|---|---|",
        *(row(result, unit) for result in [*ours, *theirs]),
    ]
    text = replaced(text, "comparison", "\n".join(lines))
    lines = ["| springs (N/m) | rk4, 1 ms | rk4, 0.25 ms | adaptive |", "|---|---|---|---|"]
    lines += [stiffer(robot, stiffness) for stiffness in (80, 400, 2000)]
    PAGE.write_text(replaced(text, "stiffness", "\n".join(lines)), "utf-8")


# The robot ----------------------------------------------------------------------------------------


def comparable_robot() -> RPSRobot:
    """Return the sokolov preset with bodies that MuJoCo accepts.

    The rods have a mass, and the platform an inertia that satisfies the triangle inequality.
    """
    given = RPSParameters.from_preset("sokolov")
    fields = {name: getattr(given, name) for name in type(given).model_fields}
    fields |= {"platform_inertia": np.diag([0.093, 0.093, 0.185])}
    fields |= {"rod_mass": 0.03, "rod_com": -0.1, "rod_inertia": 5e-4}
    return RPSRobot(RPSParameters(**fields))


def sprung(robot: RPSRobot, stiffness: float = STIFFNESS) -> ClosedLoopModel:
    """Return the robot on springs that carry the platform at 0.4 m."""
    bare = robot.mechanism
    springs = dict.fromkeys(LEGS, stiffness)
    effects = JointEffects.named(bare.model, stiffness=springs, rest=rest(robot, stiffness))
    return ClosedLoopModel(bare.model, bare.closures, bare.actuated, effects=effects)


def rest(robot: RPSRobot, stiffness: float) -> dict[str, float]:
    """Return the lengths at which the springs have no force, m."""
    carried = robot.mechanism.inverse_dynamics(*robot.state([0.4, 0, 0], [0, 0, 0], [0, 0, 0])).tau
    lengths = robot.inverse_kinematics([0.4, 0, 0]).length + carried / stiffness
    return dict(zip(LEGS, lengths.tolist(), strict=True))


# Runs ---------------------------------------------------------------------------------------------


def our(mechanism: ClosedLoopModel, robot: RPSRobot, step: float, **options: Any) -> Result:
    """Simulate with rps_pin; the time is that of the fastest run, with recording."""
    q, v, _ = robot.state(*START)
    spent = np.inf
    for _ in range(REPEATS):
        began = time.process_time()
        motion = simulate(mechanism, q, v, duration=DURATION, step=step, **options)
        spent = min(spent, time.process_time() - began)
    gap = float(np.max([mechanism.loop_gap(q) for q in motion.q]))
    name = options.get("closing") or "projection"
    name = f"rps_pin, {options.get('method', 'rk4')}, {name}"
    return Result(name, step, gap, drift(motion.kinetic, motion.energy), spent / DURATION / 1e3)


def drift(kinetic: Array, energy: Array) -> float:
    """Return the largest change of the energy, relative to the largest kinetic energy."""
    return float(np.abs(energy - energy[0]).max() / kinetic.max())


def in_mujoco(
    mechanism: ClosedLoopModel, robot: RPSRobot, step: float, integrator: str, stiff: bool
) -> Result:
    """Simulate with MuJoCo; the time is that of `mj_step` in the fastest run."""
    runs = [_in_mujoco(mechanism, robot, step, integrator, stiff) for _ in range(REPEATS)]
    return min(runs, key=lambda result: result.seconds)


def _in_mujoco(
    mechanism: ClosedLoopModel, robot: RPSRobot, step: float, integrator: str, stiff: bool
) -> Result:
    model = mujoco_model(robot, step, integrator, stiff)
    data = mujoco.MjData(model)
    q, v, _ = robot.state(*START)
    put(mechanism, model, data, q, v)
    ends = np.array([[model.eq_obj1id[i], model.eq_obj2id[i]] for i in range(model.neq)])
    spent, gap, energies = 0.0, 0.0, []
    for _ in range(round(DURATION / step)):
        began = time.process_time()
        mujoco.mj_step(model, data)
        spent += time.process_time() - began
        # `data` still holds the placements, and the energies, of the step's start.
        apart = data.site_xpos[ends[:, 0]] - data.site_xpos[ends[:, 1]]
        gap = float(np.max([gap, *np.linalg.norm(apart, axis=1)]))
        energies.append(data.energy.copy())
    potential, kinetic = np.array(energies).T
    settings = "stiffest solref" if stiff else "default solref"
    return Result(
        f"MuJoCo {mujoco.__version__}, {integrator}, {settings}",
        step,
        gap,
        drift(kinetic, kinetic + potential),
        spent / DURATION / 1e3,
    )


def mujoco_model(robot: RPSRobot, step: float, integrator: str, stiff: bool) -> Any:
    """Return the URDF in MuJoCo, with springs and equality connects."""
    tree = etree.fromstring(robot.urdf)
    options = {"balanceinertia": "false", "boundmass": "0", "boundinertia": "0"}
    options |= {"discardvisual": "true"}
    etree.SubElement(etree.SubElement(tree, "mujoco"), "compiler", options)
    spec = mujoco.MjSpec.from_string(etree.tostring(tree, encoding="unicode"))
    for name, length in rest(robot, STIFFNESS).items():
        spring = spec.joint(name)
        spring.stiffness = np.array([STIFFNESS, 0.0, 0.0])[: np.size(spring.stiffness)]
        spring.springref = length
    tree_model = robot.mechanism.model
    connect, site = mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtObj.mjOBJ_SITE
    for closure in robot.mechanism.closures:
        for name in (closure.frame_a, closure.frame_b):
            frame = tree_model.frames[tree_model.getFrameId(name)]
            body = spec.joint(tree_model.names[frame.parentJoint]).parent
            body.add_site(name=name, pos=frame.placement.translation)
        equality = spec.add_equality(type=connect, objtype=site)
        equality.name1, equality.name2 = closure.frame_a, closure.frame_b
        if stiff:  # MuJoCo keeps the time constant at two steps or more
            equality.solref[:] = 2 * step, 1
            equality.solimp[:] = 0.9999, 0.9999, 0.001, 0.5, 2
    spec.option.timestep = step
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    spec.option.gravity = robot.parameters.gravity
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT  # touching shapes are drawings
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    return spec.compile()


def put(mechanism: ClosedLoopModel, model: Any, data: Any, q: Array, v: Array) -> None:
    """Set MuJoCo's state: quaternions (w, x, y, z), linear free velocities in world axes."""
    for name, joint in list(zip(mechanism.model.names, mechanism.model.joints, strict=True))[1:]:
        address = model.joint(name)
        place, dof = int(address.qposadr[0]), int(address.dofadr[0])
        own, rate = q[joint.idx_q :][: joint.nq], v[joint.idx_v :][: joint.nv].copy()
        if joint.nq == 7:
            own = own[[0, 1, 2, 6, 3, 4, 5]]
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, own[3:])
            rate[:3] = turn.reshape(3, 3) @ rate[:3]
        data.qpos[place : place + joint.nq] = own
        data.qvel[dof : dof + joint.nv] = rate


def stiffer(robot: RPSRobot, stiffness: float) -> str:
    """Return a row of energy drifts over ten seconds."""
    mechanism = sprung(robot, stiffness)
    q, v, _ = robot.state(*START)
    runs: list[Callable[[], Any]] = [
        lambda: simulate(mechanism, q, v, duration=10.0),
        lambda: simulate(mechanism, q, v, duration=10.0, step=2.5e-4),
        lambda: simulate(mechanism, q, v, duration=10.0, method="adaptive"),
    ]
    motions = [run() for run in runs]
    drifts = [f"{drift(motion.kinetic, motion.energy):.0e}" for motion in motions]
    return f"| {stiffness} | {' | '.join(drifts)} |"


# The page -----------------------------------------------------------------------------------------


def row(result: Result, unit: float) -> str:
    """Return a row of the table, with times relative to a unit."""
    return (
        f"| {result.name} | {result.step * 1e3:g} | {result.gap:.0e} | {result.drift:.0e} | "
        f"{result.seconds / unit:.2g} |"
    )


if __name__ == "__main__":
    main()

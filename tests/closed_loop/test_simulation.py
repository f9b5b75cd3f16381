"""Simulated motions: conservation laws, closed forms, Lagrange, MuJoCo, and what goes wrong."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree
from numpy.typing import NDArray
from scipy.integrate import quad, simpson
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

from rps_pin import (
    ClosedLoopModel,
    JointCoupling,
    JointEffects,
    LoopClosure,
    RPSParameters,
    RPSRobot,
)
from rps_pin.closed_loop.simulation.manifold import ClosedManifold
from rps_pin.closed_loop.simulation.result import Simulation
from rps_pin.closed_loop.simulation.simulate import simulate
from rps_pin.errors import ClosureError, InputError, SingularityError
from tests.closed_loop.mechanisms import ALL, FOUR_BAR, GRAVITY, joint, link, robot, state
from tests.quick import quick
from tests.worst import worst

Array = NDArray[np.float64]
State = tuple[Array, Array]
Case = tuple[ClosedLoopModel, Array, Array]

STIFFNESS, LEGS = 80.0, tuple(f"leg_{i}_prismatic" for i in (1, 2, 3))


# The mechanisms -----------------------------------------------------------------------------------


@cache
def rest() -> dict[str, float]:
    """Where the springs of the legs carry the platform at 0.4 m, level."""
    mechanism = RPSRobot.from_preset("sokolov")
    q, v, a = mechanism.state([0.4, 0, 0], [0, 0, 0], [0, 0, 0])
    carried = mechanism.mechanism.inverse_dynamics(q, v, a).tau
    lengths = mechanism.inverse_kinematics([0.4, 0, 0]).length
    return dict(zip(LEGS, (lengths + carried / STIFFNESS).tolist(), strict=True))


def sprung_rps(damping: float = 0.0) -> ClosedLoopModel:
    """The preset 3-RPS on springs."""
    bare = RPSRobot.from_preset("sokolov").mechanism
    effects = JointEffects.named(
        bare.model,
        stiffness=dict.fromkeys(LEGS, STIFFNESS),
        rest=rest(),
        damping=dict.fromkeys(LEGS, damping),
    )
    return ClosedLoopModel(bare.model, bare.closures, bare.actuated, effects=effects)


def tossed_rps() -> State:
    """A state from which it swings and tilts, by some 0.1 rad and 4 cm."""
    return RPSRobot.from_preset("sokolov").state([0.41, 0.1, -0.05], [0.1, 0.3, -0.2], [0, 0, 0])[
        :2
    ]


def turning_four_bar(rigid: bool = False) -> Case:
    mechanism = FOUR_BAR.mechanism() if rigid else FOUR_BAR.spherical_mechanism()
    q, _, _ = state(mechanism)
    return mechanism, q, mechanism.velocity(q, [3.0])


def bennett() -> Case:
    """Bennett's linkage: four skew axes that only a proportion of lengths and twists lets move.

    Of five closure rows two are independent where it is closed, and three anywhere near.
    """
    alpha, beta, a = 0.6, 1.1, 0.3
    b = a * np.sin(beta) / np.sin(alpha)

    def turning(parent: str, child: str, xyz: str, roll: float) -> str:
        text = joint("revolute", parent, child, xyz, "0 0 1")
        return text.replace(f'<origin xyz="{xyz}"/>', f'<origin xyz="{xyz}" rpy="{roll} 0 0"/>')

    def fixed(parent: str, child: str, xyz: str, roll: float) -> str:
        text = joint("fixed", parent, child, xyz)
        return text.replace(f'<origin xyz="{xyz}"/>', f'<origin xyz="{xyz}" rpy="{roll} 0 0"/>')

    urdf = robot(
        *(link(f"bar_{i}", 1.0 + 0.2 * i, "0.1 0.02 0.03", 0.02) for i in (1, 2, 3)),
        link("tip"),
        link("ground"),
        turning("base", "bar_1", "0 0 0", 0.0),
        turning("bar_1", "bar_2", f"{a} 0 0", alpha),
        turning("bar_2", "bar_3", f"{b} 0 0", beta),
        fixed("bar_3", "tip", f"{a} 0 0", alpha),
        fixed("base", "ground", f"{-b} 0 0", -beta),
    )
    closure = LoopClosure("ground", "tip", "revolute", name="fourth axis")
    mechanism = ClosedLoopModel.from_urdf(urdf, [closure], ["bar_1_joint"])
    # tan(theta_1 / 2) tan(theta_2 / 2) is the linkage's constant; opposite angles are opposite.
    first = 1.0
    constant = np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2)
    second = 2 * np.arctan(constant / np.tan(first / 2))
    q = np.array([first, second, -first])
    return mechanism, q, mechanism.allowed_motions(q)[:, 0]


def pendulum(angle: float) -> tuple[ClosedLoopModel, Array, float]:
    """A free body hung on the world by a revolute closure; its state; omega^2 for small swings."""
    mass, lever, inertia = 1.7, 0.6, 0.05
    model = pin.Model()
    body = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    model.appendBodyToJoint(
        body, pin.Inertia(mass, np.zeros(3), inertia * np.eye(3)), pin.SE3.Identity()
    )
    model.addBodyFrame("bob", body, pin.SE3.Identity(), 0)
    hook = pin.SE3(np.eye(3), np.array([0.0, 0.0, lever]))
    model.addFrame(pin.Frame("hook", body, 0, hook, pin.FrameType.OP_FRAME))
    closure = LoopClosure("universe", "hook", "revolute", axis=(0, 1, 0))
    mechanism = ClosedLoopModel(model, [closure], ["free"])
    turn = pin.exp3(np.array([0.0, angle, 0.0]))
    q = pin.SE3ToXYZQUAT(pin.SE3(turn, -turn @ hook.translation))
    return mechanism, q, mass * GRAVITY * lever / (inertia + mass * lever**2)


def drift(motion: Simulation) -> float:
    """Largest change of the energy, relative to the largest kinetic energy."""
    return float(np.abs(motion.energy - motion.energy[0]).max() / motion.kinetic.max())


def widest(mechanism: ClosedLoopModel, motion: Simulation, every: int = 1) -> float:
    return worst([mechanism.loop_gap(q) for q in motion.q[::every]])


# Ten seconds at a millisecond ---------------------------------------------------------------------


@pytest.mark.slow
def test_a_conservative_rps_keeps_its_energy_and_its_loops_closed() -> None:
    mechanism = sprung_rps()
    q, v = tossed_rps()
    motion = simulate(mechanism, q, v, duration=10.0)
    assert motion.time.shape == (10001,)
    assert motion.time[-1] == 10.0
    assert drift(motion) <= 1e-8
    assert motion.gap.max() <= 1e-12
    assert widest(mechanism, motion, 50) <= 1e-12
    assert np.ptp(motion.q[:, 8]) > 0.02  # it does move
    rates = [mechanism.loop_errors(q, v).velocity for q, v in zip(motion.q, motion.v, strict=True)]
    assert np.abs(rates[::50]).max() <= 1e-12


@pytest.mark.slow
def test_a_conservative_four_bar_keeps_its_energy_and_its_loop_closed() -> None:
    mechanism, q, v = turning_four_bar()
    motion = simulate(mechanism, q, v, duration=10.0)
    assert drift(motion) <= 1e-8
    assert motion.gap.max() <= 1e-12
    assert widest(mechanism, motion, 50) <= 1e-12
    assert motion.q[-1, 0] > 4 * np.pi  # it turns over and over


@pytest.mark.parametrize("make", ALL, ids=lambda make: make.__name__)
def test_any_mechanism_keeps_its_energy_and_its_loops_closed(
    make: Callable[[], ClosedLoopModel],
) -> None:
    mechanism = make()
    q, v, _ = state(mechanism)
    motion = simulate(mechanism, q, v, duration=0.2)
    assert drift(motion) <= 1e-8
    assert widest(mechanism, motion) <= 1e-12


def geared_pendulums(coupled: bool) -> ClosedLoopModel:
    """Two bars, one on the other; geared to each other, or free: a tree without a loop."""
    urdf = robot(
        link("upper", 1.0, "0.2 0 0", 0.02),
        link("lower", 0.5, "0.1 0 0.05", 0.01),
        joint("revolute", "base", "upper"),
        joint("revolute", "upper", "lower", "0.4 0 0"),
    )
    gears = [JointCoupling("lower_joint", "upper_joint", ratio=-1.5)] if coupled else []
    return ClosedLoopModel.from_urdf(urdf, gears, ["upper_joint"])


@pytest.mark.parametrize("coupled", [True, False])
def test_couplings_and_trees_move_too(coupled: bool) -> None:
    mechanism = geared_pendulums(coupled)
    motion = simulate(mechanism, np.zeros(2), duration=0.5)
    assert drift(motion) <= 1e-8
    assert widest(mechanism, motion) <= 1e-12
    assert np.abs(motion.q[-1]).min() > 0.1
    if coupled:
        np.testing.assert_allclose(motion.q[:, 1], -1.5 * motion.q[:, 0], atol=1e-12)


# Against closed forms and Lagrange ----------------------------------------------------------------


def test_a_pendulum_swings_in_the_time_of_its_elliptic_integral() -> None:
    largest = 2.0
    mechanism, q, squared = pendulum(largest)
    period = 4 / np.sqrt(squared) * float(ellipk(np.sin(largest / 2) ** 2))
    motion = simulate(mechanism, q, duration=period, step=period / 2000)
    np.testing.assert_allclose(motion.q[-1], q, atol=1e-9)
    np.testing.assert_allclose(motion.v[-1], 0, atol=1e-9)
    np.testing.assert_allclose(motion.q[1000, :3], q[:3] * [-1, 1, 1], atol=1e-9)
    assert widest(mechanism, motion, 50) <= 1e-12


def lagrange_four_bar(angle: float) -> tuple[float, float]:
    """Inertia and potential energy of the four-bar at a crank angle."""
    height = sum(bar.mass * com[1] for bar, _, com, _ in FOUR_BAR.bodies(angle))
    return FOUR_BAR.inertia(angle), GRAVITY * float(np.real(height))


@pytest.mark.parametrize("rigid", [False, True])
def test_a_four_bar_moves_as_lagrange_says(rigid: bool) -> None:
    """Its energy gives the crank's rate at every angle, and that the time it takes."""
    mechanism, q, v = turning_four_bar(rigid)
    motion = simulate(mechanism, q, v, duration=0.8)
    crank = mechanism.actuated_indices[0]
    inertia, potential = lagrange_four_bar(q[crank])
    energy = inertia * v[crank] ** 2 / 2 + potential

    def rate(angle: float) -> float:
        inertia, potential = lagrange_four_bar(angle)
        return float(np.sqrt(2 * (energy - potential) / inertia))

    found = motion.q[::100, crank]
    np.testing.assert_allclose(motion.v[::100, crank], [rate(x) for x in found], rtol=1e-8)
    taken, _ = quad(lambda x: 1 / rate(x), found[0], found[-1], epsabs=1e-12, limit=200)
    assert taken == pytest.approx(0.8, abs=1e-9)


def test_what_is_lost_is_what_the_dampers_take() -> None:
    mechanism = sprung_rps(damping=2.0)
    q, v = tossed_rps()
    motion = simulate(mechanism, q, v, duration=1.0)
    power = 2.0 * (motion.v[:, mechanism.actuated_indices] ** 2).sum(axis=1)
    lost = motion.energy[0] - motion.energy[-1]
    assert lost > 0.5 * motion.kinetic.max()
    assert simpson(power, x=motion.time) == pytest.approx(lost, rel=1e-7)


def test_what_is_won_is_what_the_actuators_give() -> None:
    mechanism, q, v = turning_four_bar()
    motion = simulate(mechanism, q, v, duration=1.0, tau=[1.5], method="adaptive")
    won = motion.energy[-1] - motion.energy[0]
    assert won == pytest.approx(1.5 * (motion.q[-1, 0] - q[0]), rel=1e-9)
    np.testing.assert_array_equal(motion.tau, 1.5)


@pytest.mark.parametrize("method", ["rk4", "adaptive"])
@pytest.mark.parametrize("driven", ["constant", "controlled"])
def test_energy_less_work_is_the_integration_s_error(method: str, driven: str) -> None:
    """Of a driven four-bar, whose energy itself changes by much more."""
    mechanism, q, v = turning_four_bar()
    forces = {"tau": [1.5]}
    if driven == "controlled":
        forces = {"controller": lambda t, q, v: [1.5 + np.sin(9 * t) - 0.1 * v[0]]}
    motion = simulate(mechanism, q, v, duration=1.0, method=method, **forces)
    assert np.ptp(motion.energy) > 0.4 * motion.kinetic.max()
    assert motion.work[0] == motion.energy_balance[0] == 0
    assert worst(motion.energy_balance) < 1e-6 * motion.kinetic.max()
    if driven == "constant":
        np.testing.assert_allclose(motion.work, 1.5 * (motion.q[:, 0] - q[0]), atol=1e-6)


def test_energy_balance_is_of_order_four() -> None:
    mechanism, q, v = turning_four_bar()
    errors = [
        worst(simulate(mechanism, q, v, duration=0.5, step=step, tau=[3.0]).energy_balance)
        for step in (1e-2, 5e-3)
    ]
    assert errors[0] / errors[1] > 2**3.5


def test_work_counts_wrenches_dampers_and_friction_but_not_springs() -> None:
    """Against the powers at the recorded rows, by Simpson's rule."""
    bare = sprung_rps(damping=2.0)
    assert bare.effects is not None
    friction = np.zeros(bare.model.nv)
    friction[bare.actuated_indices] = 3.0
    effects = replace(bare.effects, friction=friction, friction_speed=0.5)
    mechanism = ClosedLoopModel(bare.model, bare.closures, bare.actuated, effects=effects)
    q, v = tossed_rps()
    push = np.array([5.0, -3.0, 8.0, 0.5, 0.2, -0.1])
    motion = simulate(
        mechanism, q, v, duration=0.5, tau=[1.0, 2.0, -1.0], wrenches={"platform": push}
    )
    power = []
    for at, rate in zip(motion.q, motion.v, strict=True):
        rates = rate[mechanism.actuated_indices]
        twist = mechanism.frame_jacobian(at, "platform") @ rates
        resisting = 2.0 * rates + 3.0 * np.tanh(rates / 0.5)
        power.append(np.array([1.0, 2.0, -1.0]) @ rates + push @ twist - resisting @ rates)
    scale = motion.kinetic.max()
    assert motion.work[-1] == pytest.approx(simpson(power, x=motion.time), abs=1e-6 * scale)
    assert worst(motion.energy_balance) < 1e-6 * scale
    assert np.ptp(motion.energy) > 0.3 * scale


def test_a_motion_that_breaks_off_has_its_work_until_then() -> None:
    mechanism, q, v = turning_four_bar()

    def controller(t: float, q: Array, v: Array) -> list[float]:
        if t > 0.05:
            raise RuntimeError("no more")
        return [1.5]

    with pytest.raises(RuntimeError, match="no more") as caught:
        simulate(mechanism, q, v, duration=1.0, controller=controller)
    partial = caught.value.partial  # type: ignore[attr-defined]
    np.testing.assert_allclose(partial.work, 1.5 * (partial.q[:, 0] - q[0]), atol=1e-9)


def test_backwards_it_returns_to_where_it_began() -> None:
    mechanism = sprung_rps()
    q, v = tossed_rps()
    there = simulate(mechanism, q, v, duration=0.5)
    back = simulate(mechanism, there.q[-1], -there.v[-1], duration=0.5)
    np.testing.assert_allclose(back.q[-1], q, atol=1e-8)
    np.testing.assert_allclose(back.v[-1], -v, atol=1e-6)


# Orders and methods -------------------------------------------------------------------------------


def sprung_case() -> Case:
    return sprung_rps(), *tossed_rps()


CASES = [sprung_case, turning_four_bar, lambda: turning_four_bar(True), bennett]
NAMES = ["rps", "four-bar", "rigid four-bar", "bennett"]


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_projected_steps_are_of_order_four(
    case: Callable[[], Case],
) -> None:
    """Also of mechanisms whose redundant rows contradict each other off the closed states."""
    mechanism, q, v = case()
    duration = 0.4
    exact = simulate(
        mechanism, q, v, duration=duration, step=duration, method="adaptive", tolerance=1e-13
    )
    errors = []
    for step in (0.02, 0.01, 0.005):
        motion = simulate(mechanism, q, v, duration=duration, step=step, record_every=1000)
        apart = pin.difference(mechanism.model, motion.q[-1], exact.q[-1])
        errors.append(np.linalg.norm(np.concatenate([apart, motion.v[-1] - exact.v[-1]])))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[-1] > 3.7, (errors, orders)


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_adaptive_and_fixed_steps_agree(
    case: Callable[[], Case],
) -> None:
    mechanism, q, v = case()
    fixed = simulate(mechanism, q, v, duration=0.3)
    adaptive = simulate(mechanism, q, v, duration=0.3, method="adaptive")
    np.testing.assert_array_equal(adaptive.time, fixed.time)
    np.testing.assert_allclose(adaptive.q, fixed.q, atol=1e-7)
    np.testing.assert_allclose(adaptive.a, fixed.a, atol=1e-5)
    assert widest(mechanism, adaptive) <= 1e-12
    assert drift(adaptive) <= 1e-8


def test_an_adaptive_run_takes_fewer_steps_than_it_records() -> None:
    mechanism, q, v = turning_four_bar()
    asked: list[float] = []

    def nothing(t: float, q: Array, v: Array) -> dict[str, Array]:
        asked.append(t)
        return {}

    simulate(mechanism, q, v, duration=0.5, method="adaptive", wrenches=nothing, tolerance=1e-8)
    assert len(asked) < 2 * 500  # one a record, and the stages of a few steps


def test_baumgarte_keeps_gaps_small_but_does_not_close_them() -> None:
    mechanism, q, v = turning_four_bar()
    options = {"duration": 2.0, "step": 5e-3, "closing": "baumgarte"}
    pulled = simulate(mechanism, q, v, **options)
    left_alone = simulate(mechanism, q, v, baumgarte_gain=1e-9, **options)
    assert pulled.gap[0] <= 1e-12
    assert 1e-12 < pulled.gap.max() < left_alone.gap.max() / 3
    np.testing.assert_allclose(pulled.gap, [mechanism.loop_gap(q) for q in pulled.q], atol=1e-14)
    adaptive = simulate(mechanism, q, v, method="adaptive", **options)
    np.testing.assert_allclose(adaptive.q, pulled.q, atol=1e-4)
    assert 1e-15 < adaptive.gap.max() < pulled.gap.max()


@pytest.mark.parametrize("case", quick(CASES, CASES[1:2]), ids=NAMES)
def test_baumgarte_and_projection_agree(case: Callable[[], Case]) -> None:
    mechanism, q, v = case()
    pulled = simulate(mechanism, q, v, duration=1.0, closing="baumgarte")
    projected = simulate(mechanism, q, v, duration=1.0)
    np.testing.assert_allclose(pulled.q, projected.q, atol=1e-6)


@pytest.mark.parametrize("gain", [20.0, 50.0])
def test_under_baumgarte_a_gap_is_critically_damped(gain: float) -> None:
    """e'' + 2 alpha e' + alpha^2 e = 0 by the accelerations at an open state, by differences."""
    mechanism = sprung_rps()
    q, v = tossed_rps()
    manifold = ClosedManifold(mechanism.system, q)
    rng = np.random.default_rng(1)
    q = pin.integrate(mechanism.model, q, 1e-2 * rng.normal(size=mechanism.model.nv))
    v = v + 0.1 * rng.normal(size=mechanism.model.nv)
    a, _ = manifold.acceleration(q, v, np.zeros(3), None, gain)
    h = 1e-4

    def gaps(t: float) -> Array:
        """Along a motion that has this velocity and acceleration at 0."""
        moved = pin.integrate(mechanism.model, q, t * (v + t * a / 2))
        return mechanism.loop_errors(moved).position

    rate = (gaps(h) - gaps(-h)) / (2 * h)
    bend = (gaps(h) - 2 * gaps(0) + gaps(-h)) / h**2
    wanted = -2 * gain * rate - gain**2 * gaps(0)
    np.testing.assert_allclose(bend, wanted, atol=1e-4 * np.abs(wanted).max())


# MuJoCo -------------------------------------------------------------------------------------------


def heavy_rps() -> RPSRobot:
    """The preset with what MuJoCo demands: rods of some mass, a platform inertia that can be."""
    given = RPSParameters.from_preset("sokolov")
    fields = {name: getattr(given, name) for name in type(given).model_fields}
    fields |= {"platform_inertia": np.diag([0.093, 0.08, 0.17])}
    fields |= {"rod_mass": 0.03, "rod_com": -0.1, "rod_inertia": 5e-4}
    return RPSRobot(RPSParameters(**fields))


def in_mujoco(robot: RPSRobot, pushes: Array, step: float) -> tuple[Any, Any, Any]:
    """The robot in MuJoCo under constant forces, its loops as equality connects, very stiff."""
    mujoco = pytest.importorskip("mujoco")
    tree = etree.fromstring(robot.urdf)
    options = {"balanceinertia": "false", "boundmass": "0", "boundinertia": "0"}
    etree.SubElement(etree.SubElement(tree, "mujoco"), "compiler", options)
    spec = mujoco.MjSpec.from_string(etree.tostring(tree, encoding="unicode"))
    model = robot.mechanism.model
    for closure in robot.mechanism.closures:
        for name in (closure.frame_a, closure.frame_b):
            frame = model.frames[model.getFrameId(name)]
            body = spec.joint(model.names[frame.parentJoint]).parent
            body.add_site(name=name, pos=frame.placement.translation)
        kind, ends = mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtObj.mjOBJ_SITE
        equality = spec.add_equality(type=kind, objtype=ends)
        equality.name1, equality.name2 = closure.frame_a, closure.frame_b
        equality.solref[:] = 2 * step, 1
        equality.solimp[:] = 0.9999, 0.9999, 0.001, 0.5, 2
    spec.option.timestep = step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    twin = spec.compile()
    data = mujoco.MjData(twin)
    for name, push in zip(robot.mechanism.actuated, pushes, strict=True):
        data.qfrc_applied[twin.joint(name).dofadr[0]] = push
    return mujoco, twin, data


def test_mujoco_comes_to_the_same_motion_as_its_steps_shrink() -> None:
    """Its soft loops give way by less and less; the limit is ours."""
    robot = heavy_rps()
    mechanism, duration, pushes = robot.mechanism, 0.2, np.array([2.0, 3.5, 2.5])
    q, v, _ = robot.state([0.41, 0.1, -0.05], [0.1, 0.3, -0.2], [0, 0, 0])
    motion = simulate(mechanism, q, v, duration=duration, tau=pushes)
    joints = list(zip(mechanism.model.names, mechanism.model.joints, strict=True))[1:]
    apart = []
    for step in (1e-3, 2e-4):
        mujoco, twin, data = in_mujoco(robot, pushes, step)
        legs = [
            (
                one.idx_q,
                one.idx_v,
                int(twin.joint(name).qposadr[0]),
                int(twin.joint(name).dofadr[0]),
            )
            for name, one in joints
            if one.nq == 1
        ]
        platform = twin.joint("platform_free")
        place, dof = int(platform.qposadr[0]), int(platform.dofadr[0])
        free = mechanism.model.joints[mechanism.model.getJointId("platform_free")]
        at, moving = q[free.idx_q :][:7], v[free.idx_v :][:6]
        data.qpos[place : place + 7] = at[[0, 1, 2, 6, 3, 4, 5]]
        data.qvel[dof : dof + 3] = Rotation.from_quat(at[3:]).apply(moving[:3])
        data.qvel[dof + 3 : dof + 6] = moving[3:]
        for i, j, k, m in legs:
            data.qpos[k], data.qvel[m] = q[i], v[j]
        for _ in range(round(duration / step)):
            mujoco.mj_step(twin, data)
        there = [data.qpos[k] for _, _, k, _ in legs]
        apart.append(np.abs(there - motion.q[-1, [i for i, *_ in legs]]).max())
    moved = np.abs(motion.q[-1] - q).max()
    assert moved > 0.05
    assert apart[1] < apart[0] / 5
    assert apart[1] < 1e-7 * moved


# What drives it -----------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["rk4", "adaptive"])
def test_a_controller_is_asked_once_a_step_and_its_answer_is_held(method: str) -> None:
    mechanism = sprung_rps()
    q, v = tossed_rps()
    asked: list[tuple[float, Array, Array]] = []

    def controller(t: float, q: Array, v: Array) -> list[float]:
        asked.append((t, q.copy(), v.copy()))
        q[:] = np.nan  # its own copies
        return [t, 1.0, -t]

    motion = simulate(
        mechanism, q, v, duration=0.05, step=0.01, method=method, controller=controller
    )
    np.testing.assert_allclose([t for t, *_ in asked], np.arange(6) * 0.01)
    np.testing.assert_array_equal([q for _, q, _ in asked], motion.q)
    np.testing.assert_array_equal(motion.tau, [[t, 1.0, -t] for t in motion.time])
    # Held: each interval alone is a motion under its constant force.
    alone = simulate(
        mechanism, motion.q[3], motion.v[3], duration=0.01, tau=motion.tau[3], method="adaptive"
    )
    tolerance = 1e-6 if method == "rk4" else 1e-10
    np.testing.assert_allclose(alone.q[-1], motion.q[4], atol=tolerance)
    for k, (q, v) in enumerate(zip(motion.q, motion.v, strict=True)):
        expected = mechanism.forward_dynamics(q, v, motion.tau[k])
        np.testing.assert_allclose(motion.a[k], expected, atol=1e-9)


def test_a_controller_that_cancels_gravity_holds_the_robot_still() -> None:
    preset = RPSRobot.from_preset("sokolov")
    q = preset.state([0.4, 0.1, 0.2], [0, 0, 0], [0, 0, 0])[0]
    hold = preset.mechanism.gravity_forces(q)
    motion = simulate(preset.mechanism, q, duration=0.2, controller=lambda t, q, v: hold)
    np.testing.assert_allclose(motion.q[-1], q, atol=1e-12)


@pytest.mark.parametrize("function", [False, True])
def test_a_wrench_moves_it_as_a_weight_does(function: bool) -> None:
    """A weightless four-bar under the bars' weights as wrenches, against one with gravity."""
    heavy, q, v = turning_four_bar()
    model = pin.Model(heavy.model)
    model.gravity.linear = np.zeros(3)
    bars = {"crank": FOUR_BAR.crank, "coupler": FOUR_BAR.coupler, "rocker": FOUR_BAR.rocker}
    wrenches = {}
    for name, bar in bars.items():
        at = pin.SE3(np.eye(3), np.array([bar.along, 0.0, bar.across]))
        body = model.frames[model.getFrameId(name)]
        model.addFrame(
            pin.Frame(f"{name}_com", body.parentJoint, body.placement * at, pin.FrameType.OP_FRAME)
        )
        wrenches[f"{name}_com"] = [0, 0, -bar.mass * GRAVITY, 0, 0, 0]
    weightless = ClosedLoopModel(model, heavy.closures, heavy.actuated)
    given: Any = (lambda t, q, v: wrenches) if function else wrenches
    expected = simulate(heavy, q, v, duration=0.3, forces=True)
    found = simulate(weightless, q, v, duration=0.3, wrenches=given, forces=True)
    np.testing.assert_allclose(found.q, expected.q, atol=1e-11)
    np.testing.assert_allclose(found.constraint_forces, expected.constraint_forces, atol=1e-9)


def test_a_force_that_changes_in_time_is_felt_at_the_stages() -> None:
    """A slider under cos(w t): its velocity is its integral, to far beyond a held force."""
    urdf = robot(
        link("sled", 2.0, inertia=0.1),
        link("tip"),
        joint("prismatic", "base", "sled", axis="1 0 0"),
        joint("fixed", "sled", "tip"),
    )
    closure = LoopClosure("universe", "tip", "point_on_line", axis=(1, 0, 0))
    mechanism = ClosedLoopModel.from_urdf(urdf, [closure], ["sled_joint"])

    def push(t: float, q: Array, v: Array) -> dict[str, list[float]]:
        return {"sled": [np.cos(7 * t), 0, 0, 0, 0, 0]}

    motion = simulate(mechanism, [0.0], duration=1.0, step=0.01, wrenches=push)
    np.testing.assert_allclose(motion.v[:, 0], np.sin(7 * motion.time) / 14, atol=1e-8)


# Records ------------------------------------------------------------------------------------------


def test_records_may_be_thinned_and_always_hold_the_end() -> None:
    mechanism, q, v = turning_four_bar()
    every = simulate(mechanism, q, v, duration=0.0235)
    some = simulate(mechanism, q, v, duration=0.0235, record_every=10)
    assert every.time.shape == (25,)
    np.testing.assert_array_equal(some.time, [0.0, 0.01, 0.02, 0.0235])
    np.testing.assert_array_equal(some.q, every.q[[0, 10, 20, 24]])
    assert some.constraint_forces is None


def test_constraint_forces_are_those_of_inverse_dynamics() -> None:
    mechanism = sprung_rps()
    q, v = tossed_rps()
    motion = simulate(mechanism, q, v, duration=0.01, tau=[1.0, 2.0, 3.0], forces=True)
    assert motion.constraint_forces is not None
    for k in range(len(motion.time)):
        inverse = mechanism.inverse_dynamics(motion.q[k], motion.v[k], motion.a[k])
        np.testing.assert_allclose(inverse.tau, [1.0, 2.0, 3.0], atol=1e-9)
        np.testing.assert_allclose(
            motion.constraint_forces[k], inverse.constraint_forces, atol=1e-9
        )


def test_energies_are_the_model_s() -> None:
    mechanism = sprung_rps()
    q, v = tossed_rps()
    motion = simulate(mechanism, q, v, duration=0.01)
    expected = [mechanism.energy(q, v) for q, v in zip(motion.q, motion.v, strict=True)]
    np.testing.assert_allclose(np.transpose([motion.kinetic, motion.potential]), expected)


def test_leaving_joint_limits_is_told_and_not_prevented() -> None:
    mechanism, q, v = turning_four_bar()
    motion = simulate(mechanism, q, v, duration=3.0, step=2e-3, record_every=100)
    passed = {one.joint: one for one in motion.limits_passed}
    assert motion.limits_passed[0].joint == "crank_joint"
    first = passed["crank_joint"]
    assert first.lower == -9
    assert 9 < first.value < 9.1 == first.upper + 0.1
    before = simulate(mechanism, q, v, duration=first.time - 2e-3, step=2e-3)
    assert before.limits_passed == ()
    assert before.q[-1, 0] <= 9
    assert motion.q[-1, 0] > 9
    assert "'crank_joint' left its limits -9 to 9 at t = 2." in str(first)


@pytest.mark.parametrize("forces", [False, True])
def test_tables_read_back_as_they_were(tmp_path: Path, forces: bool) -> None:
    mechanism = sprung_rps()
    q, v = tossed_rps()
    motion = simulate(mechanism, q, v, duration=0.005, forces=forces)
    motion.to_csv(tmp_path / "motion.csv")
    motion.to_npz(tmp_path / "motion.npz")
    with (tmp_path / "motion.csv").open(newline="") as stream:
        heading, *rows = csv.reader(stream)
    table = np.array(rows, dtype=float)
    assert heading[:3] == ["time", "q_leg_1_revolute", "q_leg_1_prismatic"]
    assert heading.count("tau_leg_2_prismatic") == 1
    assert len(set(heading)) == len(heading) == 1 + 13 + 12 + 12 + 3 + 4 + 9 * forces
    np.testing.assert_array_equal(table[:, heading.index("q_platform_free_2")], motion.q[:, 8])
    np.testing.assert_array_equal(table[:, heading.index("a_platform_free_5")], motion.a[:, 11])
    np.testing.assert_array_equal(table[:, heading.index("gap")], motion.gap)
    with np.load(tmp_path / "motion.npz") as stored:
        assert ("constraint_forces" in stored) is forces
        for name in ("time", "q", "v", "a", "tau", "kinetic", "potential", "gap", "work"):
            np.testing.assert_array_equal(stored[name], getattr(motion, name))
        assert tuple(stored["v_names"]) == motion.v_names
    assert sorted(path.name for path in tmp_path.iterdir()) == ["motion.csv", "motion.npz"]


def test_progress_grows_from_something_to_one() -> None:
    mechanism, q, v = turning_four_bar()
    seen: list[float] = []
    simulate(mechanism, q, v, duration=0.5, progress=seen.append)
    assert 150 < len(seen) <= 201
    assert seen == sorted(seen)
    assert seen[0] < 0.01
    assert seen[-1] == 1


# What goes wrong ----------------------------------------------------------------------------------


def test_open_loops_are_refused_with_their_gap_and_what_closes_them() -> None:
    mechanism, q, v = turning_four_bar()
    q[0] += 1e-6
    gap = mechanism.loop_gap(q)
    with pytest.raises(ClosureError, match=rf"open by {gap:.3g} m .* close\(\)") as caught:
        simulate(mechanism, q, v, duration=1.0)
    assert caught.value.gap == gap


def test_a_velocity_that_opens_the_loops_is_refused() -> None:
    mechanism, q, v = turning_four_bar()
    with pytest.raises(ClosureError, match=r"opens the loops at 0\.\d+ m/s .* velocity\(\)"):
        simulate(mechanism, q, v + np.eye(3)[0], duration=1.0)


def test_what_rounding_left_open_is_closed_before_the_start() -> None:
    for mechanism, q, v in (turning_four_bar(True), bennett()):
        nearly = q + 1e-10
        motion = simulate(mechanism, nearly, v, duration=0.01)
        assert widest(mechanism, motion) <= 1e-12
        np.testing.assert_allclose(motion.q[0], q, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"duration": 0.0}, "duration = 0.0"),
        ({"duration": np.nan}, "duration = nan"),
        ({"step": -1e-3}, "step = -0.001"),
        ({"tolerance": 0.0}, "tolerance = 0.0"),
        ({"baumgarte_gain": np.inf}, "baumgarte_gain = inf"),
        ({"record_every": 0}, "record_every = 0"),
        ({"method": "euler"}, "'euler': it must be 'rk4' or 'adaptive'"),
        ({"closing": "glue"}, "'glue': it must be 'projection' or 'baumgarte'"),
        ({"tau": [1.0, 2.0]}, r"tau has shape \(2,\); it must be \(1,\)"),
        ({"tau": [1.0], "controller": lambda t, q, v: [0.0]}, "not both"),
        ({"v": [1.0]}, r"v has shape \(1,\)"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(options: dict[str, Any], said: str) -> None:
    mechanism, q, v = turning_four_bar()
    arguments: dict[str, Any] = {"v": v, "duration": 1.0} | options
    with pytest.raises(InputError, match=said):
        simulate(mechanism, q, **arguments)


@pytest.mark.parametrize("bad", [[np.nan], [0.0, 1.0], "fast", None])
@pytest.mark.parametrize("method", ["rk4", "adaptive"])
def test_a_bad_answer_of_the_controller_is_refused_with_its_time(bad: Any, method: str) -> None:
    mechanism, q, v = turning_four_bar()
    with pytest.raises(InputError, match=r"at t = 0\.007 s: the controller's tau") as caught:
        simulate(
            mechanism,
            q,
            v,
            duration=1.0,
            method=method,
            controller=lambda t, q, v: bad if t > 0.0065 else [0.0],
        )
    np.testing.assert_allclose(caught.value.partial.time, np.arange(7) * 1e-3)


@pytest.mark.parametrize("kind", [KeyboardInterrupt, ZeroDivisionError])
def test_what_interrupts_it_leaves_what_was_done(kind: type[BaseException]) -> None:
    mechanism, q, v = turning_four_bar()

    def controller(t: float, q: Array, v: Array) -> list[float]:
        if t > 0.0495:
            raise kind("stop")
        return [0.0]

    with pytest.raises(kind, match=r"^stop$") as caught:
        simulate(mechanism, q, v, duration=1.0, controller=controller)
    partial = caught.value.partial
    whole = simulate(mechanism, q, v, duration=0.05)
    np.testing.assert_array_equal(partial.q, whole.q[:-1])


@pytest.mark.parametrize(
    ("method", "closing"),
    [("rk4", "projection"), ("rk4", "baumgarte"), ("adaptive", "projection")],
)
def test_a_motion_without_bounds_ends_in_words(method: str, closing: str) -> None:
    mechanism = sprung_rps()
    q, v = tossed_rps()
    with pytest.raises((SingularityError, ClosureError), match=r"^at t = 0\.\d+ s: ") as caught:
        simulate(
            mechanism,
            q,
            v,
            duration=1.0,
            step=0.01,
            method=method,
            closing=closing,
            controller=lambda t, q, v: 20 * v[mechanism.actuated_indices],
            tolerance=1e-6,
        )
    partial = caught.value.partial
    assert len(partial.time) > 2
    assert np.isfinite(partial.q).all()
    assert np.isfinite(partial.energy).all()


def test_a_motion_that_moves_no_mass_is_refused() -> None:
    urdf = robot(link("bar", 1.0, inertia=0.1), link("flag"), joint("revolute", "base", "bar"))
    urdf = urdf.replace("</robot>", joint("revolute", "bar", "flag") + "</robot>")
    closure = LoopClosure("universe", "bar", "point_on_plane", axis=(0, 1, 0))
    mechanism = ClosedLoopModel.from_urdf(urdf, [closure], ["bar_joint"])
    with pytest.raises(SingularityError, match=r"at t = 0 s: .* moves no mass") as caught:
        simulate(mechanism, np.zeros(2), duration=1.0)
    assert caught.value.partial.q.shape == (0, 2)


def test_the_loss_of_a_row_is_told() -> None:
    """A parallelogram's rows become dependent where its bars come to lie in a line."""
    urdf = robot(
        link("left", 1.0, "0.1 0 0", 0.01),
        link("top", 1.0, "0.2 0 0", 0.01),
        link("right", 1.0, "0.1 0 0", 0.01),
        link("top_tip"),
        link("right_tip"),
        joint("revolute", "base", "left"),
        joint("revolute", "left", "top", "0.2 0 0"),
        joint("revolute", "base", "right", "0.4 0 0"),
        joint("fixed", "top", "top_tip", "0.4 0 0"),
        joint("fixed", "right", "right_tip", "0.2 0 0"),
    )
    closure = LoopClosure("top_tip", "right_tip", name="tips")
    mechanism = ClosedLoopModel.from_urdf(urdf, [closure], ["left_joint"], gravity=(0, 0, 0))
    start = -1.0
    q = np.array([start, -start, start])
    manifold = ClosedManifold(mechanism.system, q)
    flat = np.zeros(3)
    with pytest.raises(SingularityError, match="do not determine the motion"):
        manifold.acceleration(flat, np.zeros(3), np.zeros(1), None)
    with pytest.raises(SingularityError, match="had 2 independent rows and have 1"):
        manifold.renew(flat)
    # At a constant rate it comes exactly there, to rounding, after ten steps.
    v = mechanism.velocity(q, [1.0])
    with pytest.raises(SingularityError, match=r"^at t = 1 s|^at t = 0.9 s"):
        simulate(mechanism, q, v, duration=2.0, step=0.1)

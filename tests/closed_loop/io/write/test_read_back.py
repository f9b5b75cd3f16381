"""MuJoCo files that are written, read again: the same mechanism, and MuJoCo's own numbers.

States are random and their loops open, so that every coordinate and every row counts.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, JointCoupling, JointEffects, LoopClosure
from tests.closed_loop.random_mechanisms import case, random_inertia, random_placement
from tests.worst import worst

Array = NDArray[np.float64]
URDF = Path(__file__).resolve().parents[4] / "urdf"
#: The paper's rods have no mass, and MuJoCo has no closure of a slider: its body is cut.
APART = ("rps", "slider_crank")
PACKAGE = sorted(path.stem for path in URDF.glob("*.yaml") if path.stem not in APART)
JOINTS = ["revolute"] * 3 + ["prismatic", "ball", "translation", "universal", "zyx"]
#: Of one coordinate, so that each may have an effect of its own.
SINGLE = ["revolute"] * 3 + ["prismatic", "translation", "universal", "zyx"]
KINDS = ["spherical", "rigid", "distance", "coupling", "polynomial", "differential"]
ARRAYS = ("damping", "friction", "stiffness", "rest")
LIMITS = ("lowerPositionLimit", "upperPositionLimit")


def random_state(mechanism: ClosedLoopModel, rng: np.random.Generator) -> tuple[Array, ...]:
    model = mechanism.model
    v, a = rng.normal(size=(2, model.nv))
    return pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv)), v, a


def smooth_force(mechanism: ClosedLoopModel, q: Array, v: Array, a: Array) -> Array:
    """All but dry friction, whose law is not in the file."""
    model, effects = mechanism.model, mechanism.effects
    force = pin.rnea(model, model.createData(), q, v, a)  # of bodies and rotors
    return np.asarray(force - passive(model, effects, q, v))


def passive(model: pin.Model, effects: JointEffects | None, q: Array, v: Array) -> Array:
    force = np.zeros(model.nv)
    if effects is not None:
        force -= effects.damping * v
        for joint in list(model.joints)[1:]:
            if joint.nq == joint.nv:
                k, own = (slice(i, i + joint.nv) for i in (joint.idx_v, joint.idx_q))
                force[k] -= effects.stiffness[k] * (q[own] - effects.rest[k])
    return force


def assert_read_back(mechanism: ClosedLoopModel, path: Path, scale: float = 1.0) -> None:
    back = ClosedLoopModel.from_mjcf(path)
    one, other = mechanism.model, back.model
    assert (one.nq, one.nv) == (other.nq, other.nv)
    assert np.array_equal(mechanism.actuated_indices, back.actuated_indices)
    assert worst(mechanism.home - back.home) < 1e-12
    rng = np.random.default_rng(0)
    for _ in range(3):
        q, v, a = random_state(mechanism, rng)
        force = smooth_force(mechanism, q, v, a)
        assert worst(force - smooth_force(back, q, v, a)) < 1e-12 * (scale + np.abs(force).max())
        assert_same_rows(mechanism, back, q)
    for name in LIMITS:
        plain = np.abs(getattr(one, name)) < 1e10
        plain &= np.isin(np.arange(one.nq), [j.idx_q for j in one.joints if j.nq == j.nv == 1])
        assert np.array_equal(getattr(one, name)[plain], getattr(other, name)[plain])
    driven = mechanism.actuated_indices
    for name in ("lowerEffortLimit", "upperEffortLimit"):
        plain = driven[np.abs(getattr(one, name)[driven]) < 1e10]
        assert np.array_equal(getattr(one, name)[plain], getattr(other, name)[plain])
    for name in ARRAYS:
        given, found = (
            np.zeros(one.nv) if m.effects is None else getattr(m.effects, name)
            for m in (mechanism, back)
        )
        if name == "rest" and mechanism.effects is not None:
            given = np.where(mechanism.effects.stiffness > 0, given, 0)
        assert worst(given - found) < 1e-14, name


def assert_same_rows(mechanism: ClosedLoopModel, back: ClosedLoopModel, q: Array) -> None:
    """Rows by the closures' names; those of a hinge are other rows, with the same row space."""
    gaps, found = mechanism.loop_errors(q).position, back.loop_errors(q).position
    rows, read = mechanism.jacobian(q), back.jacobian(q)
    names = [closure.name for closure in back.closures]
    for closure in mechanism.closures:
        if isinstance(closure, LoopClosure) and closure.kind == "revolute":
            continue
        name = closure.name
        if name not in names:  # that of a tendon
            assert isinstance(closure, JointCoupling)
            name = f"{closure.joint}:length"
        here, there = mechanism.rows(closure.name), back.rows(name)
        sign = 1.0
        if isinstance(closure, JointCoupling):  # solved for another of its joints, perhaps
            k = np.argmax(np.abs(rows[here]))
            sign = rows[here].ravel()[k] / read[there].ravel()[k]
        assert worst(gaps[here] - sign * found[there]) < 1e-12
        assert worst(rows[here] - sign * read[there]) < 1e-12


def assert_is_in_mujoco(mechanism: ClosedLoopModel, path: Path) -> None:
    """mj_fullM, qfrc_bias, qfrc_passive and efc_pos at random states."""
    there = mujoco.MjModel.from_xml_path(str(path))
    there.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    there.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    data, model = mujoco.MjData(there), mechanism.model
    assert there.nv == model.nv
    rng = np.random.default_rng(3)
    for _ in range(3):
        q, v, _ = random_state(mechanism, rng)
        data.qpos[:] = q
        for joint in list(model.joints)[1:]:
            if joint.shortname() == "JointModelSpherical":
                data.qpos[joint.idx_q : joint.idx_q + 4] = np.roll(q[joint.idx_q :][:4], 1)
        data.qvel[:] = v
        mujoco.mj_forward(there, data)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(there, data, mass)
        own = np.triu(pin.crba(model, model.createData(), q))
        own += np.triu(own, 1).T
        assert worst(mass - own) < 1e-12 * np.abs(own).max()
        bias = pin.rnea(model, model.createData(), q, v, np.zeros(model.nv))
        assert worst(data.qfrc_bias - bias) < 1e-12 * (1 + np.abs(bias).max())
        losses = passive(model, mechanism.effects, q, v)
        assert worst(data.qfrc_passive - losses) < 1e-12 * (1 + np.abs(losses).max())
        gaps, at = mechanism.loop_errors(q).position, 0
        for closure in mechanism.closures:
            kind = closure.kind if isinstance(closure, LoopClosure) else "coupling"
            size = {"rigid": 6, "spherical": 3, "revolute": 6}.get(kind, 1)
            own_gap = gaps[mechanism.rows(closure.name)]
            if size > 1:  # in other axes, and MuJoCo's angles of a weld have another measure
                own_gap, gap = own_gap[:3], data.efc_pos[at : at + 3]
            else:
                gap = data.efc_pos[at : at + 1]
            assert np.linalg.norm(gap) == pytest.approx(np.linalg.norm(own_gap), abs=1e-12)
            at += size


@pytest.mark.parametrize("name", PACKAGE)
def test_mechanisms_of_the_package(name: str, tmp_path: Path) -> None:
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    path = mechanism.to_mjcf(tmp_path / "m.xml")
    assert_read_back(mechanism, path)
    floats = any(joint.shortname() == "JointModelFreeFlyer" for joint in mechanism.model.joints)
    if not floats and name != "gripper":  # other velocities; a tendon that is a slide here
        assert_is_in_mujoco(mechanism, path)


def random_mechanism(seed: int, **options: object) -> ClosedLoopModel:
    """Without polynomials of fifth degree."""
    while True:
        mechanism = case(seed, **options).mechanism  # type: ignore[arg-type]
        curves = [c.terms for c in mechanism.closures if isinstance(c, JointCoupling)]
        if all(len(term) < 5 for terms in curves for term in terms):
            return mechanism
        seed += 100


@pytest.mark.parametrize("seed", range(8))
def test_random_mechanisms(seed: int, tmp_path: Path) -> None:
    mechanism = random_mechanism(seed, kinds=KINDS[seed % 6 :] + KINDS[: seed % 6], joints=JOINTS)
    path = mechanism.to_mjcf(tmp_path / "m.xml")
    assert_read_back(mechanism, path)
    assert_is_in_mujoco(mechanism, path)


@pytest.mark.parametrize("seed", range(6))
def test_random_mechanisms_with_losses_springs_and_rotors(seed: int, tmp_path: Path) -> None:
    mechanism = random_mechanism(seed, kinds=KINDS, joints=SINGLE, effects=True, armature=True)
    path = mechanism.to_mjcf(tmp_path / "m.xml")
    assert_read_back(mechanism, path)
    assert_is_in_mujoco(mechanism, path)


def with_tendon(offset: float = 0.0) -> ClosedLoopModel:
    """Three joints, and a slide without mass whose coordinate is a sum of two of theirs."""
    rng = np.random.default_rng(6)
    model = pin.Model()
    for index, joint in enumerate((pin.JointModelRX(), pin.JointModelRY(), pin.JointModelPZ())):
        model.addJoint(index, joint, random_placement(rng), f"joint_{index}")
        model.appendBodyToJoint(index + 1, random_inertia(rng), pin.SE3.Identity())
    model.addJoint(0, pin.JointModelPX(), random_placement(rng), "pull")
    model.lowerPositionLimit[:], model.upperPositionLimit[:] = -np.inf, np.inf
    model.lowerPositionLimit[3], model.upperPositionLimit[3] = -3.0, 4.0
    model.lowerEffortLimit[:], model.upperEffortLimit[:] = -np.inf, np.inf
    model.lowerEffortLimit[3], model.upperEffortLimit[3] = -5.0, 6.0
    model.armature = np.array([0.1, 0.0, 0.0, 0.7])
    ratios = {"joint_0": 0.3, "joint_2": -2.0}
    tie = JointCoupling("pull", ratios, offset=offset, name="tie")
    effects = JointEffects.named(
        model,
        damping={"pull": 0.8, "joint_1": 0.2},
        stiffness={"pull": 3.0},
        rest={"pull": 0.25},
        friction={"pull": 0.1},
    )
    return ClosedLoopModel(model, [tie], ["joint_1", "pull"], effects=effects)


def test_a_tendon_is_read_back_as_the_slide_it_was(tmp_path: Path) -> None:
    mechanism = with_tendon()
    path = mechanism.to_mjcf(tmp_path / "m.xml")
    there = mujoco.MjModel.from_xml_path(str(path))
    assert (there.nv, there.ntendon, there.neq, there.nu) == (3, 1, 0, 2)
    assert_read_back(mechanism, path)


@pytest.mark.parametrize("offset", [0.0, 0.4, 1.25])
def test_a_tendon_acts_as_the_slide_does(offset: float, tmp_path: Path) -> None:
    """Accelerations under the motors' forces, with the spring, damper and rotor of the tendon."""
    mechanism = with_tendon(offset)
    there = mujoco.MjModel.from_xml_path(str(mechanism.to_mjcf(tmp_path / "m.xml")))
    there.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    data, rng = mujoco.MjData(there), np.random.default_rng(1)
    effects = mechanism.effects
    assert effects is not None
    smooth = JointEffects(
        effects.damping, 0 * effects.friction, effects.stiffness, effects.rest, 1.0
    )
    plain = ClosedLoopModel(mechanism.model, mechanism.closures, mechanism.actuated, effects=smooth)
    u, rate, tau = rng.normal(size=(3, 3))
    q = np.append(u, offset + 0.3 * u[0] - 2.0 * u[2])
    v = np.append(rate, 0.3 * rate[0] - 2.0 * rate[2])
    data.qpos[:], data.qvel[:], data.ctrl[:] = u, rate, tau[:2]
    mujoco.mj_forward(there, data)
    found = plain.forward_dynamics(q, v, tau[:2])[:3]
    assert worst(found - data.qacc) < 1e-9 * (1 + np.abs(found).max())

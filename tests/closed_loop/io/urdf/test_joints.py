"""Joints of URDF files: their types, limits and losses, against MuJoCo and closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, JointCoupling, JointEffects, LoopClosure, MechanismError
from rps_pin.closed_loop.io.urdf import model_from_urdf, parts_from_urdf
from tests.closed_loop.io.urdf.texts import body, joint, link, robot
from tests.each import each

ARM = (link("base"), link("arm", 1.0, "0.5 0 0"))


def arm(kind: str = "revolute", **options) -> str:
    return robot(*ARM, joint("j", kind, "base", "arm", **options))


# Limits -------------------------------------------------------------------------------------------


@each(
    ("limit", "lower", "upper", "note"),
    [
        ('lower="-1" upper="2" effort="3" velocity="4"', -1, 2, None),
        ('effort="3" velocity="4"', -math.inf, math.inf, "no position limits: 'j' (line 1)"),
        (None, -math.inf, math.inf, "no position limits: 'j' (line 1)"),
        ('lower="0" upper="0" effort="3" velocity="4"', -math.inf, math.inf, "are 0, taken as no"),
        ('lower="-1" effort="3" velocity="4"', -1, 0, "without upper, which is 0"),
        ('upper="1" effort="3" velocity="4"', 0, 1, "without lower, which is 0"),
        ('lower="-1" upper="2"', -1, 2, None),
    ],
)
def test_limits_are_those_of_mujoco(
    limit: str | None, lower: float, upper: float, note: str
) -> None:
    text = arm(limit=limit)
    parts = parts_from_urdf(text)
    bounds = (parts.model.lowerPositionLimit[0], parts.model.upperPositionLimit[0])
    assert bounds == (lower, upper)
    theirs = mujoco.MjModel.from_xml_string(text)
    if "without" not in (note or ""):  # one alone is no limit in MuJoCo, and urdfdom's 0 here
        assert theirs.jnt_limited[0] == math.isfinite(lower)
        assert tuple(theirs.jnt_range[0]) == (bounds if math.isfinite(lower) else (0, 0))
    assert bool(parts.notes) == (note is not None)
    assert (note or "") in " ".join(parts.notes)
    given = limit is not None and "effort" in limit
    assert parts.model.upperEffortLimit[0] == (3 if given else math.inf)
    assert parts.model.lowerVelocityLimit[0] == (-4 if given else -math.inf)


def test_effort_and_velocity_of_zero_are_no_limits() -> None:
    parts = parts_from_urdf(arm(limit='lower="-1" upper="1" effort="0" velocity="0"'))
    assert parts.model.upperEffortLimit[0] == parts.model.upperVelocityLimit[0] == math.inf
    assert len(parts.notes) == 2


def test_equal_limits_hold_a_joint_and_are_told() -> None:
    parts = parts_from_urdf(arm(limit='lower="0.3" upper="0.3" effort="1" velocity="1"'))
    assert parts.model.upperPositionLimit[0] == 0.3
    assert "joints that are held" in parts.notes[0]


def test_infinite_limits_are_none() -> None:
    model = model_from_urdf(arm(limit='lower="-inf" upper="INF" effort="inf" velocity="1"'))
    assert (model.lowerPositionLimit[0], model.upperPositionLimit[0]) == (-math.inf, math.inf)


@each(
    ("text", "why"),
    [
        (arm(limit='lower="1" upper="-1" effort="1" velocity="1"'), "lower = 1 is above upper"),
        (arm(limit='lower="0.5" effort="1" velocity="1"'), "lower = 0.5 is above upper = 0"),
        (arm(limit='lower="-1" upper="1" effort="-1"'), "limit effort = -1 is negative"),
        (arm(limit='lower="nan" upper="1" effort="1"'), "limit lower = 'nan' must be a finite"),
        (arm(axis="0 0 0"), "axis xyz = '0 0 0' is no direction"),
        (arm(axis="0 1e-9 0"), "axis xyz = '0 1e-9 0' is no direction"),
        (arm(more='<dynamics damping="-1"/>'), "dynamics damping = -1 is negative"),
        (arm(more='<dynamics friction="-1"/>'), "dynamics friction = -1 is negative"),
        (arm(more="<limit/>"), "<joint> has a second <limit>"),
        (arm(kind="ball"), "no type 'ball'; there are: revolute"),
    ],
)
def test_impossible_joints_are_refused_with_their_line(text: str, why: str) -> None:
    with pytest.raises(MechanismError, match="line 1: ") as caught:
        model_from_urdf(text)
    assert why in str(caught.value)


def test_an_axis_need_not_be_of_unit_length() -> None:
    """A pendulum about 0 2 0: tau = I a - m g l."""
    mechanism = ClosedLoopModel.from_urdf(arm(axis="0 2 0"), [], ["j"])
    tau = mechanism.inverse_dynamics(np.zeros(1), np.zeros(1), np.ones(1)).tau
    assert tau[0] == pytest.approx(1e-3 + 0.25 - 9.81 * 0.5, rel=1e-12)


def test_position_limits_can_be_ignored() -> None:
    text = arm(limit='lower="1" upper="2" effort="1" velocity="1"')
    mechanism = ClosedLoopModel.from_urdf(text, [], ["j"], within_limits=False)
    assert mechanism.complete([-3.0])[0] == -3.0
    assert "position limits are ignored" in str(mechanism.describe())


def test_limits_name_each_joint_once() -> None:
    held = 'lower="0.3" upper="0.3" effort="1" velocity="1"'
    text = robot(
        *ARM,
        link("tip"),
        joint("j", "revolute", "base", "arm", limit=held),
        joint("k", "prismatic", "arm", "tip", limit=held),
    )
    mechanism = ClosedLoopModel.from_urdf(text, [JointCoupling("k", "j", 5.0)], ["j"])
    with pytest.raises(Exception, match="'j' at its limit") as caught:
        mechanism.close([0.3, 0.3])
    assert str(caught.value).count("'j'") == 1


# Losses -------------------------------------------------------------------------------------------

LOSSES = arm(more='<dynamics damping="0.7" friction="0.3"/>')
STATE = np.zeros(1), np.full(1, 2.0), np.zeros(1)
WEIGHT = -9.81 * 0.5


def torque(**options) -> float:
    return float(
        ClosedLoopModel.from_urdf(LOSSES, [], ["j"], **options).inverse_dynamics(*STATE).tau[0]
    )


def test_damping_and_friction_count() -> None:
    assert torque() == pytest.approx(WEIGHT + 0.7 * 2 + 0.3, rel=1e-12)


def test_effects_replace_those_of_the_file_joint_by_joint() -> None:
    assert torque(effects={"damping": {"j": 0.0}}) == pytest.approx(WEIGHT + 0.3, rel=1e-12)
    assert torque(effects={"friction": {"j": 0.5}}) == pytest.approx(WEIGHT + 1.9, rel=1e-12)
    spring = {"stiffness": {"j": 2.0}, "rest": {"j": -1.0}}
    assert torque(effects=spring) == pytest.approx(WEIGHT + 1.7 + 2.0, rel=1e-12)
    named = JointEffects.named(model_from_urdf(LOSSES), damping={"j": 1.0})
    assert torque(effects=named) == pytest.approx(WEIGHT + 2.0 + 0.3, rel=1e-12)
    with pytest.raises(Exception, match="effects: no 'dampings'; there are: damping, friction"):
        torque(effects={"dampings": {"j": 0.0}})


def test_a_rotor_of_drake_is_armature() -> None:
    rotor = '<drake:rotor_inertia value="2e-4"/><drake:gear_ratio value="50"/>'
    for text in (
        LOSSES.replace(
            "</robot>",
            f'<transmission name="t"><joint name="j"/><actuator name="m">{rotor}</actuator>'
            "</transmission></robot>",
        ),
        LOSSES.replace("</joint>", f'<actuator name="m">{rotor}</actuator></joint>'),
    ):
        assert model_from_urdf(text).armature[0] == pytest.approx(0.5, rel=1e-12)


# Continuous joints --------------------------------------------------------------------------------

GEARS = robot(
    link("base"),
    body("g1", 1.0, "0 0 0", "1e-3 1e-3 2e-3"),
    body("g2", 1.0, "0 0 0", "3e-3 3e-3 4e-3"),
    joint("pinion", "continuous", "base", "g1", axis="0 0 1"),
    joint("wheel", "continuous", "base", "g2", xyz="0.1 0 0", axis="0 0 1"),
)


def test_continuous_joints_have_one_coordinate_without_limits() -> None:
    parts = parts_from_urdf(GEARS)
    assert (parts.model.nq, mujoco.MjModel.from_xml_string(GEARS).nq) == (2, 2)
    assert np.isinf(parts.model.upperPositionLimit).all()
    assert parts.continuous == {"pinion", "wheel"}
    assert parts.notes == ()


def test_a_gear_of_continuous_joints_turns_as_often_as_asked() -> None:
    mechanism = ClosedLoopModel.from_urdf(
        GEARS, [JointCoupling("wheel", "pinion", -0.5)], ["pinion"]
    )
    q = mechanism.complete({"pinion": 100.0})
    np.testing.assert_allclose(q, [100.0, -50.0], rtol=1e-14)
    tau = mechanism.inverse_dynamics(np.zeros(2), np.zeros(2), np.array([1.0, -0.5])).tau
    assert tau[0] == pytest.approx(2e-3 + 4e-3 * 0.25, rel=1e-12)


def test_springs_act_on_continuous_joints() -> None:
    mechanism = ClosedLoopModel.from_urdf(
        GEARS, [], ["pinion", "wheel"], effects={"stiffness": {"wheel": 3.0}}
    )
    tau = mechanism.inverse_dynamics(np.array([0.0, 7.0]), np.zeros(2), np.zeros(2)).tau
    np.testing.assert_allclose(tau, [0.0, 21.0], atol=1e-14)


def test_loops_of_continuous_joints_close_from_far_away() -> None:
    """A parallelogram: restarts and clipping meet no limits."""
    text = robot(
        link("base"),
        link("crank", 1.0, "0.1 0 0"),
        link("coupler", 1.0, "0.2 0 0"),
        link("rocker", 1.0, "0.1 0 0"),
        link("tip"),
        link("knee"),
        joint("a", "continuous", "base", "crank"),
        joint("b", "continuous", "crank", "coupler", xyz="0.2 0 0"),
        joint("c", "continuous", "base", "rocker", xyz="0.4 0 0"),
        joint("t", "fixed", "coupler", "tip", xyz="0.4 0 0"),
        joint("u", "fixed", "rocker", "knee", xyz="0.2 0 0"),
        '<loop_joint name="l" type="spherical"><link1 link="tip"/><link2 link="knee"/>',
        "</loop_joint>",
    )
    mechanism = ClosedLoopModel.from_urdf(text, [], ["a"])
    for seed in range(10):
        guess = np.random.default_rng(seed).uniform(-9.0, 9.0, 3)
        q = mechanism.close(guess)
        assert mechanism.loop_gap(q) < 1e-12
        described = mechanism.describe(q)
        assert described.mobility == 1
        assert described.joints[0].upper == (math.inf,)


# Several coordinates ------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", ["0 0 1", "0 1 0", "1 0 0", "1 -2 3", "0 0 -1", None])
@pytest.mark.parametrize("tag", ["joint", "drake:joint"])
def test_planar_joints_move_across_their_axis_as_in_mujoco(axis: str | None, tag: str) -> None:
    """x along URDF's own rule if there is no axis; Pinocchio's parser always takes z."""
    text = robot(
        link("base"),
        body("arm", 1.0, "0.1 0.2 0.3", "0.1 0.2 0.25"),
        link("tip", 0.5, "0.1 0 0"),
        joint("j", "planar", "base", "arm", xyz="1 2 3", axis=axis, tag=tag),
        joint("k", "revolute", "arm", "tip", xyz="0.3 0.2 0.1"),
    )
    x, y, angle, bend = 0.3, 0.7, 0.5, -0.4
    model = model_from_urdf(text)
    theirs = mujoco.MjModel.from_xml_string(text.replace("drake:joint", "joint"))
    there = mujoco.MjData(theirs)
    there.qpos[:] = (x, y, angle, bend)
    mujoco.mj_forward(theirs, there)
    data, q = model.createData(), np.array([x, y, math.cos(angle), math.sin(angle), bend])
    pin.framesForwardKinematics(model, data, q)
    for name in ("arm", "tip"):
        here = data.oMf[model.getFrameId(name, pin.FrameType.BODY)].homogeneous
        body_id = mujoco.mj_name2id(theirs, mujoco.mjtObj.mjOBJ_BODY, name)
        np.testing.assert_allclose(here[:3, 3], there.xpos[body_id], atol=1e-12)
        np.testing.assert_allclose(here[:3, :3].ravel(), there.xmat[body_id], atol=1e-12)
    assert pin.computePotentialEnergy(model, data, q) == pytest.approx(
        9.81 * sum(theirs.body_mass * there.xipos[:, 2]), rel=1e-12
    )


#: Placements that Drake 1.51 gives, with joint coordinates q: origin xyz 1 2 3, rpy .1 .2 .3.
DRAKE = {
    "ball": ("", (0.3, 0.4, 0.5)),
    "universal": ("", (0.3, 0.7)),
    "screw": ('<axis xyz="1 2 2"/><drake:screw_thread_pitch value="0.05"/>', (1.3,)),
}


@pytest.mark.parametrize("kind", DRAKE)
def test_joint_types_of_drake(kind: str) -> None:
    """By their definitions: ball, rotations about x then y, a screw of 5 cm a turn."""
    more, angles = DRAKE[kind]
    text = robot(*ARM, joint("j", kind, "base", "arm", axis=None, more=more, tag="drake:joint"))
    model = model_from_urdf(text.replace('xyz="0 0 0"', 'xyz="1 2 3" rpy="0.1 0.2 0.3"', 1))
    turn, shift = np.eye(3), np.zeros(3)
    if kind == "ball":
        turn = pin.rpy.rpyToMatrix(*angles)
        q = pin.Quaternion(turn).coeffs()
    elif kind == "universal":
        turn = pin.exp3(np.array([angles[0], 0, 0])) @ pin.exp3(np.array([0, angles[1], 0]))
        q = np.array(angles)
    else:
        axis = np.array([1.0, 2.0, 2.0]) / 3.0
        turn, shift = pin.exp3(axis * angles[0]), axis * 0.05 * angles[0] / (2 * math.pi)
        q = np.array(angles)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    at = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([1.0, 2.0, 3.0]))
    expected = (at * pin.SE3(turn, shift)).homogeneous
    here = data.oMf[model.getFrameId("arm", pin.FrameType.BODY)].homogeneous
    np.testing.assert_allclose(here, expected, atol=1e-14)
    assert sum(one.mass for one in model.inertias) == 1.0
    if kind == "screw":
        assert not np.isfinite(model.upperPositionLimit).any()


def test_floating_joints_inside_are_free_flyers() -> None:
    mechanism = ClosedLoopModel.from_urdf(arm(kind="floating", axis=None), [], ["j"])
    assert (mechanism.model.nq, mechanism.model.nv) == (7, 6)
    still = np.zeros(6)
    tau = mechanism.inverse_dynamics(mechanism.home, still, still).tau
    np.testing.assert_allclose(tau, [0, 0, 9.81, 0, -9.81 * 0.5, 0], atol=1e-12)


def test_the_root_can_float_in_python() -> None:
    mechanism = ClosedLoopModel.from_urdf(arm(), [], ["j"], root="free")
    assert list(mechanism.model.names)[1:] == ["root_joint", "j"]
    with pytest.raises(MechanismError, match="a free root's joint is called 'root_joint'; rename"):
        ClosedLoopModel.from_urdf(arm().replace('"j"', '"root_joint"'), [], [], root="free")


# Origins ------------------------------------------------------------------------------------------


def test_quaternions_of_urdf_1_1_are_read_everywhere() -> None:
    turn = pin.Quaternion(pin.rpy.rpyToMatrix(0.3, -0.4, 0.5)).coeffs()
    quaternion = " ".join(repr(float(part)) for part in turn)
    text = LOSSES.replace('xyz="0.5 0 0"', 'xyz="0.5 0 0" R').replace('xyz="0 0 0"', "R")
    first = model_from_urdf(text.replace(" R", ' rpy="0.3 -0.4 0.5"'))
    second = model_from_urdf(text.replace(" R", f' quat_xyzw="{quaternion}"'))
    for one, other in (("inertias", "inertias"), ("jointPlacements", "jointPlacements")):
        a, b = getattr(first, one)[1], getattr(second, other)[1]
        assert a.isApprox(b, 1e-14)
    assert not first.jointPlacements[1].isIdentity()
    with pytest.raises(MechanismError, match="rpy or quat_xyzw, not both"):
        model_from_urdf(text.replace(" R", ' rpy="0 0 0" quat_xyzw="0 0 0 1"'))
    with pytest.raises(MechanismError, match="quat_xyzw = '0 0 0 2' is not of length 1"):
        model_from_urdf(text.replace(" R", ' quat_xyzw="0 0 0 2"'))


@pytest.mark.parametrize("seed", range(8))
def test_random_trees_have_mujocos_mass_matrix(seed: int) -> None:
    rng = np.random.default_rng(seed)

    def numbers(size: int, scale: float = 1.0) -> str:
        return " ".join(map(repr, (scale * rng.normal(size=size)).tolist()))

    parts = [link("l0")]
    kinds = ("revolute", "continuous", "prismatic", "fixed")
    for index in range(1, 8):
        a, b, c = np.sort(rng.uniform(0.1, 0.2, 3)).tolist()
        parts.append(body(f"l{index}", rng.uniform(0.5, 2.0), numbers(3, 0.2), f"{a} {b} {c}"))
        one = joint(
            f"j{index}",
            kinds[rng.integers(4)] if index > 1 else "continuous",
            f"l{rng.integers(index)}",
            f"l{index}",
            xyz=numbers(3, 0.5) + f'" rpy="{numbers(3)}',
            axis=numbers(3),
        )
        parts.append(one)
    text = robot(*parts)
    model = model_from_urdf(text)
    theirs = mujoco.MjModel.from_xml_string(text)
    data, there = model.createData(), mujoco.MjData(theirs)
    names = [mujoco.mj_id2name(theirs, mujoco.mjtObj.mjOBJ_JOINT, i) for i in range(theirs.njnt)]
    q, v = rng.uniform(-3, 3, model.nq), rng.normal(size=model.nv)
    order = [model.joints[model.getJointId(name)].idx_q for name in names]
    assert sorted(order) == list(range(model.nq))
    there.qpos[:], there.qvel[:] = q[order], v[order]
    mujoco.mj_forward(theirs, there)
    full = np.zeros((theirs.nv, theirs.nv))
    mujoco.mj_fullM(theirs, there, full)
    mass = pin.crba(model, data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    np.testing.assert_allclose(mass[np.ix_(order, order)], full, atol=1e-12)
    bias = pin.nonLinearEffects(model, data, q, v)
    np.testing.assert_allclose(bias[order], there.qfrc_bias, atol=1e-10)


# As people met them -------------------------------------------------------------------------------


def test_losses_of_a_file_and_of_its_description_are_the_same(tmp_path: Path) -> None:
    """A beam of 1 kg, 0.5 m out, at 2 rad/s: -g m r + 0.7 * 2 + 0.3 = -3.205 N m."""
    (tmp_path / "a.urdf").write_text(LOSSES)
    (tmp_path / "a.yaml").write_text("urdf: a.urdf\nactuated: [j]\n")
    for mechanism in (
        ClosedLoopModel.from_urdf(tmp_path / "a.urdf", [], ["j"]),
        ClosedLoopModel.load(tmp_path / "a.yaml"),
    ):
        assert mechanism.inverse_dynamics(*STATE).tau[0] == pytest.approx(-3.205, rel=1e-12)


def test_a_gripper_whose_fingers_mimic_each_other_balances() -> None:
    """Two fingers of 0.05 kg in opposite directions: gravity cancels, and they weigh 0.1 kg."""
    text = robot(
        link("palm"),
        link("f1", 0.05, "0 0.03 0"),
        link("f2", 0.05, "0 0.03 0"),
        joint("one", "prismatic", "palm", "f1", axis="1 0 0"),
        joint(
            "two",
            "prismatic",
            "palm",
            "f2",
            axis="1 0 0",
            more='<mimic joint="one" multiplier="-1.0" offset="0"/>',
        ),
    )
    gripper = ClosedLoopModel.from_urdf(text, [], ["one"], gravity=(-9.81, 0, 0))
    assert gripper.describe().mobility == 1
    q, still = np.array([0.01, -0.01]), np.zeros(2)
    assert gripper.inverse_dynamics(q, still, still).tau[0] == pytest.approx(0, abs=1e-14)
    tau = gripper.inverse_dynamics(q, still, np.array([1.0, -1.0])).tau
    assert tau[0] == pytest.approx(0.1, rel=1e-12)


def test_a_limit_of_effort_and_velocity_bounds_no_closed_chain_that_floats() -> None:
    """Exported by Onshape: a four-bar on a free root moves in 6 + 1 ways, and has no limits."""
    no_bounds = 'effort="1" velocity="20"'
    text = robot(
        link("ground", 1.0),
        link("crank", 0.2, "0.05 0 0"),
        link("coupler", 0.3, "0.15 0 0"),
        link("rocker", 0.2, "0.1 0 0"),
        link("coupler_end"),
        link("rocker_end"),
        joint("motor", "revolute", "ground", "crank", limit=no_bounds),
        joint("elbow", "revolute", "crank", "coupler", xyz="0.1 0 0", limit=no_bounds),
        joint("swing", "revolute", "ground", "rocker", xyz="0.3 0 0", limit=no_bounds),
        joint("a", "fixed", "coupler", "coupler_end", xyz="0.3 0 0"),
        joint("b", "fixed", "rocker", "rocker_end", xyz="0.2 0 0"),
    )
    pin_ = LoopClosure("coupler_end", "rocker_end", "revolute", axis=(0, 1, 0))
    home = np.array([0, 0, 0, 0, 0, 0, 1, -1.0, 0.6, -1.6])
    for root, mobility in (("free", 7), ("fixed", 1)):
        start = home if root == "free" else home[7:]
        found = ClosedLoopModel.from_urdf(text, [pin_], ["motor"], root=root, home=start)
        assert found.describe().mobility == mobility
        assert found.loop_gap(found.home) < 1e-9

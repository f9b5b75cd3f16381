"""Joints of other types: the tree that is built with these joints from the start."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, InputError, JointCoupling, JointEffects, MechanismError
from rps_pin.closed_loop import replace_joints
from rps_pin.closed_loop.editing.replace import JOINT_KINDS, replaced_configuration
from tests.closed_loop.mechanisms import FOUR_BAR, joint, link, robot
from tests.closed_loop.random_mechanisms import random_inertia, random_placement, unit
from tests.worst import worst

Array = NDArray[np.float64]
X, Y, Z = np.eye(3)

MADE = {
    "spherical": pin.JointModelSpherical(),
    "free": pin.JointModelFreeFlyer(),
    "planar": pin.JointModelPlanar(),
    "translation": pin.JointModelTranslation(),
    "universal_xy": pin.JointModelUniversal(X, Y),
    "universal_zx": pin.JointModelUniversal(Z, X),
    "revolute_y": pin.JointModelRY(),
    "prismatic_z": pin.JointModelPZ(),
}


def tree(middle: object, seed: int = 0) -> pin.Model:
    """A chain of three joints and a branch; the second joint is given, all else is the same."""
    rng = np.random.default_rng(seed)
    model = pin.Model()
    model.name = "tree"
    model.gravity.linear = 9.81 * unit(rng)
    kinds = [pin.JointModelRX(), middle, pin.JointModelPY(), pin.JointModelSpherical()]
    for k, (kind, parent) in enumerate(zip(kinds, [0, 1, 2, 1], strict=True)):
        made = model.addJoint(parent, kind, random_placement(rng), f"j{k}")
        model.addJointFrame(made)
        model.appendBodyToJoint(made, random_inertia(rng), pin.SE3.Identity())
        frame = pin.Frame(f"body_{k}", made, 0, random_placement(rng), pin.FrameType.BODY)
        model.addFrame(frame)
    for name in ("armature", "upperEffortLimit", "upperVelocityLimit", "lowerPositionLimit"):
        values = getattr(model, name)
        for k in (0, 2, 3):
            one = model.joints[model.getJointId(f"j{k}")]
            start = one.idx_q if name == "lowerPositionLimit" else one.idx_v
            values[start : start + 1] = 0.1 * k + 0.3
        setattr(model, name, values)
    return model


@pytest.mark.parametrize("kind", MADE)
def test_the_model_is_that_of_a_tree_built_with_the_new_joint(kind: str) -> None:
    wanted = tree(MADE[kind])
    for given in (kind, MADE[kind]):
        found = replace_joints(tree(pin.JointModelRZ()), {"j1": given})
        assert list(found.names) == list(wanted.names)
        assert [f.name for f in found.frames] == [f.name for f in wanted.frames]
        assert (found.nq, found.nv, found.name) == (wanted.nq, wanted.nv, "tree")
        rng, errors = np.random.default_rng(1), []
        data, other = found.createData(), wanted.createData()
        for _ in range(3):
            q = pin.integrate(wanted, pin.neutral(wanted), rng.normal(size=wanted.nv))
            v, a = rng.normal(size=(2, wanted.nv))
            errors.append(pin.rnea(found, data, q, v, a) - pin.rnea(wanted, other, q, v, a))
            pin.framesForwardKinematics(found, data, q)
            pin.framesForwardKinematics(wanted, other, q)
            pairs = zip(data.oMf, other.oMf, strict=True)
            errors += [one.homogeneous - two.homogeneous for one, two in pairs]
        assert worst(*errors) < 1e-12
        for name in ("armature", "upperEffortLimit", "upperVelocityLimit"):
            np.testing.assert_array_equal(getattr(found, name)[0], getattr(wanted, name)[0])
            np.testing.assert_array_equal(getattr(found, name)[-4:], getattr(wanted, name)[-4:])
        one = found.joints[found.getJointId("j1")]
        if one.nq == one.nv:  # not bounded
            bounds = found.lowerPositionLimit[one.idx_q : one.idx_q + one.nq]
            assert (bounds == -np.inf).all()


def test_a_fixed_joint_stands_at_its_neutral_coordinates() -> None:
    old = tree(pin.JointModelRZ())
    new = replace_joints(old, {"j1": "fixed"})
    assert list(new.names) == ["universe", "j0", "j2", "j3"]
    assert new.existFrame("j1")
    rng, errors = np.random.default_rng(1), []
    q = pin.integrate(old, pin.neutral(old), rng.normal(size=old.nv))
    v, a = rng.normal(size=(2, old.nv))
    q[1] = v[1] = a[1] = 0.0
    kept = [0, 2, 3, 4, 5]
    found = pin.rnea(
        new, new.createData(), replaced_configuration(old, {"j1": "fixed"}, q), v[kept], a[kept]
    )
    errors.append(found - pin.rnea(old, old.createData(), q, v, a)[kept])
    assert worst(*errors) < 1e-12
    np.testing.assert_array_equal(new.armature, old.armature[kept])
    np.testing.assert_array_equal(new.upperEffortLimit, old.upperEffortLimit[kept])


@pytest.mark.parametrize("kind", ["spherical", "free"])
def test_a_ball_takes_the_angle_of_its_hinge_over(kind: str) -> None:
    old = tree(pin.JointModelRevoluteUnaligned(0.6 * X + 0.8 * Z))
    new = replace_joints(old, {"j1": kind})
    rng = np.random.default_rng(2)
    q = pin.integrate(old, pin.neutral(old), rng.normal(size=old.nv))
    moved = replaced_configuration(old, {"j1": kind}, q)
    data, other = old.createData(), new.createData()
    pin.framesForwardKinematics(old, data, q)
    pin.framesForwardKinematics(new, other, moved)
    pairs = zip(data.oMf, other.oMf, strict=True)
    assert worst(*(one.homogeneous - two.homogeneous for one, two in pairs)) < 1e-12


def test_cosine_and_sine_become_an_angle_and_keep_rotor_and_effort() -> None:
    """What couplings need."""
    old = tree(pin.JointModelRUBZ())
    place = old.joints[2]
    old.armature[place.idx_v], old.upperEffortLimit[place.idx_v] = 0.7, 12.0
    new = replace_joints(old, {"j1": "revolute"})
    one = new.joints[2]
    assert (one.nq, one.nv) == (1, 1)
    assert (new.armature[one.idx_v], new.upperEffortLimit[one.idx_v]) == (0.7, 12.0)
    assert new.lowerPositionLimit[one.idx_q] == -np.inf
    q = pin.neutral(old)
    q[place.idx_q : place.idx_q + 2] = np.cos(-2.5), np.sin(-2.5)
    assert replaced_configuration(old, {"j1": "revolute"}, q)[one.idx_q] == pytest.approx(-2.5)
    JointCoupling("j1", "j0").joint_ids(new)
    back = replace_joints(new, {"j1": pin.JointModelRUBZ()})
    assert (back.nq, back.armature[place.idx_v]) == (old.nq, 0.7)


WRONG = {
    "no joint 'elbow'; there are: j0, j1": {"elbow": "spherical"},
    "joint 'j1' cannot be 'hinge'; there are: fixed, revolute, prismatic, spherical": {
        "j1": "hinge"
    },
    r"joint 'j1' cannot be replaced by 3: give one of fixed.*or a Pinocchio joint model": {"j1": 3},
    r"'j1' cannot be replaced by the class JointModelSpherical: give a joint, .*Spherical\(\.": {
        "j1": pin.JointModelSpherical
    },
    "joint 'j1' cannot be replaced by .*or a Pinocchio joint": {"j1": pin.JointModelComposite()},
    "joint 'j1' cannot be replaced by .* give one of fixed": {
        "j1": pin.JointModelRX().createData()
    },
    "joint 'j1' cannot be replaced by .*give one of fixed, rev": {
        "j1": pin.JointModelMimic(pin.JointModelRX(), 2.0, 0.0)
    },
    r"joint 'j3' \(JointModelSpherical\) has no axis .*; say which: revolute_x": {"j3": "revolute"},
    r"joint 'j2' has armature = \[0.5\], which its new type cannot keep": {"j2": "spherical"},
}


@pytest.mark.parametrize(("why", "kinds"), WRONG.items())
def test_what_cannot_be_replaced_is_told(why: str, kinds: dict[str, object]) -> None:
    with pytest.raises(MechanismError, match=why):
        replace_joints(tree(pin.JointModelRZ()), kinds)
    assert "fixed" in JOINT_KINDS


def test_another_axis_keeps_no_rotor() -> None:
    model = tree(pin.JointModelRZ())
    model.armature[1] = 0.2
    replace_joints(model, {"j1": "revolute_z"})
    with pytest.raises(MechanismError, match=r"j1.* has armature"):
        replace_joints(model, {"j1": "revolute_x"})


# Mechanisms ---------------------------------------------------------------------------------------


def test_a_four_bar_with_a_ball_in_a_hinge_is_a_spatial_one() -> None:
    """Pinned elsewhere, it gains the two tilts of the ball, which the other pins forbid again."""
    old = FOUR_BAR.mechanism()
    effects = JointEffects.named(old.model, damping={"crank_joint": 0.3})
    old = ClosedLoopModel(
        old.model, old.closures, old.actuated, home=old.home, effects=effects, name="bars"
    )
    new = old.with_joints({"coupler_joint": "spherical"})
    assert (new.name, new.closures, new.actuated) == ("bars", old.closures, old.actuated)
    assert new.effects.damping[new.actuated_indices].tolist() == [0.3]
    assert new.describe().mobility == 1
    q, p = old.home, new.home
    assert new.loop_gap(p) < 1e-12
    assert worst(old.frame_placement(q, "knee") - new.frame_placement(p, "knee")) < 1e-9
    tau = [
        m.inverse_dynamics(x, v, v).tau
        for m, x, v in ((old, q, np.zeros(old.model.nv)), (new, p, np.zeros(new.model.nv)))
    ]
    assert worst(tau[0] - tau[1]) < 1e-9
    assert new.with_joints({"coupler_joint": "revolute_y"}).model.nv == old.model.nv


def test_what_a_mechanism_cannot_keep_is_told_by_name() -> None:
    old = FOUR_BAR.mechanism()
    with pytest.raises(MechanismError, match="'crank_joint' is actuated and would have 3 vel"):
        old.with_joints({"crank_joint": "spherical"})
    ties = [JointCoupling("rocker_joint", "crank_joint", name="tie")]
    tied = ClosedLoopModel(old.model, ties, ["crank_joint"])
    with pytest.raises(MechanismError, match="coupling 'tie': no joint 'rocker_joint' of one"):
        tied.with_joints({"rocker_joint": "spherical"})
    effects = JointEffects.named(old.model, friction={"rocker_joint": 0.5})
    rough = ClosedLoopModel(old.model, old.closures, old.actuated, effects=effects)
    with pytest.raises(MechanismError, match=r"joint 'rocker_joint' is replaced and has friction"):
        rough.with_joints({"rocker_joint": "spherical"})
    fixed = rough.without_closures([old.closures[0].name]).with_joints({"rocker_joint": "fixed"})
    assert not fixed.effects.friction.any()


# Files --------------------------------------------------------------------------------------------

LEG = robot(
    link("thigh", 1.0, "0.1 0 0", 0.05),
    link("rod", 0.2, "0 0.1 0", 0.02),
    joint("revolute", "base", "thigh", axis="0 1 0"),
    joint("revolute", "thigh", "rod", axis="0 0 1"),
)


def load(folder: Path, text: str, urdf: str = LEG) -> ClosedLoopModel:
    (folder / "leg.urdf").write_text(urdf)
    file = folder / "leg.yaml"
    file.write_text("urdf: leg.urdf\nactuated: [thigh_joint]\n" + text)
    return ClosedLoopModel.load(file)


def test_files_name_the_types_of_joints(tmp_path: Path) -> None:
    mechanism = load(
        tmp_path,
        "joint_types: {rod_joint: spherical}\n"
        "damping: {rod_joint: 0.1}\nhome: {rod_joint: [0.6, 0, 0, 0.8]}\n",
    )
    assert mechanism.model.joints[2].shortname() == "JointModelSpherical"
    assert mechanism.effects.damping.tolist() == [0, 0.1, 0.1, 0.1]
    assert worst(mechanism.home - [0, 0.6, 0, 0, 0.8]) < 1e-15
    joints = load(tmp_path, "joint_types: {rod_joint: universal_zy, thigh_joint: revolute_x}\n")
    assert (joints.model.nq, joints.model.nv) == (3, 3)
    assert load(tmp_path, "joint_types: {rod_joint: fixed}\n").model.nv == 1


WRONG_FILES = {
    "line 3: joint_types: no joint 'knee'; there are: thigh_joint": "joint_types: {knee: fixed}\n",
    "line 4: joint 'rod_joint' cannot be 'ball'; there are: fixed": (
        "joint_types:\n  rod_joint: ball\n"
    ),
    "line 3: actuated: no joint 'thigh_joint'": "joint_types: {thigh_joint: fixed}\n",
    "line 3: coupling .* no joint 'rod_joint' of one coordinate": (
        "couplings: [{joint: rod_joint, other: thigh_joint}]\njoint_types: {rod_joint: free}\n"
    ),
}


@pytest.mark.parametrize(("why", "text"), WRONG_FILES.items())
def test_what_is_wrong_in_a_file_is_told_with_its_line(why: str, text: str, tmp_path: Path) -> None:
    if "actuated" in why:
        why = why.replace("line 3", "line 2")
    with pytest.raises(InputError, match=why):
        load(tmp_path, text)


def test_damping_in_the_tree_s_file_is_said_anew_or_refused(tmp_path: Path) -> None:
    damped = LEG.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><dynamics damping="0.4"/>')
    assert damped != LEG
    kinds = "joint_types: {rod_joint: spherical}\n"
    with pytest.raises(MechanismError, match="line 3: joint 'rod_joint' has damping in its file"):
        load(tmp_path, kinds, damped)
    mechanism = load(tmp_path, kinds + "damping: {rod_joint: 0}\n", damped)
    assert mechanism.effects is None or not mechanism.effects.damping.any()
    assert load(tmp_path, "joint_types: {rod_joint: fixed}\n", damped).model.nv == 1

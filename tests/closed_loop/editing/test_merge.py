"""Merged joints move and weigh as the joints they are made of, away from gimbal lock."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, MechanismError
from rps_pin.closed_loop.editing.merge import JointMerge, merged, merged_configuration
from tests.each import each

Array = NDArray[np.float64]

BALL = JointMerge(["s1", "s2", "s3"], "spherical", "ball")
CARDAN = JointMerge(["u1", "u2"], "universal", "cardan")


def random_body(rng: np.random.Generator) -> pin.Inertia:
    return pin.Inertia(rng.uniform(0.5, 2), rng.normal(size=3), np.diag([1.0, 1.2, 1.4]))


def tree(seed: int = 0, universal_angle: float = 90.0) -> pin.Model:
    """A slide, a ball of three joints, a hinge and a ball joint on it, and a cardan of two."""
    rng = np.random.default_rng(seed)
    model = pin.Model()
    model.name = "tree"
    model.gravity.linear = np.array([0.3, -0.2, -9.0])

    def add(parent: int, kind: object, name: str, apart: bool = True, mass: bool = True) -> int:
        placement = pin.SE3.Random()
        placement.rotation = pin.exp3(rng.normal(size=3))
        placement.translation = rng.normal(size=3) if apart else np.zeros(3)
        joint = model.addJoint(parent, kind, placement, name)
        frame = model.addJointFrame(joint)
        if mass:
            model.appendBodyToJoint(joint, random_body(rng), pin.SE3.Identity())
        body = pin.Frame(name + "_link", joint, frame, pin.SE3.Random(), pin.FrameType.BODY)
        model.addFrame(body)
        return int(joint)

    slide = add(0, pin.JointModelPX(), "slide")
    s1 = add(slide, pin.JointModelRX(), "s1", mass=False)
    s2 = add(s1, pin.JointModelRevoluteUnaligned(unit(rng)), "s2", apart=False, mass=False)
    s3 = add(s2, pin.JointModelRZ(), "s3", apart=False)
    add(s3, pin.JointModelSpherical(), "hand")
    add(s3, pin.JointModelRY(), "hinge")
    u1 = add(slide, pin.JointModelRX(), "u1", mass=False)
    u2 = add(u1, pin.JointModelRY(), "u2", apart=False)
    # The second axis, y of u2, at the given angle to the first, x of u1: cos = R[0, 1].
    turn = np.radians(universal_angle - 90)
    model.jointPlacements[u2].rotation = pin.exp3(np.array([0, 0, turn])) @ pin.exp3(
        np.array([0, 0.7, 0])
    )
    add(u2, pin.JointModelRUBX(), "wheel")
    plate = pin.Frame("plate", s3, 0, pin.SE3.Random(), pin.FrameType.BODY, random_body(rng))
    model.addFrame(plate)  # fixed to the link, which is the heavier for it
    model.upperPositionLimit = np.arange(model.nq) + 1.0
    model.lowerPositionLimit = -np.arange(model.nq) - 2.0
    model.velocityLimit = np.arange(model.nv) + 3.0
    model.upperEffortLimit = np.arange(model.nv) + 4.0
    model.lowerEffortLimit = -np.arange(model.nv) - 4.5
    model.damping = np.arange(model.nv) + 5.0
    model.upperDryFrictionLimit = np.arange(model.nv) + 6.0
    rotors = np.arange(model.nv) + 7.0
    rotors[1:4] = 0
    model.armature = rotors
    model.rotorInertia = rotors / 2
    model.rotorGearRatio = np.arange(model.nv) + 8.0
    return model


def unit(rng: np.random.Generator) -> Array:
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def joint_of(model: pin.Model, name: str) -> object:
    return model.joints[model.getJointId(name)]


def mapped(
    old: pin.Model, new: pin.Model, merges: list[JointMerge], q: Array, v: Array, a: Array
) -> tuple[Array, Array, Array]:
    """The state of the merged model, from the motion of the links in the model as it was."""
    data = old.createData()
    pin.forwardKinematics(old, data, q, v, a)
    q_new = merged_configuration(old, merges, q)
    v_new, a_new = np.zeros(new.nv), np.zeros(new.nv)
    first_and_last = {merge.name: (merge.joints[0], merge.joints[-1]) for merge in merges}
    for name in list(new.names)[1:]:
        place = joint_of(new, name)
        part = slice(place.idx_v, place.idx_v + place.nv)
        if name == "ball":
            first, last = (old.getJointId(n) for n in first_and_last[name])
            parent = old.parents[first]
            M = data.oMi[parent].inverse() * data.oMi[last]
            relative = data.v[last] - M.actInv(data.v[parent])
            v_new[part] = relative.angular
            # d/dt of the relative velocity, seen from the last link.
            change = (
                data.a[last] - M.actInv(data.a[parent]) + relative.cross(M.actInv(data.v[parent]))
            )
            a_new[part] = change.angular
        elif name == "cardan":
            indices = [joint_of(old, n).idx_v for n in CARDAN.joints]
            v_new[part], a_new[part] = v[indices], a[indices]
        else:
            was = joint_of(old, name)
            v_new[part] = v[was.idx_v : was.idx_v + was.nv]
            a_new[part] = a[was.idx_v : was.idx_v + was.nv]
    return q_new, v_new, a_new


@each("merges", [[BALL], [CARDAN], [BALL, CARDAN]], ids=["ball", "cardan", "both"])
@each("seed", range(5))
def test_the_merged_model_is_the_same_mechanism(merges: list[JointMerge], seed: int) -> None:
    """Frames, energies, and the power of the inverse dynamics' forces."""
    old = tree(seed)
    new = merged(old, merges)
    rng = np.random.default_rng(seed)
    for _ in range(5):
        q = pin.integrate(old, pin.neutral(old), rng.normal(size=old.nv))
        v, a = rng.normal(size=(2, old.nv))
        state = mapped(old, new, merges, q, v, a)
        old_data, new_data = old.createData(), new.createData()
        pin.framesForwardKinematics(old, old_data, q)
        pin.framesForwardKinematics(new, new_data, state[0])
        seen = 0
        for i, frame in enumerate(new.frames):
            if old.existFrame(frame.name):
                before = old_data.oMf[old.getFrameId(frame.name)]
                assert before.isApprox(new_data.oMf[i], 1e-12)
                seen += 1
        assert seen == new.nframes - len(merges)
        assert pin.computePotentialEnergy(new, new_data, state[0]) == pytest.approx(
            pin.computePotentialEnergy(old, old_data, q), rel=1e-12
        )
        assert pin.computeKineticEnergy(new, new_data, *state[:2]) == pytest.approx(
            pin.computeKineticEnergy(old, old_data, q, v), rel=1e-12
        )
        power = pin.rnea(old, old_data, q, v, a) @ v
        assert pin.rnea(new, new_data, *state) @ state[1] == pytest.approx(power, rel=1e-9)


def test_everything_else_is_kept() -> None:
    old = tree()
    new = merged(old, [BALL, CARDAN])
    assert list(new.names) == ["universe", "slide", "ball", "hand", "hinge", "cardan", "wheel"]
    assert new.name == "tree"
    np.testing.assert_array_equal(new.gravity.linear, old.gravity.linear)
    for name in ("slide", "hand", "hinge", "wheel", "cardan"):
        there = joint_of(new, name)
        was = [joint_of(old, n) for n in (CARDAN.joints if name == "cardan" else [name])]
        in_q = [i for j in was for i in range(j.idx_q, j.idx_q + j.nq)]
        in_v = [i for j in was for i in range(j.idx_v, j.idx_v + j.nv)]
        for field in ("lowerPositionLimit", "upperPositionLimit"):
            part = getattr(new, field)[there.idx_q : there.idx_q + there.nq]
            np.testing.assert_array_equal(part, getattr(old, field)[in_q])
        for field in (
            "velocityLimit",
            "upperEffortLimit",
            "lowerEffortLimit",
            "damping",
            "upperDryFrictionLimit",
            "armature",
            "rotorInertia",
            "rotorGearRatio",
        ):
            part = getattr(new, field)[there.idx_v : there.idx_v + there.nv]
            np.testing.assert_array_equal(part, getattr(old, field)[in_v])
    ball = joint_of(new, "ball")
    assert not new.armature[ball.idx_v : ball.idx_v + 3].any()
    assert not new.existFrame("s2_link") and new.existFrame("s3_link")
    assert new.frames[new.getFrameId("ball")].type == pin.FrameType.JOINT
    assert old.names[2] == "s1"  # the model given is not changed


def test_neutral_stays_neutral_and_references_are_kept() -> None:
    old = tree()
    q = pin.integrate(old, pin.neutral(old), 0.3 * np.ones(old.nv))
    old.referenceConfigurations["home"] = q
    new = merged(old, [BALL, CARDAN])
    at_rest = merged_configuration(old, [BALL, CARDAN], pin.neutral(old))
    np.testing.assert_allclose(at_rest, pin.neutral(new), atol=1e-15)
    home = new.referenceConfigurations["home"]
    np.testing.assert_array_equal(home, merged_configuration(old, [BALL, CARDAN], q))
    assert pin.isNormalized(new, home)


def test_a_name_of_the_row_can_be_used_again() -> None:
    new = merged(tree(), [JointMerge(["s1", "s2", "s3"], "spherical", "s3")])
    assert new.existJointName("s3") and joint_of(new, "s3").nq == 4


def test_nothing_to_merge_is_a_copy() -> None:
    old = tree()
    new = merged(old, [])
    q = pin.integrate(old, pin.neutral(old), np.ones(old.nv))
    before = pin.crba(old, old.createData(), q)
    np.testing.assert_array_equal(pin.crba(new, new.createData(), q), before)
    assert [frame.name for frame in new.frames] == [frame.name for frame in old.frames]


def refused(model: pin.Model, joints: list[str], into: str, why: str, name: str = "m") -> None:
    with pytest.raises(MechanismError, match=why):
        merged(model, [JointMerge(joints, into, name)])  # type: ignore[arg-type]


def test_what_does_not_fit_is_refused_by_how_much() -> None:
    refused(tree(), ["s1", "s2", "x"], "spherical", "no joint 'x'; there are: slide, s1")
    refused(tree(), ["s1", "s2"], "spherical", "made of 3 different joints, not of s1, s2")
    refused(tree(), ["u1", "u2"], "screw", "into 'screw'; there are: spherical, universal")
    refused(tree(), ["slide", "s1"], "universal", r"'slide' \(JointModelPX\) is not revolute")
    refused(tree(), ["hinge", "wheel"], "universal", r"'wheel' \(JointModelRUBX\) is not revolute")
    refused(tree(), ["u2", "u1"], "universal", "'u1' does not follow 'u2'; it follows 'slide'")
    refused(tree(universal_angle=70), ["u1", "u2"], "universal", "'u2' are at 70 degrees")
    refused(tree(), ["u1", "u2"], "universal", "'hand': that name is taken", "hand")
    refused(tree(), ["u1", "u2"], "universal", "cannot be called ''", "")
    apart = tree()
    apart.jointPlacements[apart.getJointId("s3")].translation = np.array([0, 0.3, 0.4])
    refused(apart, ["s1", "s2", "s3"], "spherical", "origins of 's2' and 's3' are 0.5 m apart")
    heavy = tree()
    heavy.appendBodyToJoint(heavy.getJointId("s1"), pin.Inertia.Random(), pin.SE3.Identity())
    refused(heavy, ["s1", "s2", "s3"], "spherical", "between 's1' and 's2' has a mass of")
    branch = tree()
    branch.addJoint(branch.getJointId("u1"), pin.JointModelRX(), pin.SE3.Identity(), "twig")
    refused(branch, ["u1", "u2"], "universal", "between 'u1' and 'u2' also carries twig")
    rotors = tree()
    rotors.armature = np.ones(rotors.nv)
    refused(rotors, ["s1", "s2", "s3"], "spherical", "'s1' has armature = 1, which")
    shared = [CARDAN, JointMerge(["u1", "u2"], "universal", "again")]
    with pytest.raises(MechanismError, match="joint 'u1' is merged twice"):
        merged(tree(), shared)


def test_three_parallel_axes_are_no_ball() -> None:
    model = pin.Model()
    joint = 0
    for name in ("a", "b", "c"):
        joint = model.addJoint(joint, pin.JointModelRX(), pin.SE3.Identity(), name)
    refused(model, ["a", "b", "c"], "spherical", "neighbouring axes are parallel")


def test_configurations_are_checked() -> None:
    with pytest.raises(InputError, match="q has shape"):
        merged_configuration(tree(), [BALL], np.zeros(3))

"""Split trees are the same mechanisms, and Pinocchio's derivatives of them are right."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import MechanismError
from rps_pin.closed_loop.editing.merge import JointMerge, merged
from rps_pin.closed_loop.editing.split import split
from tests.each import each
from tests.worst import worst

Array = NDArray[np.float64]
Maker = Callable[[np.random.Generator], Any]

VECTORS = (
    "lowerPositionLimit",
    "upperPositionLimit",
    "positionLimitMargin",
    "lowerVelocityLimit",
    "upperVelocityLimit",
    "lowerEffortLimit",
    "upperEffortLimit",
    "lowerDryFrictionLimit",
    "upperDryFrictionLimit",
    "damping",
    "armature",
    "rotorInertia",
    "rotorGearRatio",
)


def unit(rng: np.random.Generator) -> Array:
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def somewhere(rng: np.random.Generator) -> pin.SE3:
    return pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))


def universal(rng: np.random.Generator) -> Any:
    first = unit(rng)
    second = np.cross(first, unit(rng))
    return pin.JointModelUniversal(first, second / np.linalg.norm(second))


def skew_universal(rng: np.random.Generator) -> Any:
    return pin.JointModelUniversal(unit(rng), unit(rng))


def unbounded(rng: np.random.Generator) -> Any:
    joint = pin.JointModelRevoluteUnboundedUnaligned()
    joint.axis = unit(rng)
    return joint


def composite(*makers: Maker) -> Maker:
    def make(rng: np.random.Generator) -> Any:
        joint = pin.JointModelComposite(len(makers))
        for maker in makers:
            joint.addJoint(maker(rng), somewhere(rng))
        return joint

    return make


def plain(kind: Any, *arguments: float) -> Maker:
    return lambda rng: kind(*arguments)


def with_axis(kind: Any, *arguments: float) -> Maker:
    return lambda rng: kind(unit(rng), *arguments)


RX, PX = plain(pin.JointModelRX), plain(pin.JointModelPX)
REVOLUTE = with_axis(pin.JointModelRevoluteUnaligned)
ZYX = plain(pin.JointModelSphericalZYX)
ELLIPSOID = plain(pin.JointModelEllipsoid, 0.3, 0.5, 0.8)

#: Joints whose subspace depends on q, and how many they are split into.
CHANGING: dict[str, tuple[Maker, int]] = {
    "universal": (universal, 2),
    "skew universal": (skew_universal, 2),
    "ZYX": (ZYX, 3),
    "two revolutes": (composite(RX, REVOLUTE), 2),
    "slide and turn": (composite(PX, REVOLUTE), 2),
    "ZYX between": (composite(RX, ZYX, plain(pin.JointModelFreeFlyer)), 5),
    "universal in nested": (composite(composite(PX, universal), unbounded), 4),
}
#: Joints whose subspace does not.
CONSTANT: dict[str, Maker] = {
    "RY": plain(pin.JointModelRY),
    "revolute": REVOLUTE,
    "RUBX": plain(pin.JointModelRUBX),
    "RUBZ": plain(pin.JointModelRUBZ),
    "unbounded": unbounded,
    "PZ": plain(pin.JointModelPZ),
    "prismatic": with_axis(pin.JointModelPrismaticUnaligned),
    "HX": plain(pin.JointModelHX, 0.4),
    "helical": with_axis(pin.JointModelHelicalUnaligned, 0.4),
    "planar": plain(pin.JointModelPlanar),
    "translation": plain(pin.JointModelTranslation),
    "spherical": plain(pin.JointModelSpherical),
    "free": plain(pin.JointModelFreeFlyer),
    "composite of one": composite(REVOLUTE),
    "composite of slides": composite(PX, with_axis(pin.JointModelPrismaticUnaligned)),
}


def tree(make: Maker, rng: np.random.Generator, places: str = "root middle leaf") -> pin.Model:
    """A tree with hinges, and joints of one kind where asked."""
    model = pin.Model()
    model.name = "tree"
    model.gravity.linear = np.array([0.3, -0.2, -9.0])

    def add(parent: int, name: str) -> int:
        kind = make(rng) if name in places.split() else REVOLUTE(rng)
        joint = int(model.addJoint(parent, kind, somewhere(rng), name))
        frame = model.addJointFrame(joint)
        body = pin.Inertia(rng.uniform(0.5, 2), rng.normal(size=3), np.diag([1.0, 1.2, 1.4]))
        model.appendBodyToJoint(joint, body, somewhere(rng))
        link = pin.Frame(f"{name}_link", joint, frame, somewhere(rng), pin.FrameType.BODY)
        tool = model.addFrame(link)
        tip = pin.Frame(f"{name}_tip", joint, tool, somewhere(rng), pin.FrameType.OP_FRAME)
        model.addFrame(tip)
        return joint

    root = add(0, "root")
    middle = add(add(root, "hinge"), "middle")
    add(middle, "leaf")
    add(add(middle, "elbow"), "wrist")
    add(root, "tail")
    for name in VECTORS:
        setattr(model, name, rng.uniform(1, 2, size=getattr(model, name).size))
    return model


def states(model: pin.Model, rng: np.random.Generator, count: int) -> list[tuple[Array, ...]]:
    neutral = pin.neutral(model)
    return [
        (pin.integrate(model, neutral, rng.normal(size=model.nv)), *rng.normal(size=(2, model.nv)))
        for _ in range(count)
    ]


def of_frames(model: pin.Model, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
    """Velocities and accelerations of all frames, each in its own axes, (nframes, 6)."""
    data = model.createData()
    pin.forwardKinematics(model, data, q, v, a)
    moving = [
        [get(model, data, i, pin.LOCAL).vector for i in range(model.nframes)]
        for get in (pin.getFrameVelocity, pin.getFrameAcceleration)
    ]
    return np.array(moving[0]), np.array(moving[1])


def mass_matrix(model: pin.Model, q: Array) -> Array:
    data = model.createData()
    return np.array(pin.crba(model, data, q))


def relative(found: Array, wanted: Array) -> float:
    return worst(found - wanted) / worst(1.0, wanted)


@each("kind", CHANGING)
@each("places", ["root", "middle", "leaf", "root middle leaf"])
def test_the_split_tree_is_the_same_mechanism(kind: str, places: str) -> None:
    rng = np.random.default_rng(len(kind) + len(places))
    make, parts = CHANGING[kind]
    old = tree(make, rng, places)
    new = split(old)
    assert new.njoints == old.njoints + (parts - 1) * len(places.split())
    assert (new.nq, new.nv) == (old.nq, old.nv)
    np.testing.assert_array_equal(pin.neutral(new), pin.neutral(old))
    for q, v, a in states(old, rng, 5):
        step = pin.integrate(old, q, v)
        np.testing.assert_allclose(pin.integrate(new, q, v), step, rtol=0, atol=1e-14)
        old_data, new_data = old.createData(), new.createData()
        pin.framesForwardKinematics(old, old_data, q)
        pin.framesForwardKinematics(new, new_data, q)
        for before, after in zip(old_data.oMf, new_data.oMf, strict=True):
            assert before.isApprox(after, 1e-12)
        for before, after in zip(of_frames(old, q, v, a), of_frames(new, q, v, a), strict=True):
            assert relative(after, before) < 1e-12
        forces = pin.rnea(old, old_data, q, v, a)
        assert relative(pin.rnea(new, new_data, q, v, a), forces) < 1e-12
        assert relative(mass_matrix(new, q), mass_matrix(old, q)) < 1e-12


# Derivatives --------------------------------------------------------------------------------------


def slope(function: Callable[[Array], Array], size: int, step: float = 1e-3) -> Array:
    """Central differences of fourth order at zero."""
    columns = []
    for i in range(size):
        e = np.zeros(size)
        e[i] = step
        near, far = function(e) - function(-e), function(2 * e) - function(-2 * e)
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, axis=-1)


def derivative_errors(model: pin.Model, state: tuple[Array, ...]) -> list[float]:
    """Relative errors of rnea's derivatives, and of those of a tip's velocity and acceleration."""
    q, v, a = state
    data = model.createData()
    by_q, by_v, mass = (np.array(x) for x in pin.computeRNEADerivatives(model, data, q, v, a))
    mass = np.triu(mass) + np.triu(mass, 1).T
    tip = model.getFrameId("wrist_tip")
    pin.computeForwardKinematicsDerivatives(model, data, q, v, a)
    motion = pin.getFrameAccelerationDerivatives(model, data, tip, pin.LOCAL)

    def forces(dq: Array, dv: Array, da: Array) -> Array:
        scratch = model.createData()
        return np.array(pin.rnea(model, scratch, pin.integrate(model, q, dq), v + dv, a + da))

    def tip_motion(dq: Array, dv: Array, da: Array) -> Array:
        moved = of_frames(model, pin.integrate(model, q, dq), v + dv, a + da)
        return np.concatenate([part[tip] for part in moved])

    zero = np.zeros(model.nv)
    of_forces, of_tip = (
        [
            slope(lambda d, f=function: f(d, zero, zero), model.nv),
            slope(lambda d, f=function: f(zero, d, zero), model.nv),
            slope(lambda d, f=function: f(zero, zero, d), model.nv),
        ]
        for function in (forces, tip_motion)
    )
    rate_q, acc_q, acc_v, acc_a = (np.array(x) for x in motion)
    wanted = [*of_forces, of_tip[0][:6], of_tip[0][6:], of_tip[1][6:], of_tip[2][6:]]
    found = [by_q, by_v, mass, rate_q, acc_q, acc_v, acc_a]
    return [relative(one, other) for one, other in zip(found, wanted, strict=True)]


@pytest.mark.parametrize("kind", CHANGING)
def test_derivatives_are_right_once_split_and_wrong_before(kind: str) -> None:
    rng = np.random.default_rng(len(kind))
    old = tree(CHANGING[kind][0], rng)
    for state in states(old, rng, 2):
        assert worst(derivative_errors(split(old), state)) < 1e-7
        assert max(derivative_errors(old, state)) > 1e-2


@each("kind", CONSTANT)
def test_joints_left_as_they_are_have_right_derivatives(kind: str) -> None:
    rng = np.random.default_rng(len(kind))
    model = tree(CONSTANT[kind], rng)
    assert split(model) is model
    assert worst(derivative_errors(model, states(model, rng, 1)[0])) < 1e-7


def test_the_ellipsoid_is_refused_for_a_reason() -> None:
    rng = np.random.default_rng(0)
    model = tree(ELLIPSOID, rng, "middle")
    assert max(derivative_errors(model, states(model, rng, 1)[0])) > 1e-2
    with pytest.raises(
        MechanismError, match=r"derivatives are not those of joint 'middle' \(Ellipsoid\)"
    ):
        split(model)


# What is kept -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", CHANGING)
def test_everything_else_is_kept(kind: str) -> None:
    rng = np.random.default_rng(7)
    old = tree(CHANGING[kind][0], rng)
    old.referenceConfigurations["home"] = states(old, rng, 1)[0][0]
    names, joints = list(old.names), old.njoints
    new = split(old)
    assert (list(old.names), old.njoints) == (names, joints)  # the model given is not changed
    assert new.name == "tree"
    assert new.gravity == old.gravity
    for name in VECTORS:
        np.testing.assert_array_equal(getattr(new, name), getattr(old, name))
    home = new.referenceConfigurations["home"]
    np.testing.assert_array_equal(home, old.referenceConfigurations["home"])
    for joint in range(joints):
        after = new.getJointId(old.names[joint])
        assert new.inertias[after] == old.inertias[joint]
    assert new.nframes == old.nframes
    for before, after in zip(old.frames, new.frames, strict=True):
        assert (before.name, before.type) == (after.name, after.type)
        assert before.parentFrame == after.parentFrame
        assert before.placement == after.placement
        assert before.inertia == after.inertia
        assert new.names[after.parentJoint] == old.names[before.parentJoint]


def test_the_armature_is_in_the_dynamics_of_both() -> None:
    rng = np.random.default_rng(3)
    old = tree(universal, rng)
    bare = old.copy()
    bare.armature = np.zeros(old.nv)
    q, _, _ = states(old, rng, 1)[0]
    added = mass_matrix(split(old), q) - mass_matrix(split(bare), q)
    np.testing.assert_allclose(added, np.diag(old.armature), atol=1e-12)


def test_names_count_up_to_the_joint() -> None:
    names = list(split(tree(ZYX, np.random.default_rng(0), "middle")).names)
    assert names[2:6] == ["hinge", "middle:1", "middle:2", "middle"]


def test_massless_links_between() -> None:
    model = split(tree(ZYX, np.random.default_rng(0), "middle"))
    for name in ("middle:1", "middle:2"):
        assert model.inertias[model.getJointId(name)] == pin.Inertia.Zero()


def test_splitting_undoes_merging_into_a_universal_joint() -> None:
    rng = np.random.default_rng(5)
    old = split(tree(universal, rng, "middle"))
    whole = merged(old, [JointMerge(["middle:1", "middle"], "universal", "middle")])
    again = split(whole)
    assert whole.njoints == old.njoints - 1
    assert list(again.names) == list(old.names)
    for before, after in zip(old.jointPlacements, again.jointPlacements, strict=True):
        assert before.isApprox(after, 1e-12)


def test_a_split_model_and_a_model_of_nothing_stay() -> None:
    once = split(tree(universal, np.random.default_rng(0)))
    assert split(once) is once
    empty = pin.Model()
    assert split(empty) is empty


# Refusals -----------------------------------------------------------------------------------------


def refused(model: pin.Model, why: str) -> None:
    with pytest.raises(MechanismError, match=why):
        split(model)


def test_what_cannot_be_split_is_refused_by_name() -> None:
    rng = np.random.default_rng(0)
    refused(
        tree(composite(RX, ELLIPSOID), rng, "leaf"),
        r"not those of joint 'leaf' \(Composite\) \(Ellipsoid\)",
    )
    long_axis = plain(pin.JointModelUniversal, 2.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    refused(tree(long_axis, rng, "root"), "joint 'root' is universal with an axis of length 2;")


def test_mimic_joints_are_refused() -> None:
    model = tree(REVOLUTE, np.random.default_rng(0))
    follower, leader = model.getJointId("tail"), model.getJointId("hinge")
    mimic = pin.transformJointIntoMimic(model, leader, follower, 1.5, 0.1)
    state = [pin.neutral(mimic), np.zeros(mimic.nv), np.zeros(mimic.nv)]
    with pytest.raises(RuntimeError, match="Mimic"):  # Pinocchio's own word on it
        pin.computeRNEADerivatives(mimic, mimic.createData(), *state)
    refused(mimic, r"not those of joint 'tail' \(Mimic\): .*couple the joints instead")


def test_taken_names_are_refused() -> None:
    model = tree(universal, np.random.default_rng(0), "middle")
    model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "middle:1")
    refused(model, "joint 'middle' is split into 2 joints, .* 'middle:1'; that name is taken")

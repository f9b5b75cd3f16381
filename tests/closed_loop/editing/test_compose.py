"""Trees side by side: each moves and weighs as it does alone, under names of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, MechanismError
from rps_pin.closed_loop.editing.compose import Part, body, compose
from tests.each import each

Array = NDArray[np.float64]


def panda() -> pin.Model:
    """The arm of example-robot-data, whose files stand beside Pinocchio's own."""
    prefix = next(p for p in Path(pin.__file__).parents if p.name == "cmeel.prefix")
    robots = prefix / "share" / "example-robot-data" / "robots"
    return pin.buildModelFromUrdf(str(robots / "panda_description" / "urdf" / "panda.urdf"))


def sample() -> pin.Model:
    """Joints of every size, with limits and rotors; a link fixed to the world has mass."""
    model = pin.buildSampleModelManipulator()
    last = model.addJoint(model.njoints - 1, pin.JointModelSpherical(), pin.SE3.Random(), "ball")
    model.appendBodyToJoint(last, pin.Inertia.Random(), pin.SE3.Identity())
    wheel = model.addJoint(last, pin.JointModelRUBZ(), pin.SE3.Random(), "wheel")
    model.appendBodyToJoint(wheel, pin.Inertia.Random(), pin.SE3.Identity())
    tool = pin.Frame("tool", wheel, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME)
    model.addFrame(tool)
    base = pin.Frame("base", 0, 0, pin.SE3.Random(), pin.FrameType.BODY, pin.Inertia.Random())
    model.addFrame(base)
    rng = np.random.default_rng(0)
    for name in (
        "armature",
        "rotorInertia",
        "damping",
        "upperEffortLimit",
        "upperDryFrictionLimit",
    ):
        setattr(model, name, rng.uniform(1, 2, model.nv))
    for name in ("rotorGearRatio", "velocityLimit"):
        setattr(model, name, rng.uniform(1, 2, model.nv))
    for name in ("upperPositionLimit", "positionLimitMargin"):
        setattr(model, name, rng.uniform(1, 2, model.nq))
    model.lowerPositionLimit = -rng.uniform(1, 2, model.nq)
    model.lowerVelocityLimit = -model.upperVelocityLimit
    model.lowerDryFrictionLimit = -model.upperDryFrictionLimit
    model.lowerEffortLimit = -rng.uniform(1, 2, model.nv)
    return model


def parts() -> dict[str, Part]:
    bar = body("bar", 2.0, np.diag([0.01, 0.2, 0.2]), (0.1, 0, 0), {"end": pin.SE3.Random()})
    return {
        "left": Part(panda(), pin.SE3(np.eye(3), np.array([0, 0.5, 0]))),
        "right": Part(panda(), pin.SE3(pin.rpy.rpyToMatrix(0, 0, 1.0), np.array([0, -0.5, 0]))),
        "bar": Part(bar),
        "other": Part(sample()),
    }


def split(whole: pin.Model, part: Part, key: str) -> tuple[list[int], list[int]]:
    """Indices of a part's coordinates in q and v of the whole."""
    in_q: list[int] = []
    in_v: list[int] = []
    for name in list(part.model.names)[1:]:
        joint = whole.joints[whole.getJointId(f"{key}/{name}")]
        in_q += range(joint.idx_q, joint.idx_q + joint.nq)
        in_v += range(joint.idx_v, joint.idx_v + joint.nv)
    return in_q, in_v


def symmetric(mass: Array) -> Array:
    return np.asarray(np.triu(mass) + np.triu(mass, 1).T)


def states(whole: pin.Model, count: int = 5) -> list[tuple[Array, Array]]:
    rng = np.random.default_rng(1)
    return [
        (pin.integrate(whole, pin.neutral(whole), rng.normal(size=whole.nv)), v)
        for v in rng.normal(size=(count, whole.nv))
    ]


def test_parts_weigh_what_they_weigh_alone() -> None:
    """The mass matrix is block-diagonal, its blocks the parts' own; so are the other forces."""
    given = parts()
    whole = compose(given)
    data = whole.createData()
    for q, v in states(whole):
        mass = symmetric(pin.crba(whole, data, q))
        gravity = pin.computeGeneralizedGravity(whole, data, q).copy()
        bias = pin.nonLinearEffects(whole, data, q, v).copy()
        outside = mass.copy()
        for key, part in given.items():
            in_q, in_v = split(whole, part, key)
            own = part.model.createData()
            block = symmetric(pin.crba(part.model, own, q[in_q]))
            np.testing.assert_allclose(mass[np.ix_(in_v, in_v)], block, rtol=1e-12, atol=1e-13)
            outside[np.ix_(in_v, in_v)] = 0
            # All are turned about the vertical at most, so gravity is what it was.
            alone = pin.computeGeneralizedGravity(part.model, own, q[in_q])
            np.testing.assert_allclose(gravity[in_v], alone, rtol=1e-10, atol=1e-11)
            alone = pin.nonLinearEffects(part.model, own, q[in_q], v[in_v])
            np.testing.assert_allclose(bias[in_v], alone, rtol=1e-10, atol=1e-10)
        assert not outside.any()


def test_frames_stand_where_the_parts_put_them() -> None:
    given = parts()
    whole = compose(given)
    data = whole.createData()
    for q, _ in states(whole):
        pin.framesForwardKinematics(whole, data, q)
        for key, part in given.items():
            in_q, _ = split(whole, part, key)
            own = part.model.createData()
            pin.framesForwardKinematics(part.model, own, q[in_q])
            for i, frame in enumerate(list(part.model.frames)[1:], 1):
                index = whole.getFrameId(f"{key}/{frame.name}", frame.type)
                expected = part.placement * own.oMf[i]
                assert data.oMf[index].isApprox(expected, 1e-12), frame.name


def test_names_are_prefixed_and_everything_of_a_joint_is_kept() -> None:
    given = parts()
    whole = compose(given, name="pair")
    assert whole.name == "pair"
    assert compose(given).name == "left + right + bar + other"
    assert list(whole.names)[1:] == [
        f"{key}/{name}" for key, part in given.items() for name in list(part.model.names)[1:]
    ]
    for key, part in given.items():
        in_q, in_v = split(whole, part, key)
        for field in ("lowerPositionLimit", "upperPositionLimit", "positionLimitMargin"):
            np.testing.assert_array_equal(getattr(whole, field)[in_q], getattr(part.model, field))
        for field in (
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
        ):
            np.testing.assert_array_equal(getattr(whole, field)[in_v], getattr(part.model, field))
    assert given["left"].model.names[1] == "panda_joint1"  # the parts are not changed


def test_a_part_can_be_fixed_to_an_earlier_one() -> None:
    """A gripper on a flange: they move together, and the arm carries its base."""
    arm, gripper = sample(), sample()
    placement = pin.SE3.Random()
    whole = compose({"arm": Part(arm), "grip": Part(gripper, placement, "arm/tool")})
    data, arm_data, grip_data = whole.createData(), arm.createData(), gripper.createData()
    for q, _ in states(whole):
        in_q, _ = split(whole, Part(arm), "arm")
        in_grip, _ = split(whole, Part(gripper), "grip")
        pin.framesForwardKinematics(whole, data, q)
        pin.framesForwardKinematics(arm, arm_data, q[in_q])
        pin.framesForwardKinematics(gripper, grip_data, q[in_grip])
        tool = arm_data.oMf[arm.getFrameId("tool")] * placement
        expected = tool * grip_data.oMf[gripper.getFrameId("tool")]
        assert data.oMf[whole.getFrameId("grip/tool")].isApprox(expected, 1e-12)
    base = next(frame.inertia.mass for frame in gripper.frames if frame.name == "base")
    own = [sum([m.inertias[i].mass for i in range(1, m.njoints)]) for m in (arm, gripper)]
    assert pin.computeTotalMass(whole) == pytest.approx(sum(own) + base, rel=1e-12)


def test_gravity_is_that_of_the_parts() -> None:
    given = parts()
    for part in given.values():
        part.model.gravity.linear = np.array([0, 0, -1.62])
    np.testing.assert_array_equal(compose(given).gravity.linear, [0, 0, -1.62])
    given["bar"].model.gravity.linear = np.zeros(3)
    with pytest.raises(MechanismError, match=r"'left' is .* that of 'bar' is \[0\. 0\. 0\.\]"):
        compose(given)


def test_reference_configurations_are_put_together() -> None:
    given = parts()
    left, right = given["left"].model, given["right"].model
    rng = np.random.default_rng(2)
    left.referenceConfigurations["home"] = rng.normal(size=left.nq)
    right.referenceConfigurations["home"] = rng.normal(size=right.nq)
    right.referenceConfigurations["away"] = rng.normal(size=right.nq)
    whole = compose(given)
    for name, holders in {"home": ["left", "right"], "away": ["right"]}.items():
        q = whole.referenceConfigurations[name]
        for key, part in given.items():
            in_q, _ = split(whole, part, key)
            if key in holders:
                expected = part.model.referenceConfigurations[name]
            else:
                expected = pin.neutral(part.model)
            np.testing.assert_array_equal(q[in_q], expected)


def test_wholes_can_be_parts() -> None:
    pair = compose({"a": Part(sample()), "b": Part(sample())})
    whole = compose({"first": Part(pair), "second": Part(pair)})
    assert whole.existFrame("second/b/tool")
    assert whole.nv == 4 * sample().nv


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({}, "no part was given"),
        ({"": Part(pin.Model())}, "a part cannot be called ''"),
        ({"a/b": Part(pin.Model())}, "a part cannot be called 'a/b'"),
        ({"a": pin.Model()}, "part 'a' must be a Part, not a Model"),
        (
            {"a": Part(sample(), parent="b/tool")},
            "parent of part 'a': no frame 'b/tool'; there are: universe",
        ),
    ],
)
def test_bad_parts_are_refused(given: dict[str, Part], why: str) -> None:
    with pytest.raises(MechanismError, match=why):
        compose(given)


def test_what_pinocchio_refuses_names_the_part() -> None:
    model = sample()
    model.lowerVelocityLimit = model.upperVelocityLimit + 1
    with pytest.raises(MechanismError, match=r"part 'b': .*min_velocity"):
        compose({"a": Part(sample()), "b": Part(model)})


# A body -------------------------------------------------------------------------------------------


def test_a_body_falls_and_turns_as_euler_says() -> None:
    """About its centre of mass: force m (a - g), moment I w' + w x I w."""
    mass, com = 2.0, np.array([0.1, -0.2, 0.3])
    inertia = np.array([[0.3, 0.02, 0.01], [0.02, 0.4, 0.03], [0.01, 0.03, 0.5]])
    grip = pin.SE3.Random()
    model = body("bar", mass, inertia, com, {"grip": grip})
    assert [frame.name for frame in model.frames] == ["universe", "root_joint", "bar", "grip"]
    assert model.frames[3].placement.isApprox(grip)
    data = model.createData()
    rng = np.random.default_rng(0)
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=6))
    v, a = rng.normal(size=(2, 6))
    linear, w, dlinear, dw = v[:3], v[3:], a[:3], a[3:]
    R = pin.Quaternion(q[3:]).toRotationMatrix()
    of_origin = dlinear + np.cross(w, linear) - R.T @ np.array([0, 0, -9.81])
    force = mass * (of_origin + np.cross(dw, com) + np.cross(w, np.cross(w, com)))
    moment = inertia @ dw + np.cross(w, inertia @ w) + np.cross(com, force)
    expected = np.concatenate([force, moment])
    np.testing.assert_allclose(pin.rnea(model, data, q, v, a), expected, rtol=1e-12)


@each(
    ("changes", "why"),
    [
        ({"mass": 0}, r"mass of body .bar. = 0: .* positive"),
        ({"mass": float("nan")}, r"= nan: it must be a positive number of kg"),
        ({"mass": "1"}, r"= .1.: it must be a positive number"),
        ({"inertia": [1, 2, 3]}, r"has shape \(3,\); it must be \(3, 3\)"),
        ({"inertia": "x"}, r"must be numbers of shape \(3, 3\)"),
        ({"inertia": np.full((3, 3), np.inf)}, "is not finite"),
        ({"inertia": [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]}, "must be symmetric"),
        ({"inertia": np.diag([1, 1, 3])}, "principal moments are 1, 1 and 3"),
        ({"inertia": np.diag([-1, 1, 1])}, "principal moments are -1"),
        ({"com": (1, 2)}, "com has shape"),
        ({"frames": {"bar": pin.SE3.Identity()}}, "cannot be called 'root_joint'"),
        ({"frames": {"": pin.SE3.Identity()}}, "cannot be called ''"),
    ],
)
def test_bodies_that_cannot_be_are_refused(changes: dict[str, object], why: str) -> None:
    given = {"name": "bar", "mass": 1.0, "inertia": np.eye(3)} | changes
    if "bar" in dict(given.get("frames", {})):
        given["frames"] = {"root_joint": pin.SE3.Identity()}
    with pytest.raises(InputError, match=why):
        body(**given)

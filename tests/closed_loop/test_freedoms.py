"""Idle freedoms, and freedoms that lack an actuator: told apart, named, and given least motion."""

from __future__ import annotations

import json

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, JointCoupling, LoopClosure, MechanismError, SingularityError
from rps_pin.closed_loop.dynamics.passive_joint_forces import JointEffects
from tests.worst import worst

Array = NDArray[np.float64]

CRANK, ROD = 0.1, 0.3


def slider_crank(off: float = 0.0) -> ClosedLoopModel:
    """A crank about y, a rod with a ball at both ends, a carriage along x; gravity along -z.

    The rod's centre of mass is off the line of the balls by a part of its length.
    """
    model = pin.Model()
    model.name = "slider_crank"
    crank = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "crank")
    at_tip = pin.SE3(np.eye(3), np.array([CRANK, 0.0, 0.0]))
    rod = model.addJoint(crank, pin.JointModelSpherical(), at_tip, "ball")
    slide = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    middle = np.array([ROD / 2, 0.0, off * ROD])
    thin = pin.Inertia(0.1, middle, np.diag([2e-6, 7.5e-4, 7.7e-4]))
    model.appendBodyToJoint(crank, pin.Inertia.FromSphere(0.2, 0.02), at_tip)
    model.appendBodyToJoint(rod, thin, pin.SE3.Identity())
    model.appendBodyToJoint(slide, pin.Inertia.FromSphere(0.3, 0.02), pin.SE3.Identity())
    model.addFrame(pin.Frame("bar", rod, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    end = pin.SE3(np.eye(3), np.array([ROD, 0.0, 0.0]))
    model.addFrame(pin.Frame("end", rod, 0, end, pin.FrameType.OP_FRAME))
    model.addJointFrame(slide)
    home = pin.neutral(model)
    home[model.joints[slide].idx_q] = CRANK + ROD
    return ClosedLoopModel(model, [LoopClosure("end", "slide", name="pin")], ["crank"], home=home)


def posed(mechanism: ClosedLoopModel, angle: float, spin: float) -> Array:
    """The closed configuration of a crank angle, the rod turned about its line by any angle."""
    model = mechanism.model
    dip = CRANK * np.sin(angle)  # about y, x turns towards -z
    rod_angle = np.arcsin(dip / ROD) + angle
    q = pin.neutral(model)
    q[model.joints[1].idx_q] = angle
    turn = pin.exp3(np.array([0.0, -rod_angle, 0.0])) @ pin.exp3(np.array([spin, 0.0, 0.0]))
    q[model.joints[2].idx_q : model.joints[2].idx_q + 4] = pin.Quaternion(turn).coeffs()
    q[model.joints[3].idx_q] = CRANK * np.cos(angle) + np.sqrt(ROD**2 - dip**2)
    return q


def slide_rate(angle: float) -> float:
    """d(slide)/d(crank), from the slider-crank's formula."""
    s, c = CRANK * np.sin(angle), CRANK * np.cos(angle)
    return -s - s * c / np.sqrt(ROD**2 - s**2)


def test_the_slider_follows_its_formula_whatever_the_rod_spins() -> None:
    mechanism, errors = slider_crank(), []
    rng = np.random.default_rng(0)
    slide = mechanism.model.joints[3].idx_v
    for angle in np.linspace(-3.0, 3.0, 31):
        q = posed(mechanism, float(angle), rng.uniform(-3, 3))
        assert mechanism.loop_gap(q) < 1e-12
        v = mechanism.velocity(q, [2.0])
        errors.append(v[slide] - 2 * slide_rate(angle))
        errors.append(mechanism.motion_basis(q)[slide, 0] - slide_rate(angle))
        errors.append(mechanism.loop_errors(q, v).velocity)
        a = mechanism.acceleration(q, v, [3.0])
        errors.append(mechanism.loop_errors(q, v, a).acceleration)
        h = 1e-5
        bend = (slide_rate(angle + h) - slide_rate(angle - h)) / (2 * h)
        errors.append((a[slide] - 3 * slide_rate(angle) - 4 * bend) * 1e-4)
        # The rod has no part of its spin: about its own line it stands still in the crank's.
        errors.append(v[mechanism.model.joints[2].idx_v])
    assert worst(*errors) < 1e-11


IDLE_SPIN = """<mujoco model="idle_spin">
  <compiler angle="radian"/>
  <worldbody>
    <body name="wheel">
      <joint name="crank" axis="0 1 0"/>
      <geom type="box" size="0.05 0.01 0.01" pos="0.05 0 0" mass="0.2"/>
      <body name="rod" pos="0.1 0 0">
        <joint name="ball" type="ball"/>
        <geom type="capsule" size="0.005" fromto="0 0 0 0.3 0 0" mass="0.1"/>
      </body>
    </body>
    <body name="carriage" pos="0.4 0 0">
      <joint name="slide" type="slide" axis="1 0 0"/>
      <geom type="box" size="0.02 0.02 0.02" mass="0.3"/>
    </body>
  </worldbody>
  <equality><connect name="pin" body1="carriage" body2="rod" anchor="0 0 0"/></equality>
  <actuator><motor joint="crank"/></actuator>
  <keyframe><key name="home" qpos="-1 0.96 0 0.28 0 0"/></keyframe>
</mujoco>"""

COUNT_EQUAL = """<mujoco model="count_equal">
  <compiler angle="radian"/>
  <worldbody>
    <body name="arm_1"><joint name="left" axis="0 1 0"/>
      <geom type="box" size="0.1 0.01 0.01" pos="0.1 0 0" mass="1"/></body>
    <body name="arm_2" pos="0 0.1 0"><joint name="right" axis="0 1 0"/>
      <geom type="box" size="0.1 0.01 0.01" pos="0.1 0 0" mass="1"/></body>
    <body name="wheel" pos="0 0.2 0"><joint name="idler" axis="0 1 0"/>
      <geom type="cylinder" size="0.05 0.01" euler="1.5707963267948966 0 0" mass="0.5"/></body>
  </worldbody>
  <equality><joint joint1="left" joint2="right"/></equality>
  <actuator><motor joint="left"/><motor joint="right"/></actuator>
</mujoco>"""


def test_a_file_with_a_spinning_rod() -> None:
    mechanism = ClosedLoopModel.from_mjcf(IDLE_SPIN)
    v = mechanism.velocity(mechanism.home, [1.0])
    assert v[-1] == pytest.approx(0.0761333, abs=5e-8)
    found = mechanism.describe()
    assert (found.mobility, found.actuation, found.lacking) == (2, "sufficient", ())
    assert [(freedom.size, freedom.joints) for freedom in found.idle] == [(1, ("ball",))]
    assert found.idle[0].links == ("rod",)
    assert "sufficient: 1 actuator, 1 idle freedom" in str(found)
    assert "idle: 1 motion of rod (joints: ball)" in str(found)
    assert json.loads(json.dumps(found.as_dict()))["idle"][0]["joints"] == ["ball"]
    assert found.condition == pytest.approx(mechanism.condition(found.configuration))
    assert found.condition < 100


def test_a_file_with_a_wheel_and_two_motors_on_one_freedom() -> None:
    mechanism = ClosedLoopModel.from_mjcf(COUNT_EQUAL)
    found = mechanism.describe()
    assert found.actuation == "redundant"
    assert "2 actuators, 1 more than needed, 1 idle freedom" in str(found)
    assert [freedom.joints for freedom in found.idle] == [("idler",)]
    still = np.zeros(3)
    tau = mechanism.inverse_dynamics(mechanism.home, still, still).tau
    np.testing.assert_allclose(tau, [-0.981, -0.981], rtol=1e-12)
    one = ClosedLoopModel.from_mjcf(COUNT_EQUAL, actuated=["left"])
    np.testing.assert_allclose(one.inverse_dynamics(one.home, still, still).tau, -1.962, rtol=1e-12)
    np.testing.assert_allclose(one.velocity(one.home, [1.0]), [1.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(mechanism.velocity(one.home, [1.0, 1.0]), [1, 1, 0], atol=1e-15)
    assert one.describe().actuation == "sufficient"


# What is idle -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("off", "idle"), [(0.0, True), (0.01, True), (0.04, True), (0.1, False)])
def test_a_rod_may_be_off_its_line_a_little(off: float, idle: bool) -> None:
    mechanism = slider_crank(off)
    found = mechanism.describe()
    assert (len(found.idle), len(found.lacking)) == ((1, 0) if idle else (0, 1))
    q = mechanism.home
    if idle:
        assert mechanism.velocity(q, [1.0])[-1] == pytest.approx(slide_rate(0.0), abs=1e-12)
        return
    assert found.lacking[0].joints == ("ball",)
    assert "without actuator: 1 motion of bar (joints: ball)" in str(found)
    for call in (mechanism.velocity, lambda q, u: mechanism.mass_matrix(q)):
        with pytest.raises(SingularityError, match="joint 'ball' can move while these stand still"):
            call(q, [1.0])


def test_a_spring_drives_what_would_be_idle() -> None:
    """A ball has no springs here: three hinges in its place have."""
    assert slider_crank().describe().actuation == "sufficient"
    hinged = pin.Model()
    last = hinged.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "wheel")
    hinged.appendBodyToJoint(last, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    first = hinged.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "arm")
    lever = pin.SE3(np.eye(3), np.array([0.2, 0.0, 0.0]))
    hinged.appendBodyToJoint(first, pin.Inertia.FromSphere(1.0, 0.1), lever)
    free = ClosedLoopModel(hinged, [], ["arm"])
    assert [freedom.joints for freedom in free.describe().idle] == [("wheel",)]
    effects = JointEffects.named(hinged, stiffness={"wheel": 2.0})
    sprung = ClosedLoopModel(hinged, [], ["arm"], effects=effects)
    assert [freedom.joints for freedom in sprung.describe().lacking] == [("wheel",)]
    losses = JointEffects.named(hinged, damping={"wheel": 2.0}, friction={"wheel": 1.0})
    lossy = ClosedLoopModel(hinged, [], ["arm"], effects=losses)
    assert lossy.describe().actuation == "sufficient"


@pytest.mark.parametrize("length", [0.001, 0.02, 1.0])
def test_a_pendulum_lacks_an_actuator_however_short(length: float) -> None:
    model = pin.Model()
    arm = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "arm")
    out = pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    model.appendBodyToJoint(arm, pin.Inertia.FromSphere(1.0, 0.1), out)
    bob = model.addJoint(arm, pin.JointModelRY(), out, "bob")
    below = pin.SE3(np.eye(3), np.array([0.0, 0.0, -length]))
    model.appendBodyToJoint(bob, pin.Inertia.FromSphere(0.1, 0.2 * length), below)
    mechanism = ClosedLoopModel(model, [], ["arm"])
    found = mechanism.describe()
    assert (found.actuation, found.idle) == ("underactuated", ())
    assert found.lacking[0].joints == ("bob",)
    for call in (mechanism.velocity, lambda q, u: mechanism.linearize(q, u.repeat(2), u)):
        with pytest.raises(SingularityError, match="'bob'"):
            call(mechanism.home, np.ones(1))


def test_a_spherical_pendulum_spins_idly_and_swings() -> None:
    """Its three freedoms: about the line of its centre of mass, and two that raise it."""
    model = pin.Model()
    ball = model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    below = pin.SE3(np.eye(3), np.array([0.1, 0.2, -0.4]))
    model.appendBodyToJoint(ball, pin.Inertia.FromSphere(0.1, 0.02), below)
    model.addJoint(ball, pin.JointModelRZ(), below, "tool")
    model.appendBodyToJoint(2, pin.Inertia.FromSphere(0.1, 0.02), pin.SE3.Identity())
    found = ClosedLoopModel(model, [], ["tool"]).describe()
    assert [freedom.size for freedom in found.idle] == [1]
    assert [freedom.size for freedom in found.lacking] == [2]


def test_an_arm_driven_through_a_gear_by_nobody_is_not_idle() -> None:
    """The rotor turns 200 times as fast as the arm, on the spot."""
    model = pin.Model()
    arm = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "arm")
    lever = pin.SE3(np.eye(3), np.array([0.2, 0.0, 0.0]))
    model.appendBodyToJoint(arm, pin.Inertia.FromSphere(1.0, 0.1), lever)
    rotor = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "rotor")
    model.appendBodyToJoint(rotor, pin.Inertia.FromSphere(0.1, 0.05), pin.SE3.Identity())
    model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    gear = JointCoupling("rotor", "arm", ratio=200.0)
    found = ClosedLoopModel(model, [gear], ["slide"]).describe()
    assert (found.actuation, found.idle) == ("underactuated", ())


# One coordinate of a joint ------------------------------------------------------------------------


def test_one_coordinate_of_a_ball_can_be_driven() -> None:
    """The rod's spin, about its own x axis: then nothing is idle."""
    mechanism = slider_crank(0.1)
    both = ClosedLoopModel(
        mechanism.model, mechanism.closures, ["crank", "ball.x"], home=mechanism.home
    )
    np.testing.assert_array_equal(both.actuated_indices, [0, 1])
    assert both.actuated == ("crank", "ball.x")
    found = both.describe()
    assert found.actuation == "sufficient"
    assert [joint.actuated for joint in found.joints] == [1, 1, 0]
    assert "1 of 3 actuated" in str(found)
    assert found.passive == ("slide",)
    v = both.velocity(both.home, [1.0, 5.0])
    assert v[1] == 5.0
    # As an independent velocity, too.
    basis = mechanism.motion_basis(posed(mechanism, 0.7, 0.0), ["slide", "ball.x"])
    assert basis.shape == (5, 2)


def test_coordinates_that_are_not_there_are_told() -> None:
    mechanism = slider_crank()
    for names, message in (
        (["ball.w"], "joint 'ball' has ball.x, ball.y, ball.z"),
        (["crank.x"], "joint 'crank' has one coordinate: name the joint"),
        (["bal.x"], "no joint 'bal.x' to actuate; there are: crank, ball, slide"),
        (["ball", "ball.x"], "a coordinate of 'ball.x' to actuate is named twice"),
        (["ball.x", "ball.x"], "'ball.x' is named twice"),
    ):
        with pytest.raises(MechanismError, match=message):
            ClosedLoopModel(mechanism.model, mechanism.closures, names)

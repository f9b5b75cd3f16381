"""Damping, friction and springs: the law itself, and its place in the dynamics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, InputError, JointEffects, MechanismError
from rps_pin.closed_loop.dynamics.springs import Springs
from tests.closed_loop.mechanisms import joint, link, robot
from tests.closed_loop.random_mechanisms import slopes

Array = NDArray[np.float64]


def tree() -> pin.Model:
    """A ball, a hinge, a slider, an unbounded turn and a universal joint: nv = 8."""
    model = pin.Model()
    joints = {
        "ball": pin.JointModelSpherical(),
        "hinge": pin.JointModelRX(),
        "slider": pin.JointModelPX(),
        "turn": pin.JointModelRUBZ(),
        "cross": pin.JointModelUniversal(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])),
    }
    parent = 0
    for name, model_of_joint in joints.items():
        parent = model.addJoint(parent, model_of_joint, pin.SE3.Identity(), name)
        model.appendBodyToJoint(parent, pin.Inertia.FromSphere(1.0, 0.3), pin.SE3.Identity())
    return model


def pendulum(effects: JointEffects | None, gravity: float = 0.0) -> ClosedLoopModel:
    """One hinge: 2 kg at 0.5 m, no inertia of its own about there."""
    urdf = robot(link("bob", 2.0, "0.5 0 0", 1e-9), joint("revolute", "base", "bob"))
    return ClosedLoopModel.from_urdf(
        urdf, [], ["bob_joint"], gravity=(0, 0, gravity), effects=effects
    )


def of_pendulum(**given: float) -> JointEffects:
    speed = given.pop("friction_speed", 0.01)
    model = pendulum(None).model
    named = {what: {"bob_joint": value} for what, value in given.items()}
    return JointEffects.named(model, **named, friction_speed=speed)


# The law ------------------------------------------------------------------------------------------


def test_names_find_their_velocities() -> None:
    effects = JointEffects.named(
        tree(),
        damping={"ball": [1.0, 2.0, 3.0], "turn": 4.0},
        friction={"cross": 5.0},
        stiffness={"slider": 6.0},
        rest={"slider": 0.7, "hinge": -0.1},
    )
    np.testing.assert_array_equal(effects.damping, [1, 2, 3, 0, 0, 4, 0, 0])
    np.testing.assert_array_equal(effects.friction, [0, 0, 0, 0, 0, 0, 5, 5])
    np.testing.assert_array_equal(effects.stiffness, [0, 0, 0, 0, 6, 0, 0, 0])
    np.testing.assert_array_equal(effects.rest, [0, 0, 0, -0.1, 0.7, 0, 0, 0])


def test_force_is_the_law() -> None:
    effects = of_pendulum(damping=0.3, friction=0.2, stiffness=5.0, rest=0.4, friction_speed=0.1)
    found = effects.resistance(np.array([0.1]))
    found = found + Springs(pendulum(None).model, effects).force(np.array([1.0]))
    assert found == pytest.approx([0.3 * 0.1 + 0.2 * np.tanh(1.0) + 5.0 * 0.6], rel=1e-14)


def test_friction_nears_its_full_size() -> None:
    effects = of_pendulum(friction=0.2)
    for speed, share in ((0.01, np.tanh(1.0)), (0.1, 1.0), (-50.0, -1.0), (0.0, 0.0)):
        force = effects.resistance(np.array([speed]))
        assert force == pytest.approx([0.2 * share], rel=1e-8)


@pytest.mark.parametrize("speed", [0.0, 0.004, -0.03, 1.0, 7.0, -100.0])
def test_slopes_are_those_of_the_force(speed: float) -> None:
    """At any speed: 100 rad/s are 10000 times the friction speed."""
    effects, at = of_pendulum(damping=0.3, friction=0.2), np.array([speed])
    found = slopes(lambda dv: effects.resistance(at + dv), 1, h=1e-5)
    assert effects.slopes(at) == pytest.approx(found[0], rel=1e-7)


def test_springs_hold_the_energy_that_stretching_takes() -> None:
    springs = Springs(pendulum(None).model, of_pendulum(stiffness=5.0, rest=0.4))
    slope = slopes(lambda dq: np.array(springs.energy(1.0 + dq)), 1)
    assert slope == pytest.approx(springs.force(np.ones(1)), rel=1e-9)
    assert springs.energy(np.array([0.4])) == 0


def test_arrays_are_copies_that_nobody_changes() -> None:
    given = np.ones(2)
    effects = JointEffects(given, given, given, given)
    given[:] = 7
    np.testing.assert_array_equal(effects.damping, [1, 1])
    with pytest.raises(ValueError, match="read-only"):
        effects.damping[0] = 2


# In the dynamics ----------------------------------------------------------------------------------


def test_pendulum_s_torque_and_acceleration_by_hand() -> None:
    """m l^2 = 0.5 kg m^2; the weight's moment is m g l cos q; lifted about -y."""
    effects = of_pendulum(damping=0.3, friction=0.2, stiffness=5.0, rest=0.4, friction_speed=0.1)
    mechanism = pendulum(effects, gravity=-9.81)
    q, v, a = np.array([1.0]), np.array([2.0]), np.array([3.0])
    inertia, weight = 0.5 + 1e-9, 9.81 * np.cos(1.0)
    resisting = 0.3 * 2 + 0.2 * np.tanh(20.0) + 5 * 0.6
    torque = inertia * 3 + weight + resisting
    assert mechanism.inverse_dynamics(q, v, a).tau == pytest.approx([torque], rel=1e-12)
    expected = (7.0 - weight - resisting) / inertia
    assert mechanism.forward_dynamics(q, v, [7.0]) == pytest.approx([expected], rel=1e-12)
    assert mechanism.bias(q, v) == pytest.approx([weight + resisting], rel=1e-12)
    assert mechanism.gravity_forces(q) == pytest.approx([weight], rel=1e-12)


def test_rotors_are_inertia_on_the_diagonal() -> None:
    mechanism = pendulum(None)
    mechanism.model.armature = np.array([0.3])
    q, v = np.array([1.0]), np.array([2.0])
    assert mechanism.mass_matrix(q) == pytest.approx(np.array([[0.8]]), rel=1e-8)
    assert mechanism.inverse_dynamics(q, v, np.array([3.0])).tau == pytest.approx([2.4], rel=1e-8)
    assert mechanism.energy(q, v)[0] == pytest.approx(0.8 * 4 / 2, rel=1e-8)


def test_springs_count_as_potential_energy() -> None:
    q = np.array([1.0])
    effects = of_pendulum(stiffness=5.0, rest=0.4)
    plain = pendulum(None, gravity=-9.81).energy(q, np.zeros(1))[1]
    sprung = pendulum(effects, gravity=-9.81).energy(q, np.zeros(1))[1]
    assert sprung - plain == pytest.approx(5 * 0.6**2 / 2, rel=1e-12)


# Refusals -----------------------------------------------------------------------------------------


def test_unknown_joints_are_refused_with_those_there_are() -> None:
    with pytest.raises(MechanismError, match="damping: no joint 'knee'; there are: ball, hinge"):
        JointEffects.named(tree(), damping={"knee": 1.0})


@pytest.mark.parametrize("value", [[1.0, 2.0], "much"])
def test_values_that_do_not_fit_the_joint_are_refused(value: object) -> None:
    with pytest.raises(MechanismError, match=r"damping of joint 'ball' = .* one number, or 3"):
        JointEffects.named(tree(), damping={"ball": value})


@pytest.mark.parametrize("what", ["damping", "friction", "stiffness"])
def test_negative_numbers_are_refused(what: str) -> None:
    with pytest.raises(InputError, match=f"{what} must not be negative"):
        of_pendulum(**{what: -1.0})


@pytest.mark.parametrize("what", ["damping", "friction", "stiffness", "rest"])
def test_numbers_that_are_not_finite_are_refused(what: str) -> None:
    with pytest.raises(InputError, match=f"{what} is not finite"):
        of_pendulum(**{what: np.nan})


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_friction_speed_is_positive(bad: float) -> None:
    with pytest.raises(InputError, match=r"friction_speed = .* positive"):
        of_pendulum(friction=1.0, friction_speed=bad)


def test_effects_of_another_tree_are_refused() -> None:
    with pytest.raises(InputError, match="effects are of 8 velocities, not 1"):
        pendulum(JointEffects.named(tree()))

"""Springs of joints of all kinds: their energy by hand, force and slopes by differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rps_pin import ClosedLoopModel, JointEffects, MechanismError
from rps_pin.closed_loop.dynamics.springs import Springs
from tests.closed_loop.random_mechanisms import case, random_inertia, random_placement, slopes
from tests.closed_loop.test_derivatives import check_forward, check_inverse
from tests.each import each
from tests.worst import worst

Array = NDArray[np.float64]
X, Y, Z = np.eye(3)
KINDS = {
    "hinge": (pin.JointModelRX(), [5.0]),
    "slider": (pin.JointModelPY(), [5.0]),
    "cross": (pin.JointModelUniversal(X, Y), [5.0, 2.0]),
    "angles": (pin.JointModelSphericalZYX(), [5.0, 2.0, 3.0]),
    "translation": (pin.JointModelTranslation(), [5.0, 2.0, 3.0]),
    "ball": (pin.JointModelSpherical(), [4.0] * 3),
    "free": (pin.JointModelFreeFlyer(), [7.0] * 3 + [4.0] * 3),
    "turn of a free one": (pin.JointModelFreeFlyer(), [0.0] * 3 + [4.0] * 3),
    "shift of a free one": (pin.JointModelFreeFlyer(), [7.0] * 3 + [0.0] * 3),
}


def sprung(kind: str, rng: np.random.Generator) -> tuple[pin.Model, JointEffects, Springs]:
    """A hinge, then a joint with a spring that has a rest of its own."""
    joint, stiffness = KINDS[kind]
    model = pin.Model()
    for name, one in (("first", pin.JointModelRZ()), ("j", joint)):
        index = model.addJoint(model.njoints - 1, one, random_placement(rng), name)
        model.addJointFrame(index)
        model.appendBodyToJoint(index, random_inertia(rng), pin.SE3.Identity())
    rest = rng.normal(size=len(stiffness))
    effects = JointEffects.named(model, stiffness={"j": stiffness}, rest={"j": rest})
    return model, effects, Springs(model, effects)


def energy_by_hand(kind: str, q: Array, rest: Array) -> float:
    """k |stretch|^2 / 2, the angle of a turn by SciPy."""
    stiffness = np.array(KINDS[kind][1])
    own = q[1:]
    if own.size == stiffness.size:
        return float(stiffness @ (own - rest) ** 2) / 2
    turn = Rotation.from_rotvec(rest[-3:]).inv() * Rotation.from_quat(own[-4:])
    energy = stiffness[-1] * turn.magnitude() ** 2 / 2
    if own.size == 7:
        energy += stiffness[0] * float(np.sum((own[:3] - rest[:3]) ** 2)) / 2
    return float(energy)


def differences(kind: str, rng: np.random.Generator) -> tuple[float, Array, Array]:
    """Of a joint's energy from that by hand, its force and slope from differences of energy."""
    model, effects, springs = sprung(kind, rng)
    q = pin.integrate(model, pin.neutral(model), 1.2 * rng.normal(size=model.nv))

    def energy(d: Array) -> Array:
        return np.array(springs.energy(pin.integrate(model, q, d)))

    def force(d: Array) -> Array:
        return springs.force(pin.integrate(model, q, d))

    return (
        springs.energy(q) - energy_by_hand(kind, q, effects.rest[1:].copy()),
        slopes(energy, model.nv, h=1e-5) - springs.force(q),
        slopes(force, model.nv, h=1e-5) - springs.slope(q),
    )


@each("kind", KINDS)
def test_energy_is_that_of_the_stretch_and_the_force_its_slope(kind: str) -> None:
    rng = np.random.default_rng(0)
    found = [differences(kind, rng) for _ in range(20)]
    energies, forces, bent = zip(*found, strict=True)
    assert worst(*energies) < 1e-11
    assert worst(*forces) < 1e-7
    assert worst(*bent) < 1e-6


@each("turns", [0.3, 1.0, 2.9, -0.5])
def test_a_turn_about_an_axis_is_resisted_about_it(turns: float) -> None:
    """And beyond half a turn, the shorter way round."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    rest, axis = np.array([0.4, -1.1, 0.3]), np.array([2.0, -1.0, 2.0]) / 3
    effects = JointEffects.named(model, stiffness={"ball": 2.0}, rest={"ball": rest})
    springs = Springs(model, effects)
    at = Rotation.from_rotvec(rest)
    q = (at * Rotation.from_rotvec(turns * axis)).as_quat()
    for coordinates in (q, -q):
        assert worst(springs.force(coordinates) - 2 * turns * axis) < 1e-14
    q = (at * Rotation.from_rotvec((turns + 2 * np.pi) * axis)).as_quat()
    assert worst(springs.force(q) - 2 * turns * axis) < 1e-13
    assert worst(springs.force(at.as_quat())) < 1e-15


def test_a_ball_swings_about_an_axis_as_a_torsional_oscillator() -> None:
    """I theta'' = -k theta, the axis a principal one: theta = theta_0 cos(sqrt(k / I) t)."""
    model = pin.Model()
    index = model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    inertia = pin.Inertia(1.0, np.zeros(3), np.diag([0.02, 0.03, 0.045]))
    model.appendBodyToJoint(index, inertia, pin.SE3.Identity())
    rest = np.array([0.5, 0.2, -0.9])
    effects = JointEffects.named(model, stiffness={"ball": 0.8}, rest={"ball": rest})
    mechanism = ClosedLoopModel(model, [], [], effects=effects)
    at = Rotation.from_rotvec(rest)
    start = (at * Rotation.from_rotvec([0.0, 1.3, 0.0])).as_quat()
    run = mechanism.simulate(start, duration=2.0, step=2e-3)
    angles = [(at.inv() * Rotation.from_quat(q)).as_rotvec() for q in run.q]
    expected = 1.3 * np.cos(np.sqrt(0.8 / 0.03) * run.time)
    assert worst(np.array(angles) - np.outer(expected, Y)) < 1e-6


def test_energy_is_kept_by_balls_and_free_joints_in_a_loop() -> None:
    c = case(3, effects=False, joints=("ball", "free", "revolute"))
    model = c.mechanism.model
    stiffness, rest = {}, {}
    for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
        stiffness[name] = 30.0
        rest[name] = np.full(joint.nv, 0.2)
    effects = JointEffects.named(model, stiffness=stiffness, rest=rest)
    mechanism = ClosedLoopModel(model, c.mechanism.closures, [], home=c.q, effects=effects)
    run = mechanism.simulate(c.q, duration=0.3, step=5e-4)
    springs = np.array([mechanism.system.springs.energy(q) for q in run.q])
    assert np.ptp(springs) > 1.0
    assert np.ptp(run.energy) < 1e-6 * np.ptp(springs)


@each("seed", range(3))
def test_derivatives_with_springs_are_those_of_central_differences(seed: int) -> None:
    c = case(seed, effects=True, joints=("ball", "free", "revolute"))
    assert c.mechanism.system.springs.turns
    check_inverse(c)
    check_forward(c)


def test_joints_without_springs_are_told() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelRUBX(), pin.SE3.Identity(), "turn")
    model.addJoint(1, pin.JointModelPlanar(), pin.SE3.Identity(), "plane")
    for name in ("turn", "plane"):
        effects = JointEffects.named(model, stiffness={name: 1.0})
        with pytest.raises(MechanismError, match=rf"joint '{name}' \(\w+\) has . coordinates for"):
            ClosedLoopModel(model, [], [], effects=effects)


@each(
    ("kind", "stiffness", "why"),
    [
        ("ball", [1.0, 1.0, 2.0], "the turns of a joint have one stiffness"),
        ("free", [1.0, 2.0, 1.0, 3.0, 3.0, 3.0], "the shifts of a joint have one stiffness"),
        ("ball", [1.0, 2.0], "it must be one number, or 3"),
    ],
)
def test_uneven_springs_are_refused(kind: str, stiffness: list[float], why: str) -> None:
    model = sprung(kind, np.random.default_rng(0))[0]
    with pytest.raises(MechanismError, match=f"stiffness of joint 'j' = .*{why}"):
        ClosedLoopModel(
            model, [], [], effects=JointEffects.named(model, stiffness={"j": stiffness})
        )

"""Rotation vectors of any length below a whole turn: rates, accelerations and forces of that one.

A wrist of three turns is its own inverse: its actuators' motion is found by differences of the
coordinates alone, and the frame's angular velocity by differences of its rotation.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, Task
from rps_pin.closed_loop.constraints.rotation_vector import rotation_vector
from tests.worst import worst

ANGLES = [1.0, 3.0, np.pi - 1e-7, np.pi, np.pi + 1e-9, 3.6, 5.0]
AXIS = np.array([0.3, -0.2, 0.93]) / np.linalg.norm([0.3, -0.2, 0.93])
RATE, ACCELERATION = np.array([0.4, 0.5, -0.2]), np.array([0.1, -0.3, 0.2])


@pytest.fixture(scope="module")
def interpreted() -> Task:
    model, joint = pin.Model(), 0
    kinds = (pin.JointModelRZ, pin.JointModelRY, pin.JointModelRX)
    inertia = pin.Inertia(1.0, np.array([0.1, 0.02, 0.03]), np.diag([0.1, 0.11, 0.12]))
    for name, kind in zip("zyx", kinds, strict=True):
        joint = model.addJoint(joint, kind(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("tool", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    wrist = ClosedLoopModel(model, [], list("zyx"))
    return Task(wrist, frame="tool", coordinates=["rx", "ry", "rz"])


@pytest.fixture(scope="module", params=["Pinocchio", "generated"])
def task(interpreted: Task, request: pytest.FixtureRequest) -> Task:
    if request.param == "Pinocchio":
        return interpreted
    pytest.importorskip("casadi")
    return interpreted.compile(compiler="tcc")


@pytest.mark.parametrize("angle", ANGLES)
def test_motions(task: Task, angle: float) -> None:
    x, h = angle * AXIS, 1e-4
    q = task.follow(np.linspace(0.1, angle, 40)[:, None] * AXIS)[-1]

    def at(t: float) -> np.ndarray:
        moved = x + t * RATE + t * t / 2 * ACCELERATION
        return task.configuration(moved, q, within_limits=False)

    ahead, behind = [at(k * h) for k in (1, 2)], [at(-k * h) for k in (1, 2)]
    v = (8 * (ahead[0] - behind[0]) - (ahead[1] - behind[1])) / (12 * h)
    a = (16 * (ahead[0] + behind[0]) - ahead[1] - behind[1] - 30 * at(0.0)) / (12 * h * h)
    state = task.state(x, RATE, ACCELERATION, q, within_limits=False)
    assert worst(task.at(state.q, x) - x) < 1e-14
    assert worst(state.v - v) < 1e-10  # differences
    assert worst(state.a - a) < 1e-5
    assert worst(task.jacobian(q, x=x) @ RATE - state.v) < 1e-14
    assert worst(task.rate(state.q, state.v, x=x) - RATE) < 1e-14
    assert worst(task.bias(q, RATE, x=x) - RATE @ task.hessian(q, x=x) @ RATE) < 1e-12
    # Power, and the frame's twist, by the rotation's derivative.
    forces = np.array([0.3, -1.0, 0.6])
    tau = task.forces_to_actuators(q, forces, x=x)
    assert abs(tau @ state.v - forces @ RATE) < 1e-13
    assert worst(task.forces_to_task(q, tau, x=x) - forces) < 1e-13
    turned = pin.log3(pin.exp3(x + h * RATE) @ pin.exp3(x - h * RATE).T) / (2 * h)
    assert worst(task.twist_map(q, x=x)[3:] @ RATE - turned) < 1e-7
    kinetic = pin.computeKineticEnergy(task.mechanism.model, pin.Data(task.mechanism.model), q, v)
    assert abs(RATE @ task.mass_matrix(q, x=x) @ RATE / 2 - kinetic) < 1e-9


def test_stiffness_of_the_longer_vector(interpreted: Task) -> None:
    """The slope of a spring's torque in the actuators' coordinates, pulled back to the task's."""
    x, stiffness = 3.6 * AXIS, np.diag([3.0, 4.0, 5.0])
    q = interpreted.follow(np.linspace(0.1, 3.6, 40)[:, None] * AXIS)[-1]
    tau = np.array([0.2, -0.4, 0.1])

    def force(shifted: np.ndarray) -> np.ndarray:
        there = interpreted.configuration(shifted, q, within_limits=False)
        pushed = tau + stiffness @ (there - q)
        return interpreted.forces_to_task(there, pushed, x=shifted)

    h = 1e-6
    slope = [(force(x + h * axis) - force(x - h * axis)) / (2 * h) for axis in np.eye(3)]
    found = interpreted.gains_to_task(q, stiffness, forces=tau, x=x)
    assert worst(found - np.array(slope).T) < 1e-7
    back = interpreted.gains_to_actuators(q, found, forces=tau, x=x)
    assert worst(back - stiffness) < 1e-10


def test_without_coordinates_the_shorter_vector_is_meant(interpreted: Task) -> None:
    x = 3.6 * AXIS
    q = interpreted.follow(np.linspace(0.1, 3.6, 40)[:, None] * AXIS)[-1]
    short = (3.6 - 2 * np.pi) * AXIS
    assert worst(interpreted.at(q) - short) < 1e-13
    assert worst(interpreted.jacobian(q) - interpreted.jacobian(q, x=short)) == 0.0
    assert worst(interpreted.jacobian(q) - interpreted.jacobian(q, x=x)) > 0.1


@pytest.mark.parametrize("angle", [1e-300, 1e-18, 1e-9, 1e-3, 1.0, 3.0, 3.14159265, np.pi])
def test_vectors_of_rotations_keep_their_digits(angle: float) -> None:
    rng = np.random.default_rng(1)
    for axis in rng.normal(size=(50, 3)):
        vector = angle * axis / np.linalg.norm(axis)
        found = rotation_vector(pin.exp3(vector))
        found = found if found @ vector >= 0 else found + 2 * np.pi * axis / np.linalg.norm(axis)
        assert worst(found - vector) < 4e-15 * max(angle, 1e-300)

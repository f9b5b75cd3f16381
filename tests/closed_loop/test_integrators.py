"""Steps on the configuration manifold: their orders, against other integrators and closed forms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from rps_pin.closed_loop.simulation.integrators import AdaptiveStepper, rk4_step, times

Array = NDArray[np.float64]

INERTIA = np.array([0.3, 0.7, 0.9])
SPIN = np.array([1.3, -0.8, 2.1])
TIP = np.array([0.4, -0.2, 0.5])  # a constant torque fixed in the body


def ball() -> pin.Model:
    """A rigid body on a ball joint at its centre of mass."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.diag(INERTIA)), pin.SE3())
    return model


def euler(t: float, q: Array, v: Array) -> Array:
    """Euler's equations, with a torque that grows in time."""
    return (t * TIP - np.cross(v, INERTIA * v)) / INERTIA


def reference(duration: float) -> tuple[Array, Array]:
    """Rotation and spin, of the matrix's own differential equation R' = R [w]."""

    def slope(t: float, y: Array) -> Array:
        R, w = y[:9].reshape(3, 3), y[9:]
        return np.concatenate([(R @ pin.skew(w)).ravel(), euler(t, w, w)])

    start = np.concatenate([np.eye(3).ravel(), SPIN])
    solved = solve_ivp(slope, (0, duration), start, method="DOP853", rtol=1e-13, atol=1e-13)
    return solved.y[:9, -1].reshape(3, 3), solved.y[9:, -1]


def off(q: Array, R: Array) -> float:
    """Angle between a quaternion (x, y, z, w) and a rotation matrix."""
    return float((Rotation.from_quat(q).inv() * Rotation.from_matrix(R)).magnitude())


def test_rk4_on_rotations_is_of_order_four() -> None:
    model, duration = ball(), 2.0
    R, w = reference(duration)
    errors = []
    for count in (40, 80, 160):
        h, state = duration / count, (pin.neutral(model), SPIN)
        for k in range(count):
            state = rk4_step(model, euler, k * h, state, h)
        errors.append((off(state[0], R), np.linalg.norm(state[1] - w)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders[-1], 4, atol=0.25)
    assert errors[-1][0] < 1e-5


def test_rk4_is_the_classical_method_where_coordinates_are_numbers() -> None:
    """Of x'' = -x one step is the exponential's series to the fourth power of h."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slide")
    h, x, v = 0.3, 0.7, -0.4
    series = np.eye(2)
    term = np.eye(2)
    for power in range(1, 5):
        term = term @ (h * np.array([[0, 1], [-1, 0]])) / power
        series = series + term
    got = rk4_step(model, lambda t, q, v: -q, 0.0, (np.array([x]), np.array([v])), h)
    np.testing.assert_allclose(np.concatenate(got), series @ [x, v], atol=1e-15)


def test_a_first_acceleration_that_is_known_is_not_computed_again() -> None:
    model, calls = ball(), []

    def counted(t: float, q: Array, v: Array) -> Array:
        calls.append(t)
        return euler(t, q, v)

    state = pin.neutral(model), SPIN
    with_it = rk4_step(model, counted, 0.1, state, 0.02, euler(0.1, *state))
    assert calls == pytest.approx([0.11, 0.11, 0.12])
    without = rk4_step(model, counted, 0.1, state, 0.02)
    assert len(calls) == 7
    np.testing.assert_array_equal(np.concatenate(with_it), np.concatenate(without))


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_adaptive_steps_keep_their_tolerance(tolerance: float) -> None:
    model, duration = ball(), 2.0
    R, w = reference(duration)
    stepper = AdaptiveStepper(model, tolerance, 1e-3)
    t, state = 0.0, (pin.neutral(model), SPIN)
    while t < duration:
        t, at = stepper.step(euler, t, state, duration)
        state = at(t)
    assert t == duration
    assert off(state[0], R) < 100 * tolerance
    assert np.linalg.norm(state[1] - w) < 100 * tolerance


def test_adaptive_steps_interpolate_between_their_ends() -> None:
    model = ball()
    stepper = AdaptiveStepper(model, 1e-11, 0.02)
    end, at = stepper.step(euler, 0.0, (pin.neutral(model), SPIN), 1.0)
    assert 0 < end < 1
    for part in (0.0, 0.3, 0.8, 1.0):
        q, v = at(part * end)
        R, w = reference(part * end) if part else (np.eye(3), SPIN)
        assert off(q, R) < 1e-9
        np.testing.assert_allclose(v, w, atol=1e-9)


def test_adaptive_steps_go_on_with_the_last_length_that_was_not_cut_short() -> None:
    """Two thousand short intervals do not make the step after them as short."""
    model = ball()
    stepper = AdaptiveStepper(model, 1e-8, 1e-3)
    free, _ = stepper.step(euler, 0.0, (pin.neutral(model), SPIN), 10.0)
    free, _ = stepper.step(euler, 0.0, (pin.neutral(model), SPIN), 10.0)
    cut, _ = stepper.step(euler, 0.0, (pin.neutral(model), SPIN), 1e-6)
    assert cut == 1e-6
    again, _ = stepper.step(euler, 0.0, (pin.neutral(model), SPIN), 10.0)
    assert again >= free > 1e-3


@pytest.mark.parametrize(
    ("duration", "step", "expected"),
    [
        (0.3, 0.1, [0, 0.1, 0.2, 0.3]),  # 0.3 / 0.1 is not 3 in floating point
        (0.25, 0.1, [0, 0.1, 0.2, 0.25]),
        (0.05, 0.1, [0, 0.05]),
    ],
)
def test_the_last_interval_ends_with_the_duration(
    duration: float, step: float, expected: list[float]
) -> None:
    found = list(times(duration, step))
    assert [k for k, _ in found] == list(range(len(expected)))
    assert [t for _, t in found] == pytest.approx(expected, rel=1e-15)
    assert found[-1][1] == duration

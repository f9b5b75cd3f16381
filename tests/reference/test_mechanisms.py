"""The references of the well-known mechanisms against each other: no code of the package runs here.

Lagrange with multipliers (SymPy), d'Alembert on closed forms, Newton-Euler, and MuJoCo.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.reference import delta, five_bar, four_bar, jets, slider_crank, stewart, virtual_power
from tests.reference.mujoco_loops import MujocoLoops
from tests.reference.newton_euler import Jet
from tests.reference.parallel import ankle, linear_delta, planar_rrr, rotary_stewart, rrs

Array = NDArray[np.float64]


def delta_state(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    position = np.array([0, 0, -0.55]) + rng.uniform(-0.12, 0.12, size=3)
    return position, rng.normal(size=3), rng.normal(scale=20.0, size=3)


def five_bar_state(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    q = np.array([2.0, 1.1]) + rng.uniform(-0.3, 0.3, size=2)
    return q, rng.normal(scale=3.0, size=2), rng.normal(scale=20.0, size=2)


def crank_state(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    return (
        rng.uniform(-np.pi, np.pi, size=1),
        rng.normal(scale=5.0, size=1),
        rng.normal(scale=30.0, size=1),
    )


def near(home: list[float], reach: float) -> Callable[[np.random.Generator], tuple[Array, ...]]:
    """States about a home."""
    size = len(home)

    def state(rng: np.random.Generator) -> tuple[Array, Array, Array]:
        at = np.array(home) + rng.uniform(-reach, reach, size=size)
        return at, rng.normal(scale=5 * reach, size=size), rng.normal(scale=50 * reach, size=size)

    return state


def test_four_bar_by_lagrange_and_by_one_generalised_inertia() -> None:
    rng = np.random.default_rng(0)
    equations, closed_form = four_bar.equations(), four_bar.FOUR_BAR
    for _ in range(40):
        angle, rate, acceleration = (x[0] for x in crank_state(rng))
        q = np.array([np.arctan2(u[1], u[0]) for u in closed_form.directions(angle)])
        v, a = equations.completed(q, [rate], [acceleration], [0])
        tau, force = equations.inverse_dynamics(q, v, a, [0])
        assert np.abs(equations.terms(q, v)[4]).max() < 1e-14
        # The closed form differentiates once by differences.
        assert tau[0] == pytest.approx(closed_form.torque(angle, rate, acceleration), rel=1e-8)
        expected = closed_form.knee_force(angle, rate, acceleration)
        np.testing.assert_allclose(force, expected, rtol=0, atol=1e-7 * np.abs(expected).max())


def test_five_bar_by_lagrange_and_by_virtual_power() -> None:
    rng = np.random.default_rng(1)
    for _ in range(40):
        q, v, a = five_bar_state(rng)
        joints = five_bar.joints(Jet(q, v, a))
        left, left_arm, right, right_arm = joints.values()
        angles = jets.stacked(left, left + left_arm, right, right + right_arm)
        drift = five_bar.equations().completed(angles.value, v, a, [0, 2])
        np.testing.assert_allclose(angles.first, drift[0], rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(angles.second, drift[1], rtol=1e-10, atol=1e-9)
        found, _ = five_bar.equations().inverse_dynamics(*drift_state(angles), [0, 2])
        expected = virtual_power.generalised_forces(five_bar.bodies, q, v, a)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def drift_state(curve: Jet) -> tuple[Array, Array, Array]:
    return curve.value, curve.first, curve.second


def test_slider_crank_by_lagrange_and_by_virtual_power() -> None:
    rng = np.random.default_rng(2)
    for _ in range(40):
        q, v, a = crank_state(rng)
        joints = slider_crank.joints(Jet(q, v, a))
        crank = joints["crank_joint"]
        angles = jets.stacked(crank, crank + joints["coupler_joint"])
        found, _ = slider_crank.equations().inverse_dynamics(*drift_state(angles), [0])
        expected = virtual_power.generalised_forces(slider_crank.bodies, q, v, a)
        np.testing.assert_allclose(found, expected, rtol=1e-11)


def test_delta_by_lagrange_and_by_virtual_power() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        p, v, a = delta_state(rng)
        arms = delta.angles(Jet(p, v, a))
        np.testing.assert_allclose(delta.platform_position(arms.value), p, rtol=0, atol=1e-14)
        q, dq, ddq = (np.concatenate(x) for x in zip((p, v, a), drift_state(arms), strict=True))
        assert np.abs(delta.equations().terms(q, dq)[4]).max() < 1e-15
        found, _ = delta.equations().inverse_dynamics(q, dq, ddq, [3, 4, 5])
        expected = delta.torques(p, v, a)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_delta_with_rods_and_mujoco() -> None:
    """Joint angles of the universal joints and all inertia terms of rods and crosses."""
    pairs = [
        (
            (f"rod_{i + 1}_{side}", np.array([delta.ROD, 0, 0])),
            ("platform", delta.TURNS[i] @ [delta.PLATFORM, sign * delta.HALF, 0]),
        )
        for i in range(3)
        for side, sign in delta.SIDES.items()
    ]
    twin = MujocoLoops("delta_rods", pairs)
    rng = np.random.default_rng(4)
    for _ in range(20):
        p, v, a = delta_state(rng)
        curve = Jet(p, v, a)
        twin.put(delta.joints_with_rods(curve))
        twin.put_free("platform_joint", curve, jets.constant(np.eye(3)))
        assert twin.gap() < 1e-14
        assert twin.loop_rate() < 1e-13
        tau, _, residual = twin.inverse_dynamics([f"arm_{i}_joint" for i in (1, 2, 3)])
        assert residual < 1e-12
        expected = delta.torques(p, v, a, rods=True)
        np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_stewart_by_newton_euler_virtual_power_and_mujoco() -> None:
    pairs = [(("platform", stewart.BALLS[i]), (f"leg_{i + 1}_rod", np.zeros(3))) for i in range(6)]
    twin = MujocoLoops("stewart", pairs)
    rng = np.random.default_rng(5)
    for _ in range(20):
        motion = stewart.random_motion(rng)
        forces, on_platform = stewart.newton_euler(motion)
        size = np.abs(forces).max()
        expected = stewart.virtual_power_forces(motion)
        np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-11 * size)
        twin.put(stewart.joints(motion))
        twin.put_free("platform_joint", motion.position, motion.rotation)
        assert twin.gap() < 1e-14
        assert twin.loop_rate() < 1e-13
        tau, reactions, residual = twin.inverse_dynamics(
            [f"leg_{i}_rod_joint" for i in range(1, 7)]
        )
        assert residual < 1e-12
        np.testing.assert_allclose(tau, forces, rtol=0, atol=1e-10 * size)
        np.testing.assert_allclose(reactions, on_platform, rtol=0, atol=1e-10 * size)


@pytest.mark.parametrize(
    ("bodies", "state"),
    [
        (five_bar.bodies, five_bar_state),
        (slider_crank.bodies, crank_state),
        (delta.bodies, delta_state),
        (delta.bodies_with_rods, delta_state),
        (rotary_stewart.bodies, near([0, 0, 0.22, 0, 0, 0], 0.02)),
        (linear_delta.bodies, near([0, 0, 0.11], 0.04)),
        (planar_rrr.bodies, near([0, 0, 0], 0.04)),
        (rrs.bodies, near([0.23, 0, 0], 0.03)),
        (ankle.bodies, near([0, 0], 0.2)),
    ],
)
def test_power_in_is_the_rate_of_energy(
    bodies: virtual_power.Bodies, state: Callable[..., tuple[Array, ...]]
) -> None:
    """tau . v = dE/dt, by central difference along the curve."""
    rng, h = np.random.default_rng(6), 1e-4
    for _ in range(5):
        q, v, a = state(rng)

        def energy(t: float, q: Array = q, v: Array = v, a: Array = a) -> float:
            return virtual_power.energy(bodies, q + v * t + a * t**2 / 2, v + a * t)

        rate = (energy(-2 * h) - 8 * energy(-h) + 8 * energy(h) - energy(2 * h)) / (12 * h)
        power = virtual_power.generalised_forces(bodies, q, v, a) @ v
        size = np.abs(virtual_power.generalised_forces(bodies, q, v, a)) @ np.abs(v)
        assert power == pytest.approx(rate, rel=1e-7, abs=1e-7 * size)

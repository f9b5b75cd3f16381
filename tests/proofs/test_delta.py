"""urdf/delta.yaml and delta_rods.yaml against three spheres, d'Alembert, and Lagrange by SymPy."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel
from tests.proofs import common
from tests.reference import delta, jets
from tests.reference.newton_euler import Jet

ARMS = [f"arm_{i}_joint" for i in (1, 2, 3)]
CENTRE, REACH, RATES = [0.01, -0.02, -0.55], [0.12, 0.1, 0.08], [6.0, 5.0, 7.0]

every_delta = pytest.mark.parametrize("name", ["delta", "delta_rods"])
both_engines = common.both_engines


def state(mechanism: ClosedLoopModel, position: Jet) -> common.State:
    joints = delta.joints_with_rods(position)
    own = {name: joints[name] for name in mechanism.model.names if name in joints}
    return common.state(mechanism, own, ("platform_joint", position, jets.constant(np.eye(3))))


@both_engines
@every_delta
def test_closes_from_rough_guesses(name: str, engine: str) -> None:
    mechanism = common.loaded_in(engine, name)
    lengths = [getattr(closure, "distance", None) or 0.0 for closure in mechanism.closures]
    for guess in common.guesses(mechanism, 0.15, 10):
        q = mechanism.close(guess)
        assert mechanism.loop_gap(q) <= 1e-12
        assert np.abs(common.distances(mechanism, q) - lengths).max() <= 1e-12


@both_engines
@every_delta
def test_direct_kinematics_is_where_three_spheres_meet(name: str, engine: str) -> None:
    """And the platform only translates."""
    mechanism = common.loaded_in(engine, name)
    rng = np.random.default_rng(1)
    for _ in range(10):
        arms = rng.uniform(-0.3, 0.8, size=3)
        q = mechanism.complete(dict(zip(ARMS, arms, strict=True)))
        data = mechanism.model.createData()
        pin.forwardKinematics(mechanism.model, data, q)
        platform = data.oMi[mechanism.model.getJointId("platform_joint")]
        expected = delta.platform_position(arms)
        np.testing.assert_allclose(platform.translation, expected, rtol=0, atol=1e-11)
        np.testing.assert_allclose(platform.rotation, np.eye(3), rtol=0, atol=1e-10)


@both_engines
@every_delta
def test_dynamics_along_a_motion(name: str, engine: str) -> None:
    mechanism = common.loaded_in(engine, name)
    for curve in common.swing(CENTRE, REACH, RATES):
        q, v, a = state(mechanism, curve)
        common.check_motion(mechanism, q, v, a)
        motion = (curve.value, curve.first, curve.second)
        common.check_forces(mechanism, q, v, a, delta.torques(*motion, rods=name == "delta_rods"))


@both_engines
def test_rods_pull_as_lagrange_says(engine: str) -> None:
    """The multipliers are the rods' tensions; those of a pair add up to that of one rod between."""
    mechanism = common.loaded_in(engine, "delta")
    for curve in common.swing(CENTRE, REACH, RATES):
        q, v, a = state(mechanism, curve)
        found = mechanism.inverse_dynamics(q, v, a)
        arms = delta.angles(curve)
        full = [
            np.concatenate([getattr(curve, part), getattr(arms, part)])
            for part in ("value", "first", "second")
        ]
        torques, push = delta.equations().inverse_dynamics(*full, [3, 4, 5])
        np.testing.assert_allclose(found.tau, torques, rtol=0, atol=1e-9 * np.abs(torques).max())
        for i in range(3):
            pair = [
                found.constraint_forces[mechanism.rows(f"rod_{i + 1}_{side}")][0]
                for side in delta.SIDES
            ]
            assert sum(pair) == pytest.approx(-push[i], abs=1e-9 * np.abs(push).max())


@both_engines
def test_the_jacobian_of_the_platform(engine: str) -> None:
    """dP/d(arms), whose inverse the closed form gives; no rotation."""
    mechanism = common.loaded_in(engine, "delta")
    for curve in common.swing(CENTRE, REACH, RATES):
        q, _, _ = state(mechanism, curve)
        still = np.zeros(3)
        inverse = np.column_stack(
            [delta.angles(Jet(curve.value, way, still)).first for way in np.eye(3)]
        )
        jacobian = mechanism.frame_jacobian(q, "platform")
        np.testing.assert_allclose(jacobian[:3] @ inverse, np.eye(3), rtol=0, atol=1e-10)
        np.testing.assert_allclose(jacobian[3:], 0.0, rtol=0, atol=1e-10)


def test_describes_a_mobility_of_three() -> None:
    common.check_description(common.loaded("delta"), rows=6, rank=6, mobility=3)
    common.check_description(common.loaded("delta_rods"), rows=18, rank=18, mobility=3)

"""Closed chains that people build, in urdf/, against MuJoCo, which reads their URDFs itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import null_space

pytest.importorskip("mujoco")

from benchmarks.robot_files.beside_mujoco import Twin, differences, random_closed
from tests.proofs.common import both_engines, loaded, through
from tests.reference.mujoco_description import compiled
from tests.worst import worst

SIZES = {
    "ankle": (6, 6, 2),
    "cassie_leg": (6, 6, 7),
    "cassie_leg_free": (6, 6, 13),
    "cassie_biped": (12, 12, 20),
    "differential": (2, 2, 2),
    "gripper": (12, 6, 3),
    "minitaur_leg": (5, 2, 2),
    "planar_rrr": (6, 4, 3),
    "rotary_stewart": (18, 18, 6),
    "rrs": (9, 9, 3),
}
"""Rows, rank, mobility: two of cassie_leg's motions are the idle spins of its rods."""
#: Accelerations are of links whose inertia about one axis is a millionth of others.
ROUNDING = {"mass matrix": 1e-13, "forces": 1e-13, "acceleration": 1e-9}
every_linkage = pytest.mark.parametrize("name", SIZES)


@every_linkage
def test_rows_rank_and_mobility(name: str) -> None:
    described = loaded(name).describe()
    assert (described.rows, described.rank, described.mobility) == SIZES[name]


@every_linkage
def test_masses_forces_closures_and_accelerations(name: str) -> None:
    mechanism = loaded(name)
    for seed in range(5):
        found = differences(mechanism, compiled(name), seed)
        assert found["rank"] == 0
        for quantity, value in found.items():
            assert value < ROUNDING.get(quantity, 1e-12), quantity


@both_engines
@pytest.mark.parametrize(
    "name", ["ankle", "differential", "minitaur_leg", "rotary_stewart", "rrs", "cassie_leg"]
)
def test_holding_torques(name: str, engine: str) -> None:
    """S' tau + J' lambda = forces at rest, J and forces of MuJoCo: one tau, and exactly."""
    mechanism, rng = loaded(name), np.random.default_rng(3)
    calls = through(engine, mechanism)
    twin, rest = Twin(mechanism, compiled(name)), np.zeros(mechanism.model.nv)
    S = np.eye(rest.size)[mechanism.actuated_indices]
    for _ in range(5):
        q = random_closed(mechanism, rng)
        _, forces = twin.mass_and_forces(q, rest, rest)
        _, rows = twin.equalities(q)
        solution = np.linalg.lstsq(np.vstack([S, rows]).T, forces, rcond=1e-10)[0]
        found = calls.inverse_dynamics(q, rest, rest)
        assert worst(np.vstack([S, rows]).T @ solution - forces) < 1e-11
        assert worst(found.tau - solution[: S.shape[0]]) < 1e-9 * worst(found.tau)


@both_engines
@pytest.mark.parametrize("name", ["cassie_leg", "cassie_leg_free", "cassie_biped"])
def test_accelerations_of_slender_rods_obey_their_equations(engine: str, name: str) -> None:
    """N' (M a + forces) = N' S' tau and J a = -J' v to rounding, N the motions by SciPy.

    Accelerations themselves are known to 1e-9 only: the rods' inertia about their own axes is a
    millionth of others, and so is the condition of N' M N. That is no error of an engine.
    """
    mechanism, rng = loaded(name), np.random.default_rng(5)
    calls = through(engine, mechanism)
    twin, nv = Twin(mechanism, compiled(name)), mechanism.model.nv
    S = np.eye(nv)[mechanism.actuated_indices]
    for _ in range(5):
        q = random_closed(mechanism, rng)
        N = null_space(mechanism.jacobian(q), rcond=1e-9)
        v, tau = N @ rng.normal(size=N.shape[1]), 10 * rng.normal(size=len(S))
        a = calls.forward_dynamics(q, v, tau)
        mass, forces = twin.mass_and_forces(q, v, np.zeros(nv))
        wrong = N.T @ (mass @ a + forces - S.T @ tau)
        size = np.abs(N.T) @ (np.abs(mass) @ np.abs(a) + np.abs(forces) + S.T @ np.abs(tau))
        assert worst(wrong / size) < 1e-13
        assert worst(mechanism.loop_errors(q, v, a).acceleration) < 1e-12 * (1 + worst(a))


def test_gripper_is_held_by_motor_and_springs() -> None:
    """What the motor does not hold is told in full: the rest is the closures' alone."""
    mechanism, rng = loaded("gripper"), np.random.default_rng(4)
    twin, rest = Twin(mechanism, compiled("gripper")), np.zeros(mechanism.model.nv)
    for _ in range(5):
        q = random_closed(mechanism, rng)
        _, forces = twin.mass_and_forces(q, rest, rest)
        _, rows = twin.equalities(q)
        found = mechanism.inverse_dynamics(q, rest, rest)
        left = forces - found.unproduced
        left[mechanism.actuated_indices] -= found.tau
        closures = rows.T @ np.linalg.lstsq(rows.T, left, rcond=1e-10)[0]
        assert worst(found.unproduced) > 1e-4
        assert worst(left - closures) < 1e-12


def test_tendon_pulls_both_fingers_alike() -> None:
    """F newtons at the winch give 0.01 F at each driver: as virtual work says, 0.02 F together."""
    mechanism = loaded("gripper")
    q = mechanism.home
    speed = mechanism.velocity(
        q, [1.0, 0.0, 0.0], ["right_driver_joint", "right_spring_joint", "left_spring_joint"]
    )
    model = mechanism.model
    by_name = {name: speed[model.joints[model.getJointId(name)].idx_v] for name in model.names[1:]}
    assert by_name["tendon_joint"] == pytest.approx(0.02, abs=1e-14)
    assert by_name["left_driver_joint"] == pytest.approx(1.0, abs=1e-14)

"""The biped of urdf/ on its feet: statics, and MuJoCo, which reads the URDF itself."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

pytest.importorskip("mujoco")

import mujoco

from benchmarks.robot_files.beside_mujoco import Twin
from rps_pin import ClosedLoopModel, ClosureError, InfeasibleError
from rps_pin.closed_loop import DistributedForces, ForceDistribution, friction_pyramid
from tests.proofs.common import loaded
from tests.reference.mujoco_description import compiled
from tests.worst import worst

Array = NDArray[np.float64]

GRAVITY, FRICTION = 9.81, 0.6
#: Where the points of contact are on a foot, m.
SOLE = {"toe": (0.09, 0.0, -0.03), "heel": (-0.08, 0.0, -0.03)}
POINTS = [f"{side}_{end}" for side in ("left", "right") for end in SOLE]
EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "standing.py"


def on_feet(least: float = 0.0) -> tuple[ClosedLoopModel, ForceDistribution]:
    biped = loaded("cassie_biped")
    feet = [biped.closure_at(biped.home, point, kind="spherical", name=point) for point in POINTS]
    standing = biped.with_closures(feet)
    bounds = [b for point in POINTS for b in friction_pyramid(point, FRICTION, least=least)]
    return standing, ForceDistribution(standing, torque_limits="model", bounds=bounds)


def poses(standing: ClosedLoopModel, count: int) -> list[Array]:
    """Trunks lowered, shifted and turned, feet on the ground."""
    rng, found = np.random.default_rng(6), []
    while len(found) < count:
        shift = rng.uniform([-0.03, -0.06, -0.1], [0.03, 0.06, -0.01])
        turn = pin.Quaternion(pin.exp3(rng.uniform(-0.1, 0.1, 3))).coeffs()
        trunk = np.concatenate([standing.home[:3] + shift, turn])
        try:
            found.append(standing.complete({"root_joint": trunk}, standing.home))
        except ClosureError:
            continue
    return found


def ground(standing: ClosedLoopModel, forces: DistributedForces) -> Array:
    return np.array([forces.constraint_forces[standing.rows(point)] for point in POINTS])


def test_the_ground_carries_the_weight_at_the_centre_of_mass() -> None:
    standing, distribution = on_feet()
    model, rest = standing.model, np.zeros(standing.model.nv)
    weight = GRAVITY * pin.computeTotalMass(model)
    for q in poses(standing, 8):
        push = ground(standing, distribution.solve(q, rest, rest))
        centre = pin.centerOfMass(model, model.createData(), q)
        arms = np.array([standing.frame_placement(q, point)[:3, 3] for point in POINTS]) - centre
        assert worst(push.sum(axis=0) - [0, 0, weight]) < 1e-9 * weight
        assert worst(np.cross(arms, push).sum(axis=0)) < 1e-9 * weight


def test_forces_push_within_friction_and_torques_within_limits() -> None:
    standing, distribution = on_feet(least=5.0)
    rest = np.zeros(standing.model.nv)
    for q in poses(standing, 8):
        forces = distribution.solve(q, rest, rest)
        push = ground(standing, forces)
        assert push[:, 2].min() > 5.0 - 1e-6
        assert (np.hypot(push[:, 0], push[:, 1]) <= FRICTION * push[:, 2] + 1e-6).all()
        assert (np.abs(forces.tau) <= distribution.upper + 1e-6).all()


def test_torques_and_ground_forces_balance_mujocos_forces() -> None:
    """S' tau + C' F + J' lambda = forces at rest, C at the contacts and J at the rods of MuJoCo."""
    standing, distribution = on_feet()
    biped, rest = loaded("cassie_biped"), np.zeros(standing.model.nv)
    twin = Twin(biped, compiled("cassie_biped"))
    for q in poses(standing, 5):
        forces = distribution.solve(q, rest, rest)
        _, left = twin.mass_and_forces(q, rest, rest)
        size = worst(left)
        _, rods = twin.equalities(q)
        left[biped.actuated_indices] -= forces.tau
        for point, force in zip(POINTS, ground(standing, forces), strict=True):
            left -= contact_jacobian(twin, q, point).T @ force
        of_rods = rods.T @ np.linalg.lstsq(rods.T, left, rcond=1e-10)[0]
        assert worst(left - of_rods) < 1e-9 * size


def contact_jacobian(twin: Twin, q: Array, point: str) -> Array:
    """MuJoCo's Jacobian of a point of a foot, in Pinocchio's coordinates, shape (3, nv)."""
    side, end = point.split("_")
    transform, model, data = twin.put(q), twin.model, twin.data
    mujoco.mj_fwdPosition(model, data)
    foot = model.body(f"{side}_foot").id
    place = data.xpos[foot] + data.xmat[foot].reshape(3, 3) @ SOLE[end]
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, place, foot)
    return np.asarray(jacobian @ transform)


def test_a_trunk_that_is_held_is_a_fixed_one() -> None:
    """The left leg of a biped that hangs has the torques of the leg whose pelvis is fixed."""
    biped, leg = loaded("cassie_biped"), loaded("cassie_leg")
    q = biped.home
    held = biped.with_closures([biped.closure_at(q, "pelvis", name="stand")])
    rest = np.zeros(held.model.nv)
    hanging = held.inverse_dynamics(q, rest, rest)
    fixed = leg.inverse_dynamics(leg.home, np.zeros(leg.model.nv), np.zeros(leg.model.nv))
    assert worst(hanging.tau[:5] - fixed.tau) < 1e-9 * worst(fixed.tau)
    assert worst(fixed.tau) > 1.0
    weight = GRAVITY * pin.computeTotalMass(held.model)
    force = hanging.constraint_forces[held.rows("stand")][:3]
    assert worst(force - [0, 0, weight]) < 1e-9 * weight


def test_a_weight_beyond_the_feet_is_refused() -> None:
    standing, distribution = on_feet()
    trunk, rest = standing.home[:7], np.zeros(standing.model.nv)
    trunk[:3] += [0.0, 0.2, -0.05]
    q = standing.complete({"root_joint": trunk}, standing.home)
    with pytest.raises(InfeasibleError, match="right_heel"):
        distribution.solve(q, rest, rest)


def test_the_example(capsys: pytest.CaptureFixture[str]) -> None:
    example: dict[str, Any] = runpy.run_path(str(EXAMPLE))
    assert example["main"]([]) == 0
    printed = capsys.readouterr().out
    assert "mobility 20, standing 10" in printed
    assert "sum of the ground's forces 283.509 N, weight 283.509 N" in printed
    assert float(printed.split()[-1]) < 1e-7
    assert example["main"](["--aside", "0.2"]) == 1
    assert "cannot stand so" in capsys.readouterr().err

"""What the proofs of the well-known mechanisms have in common: states by joint, and the checks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import ArrayLike, NDArray

from rps_pin import ClosedLoopModel
from rps_pin.codegen.build import tcc
from tests.reference import jets
from tests.reference.newton_euler import Jet

Array = NDArray[np.float64]
State = tuple[Array, Array, Array]

URDF = Path(__file__).resolve().parents[2] / "urdf"


def loaded(name: str) -> ClosedLoopModel:
    """The mechanism of a file in urdf/."""
    return ClosedLoopModel.load(URDF / f"{name}.yaml")


#: The engines that a proof goes through.
ENGINES = ("pinocchio", "generated")
both_engines = pytest.mark.parametrize("engine", ENGINES)


@cache
def through(engine: str, mechanism: ClosedLoopModel) -> Any:
    """The mechanism, or the same in generated code; quickly built, and compared at each build."""
    if engine == "pinocchio":
        return mechanism
    return mechanism.compile(compiler="tcc" if tcc.is_here() else "auto", functions="dynamics")


@cache
def loaded_in(engine: str, name: str) -> Any:
    """The mechanism of a file in urdf/, in an engine; once for all tests of a process."""
    return through(engine, loaded(name))


def swing(centre: ArrayLike, reach: ArrayLike, rates: ArrayLike, count: int = 12) -> Iterator[Jet]:
    """A motion at some moments: centre + reach sin(rates t), each coordinate in its own time."""
    middle, size, rate = (np.atleast_1d(np.asarray(x, dtype=float)) for x in (centre, reach, rates))
    for t in np.linspace(0.0, 2.0, count):
        sine, cosine = np.sin(rate * t), np.cos(rate * t)
        yield Jet(middle + size * sine, size * rate * cosine, -size * rate**2 * sine)


def state(
    mechanism: ClosedLoopModel,
    joints: Mapping[str, Jet],
    free: tuple[str, Jet, Jet] | None = None,
) -> State:
    """Pinocchio's vectors of a motion given joint by joint.

    `free` is a free-flyer's name, and the motion of its body: position and rotation. Its velocity
    is in body axes, (R' p', w), and its acceleration (R' p'' - w x v, w').
    """
    model = mechanism.model
    q, v, a = pin.neutral(model), np.full(model.nv, np.nan), np.full(model.nv, np.nan)
    for name, jet in joints.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q], v[joint.idx_v], a[joint.idx_v] = jet.value, jet.first, jet.second
    if free is not None:
        name, position, rotation = free
        joint, R = model.joints[model.getJointId(name)], rotation.value
        quaternion = pin.Quaternion(R).coeffs()
        q[joint.idx_q : joint.idx_q + 7] = np.concatenate([position.value, quaternion])
        linear, spin = R.T @ position.first, R.T @ jets.spin(rotation)
        pull = R.T @ position.second - np.cross(spin, linear)
        v[joint.idx_v : joint.idx_v + 6] = np.concatenate([linear, spin])
        a[joint.idx_v : joint.idx_v + 6] = np.concatenate([pull, R.T @ jets.spin_rate(rotation)])
    assert np.isfinite(v).all()
    assert np.isfinite(a).all()
    return q, v, a


def guesses(
    mechanism: ClosedLoopModel, spread: float, count: int, seed: int = 0
) -> Iterator[Array]:
    """Rough guesses about home."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        step = spread * rng.normal(size=mechanism.model.nv)
        yield pin.integrate(mechanism.model, mechanism.home, step)


def points(mechanism: ClosedLoopModel, q: Array, *frames: str) -> list[Array]:
    """Where frames stand, in world axes."""
    model = mechanism.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return [data.oMf[model.getFrameId(name)].translation.copy() for name in frames]


def distances(mechanism: ClosedLoopModel, q: Array) -> Array:
    """Between the two frames of each closure, by Pinocchio's kinematics of the tree alone."""
    pairs = [points(mechanism, q, c.frame_a, c.frame_b) for c in mechanism.closures]
    return np.array([np.linalg.norm(a - b) for a, b in pairs])


def check_motion(mechanism: ClosedLoopModel, q: Array, v: Array, a: Array) -> None:
    """A motion in closed form is one of the mechanism's, and completes to itself."""
    driven = mechanism.actuated_indices
    assert mechanism.loop_gap(q) <= 1e-12
    found = mechanism.velocity(q, v[driven])
    np.testing.assert_allclose(found, v, rtol=0, atol=1e-10 * max(1.0, np.abs(v).max()))
    found = mechanism.acceleration(q, v, a[driven])
    np.testing.assert_allclose(found, a, rtol=0, atol=1e-9 * max(1.0, np.abs(a).max()))


def check_forces(
    mechanism: ClosedLoopModel, q: Array, v: Array, a: Array, expected: Array
) -> Array:
    """Inverse dynamics gives the reference's forces, and forward dynamics the motion back.

    Returns the constraint forces.
    """
    result = mechanism.inverse_dynamics(q, v, a)
    np.testing.assert_allclose(result.tau, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    assert result.residual <= 1e-9 * np.abs(expected).max()
    back = mechanism.forward_dynamics(q, v, result.tau)
    np.testing.assert_allclose(back, a, rtol=0, atol=1e-9 * max(1.0, np.abs(a).max()))
    forces: Array = result.constraint_forces
    return forces


def check_description(
    mechanism: ClosedLoopModel,
    *,
    rows: int,
    rank: int,
    mobility: int,
    actuation: str = "sufficient",
) -> None:
    """The counts that theory gives."""
    described = mechanism.describe()
    assert described.rows == rows
    assert described.rank == rank
    assert described.redundant_rows == rows - rank
    assert described.mobility == mobility
    assert described.actuation == actuation

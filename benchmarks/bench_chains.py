"""Time of dynamics over the number of loops: chains of n four-bars, each driving the next.

Run with ``make bench``. Bar i's rocker is the crank of bar i + 1; one joint is driven. The loops
have one of two closures: `point_on_line` across the plane, two rows each and none redundant; or
`spherical`, three rows each, one of them redundant in the plane. Peers have the same rows.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.peers import ConstraintDynamics, LoopConstrainedABA, PlainPinocchio
from rps_pin import ClosedLoopModel, LoopClosure

Array = NDArray[np.float64]

CRANK, GROUND = 0.2, 0.5
LOOPS = [1, 2, 4, 8, 16, 32, 64]


def chain(loops: int, kind: str) -> ClosedLoopModel:
    """Return a chain of parallelograms: all cranks and rockers have the driven angle."""
    model = pin.Model()
    turn = pin.JointModelRY()

    def bar(parent: int, at: float, name: str, length: float) -> int:
        place = pin.SE3(np.eye(3), np.array([at, 0.0, 0.0]))
        joint = model.addJoint(parent, turn, place, name)
        middle = pin.SE3(np.eye(3), np.array([length / 2, 0, 0]))
        model.appendBodyToJoint(joint, pin.Inertia.FromCylinder(1.0, 0.02, length), middle)
        tip = pin.SE3(np.eye(3), np.array([length, 0, 0]))
        model.addFrame(pin.Frame(f"{name}_tip", joint, 0, tip, pin.FrameType.OP_FRAME))
        return int(joint)

    crank, closures = bar(0, 0.0, "crank", CRANK), []
    for i in range(loops):
        bar(crank, CRANK, f"coupler_{i}", GROUND)
        crank = bar(0, (i + 1) * GROUND, f"rocker_{i}", CRANK)
        axis = (0.0, 1.0, 0.0) if kind == "point_on_line" else None
        ends = f"rocker_{i}_tip", f"coupler_{i}_tip"
        closures.append(LoopClosure(*ends, kind, axis=axis))
    unlimited = np.full(model.nq, np.inf)
    model.lowerPositionLimit, model.upperPositionLimit = -unlimited, unlimited
    return ClosedLoopModel(model, closures, ["crank"])


def state(mechanism: ClosedLoopModel) -> tuple[Array, Array, Array]:
    angles = {"crank": -1.0, "rocker": -1.0, "coupler": 1.0}
    q = np.array([angles[name.split("_")[0]] for name in list(mechanism.model.names)[1:]])
    assert mechanism.loop_gap(q) < 1e-13
    v = mechanism.velocity(q, [1.5])
    return q, v, mechanism.acceleration(q, v, [2.0])


#: The rows that a closure of each kind keeps of a spherical one, in the plane x, z.
ROWS = {"point_on_line": [0, 2], "spherical": [0, 1, 2]}


@pytest.mark.benchmark(warmup=True, min_rounds=20, max_time=0.3, warmup_iterations=50)
@pytest.mark.parametrize("loops", LOOPS)
@pytest.mark.parametrize("kind", list(ROWS))
@pytest.mark.parametrize("role", ["ours", "plain Pinocchio and NumPy"])
def bench_inverse(benchmark: BenchmarkFixture, loops: int, kind: str, role: str) -> None:
    """Redundant rows need least squares; without them a linear solver is enough."""
    mechanism = chain(loops, kind)
    motion = state(mechanism)
    plain = PlainPinocchio(chain(loops, "spherical"), ROWS[kind])

    def by_least_squares() -> Array:
        force = pin.rnea(plain.model, plain.data, *motion)
        jacobian = plain.jacobian(motion[0])
        multipliers = np.linalg.lstsq(
            jacobian[:, plain.passive].T, force[plain.passive], rcond=1e-10
        )[0]
        tau: Array = force[plain.actuated] - jacobian[:, plain.actuated].T @ multipliers
        return tau

    def peer() -> Array:
        return plain.inverse_dynamics(*motion) if kind == "point_on_line" else by_least_squares()

    np.testing.assert_allclose(mechanism.inverse_dynamics(*motion).tau, peer(), rtol=1e-7)
    benchmark.group = f"{loops} four-bars, inverse dynamics, {kind} closures"
    benchmark.extra_info["role"] = role
    if role == "ours":
        benchmark(mechanism.inverse_dynamics, *motion)
    else:
        benchmark(peer)


#: Peers of forward dynamics by kind: Pinocchio's own algorithms have no point_on_line closure.
FORWARD_PEERS = {
    "point_on_line": {"plain Pinocchio and NumPy": PlainPinocchio},
    "spherical": {"pin.constraintDynamics": ConstraintDynamics, "pin.lcaba": LoopConstrainedABA},
}


@pytest.mark.benchmark(warmup=True, min_rounds=20, max_time=0.3, warmup_iterations=50)
@pytest.mark.parametrize("loops", LOOPS)
@pytest.mark.parametrize(
    ("kind", "role"),
    [(kind, role) for kind, peers in FORWARD_PEERS.items() for role in ["ours", *peers]],
)
def bench_forward(benchmark: BenchmarkFixture, loops: int, kind: str, role: str) -> None:
    mechanism = chain(loops, kind)
    q, v, a = state(mechanism)
    tau = mechanism.inverse_dynamics(q, v, a).tau
    benchmark.group = f"{loops} four-bars, forward dynamics, {kind} closures"
    benchmark.extra_info["role"] = role
    if role == "ours":
        benchmark(mechanism.forward_dynamics, q, v, tau)
        return
    peer_type = FORWARD_PEERS[kind][role]
    others = {"rows": ROWS[kind]} if peer_type is PlainPinocchio else {}
    peer = peer_type(chain(loops, "spherical"), **others)
    np.testing.assert_allclose(peer.forward_dynamics(q, v, tau), a, rtol=1e-5, atol=1e-5)
    benchmark(peer.forward_dynamics, q, v, tau)

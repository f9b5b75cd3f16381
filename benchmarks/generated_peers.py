"""Peers of `generated_code_table`, each made for one case and asked for the same answers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from benchmarks.generated_cases import Case
from benchmarks.mujoco_twin import MujocoTwin
from benchmarks.peers import ConstraintDynamics, LoopConstrainedABA, PlainPinocchio

Array = NDArray[np.float64]

NOT_EXACT = 1e-6
"""Relative difference above which a peer that claims exact accelerations is not measured."""


def plain(case: Case, rows: tuple[int, ...]) -> PlainPinocchio:
    """Return Pinocchio and NumPy; the dependent joints carry the constraint forces."""
    peer = PlainPinocchio(case.mechanism, rows)
    chosen = case.mechanism.system.independent(case.independent)
    peer.passive = [i for i in range(case.mechanism.model.nv) if i not in chosen]
    return peer


def inverse_peers(case: Case, rows: tuple[int, ...]) -> dict[str, Callable[[], Array]]:
    """Return calls of closed-loop inverse dynamics that give the case's forces."""
    peer = plain(case, rows)
    np.testing.assert_allclose(
        peer.inverse_dynamics(case.q, case.v, case.a),
        case.tau,
        atol=1e-9 * np.abs(case.tau).max(),
    )
    return {"plain Pinocchio and NumPy": lambda: peer.inverse_dynamics(case.q, case.v, case.a)}


def forward_peers(
    case: Case, rows: tuple[int, ...]
) -> tuple[dict[str, Callable[[], object]], dict[str, float]]:
    """Return calls of forward dynamics, and by how much their accelerations differ (relative).

    A peer of which nothing exact comes is left out of the calls; its difference tells why.
    """
    q, v, tau = case.q, case.v, case.tau
    calls: dict[str, Callable[[], object]] = {}
    differences: dict[str, float] = {}
    exact = {
        "plain Pinocchio and NumPy": plain(case, rows),
        "pin.constraintDynamics": ConstraintDynamics(case.mechanism),
        "pin.lcaba": LoopConstrainedABA(case.mechanism),
    }
    for name, peer in exact.items():
        differences[name] = relative(peer.forward_dynamics(q, v, tau), case.a)
        if differences[name] < NOT_EXACT:
            calls[name] = lambda peer=peer: peer.forward_dynamics(q, v, tau)
    for name, stiff in {"mj_forward": False, "mj_forward, stiffest": True}.items():
        twin = MujocoTwin(case.mechanism, stiff=stiff)
        assert same_tree(case, twin) < 1e-9
        twin.put(q, v, tau)
        twin.forward()
        differences[name] = relative(twin.acceleration(q, v), case.a)
        calls[name] = twin.forward
    return calls, differences


def same_tree(case: Case, twin: MujocoTwin) -> float:
    """Return the relative difference of the accelerations with open loops from Pinocchio's."""
    model, force = case.mechanism.model, np.zeros(case.mechanism.model.nv)
    force[case.mechanism.actuated_indices] = case.tau
    twin.put(case.q, case.v, case.tau)
    twin.forward()
    twin.data.qacc[:] = twin.data.qacc_smooth
    opened = pin.aba(model, model.createData(), case.q, case.v, force)
    return relative(twin.acceleration(case.q, case.v), opened)


def relative(found: Array, exact: Array) -> float:
    """Return the largest difference over the largest entry; NaN if something is not finite."""
    return float(np.abs(found - exact).max() / np.abs(exact).max())

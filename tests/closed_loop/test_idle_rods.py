"""Idle freedoms in random mechanisms: what does not spin moves as if there were none."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin.closed_loop.dynamics.forward_dynamics import forward_dynamics
from rps_pin.closed_loop.dynamics.inverse_dynamics import inverse_dynamics
from tests.closed_loop.idle_rods import case_with_rods, spinning
from tests.closed_loop.random_mechanisms import Case, slopes, worst_error
from tests.closed_loop.test_derivatives import CLOSE, check_forward, check_inverse
from tests.quick import quick
from tests.worst import worst

Array = NDArray[np.float64]

SEEDS = range(16)


def test_rods_without_mass_change_nothing() -> None:
    """Kinematics, reduced terms and forces are those of distances."""
    errors: list[object] = []
    for seed in SEEDS:
        plain, rods = case_with_rods(seed, mass=0.0)
        old, new, nv = plain.mechanism, rods.mechanism, plain.mechanism.model.nv
        q, at = rods.q, old.actuated_indices
        assert len(new.describe(q).idle) > 0
        assert new.describe(q).lacking == ()
        for found, expected in (
            (rods.v[:nv], plain.v),
            (rods.a[:nv], plain.a),
            (new.motion_basis(q)[:nv], old.motion_basis(plain.q)),
            (new.mass_matrix(q), old.mass_matrix(plain.q)),
            (new.bias(q, rods.v), old.bias(plain.q, plain.v)),
            (new.gravity_forces(q), old.gravity_forces(plain.q)),
            (new.energy(q, rods.v), old.energy(plain.q, plain.v)),
            (
                new.inverse_dynamics(q, rods.v, rods.a, wrenches=rods.wrenches).tau,
                old.inverse_dynamics(plain.q, plain.v, plain.a, wrenches=plain.wrenches).tau,
            ),
        ):
            errors.append(worst_error(np.asarray(found), np.asarray(expected), 1.0))
        frame = plain.mechanism.closures[0].frame_a
        errors.append(new.frame_jacobian(q, frame) - old.frame_jacobian(plain.q, frame))
        assert at.size
    assert worst(*errors) < 1e-8


@pytest.mark.parametrize("check", [check_inverse, check_forward])
@pytest.mark.parametrize("seed", quick([0, 1, 3, 5, 10, 14], [5]))
def test_derivatives_follow_the_motion_of_least_norm(
    check: Callable[[Case], None], seed: int
) -> None:
    """Central differences; also of rods whose centre of mass is off their line."""
    check(case_with_rods(seed, off=0.02 * (seed % 3))[1])


@pytest.mark.parametrize("seed", range(6))
def test_derivatives_while_rods_spin(seed: int) -> None:
    """The speeds of spins are held."""
    c = spinning(case_with_rods(seed, off=0.02 * (seed % 3))[1], seed)
    mechanism = c.mechanism
    tau = np.ones(mechanism.actuated_indices.size)
    forward = mechanism.forward_dynamics_derivatives(c.q, c.v, tau)
    inverse = mechanism.inverse_dynamics_derivatives(c.q, c.v, c.a)

    def a(dq: Array, dv: Array) -> Array:
        q = pin.integrate(mechanism.model, c.q, dq)
        return forward_dynamics(mechanism.system, q, c.v + dv, tau, None, closed=False)

    def forces(dq: Array, dv: Array) -> Array:
        q = pin.integrate(mechanism.model, c.q, dq)
        return inverse_dynamics(mechanism.system, q, c.v + dv, c.a, None, closed=False).tau

    still, nv = np.zeros(c.v.size), c.v.size
    for found, of in ((forward, a), (inverse, forces)):
        size = np.abs(of(still, still)).max()
        assert worst_error(found.q, slopes(lambda d, of=of: of(d, still), nv), size) < CLOSE
        assert worst_error(found.v, slopes(lambda d, of=of: of(still, d), nv), size) < CLOSE


def test_a_spinning_rod_is_linearised_with_its_spin() -> None:
    """The velocity of a state moves as T says, its spins held."""
    for seed in range(3):
        c = spinning(case_with_rods(seed)[1], seed)
        mechanism, at = c.mechanism, c.mechanism.actuated_indices
        tau = mechanism.inverse_dynamics(c.q, c.v, c.a).tau
        found = mechanism.linearize(c.q, c.v, tau)
        m = at.size
        assert found.A.shape == (2 * m, 2 * m)
        derivatives = mechanism.forward_dynamics_derivatives(c.q, c.v, tau)
        np.testing.assert_array_equal(found.A[m:, :m], derivatives.position)

        def a(du: Array, c: Case = c, tau: Array = tau) -> Array:
            v = c.v + c.mechanism.motion_basis(c.q) @ du
            return c.mechanism.forward_dynamics(c.q, v, tau)[c.mechanism.actuated_indices]

        assert worst_error(found.A[m:, m:], slopes(a, m), np.abs(c.a).max()) < CLOSE

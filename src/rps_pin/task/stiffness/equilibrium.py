"""Equilibrium of a mechanism with springs by Newton's method, and its linearisation there."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import cho_factor, cho_solve, eigh

from rps_pin.arrays import Array
from rps_pin.errors import SingularityError
from rps_pin.task.stiffness.elastic import ElasticSystem, Loads, Motions

#: Largest number of Newton's steps.
_STEPS = 50
#: A step, in characteristic lengths, below which it was the last.
_SMALL = 1e-11
#: Steps that do not get smaller, below this, are of rounding errors.
_ROUNDING = 1e-7


class Tangent(NamedTuple):
    """A mechanism with springs at one equilibrium, linearised."""

    q: Array
    """Shape (nq,)."""
    multipliers: Array
    """lambda, shape (nc,)."""
    balance: Array
    """F + K s - J' lambda, shape (nv,): what held actuators exert, zero for others."""
    motions: Motions
    undetermined: Array
    """Basis of the reactions that balance each other in rigid parts, shape (nc, r)."""
    stiffness: Array
    """B' H B, symmetric, shape (k, k)."""
    mass: Array
    """B' M B, shape (k, k)."""

    def compliance(self, output: Array) -> Array:
        """Return C = A B (B' H B)^-1 B' A' of an output's Jacobian A (p, nv), shape (p, p)."""
        AB = output @ self.motions.basis
        return np.asarray(AB @ cho_solve(cho_factor(self.stiffness), AB.T))

    def vibrations(self) -> tuple[Array, Array]:
        """Return omega (k,), rad/s, smallest first, and motions B phi, shape (nv, k).

        Motions without mass have omega = inf. The largest motion of each column is one unit.
        """
        # M phi = mu K phi: K is positive definite where M may be singular.
        mu, phi = eigh(self.mass, self.stiffness)
        tiny = 1e-14 * max(float(mu.max(initial=0.0)), 0.0)
        with np.errstate(divide="ignore"):
            omega = np.where(mu > tiny, 1 / np.sqrt(np.maximum(mu, 1e-300)), np.inf)[::-1]
        shapes = self.motions.basis @ phi[:, ::-1]
        return omega, shapes / np.maximum(np.abs(shapes).max(axis=0), 1e-300)


def equilibrium(
    elastic: ElasticSystem, q0: Array, loads: Loads, jacobian_of: Callable[[Array], Array]
) -> Tangent:
    """Return the equilibrium near a configuration at which the springs are without load.

    Parameters
    ----------
    elastic
        The equations.
    q0
        The nominal configuration, shape (nq,).
    loads
        What acts on it.
    jacobian_of
        Configuration to the output's Jacobian A, shape (p, nv).

    Raises
    ------
    SingularityError
        If nothing holds the output, or there is no stable equilibrium near.
    """
    system, model = elastic.system, elastic.system.model
    gaps = system.equations.gaps(q0).copy()
    q, length = q0.copy(), system.equations.length
    rows = elastic.rows(q)
    multipliers = rows.multipliers(elastic.forces(q, q0, loads))
    last = np.inf
    for _ in range(_STEPS):
        motions = elastic.motions(rows, jacobian_of(q))
        force = elastic.forces(q, q0, loads)
        H, mass = elastic.slopes(q, multipliers, loads)
        d = rows.correction(gaps - system.equations.gaps(q))
        B = motions.basis
        step = d - B @ np.linalg.solve(B.T @ H @ B, B.T @ (force + H @ d))
        size = float(np.abs(step / system.column_scale).max(initial=0.0))
        if size <= _SMALL * length or last / 4 < size < _ROUNDING * length:
            break
        if not size < length:
            raise _lost(f"a step of {size:.3g} m or arc, more than the characteristic length", size)
        q, last = pin.integrate(model, q, step), size
        rows = elastic.rows(q)
        multipliers = rows.multipliers(force + H @ step)
    else:
        raise _lost(f"the last step was still {size:.3g} m or arc", size)
    multipliers = rows.multipliers(force)
    H, mass = elastic.slopes(q, multipliers, loads)
    K = B.T @ H @ B
    K = (K + K.T) / 2
    least = float(np.linalg.eigvalsh(K).min(initial=np.inf))
    if least <= 0:
        raise _lost("the equilibrium is not stable: the mechanism buckles, or tips over", least)
    balance = force - system.equations.jacobian(q).T @ multipliers
    return Tangent(q, multipliers, balance, motions, rows.undetermined, K, B.T @ mass @ B)


def _lost(why: str, number: float) -> SingularityError:
    return SingularityError(f"no equilibrium near the nominal configuration: {why}", np.inf, number)

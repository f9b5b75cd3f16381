"""Steps in time under stiff damping: of light parts that their joints' damping slows at once.

With T the motions that the closures allow and D the slopes of damping and friction by the speed,
damping takes speeds away at the rates that are the eigenvalues of

    (T' M T)^-1 T' D T.

Steps h of order 4 (`integrators.rk4_step`) grow without bound where h times the largest rate
exceeds 2.79. There, this step is taken instead: the linearly implicit method of Euler,

    v+ = v + (1 + eta A)^-1 eta a(t, q, v),   q+ = q (+) eta v+,   A = T (T' M T)^-1 T' D,

with T, M and D as they are at the beginning, in 1, 2, 3 and 4 parts eta of the step, extrapolated
to order 4 (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.9). It is
stable for any damping.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import eigh
from scipy.linalg.lapack import dposv

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.dynamics.generalised_forces import tree_mass
from rps_pin.closed_loop.kinematics import allowed_motions
from rps_pin.closed_loop.simulation.integrators import Acceleration

#: Largest rate times step that is left to steps of order 4.
STIFF = 2.0
#: Parts of the step in each of the runs that are extrapolated.
_PARTS = (1, 2, 3, 4)


class Damping(NamedTuple):
    """Damping of the allowed motions at a state."""

    basis: Array
    """T, shape (nv, m)."""
    slopes: Array
    """Diagonal of D, shape (nv,)."""
    mass: Array
    """T' M T, shape (m, m)."""
    damping: Array
    """T' D T, shape (m, m)."""

    def change(self, part: float, a: Array) -> Array:
        """Return (1 + eta A)^-1 eta a, shape (nv,)."""
        right = self.basis.T @ (self.slopes * a)
        _, solved, failed = dposv(self.mass + part * self.damping, right)
        if failed:  # a motion that moves no mass: a itself has been refused then
            return part * a
        return np.asarray(part * (a - part * self.basis @ solved))


def fastest_rate(damping: Damping) -> float:
    """Return the largest rate at which damping takes speeds away, 1/s."""
    if not damping.mass.size:
        return 0.0
    try:
        rates = eigh(damping.damping, damping.mass, eigvals_only=True)
    except np.linalg.LinAlgError:  # a motion that moves no mass
        return 0.0
    return float(rates[-1])


def damping_at(system: ConstraintSystem, q: Array, v: Array, basis: Array) -> Damping | None:
    """Return the damping at a state; None where there is none.

    Parameters
    ----------
    system
        The system.
    q, v
        The state, (nq,) and (nv,); after `computeJointJacobians` at q.
    basis
        T at q, shape (nv, m).
    """
    effects = system.effects
    if effects is None or not (effects.damping.any() or effects.friction.any()):
        return None
    slopes = effects.slopes(v)
    basis = basis.copy()
    mass = basis.T @ tree_mass(system, q) @ basis
    return Damping(basis, slopes, mass, basis.T @ (slopes[:, None] * basis))


def stiff_damping(
    system: ConstraintSystem, q: Array, v: Array, basis: Array, step: float
) -> Damping | None:
    """Return the damping at a state if it is stiff for a step; see `damping_at`."""
    damping = damping_at(system, q, v, basis)
    if damping is None or not damping.mass.size:
        return None
    _, solved, failed = dposv(damping.mass, damping.damping)  # the sum of the rates is cheaper
    if failed or step * float(np.trace(solved)) <= STIFF:
        return None
    return damping if step * fastest_rate(damping) > STIFF else None


def is_stiff(system: ConstraintSystem, q: Array, v: Array, step: float) -> bool:
    """Return whether a step of order 4 from a closed state is near its limit, by a factor of 2."""
    motions = allowed_motions(system, system.equations.jacobian(q))
    damping = damping_at(system, q, v, motions)
    return damping is not None and 2 * step * fastest_rate(damping) > STIFF


def viscous_rate(system: ConstraintSystem, q: Array) -> float:
    """Return the largest rate at which viscous damping alone takes speeds away, 1/s."""
    motions = allowed_motions(system, system.equations.jacobian(q))
    fast = np.full(system.model.nv, np.inf)  # where dry friction has no slope
    damping = damping_at(system, q, fast, motions)
    return 0.0 if damping is None else fastest_rate(damping)


def implicit_step(
    model: pin.Model,
    acceleration: Acceleration,
    t: float,
    state: tuple[Array, Array],
    step: float,
    first: Array,
    damping: Damping,
    power: Callable[[], float],
) -> tuple[tuple[Array, Array], float]:
    """Return (q, v) one step later, to order 4, and the work done; see the module's text.

    Parameters
    ----------
    model, acceleration, t, state, step, first
        As for `integrators.rk4_step`.
    damping
        At the start.
    power
        Returns the power at the last call of `acceleration`, W, which `first` was.
    """
    q, v = state
    start_power = power()
    ends: list[tuple[Array, Array, float]] = []
    for parts in _PARTS:
        part, moved, speed, work = step / parts, q, v, step / parts * start_power
        for k in range(parts):
            a = first
            if k:
                a = acceleration(t + k * part, moved, speed)
                work += part * power()
            speed = speed + damping.change(part, a)
            moved = pin.integrate(model, moved, part * speed)
        ends.append((moved, speed, work))
    finest = ends[-1][0]
    rows = [
        np.concatenate([pin.difference(model, finest, moved), speed, [work]])
        for moved, speed, work in ends
    ]
    for order in range(1, len(_PARTS)):
        for j in range(len(_PARTS) - 1, order - 1, -1):
            ratio = _PARTS[j] / _PARTS[j - order]
            rows[j] = rows[j] + (rows[j] - rows[j - 1]) / (ratio - 1)
    last, nv = rows[-1], model.nv
    return (pin.integrate(model, finest, last[:nv]), last[nv:-1].copy()), float(last[-1])

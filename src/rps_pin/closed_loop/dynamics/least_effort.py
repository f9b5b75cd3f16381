"""Actuator forces of least effort, and the residual force of an underactuated mechanism.

The closures' forces do no work in the null space N of J, which leaves of S' tau + J' lambda = f
only

    (S N)' tau = N' f.

With more actuators than mobility many tau solve it: that of least |W tau| is meant. With fewer, or
with actuators that do not move all of the mechanism, in general none does: then tau is the
least-squares solution.
"""

from __future__ import annotations

from typing import NamedTuple

from rps_pin.arrays import Array
from rps_pin.numerics.linear_algebra import full_svd, rank, refuse_condition

#: Part of N' f that the actuators may leave, relative to it, before there is a residual force.
RESIDUAL = 1e-9


class LeastEffort(NamedTuple):
    """Actuator forces of least effort, and all others: tau + free y act the same for any y."""

    tau: Array
    """Shape (na,); of all least-squares solutions, that of least |W tau|."""
    missing: Array
    """N' f - (S N)' tau, shape (m,): zero but for rounding if the actuators can do it."""
    free: Array
    """Basis of the tau without work in any allowed motion, (na, na - rank), W free orthonormal."""
    values: Array
    """Singular values of W^-1 S N, largest first, shape (min(na, m),)."""


def least_effort(
    actuator_motions: Array, reduced_force: Array, weights: Array | None = None, size: float = 1.0
) -> LeastEffort:
    """Return the actuator forces tau with (S N)' tau = N' f and least |W tau|.

    Parameters
    ----------
    actuator_motions
        S N, shape (na, m): the actuators' velocities in each allowed motion. Of an underactuated
        mechanism, N should be orthonormal in comparable units.
    reduced_force
        N' f, shape (m,).
    weights
        Diagonal of W, shape (na,), positive; one if left out.
    size
        Largest singular value that W^-1 S N can have, for the rule of rank.
    """
    weighted = actuator_motions if weights is None else actuator_motions / weights[:, None]
    left, values, right = full_svd(weighted.T)  # of (S N)' W^-1, which takes W tau to N' f
    count = rank(values, size=size)
    along = (reduced_force @ left[:, :count]) / values[:count]
    tau, free = along @ right[:count], right[count:].T
    if weights is not None:
        tau, free = tau / weights, free / weights[:, None]
    missing = reduced_force - tau @ actuator_motions
    return LeastEffort(tau, missing, free, values)


def residual_force(motions: Array, missing: Array, scale: Array) -> Array:
    """Return the smallest generalised force that would have to be added, shape (nv,).

    With D = diag(scale) and tau, lambda that make |D (f - S' tau - J' lambda)| least, this is
    f - S' tau - J' lambda, for any lambda. It is zero on the actuated rows, N' u = missing, and D u
    is orthogonal to all that actuators and closures can produce.

    Parameters
    ----------
    motions
        N, shape (nv, m), D^-1 N orthonormal (as `ClosedLoopModel.allowed_motions` returns it).
    missing
        Of `least_effort`, shape (m,).
    scale
        Scaling of the velocities to one unit, shape (nv,): D.
    """
    return (motions @ missing) / scale**2  # D^-1 (D^-1 N) missing


def refuse_nearly_singular(values: Array, max_condition: float, size: float = 1.0) -> None:
    """Raise `SingularityError` if a motion is moved by actuators, but hardly.

    Singular values that do not count (see `rank`) are of motions that are not actuated.
    """
    count = rank(values, size=size)
    if count:
        reason = "the actuators hardly move one of the mechanism's motions here"
        refuse_condition(float(values[0] / values[count - 1]), max_condition, reason)

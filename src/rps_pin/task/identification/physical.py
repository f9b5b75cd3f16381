"""Physically possible parameters: the most likely ones that bodies and friction can have.

A body of mass m, first moment h and inertia I about its joint's origin exists if, and only if, its
pseudo-inertia is positive semidefinite,

    P = [ Sigma  h ]      Sigma = trace(I) / 2 - I,
        [ h'     m ]

and damping, friction, stiffness and armature are not negative. With b the base parameters that the
logs say, C their covariance, and p_0 the believed parameters with deviations d,

    minimise (B p - b)' C^-1 (B p - b) + |(p - p_0) / d|^2   subject to   P_k >= e_k > 0.

The second term decides what the logs do not tell; d is the parameter's size times `SPREAD`. This is
a semidefinite program, which Clarabel solves.

Source of the condition: P. Wensing, S. Kim, J.-J. Slotine, Linear matrix inequalities for
physically consistent inertial parameter identification, IEEE RA-L 3(1), 2018.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from rps_pin.arrays import Array
from rps_pin.numerics.linear_algebra import rank

#: Deviation of the believed parameters, over their size.
SPREAD = 1.0
#: Least eigenvalue of a body's pseudo-inertia, its units being its mass and its radius of gyration.
LEAST = 1e-4
#: Clarabel's tolerances.
_TOLERANCE = 1e-9
_SOLVED = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
#: Entries (row, column) of a triangle of 4, column by column, as Clarabel takes them.
_TRIANGLE = [(i, j) for j in range(4) for i in range(j + 1)]
_ROOT = np.sqrt(2.0)


class Possible(NamedTuple):
    """A physically possible answer."""

    parameters: Array
    """p, shape (p,)."""
    least: tuple[float, ...]
    """Least eigenvalue of each body's pseudo-inertia, in the units of its mass and size."""
    distance: float
    """Root of (B p - b)' C^-1 (B p - b): deviations between it and the free answer."""


def pseudo_inertia(body: Array) -> Array:
    """Return P of a body's ten parameters, shape (4, 4)."""
    mass, h, (xx, xy, yy, xz, yz, zz) = body[0], body[1:4], body[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    found = np.empty((4, 4))
    found[:3, :3] = np.trace(inertia) / 2 * np.eye(3) - inertia
    found[:3, 3] = found[3, :3] = h
    found[3, 3] = mass
    return found


#: d vec(P) / d parameters, shape (4, 4, 10).
_MAP = np.stack([pseudo_inertia(one) for one in np.eye(10)], axis=-1)


def body_scale(body: Array, least: float = 0.0) -> Array:
    """Return the sizes of a body's parameters, shape (10,): m, m r and m r^2; r >= `least`, m."""
    mass = float(body[0])
    trace = float(body[4] + body[6] + body[8]) / 2
    square = max(trace / mass, float(np.sum((body[1:4] / mass) ** 2)), least**2)
    return np.asarray(mass * np.sqrt(square) ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2]))


def possible(
    labels: Sequence[str],
    believed: Array,
    sizes: Array,
    matrix: Array,
    values: Array,
    covariance: Array,
) -> Possible | None:
    """Return the most likely parameters that are physically possible; None if the solver fails.

    Parameters
    ----------
    labels, believed
        The estimated parameters.
    sizes
        Of each parameter, in its unit, shape (p,).
    matrix
        B, shape (b, p).
    values, covariance
        b, and C, which has no rank in what is not seen.
    """
    target, rows = _whitened(covariance, values, matrix)
    rows, target = rows * sizes, target - rows @ believed  # of (p - p_0) / sizes
    count, p = rows.shape
    # z = (x, r): r = rows x - target; the cost is |r|^2 / 2 + |x|^2 / (2 SPREAD^2).
    weights = np.concatenate([np.full(p, SPREAD**-2), np.ones(count)])
    equal: Any = sparse.hstack([sparse.csc_array(rows), -sparse.eye_array(count)])
    kinds: list[Any] = [clarabel.ZeroConeT(count)]
    blocks, rights = [equal], [target]
    others = [k for k, label in enumerate(labels) if not label.startswith(("inertia:", "offset:"))]
    if others:
        blocks.append(_placed(-np.eye(len(others)), others, p + count))
        rights.append(believed[others] / sizes[others])
        kinds.append(clarabel.NonnegativeConeT(len(others)))
    for start in _bodies(labels):
        own = slice(start, start + 10)
        cone, right = _cone(believed[own], sizes[own])
        blocks.append(_placed(-cone, range(start, start + 10), p + count))
        rights.append(right)
        kinds.append(clarabel.PSDTriangleConeT(4))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
    found = clarabel.DefaultSolver(
        sparse.csc_matrix(sparse.diags_array(weights)),
        np.zeros(p + count),
        sparse.csc_matrix(sparse.vstack(blocks)),
        np.concatenate(rights),
        kinds,
        settings,
    ).solve()
    if found.status not in _SOLVED:
        return None
    x = np.array(found.x)[:p]
    parameters = believed + sizes * x
    parameters[others] = np.maximum(parameters[others], 0.0)
    least = tuple(
        least_eigenvalue(parameters[k : k + 10], sizes[k : k + 10]) for k in _bodies(labels)
    )
    return Possible(parameters, least, float(np.linalg.norm(rows @ x - target)))


def least_eigenvalue(body: Array, sizes: Array) -> float:
    """Return the least eigenvalue of a pseudo-inertia in units of a mass and a radius."""
    turn = _units(sizes)
    return float(np.linalg.eigvalsh(pseudo_inertia(body) * np.outer(turn, turn))[0])


def _units(sizes: Array) -> Array:
    """Return D with D P D in units of the body's mass m and radius r: 1 / (sqrt(m) r, sqrt(m))."""
    return np.asarray(1 / np.sqrt(sizes[[4, 4, 4, 0]]))


def _bodies(labels: Sequence[str]) -> list[int]:
    return [k for k, label in enumerate(labels) if label.endswith(".mass")]


def _cone(believed: Array, sizes: Array) -> tuple[Array, Array]:
    """Return the map of (p - p_0) / sizes to D P D as a scaled triangle, and D P_0 D - LEAST."""
    turn = np.outer(_units(sizes), _units(sizes))
    change = _MAP * turn[..., None] * sizes
    fixed = pseudo_inertia(believed) * turn - LEAST * np.eye(4)
    weigh = [1.0 if i == j else _ROOT for i, j in _TRIANGLE]
    cone = np.array([w * change[i, j] for w, (i, j) in zip(weigh, _TRIANGLE, strict=True)])
    right = np.array([w * fixed[i, j] for w, (i, j) in zip(weigh, _TRIANGLE, strict=True)])
    return cone, right


def _placed(block: Array, columns: Sequence[int], size: int) -> sparse.csc_array:
    """Return rows (n, size) with a block in some columns."""
    found = np.zeros((len(block), size))
    found[:, list(columns)] = block
    return sparse.csc_array(found)


def _whitened(covariance: Array, values: Array, matrix: Array) -> tuple[Array, Array]:
    """Return L b and L B, with L'L = C^-1 of what is seen."""
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.where(deviation > 0, deviation, 1.0)
    s, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    s, vectors = s[::-1], vectors[:, ::-1]
    count = rank(s)
    whiten = (vectors[:, :count] / np.sqrt(s[:count])).T / unit
    return whiten @ values, whiten @ matrix

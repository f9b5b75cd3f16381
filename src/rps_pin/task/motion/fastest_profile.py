"""The fastest speed profile within linear limits of u'' and u'^2: a convex program.

With b = u'^2 and a = u'', what limits forces and speeds along a curve reads, at each place,

    p a + q b <= r,

and the time, the integral of du / sqrt(b), is convex in b (Verscheure et al. 2009,
"Time-Optimal Path Tracking for Robots: A Convex Optimization Approach"). The unknowns are those of
a `SpeedProfile`: b at the knots, and its bump in each piece. On each piece, a is a straight line,
so that few points where limits are imposed follow a motion at a limit to second order.

The integral is replaced by a sum with weights w_j > 0: Simpson's rule, and for a piece from or to
rest, where 1 / sqrt(b) is infinite, Gauss's rule for the weight 1 / sqrt(s). Each 1 / sqrt(b_j) is
modelled by two second-order cones:

    d_j >= 1 / c_j,   c_j^2 <= b_j.

Clarabel solves this to a duality gap: the minimum is global.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from rps_pin.arrays import Array, Indices
from rps_pin.errors import RPSPinError
from rps_pin.task.motion.speed_profile import SpeedProfile

Sparse = Any  # a matrix of scipy.sparse; its stubs cannot follow how one is put together

#: Of the solver: duality gap and residuals, in units of the sum and of the limits.
TOLERANCE = 1e-9
#: A gap that is still accepted where rounding keeps the solver from the tolerance.
_ACCEPTED_GAP = 1e-6
#: A guess of b is of the right size within this factor, and is corrected so often.
_RIGHT_SIZE, _MOST_SIZES = 30.0, 8
#: How much smaller b is tried before limits are said to leave none, and how far.
_SMALLER, _SMALLEST = 1e-3, 1e-7

# Gauss-Legendre on [-1, 1] is even: with s = x^2, the integral of f(s) / sqrt(s) from 0 to 1.
_X, _W = np.polynomial.legendre.leggauss(4)
_REST_SHARES, _REST_WEIGHTS = _X[2:] ** 2, 2 * _W[2:] * _X[2:]

_INFEASIBLE = (
    clarabel.SolverStatus.PrimalInfeasible,
    clarabel.SolverStatus.AlmostPrimalInfeasible,
)


class ProfileLimits(NamedTuple):
    """Limits p a + q b <= r at places in each of n pieces; m places, k limits at each."""

    share: Array
    """Where in each piece the limits are, from 0 to 1, shape (m,)."""
    by_acceleration: Array
    """p, shape (n, m, k)."""
    by_square: Array
    """q, shape (n, m, k)."""
    bound: Array
    """r, shape (n, m, k). The solver keeps limits best whose r are about 1."""


def fastest_profile(
    knots: Array, limits: ProfileLimits, rest: tuple[bool, bool], guess: Array
) -> SpeedProfile | None:
    """Return the profile of the shortest time, or None if the limits leave none.

    Parameters
    ----------
    knots
        Of the profile, shape (n + 1,), n of 2 or more.
    limits
        The limits.
    rest
        Whether it starts, and whether it ends, with the rate zero. Otherwise that rate is free.
    guess
        Magnitude of b at the knots, shape (n + 1,), positive except at rest: the solver's units. A
        wrong magnitude is corrected.

    Raises
    ------
    RPSPinError
        If the solver does not converge.
    """
    size = 1.0
    for _ in range(_MOST_SIZES):
        program = _Program(knots, limits, rest, size * guess)
        found = program.solved()
        if found.status in _INFEASIBLE:
            # The solver may report this if b is far too large.
            if size * _SMALLER < _SMALLEST:
                return None
            size *= _SMALLER
            continue
        # The sum is the mean of 1 / sqrt(b) in the solver's units.
        off = found.obj_val**-2 if found.obj_val > 0 else math.nan
        if 1 / _RIGHT_SIZE < off < _RIGHT_SIZE and _is_solved(found):
            return program.profile(np.array(found.x))
        if not math.isfinite(off) or 1 / _RIGHT_SIZE < off < _RIGHT_SIZE:
            break
        size *= off
    raise RPSPinError(
        f"the solver of the fastest speed profile came to no result: {found.status}, after "
        f"{found.iterations} steps, with sums of {found.obj_val:.9g} and {found.obj_val_dual:.9g}"
    )


class _Program:
    """The program in the solver's form: least ``cost @ x`` with ``right - matrix @ x`` in cones.

    The unknowns x are b at the knots that are not at rest, bumps, and c and d of each place.
    """

    def __init__(
        self, knots: Array, limits: ProfileLimits, rest: tuple[bool, bool], guess: Array
    ) -> None:
        n = len(knots) - 1
        (piece, share), weights = _quadrature(knots, rest)
        count = len(weights)
        kept = np.ones(2 * n + 1, dtype=bool)
        kept[[0, n]] = not rest[0], not rest[1]
        unit = np.concatenate([guess, (guess[:-1] + guess[1:]) / 2])  # of b at knots, and bumps
        self.knots = knots
        self.units = sparse.diags_array(unit).tocsc()[:, kept]
        departing = _departing(n, rest) / unit[1]
        linear = sparse.vstack([_limit_rows(knots, limits), departing]).tocsc() @ self.units
        size = (1 - share) * guess[piece] + share * guess[piece + 1]  # of b where time is summed
        b_of = sparse.diags_array(1 / size) @ _square_at(n, piece, share) @ self.units
        cones, cone_bound = _cones(b_of, count)
        free = sparse.csc_matrix((linear.shape[0], 2 * count))
        times = weights / np.sqrt(size)
        self.matrix = sparse.vstack([sparse.hstack([linear, free]), cones]).tocsc()
        self.cost = np.concatenate([np.zeros(kept.sum() + count), times / times.sum()])
        self.right = np.concatenate([limits.bound.ravel(), np.zeros(sum(rest)), cone_bound])
        self.kinds = [
            clarabel.NonnegativeConeT(linear.shape[0]),
            *[clarabel.SecondOrderConeT(3)] * (2 * count),
        ]

    def solved(self) -> Any:
        """Return Clarabel's solution, whatever its status."""
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
        no_square = sparse.csc_matrix((len(self.cost), len(self.cost)))
        return clarabel.DefaultSolver(
            no_square, self.cost, self.matrix, self.right, self.kinds, settings
        ).solve()

    def profile(self, x: Array) -> SpeedProfile:
        """Return the speed profile of the unknowns."""
        n = len(self.knots) - 1
        unknown = self.units @ x[: self.units.shape[1]]
        return SpeedProfile(self.knots, unknown[: n + 1], unknown[n + 1 :])


def _is_solved(found: Any) -> bool:
    """Return whether the gap is closed as far as rounding allows."""
    if found.status == clarabel.SolverStatus.Solved:
        return True
    gap = abs(found.obj_val - found.obj_val_dual)
    almost = found.status == clarabel.SolverStatus.AlmostSolved
    return bool(almost and gap <= _ACCEPTED_GAP * abs(found.obj_val))


# What the solver is given -------------------------------------------------------------------------


def _quadrature(knots: Array, rest: tuple[bool, bool]) -> tuple[tuple[Indices, Array], Array]:
    """Return piece and share of each place where the time is summed, and the weights."""
    width = np.diff(knots)
    n = len(width)
    simpson = np.ones(n, dtype=bool)
    simpson[0], simpson[-1] = not rest[0], not rest[1]
    sixth = np.where(simpson, width / 6, 0.0)
    at_knots = np.append(sixth, 0.0) + np.append(0.0, sixth)
    piece = [np.minimum(np.arange(n + 1), n - 1), np.arange(n)]
    share = [np.append(np.zeros(n), 1.0), np.full(n, 0.5)]
    weight = [at_knots, 4 * sixth]
    for end, shares in ((0, _REST_SHARES), (n - 1, 1 - _REST_SHARES)):
        if not simpson[end]:
            piece.append(np.full(2, end))
            share.append(shares)
            weight.append(width[end] * _REST_WEIGHTS)
    weights = np.concatenate(weight)
    used = weights > 0
    return (np.concatenate(piece)[used], np.concatenate(share)[used]), weights[used]


def _at_pieces(n: int, piece: Indices, *parts: Array) -> Sparse:
    """Return the matrix of sums, each of a piece's b at both ends and bump, times these parts."""
    columns = np.concatenate([piece, piece + 1, n + 1 + piece])
    places = np.tile(np.arange(piece.size), 3), columns
    return sparse.csc_matrix((np.concatenate(parts, axis=None), places), (piece.size, 2 * n + 1))


def _square_at(n: int, piece: Indices, share: Array) -> Sparse:
    """Return the matrix of b at places: (1 - s) b_i + s b_(i+1) + 4 s (1 - s) bump_i."""
    return _at_pieces(n, piece, 1 - share, share, 4 * share * (1 - share))


def _limit_rows(knots: Array, limits: ProfileLimits) -> Sparse:
    """Return the matrix of the limits."""
    n = len(knots) - 1
    s = limits.share[:, None]
    p = limits.by_acceleration / (2 * np.diff(knots))[:, None, None]
    q = limits.by_square
    piece = np.broadcast_to(np.arange(n)[:, None, None], p.shape).ravel()
    # a = (b_(i+1) - b_i + 4 (1 - 2 s) bump_i) / (2 h)
    of_bump = 4 * s * (1 - s) * q + 4 * (1 - 2 * s) * p
    return _at_pieces(n, piece, q * (1 - s) - p, q * s + p, of_bump)


def _departing(n: int, rest: tuple[bool, bool]) -> Sparse:
    """Return rows that let b rise from rest and fall to rest: b_1 + 4 bump >= 0, ..."""
    matrix: Sparse = sparse.lil_matrix((2, 2 * n + 1))
    matrix[0, [1, n + 1]] = -1.0, -4.0
    matrix[1, [n - 1, 2 * n]] = -1.0, -4.0
    return matrix.tocsr()[np.flatnonzero(rest)]


def _cones(b_of: Sparse, count: int) -> tuple[Sparse, Array]:
    """Return the rows of the cones (b + 1, 2 c, b - 1) and (d + c, 2, d - c).

    A row of the solver is ``right - matrix @ unknowns``.
    """
    none = sparse.csc_matrix(b_of.shape)
    zero, one = sparse.csc_matrix((count, count)), sparse.identity(count)
    blocks: list[Any] = [
        [[b_of, zero, zero], [none, 2 * one, zero], [b_of, zero, zero]],
        [[none, one, one], [none, zero, zero], [none, -one, one]],
    ]
    rights = [[1.0, 0.0, -1.0], [0.0, 2.0, 0.0]]
    # From three rows of all cones to the three rows of each.
    order = np.arange(3 * count).reshape(3, count).T.ravel()
    rows = [-sparse.bmat(block).tocsr()[order] for block in blocks]
    return sparse.vstack(rows).tocsc(), np.concatenate([np.tile(right, count) for right in rights])

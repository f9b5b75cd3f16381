"""All assembly modes of a planar mechanism of hinges and slides, as guesses of its modes."""

from __future__ import annotations

from math import comb

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools, ComplexArray
from rps_pin.closed_loop.assembly.every.planar import Planar, planar
from rps_pin.closed_loop.assembly.every.solutions import NoFormulationError, Solutions
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.numerics.homotopy.bilinear import bilinear_solutions
from rps_pin.numerics.homotopy.krawczyk import all_distinct
from rps_pin.numerics.homotopy.quadrics import proven_solutions
from rps_pin.numerics.intervals import Interval
from rps_pin.numerics.linear_algebra import RANK_TOLERANCE

#: The last homogeneous coordinate, relative to the largest, below which a solution is at infinity.
_INFINITE = 1e-8
#: Paths at most: their number grows by 4 with each pair of equations.
_MOST_PATHS = 5000


def planar_solutions(system: ConstraintSystem, held: Bools, about: Array) -> Solutions:
    """Return all solutions of a planar mechanism's closures.

    Raises
    ------
    NoFormulationError
        If the mechanism is not planar, or has not as many equations as unknowns; says why.
    """
    found = planar(system, held, about)
    basis = _basis(found)
    r, count = basis.shape[1] - 1, len(found.bilinear)
    if not r or count != 2 * r:
        raise NoFormulationError(f"its equations are {count} for {2 * r} unknowns")
    bound = comb(count, r)
    if bound > _MOST_PATHS:
        raise NoFormulationError(f"it takes {bound} paths, more than {_MOST_PATHS}")
    forms = basis.T @ found.bilinear @ basis.conj()
    forms /= np.abs(forms).max(axis=(1, 2), keepdims=True)
    y, z, ends = bilinear_solutions(forms)
    finite = ends.regular & (_last(y) > _INFINITE) & (_last(z) > _INFINITE)
    regular = int(np.count_nonzero(finite))
    x, conjugate = ((one @ side.T)[finite] for one, side in ((y, basis), (z, basis.conj())))
    x, conjugate = x / x[:, -1:], conjugate / conjugate[:, -1:]
    # The conjugates of a solution, in each other's places, are one too: it is real if they are it.
    apart = np.abs(x.conj()[:, None] - conjugate[None]).max(axis=2, initial=0.0)
    real = x[np.argmin(apart, axis=1) == np.arange(len(x))] if len(x) else x
    guesses = [_configuration(system, found, about, one) for one in real]
    solved = np.zeros(system.model.nv, dtype=bool)
    solved[[one[0] for one in found.joints]] = True
    known = f"{bound} is the Bezout number of {count} bilinear equations"
    return Solutions(
        np.array(guesses).reshape(len(real), system.model.nq),
        solved,
        _certified(found, real),
        regular,
        bound,
        bound - regular,
        f"{known}: all are found"
        if regular == bound
        else f"{known}; the paths lead to all regular ones, with probability one",
    )


def _last(x: ComplexArray) -> Array:
    return np.asarray(np.abs(x[:, -1]) / np.abs(x).max(axis=1))


def _basis(found: Planar) -> ComplexArray:
    """Return W, (n + 1, r + 1), so that (X, 1) = W (y, 1) are the solutions of A X + a = 0."""
    n = found.linear.shape[1] - 1
    a, right = found.linear[:, :n], -found.linear[:, n]
    left, values, transposed = np.linalg.svd(a)
    count = int(np.count_nonzero(values > RANK_TOLERANCE * max(1.0, values.max(initial=0.0))))
    along = left.conj().T @ right
    if np.abs(along[count:]).max(initial=0.0) > RANK_TOLERANCE:
        raise NoFormulationError("its links do not meet in the plane")
    basis = np.zeros((n + 1, n - count + 1), dtype=np.complex128)
    basis[:n, :-1] = transposed[count:].conj().T
    basis[:n, -1] = transposed[:count].conj().T @ (along[:count] / values[:count])
    basis[n, -1] = 1.0
    return basis


def _configuration(system: ConstraintSystem, found: Planar, about: Array, x: ComplexArray) -> Array:
    """Return the configuration with turns and slides X, shape (nq,)."""
    velocity = np.zeros(system.model.nv)
    for index, own, link, sign in found.joints:
        relative = x[own] * np.conj(x[link])  # X of what stands is the 1 at the end
        velocity[index] = sign * np.angle(relative) if sign else relative.real * found.unit
    return np.asarray(pin.integrate(system.model, about, velocity))


def _certified(found: Planar, real: ComplexArray) -> Bools:
    """Return which real solutions X, (m, n + 1), are proven, and no two of them the same."""
    n = found.linear.shape[1] - 1
    if 2 * len(found.linear) + len(found.bilinear) != 2 * n:  # rows that depend on others
        return np.zeros(len(real), dtype=bool)
    # (X, 1) = P v, v = (Re X, Im X, 1)
    parts = np.zeros((n + 1, 2 * n + 1), dtype=np.complex128)
    parts[range(n), range(n)], parts[range(n), range(n, 2 * n)] = 1.0, 1j
    parts[n, 2 * n] = 1.0
    forms = list((parts.T @ found.bilinear @ parts.conj()).real)
    for row in found.linear @ parts:
        for part in (row.real, row.imag):
            form = np.zeros((2 * n + 1, 2 * n + 1))
            form[-1], form[:, -1] = part / 2, part / 2
            form[-1, -1] = part[-1]
            forms.append(form)
    v = np.hstack([real[:, :n].real, real[:, :n].imag, np.ones((len(real), 1))])
    return all_distinct(proven_solutions(Interval(np.array(forms)), np.eye(2 * n + 1)[-1], v))

"""Lagrange's equations from an energy's numbers alone, to rounding.

Kinetic energy is quadratic in the rates: its derivatives by them are differences of its values,
exactly. The other derivatives are complex steps, exact to rounding. The energy must be
complex-safe.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

_STEP = 1e-40


def inertia_forces(
    kinetic: Callable[[Array, Array], Array], x: Array, rate: Array, acceleration: Array
) -> Array:
    """d/dt dT/dx' - dT/dx, shape (..., n), of T(x, x') for x, x' and x'' of shape (..., n)."""
    step = 1j * _STEP
    x_later, rate_later = x + step * rate, rate + step * acceleration
    forces = []
    for unit in np.eye(x.shape[-1]):
        # T(x' + e) - T(x') - T(e) = e' M x' = dT/dx' . e, here a moment later
        momentum = (
            kinetic(x_later, rate_later + unit)
            - kinetic(x_later, rate_later)
            - kinetic(x_later, unit + 0 * rate_later)
        )
        slope = kinetic(x + step * unit, rate)
        forces.append(np.imag(momentum - slope) / _STEP)
    return np.stack(forces, axis=-1)


def slopes(potential: Callable[[Array], Array], x: Array) -> Array:
    """dV/dx, shape (..., n), of V(x)."""
    moved = [np.imag(potential(x + 1j * _STEP * unit)) / _STEP for unit in np.eye(x.shape[-1])]
    return np.stack(moved, axis=-1)

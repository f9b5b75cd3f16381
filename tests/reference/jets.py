"""Vectors that move: a value with its first and second derivative in time (see `newton_euler.Jet`).

Everything is carried along one curve, q(t) = q + v t + a t^2 / 2, so that closed forms of positions
give velocities and accelerations without a second derivation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.reference.newton_euler import Jet, bilinear, jet_reciprocal, jet_sqrt

Array = NDArray[np.float64]


def constant(value: ArrayLike) -> Jet:
    """Something that does not move."""
    array = np.asarray(value, dtype=float)
    return Jet(array, np.zeros_like(array), np.zeros_like(array))


def scaled(factor: Jet, vector: Jet) -> Jet:
    """Scalar times vector."""
    return bilinear(np.multiply, factor, vector)


def minus(one: Jet, other: Jet) -> Jet:
    return one + other.map(np.negative)


def dot(one: Jet, other: Jet) -> Jet:
    return bilinear(np.dot, one, other)


def cross(one: Jet, other: Jet) -> Jet:
    return bilinear(np.cross, one, other)


def root(square: Jet) -> Jet:
    return jet_sqrt(square)


def length(vector: Jet) -> Jet:
    return jet_sqrt(dot(vector, vector))


def over(vector: Jet, divisor: Jet) -> Jet:
    """Vector divided by a scalar."""
    return scaled(jet_reciprocal(divisor), vector)


def unit(vector: Jet) -> Jet:
    return over(vector, length(vector))


def turned(vector: Jet) -> Jet:
    """A plane vector (x, z), a quarter turn from x towards z."""
    return vector.map(lambda u: np.array([-u[1], u[0]]))


def direction(angle: Jet) -> Jet:
    """u = (cos, sin): u' = angle' t and u'' = angle'' t - angle'^2 u, t a quarter turn ahead."""
    u = np.array([np.cos(angle.value), np.sin(angle.value)])
    t = np.array([-u[1], u[0]])
    return Jet(u, angle.first * t, angle.second * t - angle.first**2 * u)


def meeting(w: Jet, c: Jet, side: float) -> Jet:
    """The unit plane vector u with u . w = c, ahead of w (side 1) or behind it (-1).

    With w = (a, b) and u = (cos t, sin t) that is a cos t + b sin t = c.
    """
    square = dot(w, w)
    across = root(minus(square, scaled(c, c))).map(lambda x: side * x)
    return over(scaled(c, w) + scaled(across, turned(w)), square)


def relative(u: Jet, to: Jet) -> Jet:
    """The angle from a unit plane vector to another."""
    return angle_of(stacked(dot(u, to), dot(turned(u), to)))


def stacked(*parts: Jet) -> Jet:
    """Several as one, along a new first axis."""
    return Jet(
        np.array([part.value for part in parts]),
        np.array([part.first for part in parts]),
        np.array([part.second for part in parts]),
    )


def angle_of(u: Jet) -> Jet:
    """The angle of a unit plane vector, angle' = u x u' and angle'' = u x u''."""
    (x, z), t = u.value, np.array([-u.value[1], u.value[0]])
    return Jet(np.arctan2(z, x), np.dot(t, u.first), np.dot(t, u.second))


def frame(*axes: Jet) -> Jet:
    """The rotation whose columns are the moving unit vectors x, y, z."""
    x, y, z = axes
    return Jet(
        np.column_stack([x.value, y.value, z.value]),
        np.column_stack([x.first, y.first, z.first]),
        np.column_stack([x.second, y.second, z.second]),
    )


def applied(matrix: Jet, vector: ArrayLike) -> Jet:
    """A moving rotation times a vector fixed in the body."""
    fixed = np.asarray(vector, dtype=float)
    return matrix.map(lambda m: m @ fixed)


def spin(rotation: Jet) -> Array:
    """omega, from [omega] = R' R^T."""
    return _vector(rotation.first @ rotation.value.T)


def spin_rate(rotation: Jet) -> Array:
    """alpha, the skew part of R'' R^T (what R' R'^T adds is symmetric)."""
    return _vector(rotation.second @ rotation.value.T)


def _vector(matrix: Array) -> Array:
    skew = (matrix - matrix.T) / 2
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])

"""Rotation vectors as coordinates: their rates, and how these depend on the rotation.

Let frame b stand in frame a with the rotation R = exp(r^), and turn with the angular velocity w in
a's axes. Then

    r' = A(r) w,   A(r) = 1 - r^ / 2 + beta(r . r) r^ r^,
    beta(t) = (1 - c) / t,   c = h cot h,   h = sqrt(t) / 2,   c' = (c - c^2) / (2 t) - 1 / 8,

A being the inverse of the left Jacobian of exp. It is regular below a whole turn, |r| < 2 pi.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import pinocchio as pin
from numpy.polynomial.polynomial import polyder
from scipy.special import zeta

from rps_pin.arrays import Array

skew = pin.skew

#: Coordinates that are rotation vectors stay below a whole turn, where they have no rates; rad.
MOST_TURN = 2 * math.pi - 0.05

#: beta(t) = sum_k 2 zeta(2 k) t^(k - 1) / (2 pi)^(2 k), k = 1, 2, ..., for t below `_SERIES`, where
#: the closed form loses digits.
_SERIES, _TERMS = 4.0, 20


@lru_cache
def beta_series() -> tuple[tuple[float, ...], ...]:
    """Return the coefficients of beta and of its first two derivatives, highest powers first."""
    k = np.arange(1, _TERMS + 1)
    series = 2 * zeta(2 * k) / (2 * math.pi) ** (2 * k)
    return tuple(tuple(polyder(series, order)[::-1].tolist()) for order in range(3))


def beta(t: float) -> tuple[float, float, float]:
    """Return beta and its first two derivatives by t = r . r, below (2 pi)^2."""
    if t < _SERIES:
        value, first, second = (_horner(series, t) for series in beta_series())
        return value, first, second
    h = math.sqrt(t) / 2
    c = h / math.tan(h)
    c1 = (c - c * c) / (2 * t) - 1 / 8
    c2 = (c1 - 2 * c * c1) / (2 * t) - (c - c * c) / (2 * t * t)
    value = (1 - c) / t
    first = -(c1 + value) / t
    return value, first, -(c2 + 2 * first) / t


def _horner(coefficients: tuple[float, ...], x: float) -> float:
    total = 0.0
    for one in coefficients:
        total = total * x + one
    return total


def rotation_vector(rotation: Array, near: Array | None = None) -> Array:
    """Return r of a rotation (3, 3), |r| <= pi; or the other, a turn less, if `near` is nearer.

    Components of `near` that are NaN do not count.
    """
    # By the quaternion (x, y, z, w): log3's own formulas lose digits near half a turn.
    quaternion = pin.Quaternion(rotation).coeffs()
    sine, cosine = quaternion[:3], quaternion[3]
    length = math.sqrt(sine @ sine)
    angle = 2 * math.atan2(length, abs(cosine))
    r: Array = sine * math.copysign(angle / length if length > 0 else 2.0, cosine)
    if near is None or angle < 1e-8:  # the other one has no direction
        return r
    other: Array = r * (1 - 2 * math.pi / angle)
    counts = np.isfinite(near)
    away, other_away = (r - near)[counts], (other - near)[counts]
    return other if other_away @ other_away < away @ away else r


def rate_matrix(r: Array) -> Array:
    """Return A(r), shape (3, 3)."""
    turn = skew(r)
    return np.asarray(np.eye(3) - turn / 2 + beta(float(r @ r))[0] * turn @ turn)


def vector_rates(r: Array, w: Array, dw: Array) -> tuple[Array, Array]:
    """Return r' and r'' of rotation vectors, angular velocities and accelerations (..., 3) each."""
    values = np.array([beta(t)[:2] for t in (r * r).sum(axis=-1).flat])
    value, first = np.moveaxis(values.reshape(*r.shape[:-1], 2), -1, 0)[..., None]

    def across(along: Array) -> tuple[Array, Array]:
        once = np.cross(r, along)
        return once, np.cross(r, once)

    once, twice = across(w)
    rate = w - once / 2 + value * twice
    of_dw, again = across(dw)
    both = np.cross(rate, once) + np.cross(r, np.cross(rate, w))
    inner = (r * rate).sum(axis=-1, keepdims=True)
    change = -np.cross(rate, w) / 2 + value * both + 2 * first * inner * twice
    return rate, dw - of_dw / 2 + value * again + change


def rate_slope(r: Array, along: Array) -> Array:
    """Return the derivative of A(r) as r changes along a vector, shape (3, 3)."""
    turn, change = skew(r), skew(along)
    value, first, _ = beta(float(r @ r))
    both = change @ turn + turn @ change
    return np.asarray(-change / 2 + value * both + 2 * first * (r @ along) * turn @ turn)


def rate_curvature(r: Array, along: Array, again: Array) -> Array:
    """Return the second derivative of A(r) along two vectors, shape (3, 3)."""
    turn, one, two = skew(r), skew(along), skew(again)
    value, first, second = beta(float(r @ r))
    on_one, on_two = one @ turn + turn @ one, two @ turn + turn @ two
    of_square = 4 * second * (r @ along) * (r @ again) + 2 * first * (along @ again)
    return np.asarray(
        value * (one @ two + two @ one)
        + 2 * first * ((r @ again) * on_one + (r @ along) * on_two)
        + of_square * turn @ turn
    )

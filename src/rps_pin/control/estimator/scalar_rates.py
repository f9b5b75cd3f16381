"""Pose rate, twist and distance to singularity at a known pose, in plain floats.

The formulas are those of `rps_pin.rps.kinematics.rates` (K, the legs' speeds by the pose's rate)
and `rps_pin.rps.singularity.measures` (M, whose singular values are the gains); the names are
theirs too.
"""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

import eigenpy
import numpy as np

from rps_pin.control.estimator.exponential_map import Coefficients
from rps_pin.numerics.compiled import compiled
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.kinematics.tracking import Triple, Way

(_E1, _E2, _E3) = ((float(x), float(y)) for x, y, _ in RADIAL)
_SQRT3 = math.sqrt(3.0)
_NINE = struct.Struct("9d")
Twist = tuple[float, float, float, float, float, float]


class LegGains(NamedTuple):
    """K row by row (legs), L, and det M of M = K L^-T."""

    K: tuple[Triple, Triple, Triple]
    """d' = K pose': 1, m/rad, m/rad."""
    L: tuple[Triple, Triple, Triple]
    """|L' pose'|^2 is the sum of the balls' squared speeds; lower, m and m/rad."""
    determinant: float
    """Of M, -1 to 1: `SingularityMeasures.determinant`."""
    by_legs: float
    """Of K, m^2/rad^2."""


@compiled
def leg_gains(pose: Triple, way: Way, coefficient: Coefficients, h: float) -> LegGains:
    """Return the gains of a pose whose legs point along `way`.

    With U and W the tips' Jacobians, U'U + W'W = L L' (L lower) and M = K L^-T.
    """
    _, wx, wy = pose
    c1, c2, c3, s1, s2, s3 = way
    ux1, uy1, vx1, vy1 = _tip_gradient(_E1, wx, wy, h, coefficient)
    ux2, uy2, vx2, vy2 = _tip_gradient(_E2, wx, wy, h, coefficient)
    ux3, uy3, vx3, vy3 = _tip_gradient(_E3, wx, wy, h, coefficient)
    kx1, ky1 = s1 * vx1 - c1 * ux1, s1 * vy1 - c1 * uy1
    kx2, ky2 = s2 * vx2 - c2 * ux2, s2 * vy2 - c2 * uy2
    kx3, ky3 = s3 * vx3 - c3 * ux3, s3 * vy3 - c3 * uy3
    l10, l20 = (vx1 + vx2 + vx3) / _SQRT3, (vy1 + vy2 + vy3) / _SQRT3
    q11 = ux1 * ux1 + ux2 * ux2 + ux3 * ux3 + vx1 * vx1 + vx2 * vx2 + vx3 * vx3
    q12 = ux1 * uy1 + ux2 * uy2 + ux3 * uy3 + vx1 * vy1 + vx2 * vy2 + vx3 * vy3
    q22 = uy1 * uy1 + uy2 * uy2 + uy3 * uy3 + vy1 * vy1 + vy2 * vy2 + vy3 * vy3
    l11 = math.sqrt(q11 - l10 * l10)
    l21 = (q12 - l10 * l20) / l11
    l22 = math.sqrt(q22 - l20 * l20 - l21 * l21)
    det = s1 * (kx2 * ky3 - kx3 * ky2) + s2 * (kx3 * ky1 - kx1 * ky3) + s3 * (kx1 * ky2 - kx2 * ky1)
    return LegGains(
        ((s1, kx1, ky1), (s2, kx2, ky2), (s3, kx3, ky3)),
        ((_SQRT3, 0.0, 0.0), (l10, l11, 0.0), (l20, l21, l22)),
        det / (_SQRT3 * l11 * l22),
        det,
    )


class LeastGain:
    """M's least singular value by Jacobi's rotations (eigenpy's), memory allocated once."""

    def __init__(self) -> None:
        self._memory = bytearray(_NINE.size)
        self._matrix = np.frombuffer(self._memory).reshape(3, 3, order="F")
        self._svd = eigenpy.HhJacobiSVD(3, 3)

    def of(self, gains: LegGains) -> float:
        """Return the distance to type II, `SingularityMeasures.type_ii`."""
        _, (l10, l11, _), (l20, l21, l22) = gains.L
        rows: list[float] = []
        for s, kx, ky in gains.K:  # K L^-T: forwards through L
            a = s / _SQRT3
            b = (kx - l10 * a) / l11
            rows += (a, b, (ky - l20 * a - l21 * b) / l22)
        _NINE.pack_into(self._memory, 0, *rows)
        self._svd.compute(self._matrix)
        least: float = self._svd.singularValues().item(2)
        return least


@compiled
def pose_rate(gains: LegGains, speed: Triple) -> Triple:
    """Return pose' with K pose' = d': Cramer's rule. The determinant must not be zero."""
    (k11, k12, k13), (k21, k22, k23), (k31, k32, k33) = gains.K
    d1, d2, d3 = speed
    i11, i21, i31 = k22 * k33 - k23 * k32, k23 * k31 - k21 * k33, k21 * k32 - k22 * k31
    det = gains.by_legs
    return (
        (i11 * d1 + (k13 * k32 - k12 * k33) * d2 + (k12 * k23 - k13 * k22) * d3) / det,
        (i21 * d1 + (k11 * k33 - k13 * k31) * d2 + (k13 * k21 - k11 * k23) * d3) / det,
        (i31 * d1 + (k12 * k31 - k11 * k32) * d2 + (k11 * k22 - k12 * k21) * d3) / det,
    )


@compiled
def force_of_wrench(gains: LegGains, wrench: Triple) -> Triple:
    """Return f with K' f = wrench on the pose: Cramer's rule. The determinant must not be zero."""
    (k11, k12, k13), (k21, k22, k23), (k31, k32, k33) = gains.K
    w1, w2, w3 = wrench
    i11, i21, i31 = k22 * k33 - k23 * k32, k23 * k31 - k21 * k33, k21 * k32 - k22 * k31
    det = gains.by_legs
    return (
        (i11 * w1 + i21 * w2 + i31 * w3) / det,
        ((k13 * k32 - k12 * k33) * w1 + (k11 * k33 - k13 * k31) * w2 + (k12 * k31 - k11 * k32) * w3)
        / det,
        ((k12 * k23 - k13 * k22) * w1 + (k13 * k21 - k11 * k23) * w2 + (k11 * k22 - k12 * k21) * w3)
        / det,
    )


@compiled
def wrench_of_force(gains: LegGains, force: Triple) -> Triple:
    """Return K' f: N, N m, N m."""
    (k11, k12, k13), (k21, k22, k23), (k31, k32, k33) = gains.K
    f1, f2, f3 = force
    return (
        k11 * f1 + k21 * f2 + k31 * f3,
        k12 * f1 + k22 * f2 + k32 * f3,
        k13 * f1 + k23 * f2 + k33 * f3,
    )


@compiled
def leg_speed(gains: LegGains, rate: Triple) -> Triple:
    """Return K pose', m/s; or K pose'', m/s^2, the legs' accelerations without their drift."""
    (k11, k12, k13), (k21, k22, k23), (k31, k32, k33) = gains.K
    x1, x2, x3 = rate
    return (
        k11 * x1 + k12 * x2 + k13 * x3,
        k21 * x1 + k22 * x2 + k23 * x3,
        k31 * x1 + k32 * x2 + k33 * x3,
    )


@compiled
def platform_twist(pose: Triple, rate: Triple, coefficient: Coefficients, h: float) -> Twist:
    """Return the centre's velocity and the angular velocity, base axes: `rates.platform_twist`."""
    _, wx, wy = pose
    dz, dwx, dwy = rate
    _, b, _, d, _, b_s, _, _, _ = coefficient
    db = 2.0 * b_s * (wx * dwx + wy * dwy)
    f, half_df = wx * wx - wy * wy, wx * dwx - wy * dwy
    m = wx * dwy - wy * dwx
    n = d * m
    return (
        h * (db * f / 2.0 + b * half_df),
        -h * (db * wx * wy + b * (dwx * wy + wx * dwy)),
        dz,
        dwx + n * wy,
        dwy - n * wx,
        b * m,
    )


@compiled
def _tip_gradient(
    radial: tuple[float, float], wx: float, wy: float, h: float, coefficient: Coefficients
) -> tuple[float, float, float, float]:
    """Return a leg's rho by (tilt_x, tilt_y), then its z_i by them, m/rad: `tip_jacobians`."""
    ex, ey = radial
    a, b, _, _, a_s, b_s, _, _, _ = coefficient
    e, t = wx * ex + wy * ey, wy * ex - wx * ey
    bend = b_s * (e * e - 3.0 * t * t)
    u_e, u_t = h * e * (bend + b), h * t * (bend - 3.0 * b)
    w_e, w_t = -2.0 * h * a_s * e * t, -h * (a + 2.0 * a_s * t * t)
    return (
        u_e * ex - u_t * ey,
        u_e * ey + u_t * ex,
        w_e * ex - w_t * ey,
        w_e * ey + w_t * ex,
    )

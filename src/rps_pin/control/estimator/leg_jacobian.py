"""Jacobian of the leg lengths by the pose, and its products with speeds, forces and wrenches.

Compositions of `rps_pin.rps.kernels` on floats, compiled as a whole. The names are those of
`rps_pin.rps.kinematics.rates` (K) and `rps_pin.rps.singularity.measures` (M).
"""

from __future__ import annotations

import math
import struct
from typing import Any, NamedTuple

import eigenpy
import numpy as np

from rps_pin.control.estimator.leg_geometry import LegGeometry
from rps_pin.numerics.elementary import Number, sqrt
from rps_pin.rps.kernels.forces import cofactors, column_products, row_products
from rps_pin.rps.kernels.legs import along_leg
from rps_pin.rps.kernels.tips import at_legs, speed_form, tip_slopes
from rps_pin.rps.kinematics.tracking import Triple

#: A 3 x 3 matrix, row by row.
Rows = tuple[Triple, Triple, Triple]
_SQRT3 = math.sqrt(3.0)
_NINE = struct.Struct("9d")


class LegJacobian(NamedTuple):
    """K = d(length)/d(pose), and numbers of its distance to a singularity."""

    K: Rows
    """d' = K pose', by legs: 1, m/rad, m/rad."""
    cofactors: Rows
    """Of K: its inverse is their transpose over its determinant."""
    by_legs: float
    """Determinant of K, m^2/rad^2."""
    L: Triple
    """l_xx, l_yx, l_yy, m/rad, of the lower L whose |L' pose'|^2 is the sum of the ball joints'
    squared speeds; its other entries are l_zz^2 = 3 and 0."""
    determinant: float
    """Of M = K L^-T, -1 to 1: `SingularityMeasures.determinant`."""


def leg_jacobian(geometry: LegGeometry, h: Number) -> LegJacobian:
    """Return the Jacobian in a pose."""
    (_, x, y), (c1, c2, c3, s1, s2, s3) = geometry.pose, geometry.direction
    slopes = tip_slopes(x, y, geometry.tilt)  # by h tilt
    (rx1, rx2, rx3), (ry1, ry2, ry3) = at_legs(slopes[0]), at_legs(slopes[1])
    (zx1, zx2, zx3), (zy1, zy2, zy3) = at_legs(slopes[2]), at_legs(slopes[3])
    K = (
        (s1, h * along_leg(c1, s1, rx1, zx1), h * along_leg(c1, s1, ry1, zy1)),
        (s2, h * along_leg(c2, s2, rx2, zx2), h * along_leg(c2, s2, ry2, zy2)),
        (s3, h * along_leg(c3, s3, rx3, zx3), h * along_leg(c3, s3, ry3, zy3)),
    )
    xx, xy, yy = speed_form(slopes)
    l_xx = sqrt(xx)
    l_yx = xy / l_xx
    L = (h * l_xx, h * l_yx, h * sqrt(yy - l_yx * l_yx))
    inverse, by_legs = cofactors(K)
    return LegJacobian(K, inverse, by_legs, L, by_legs / (_SQRT3 * L[0] * L[2]))


def pose_rate(jacobian: LegJacobian, speed: Triple) -> Triple:
    """Return pose' of K pose' = d'. The determinant must not be zero."""
    a, b, c = column_products(jacobian.cofactors, speed)
    return a / jacobian.by_legs, b / jacobian.by_legs, c / jacobian.by_legs


def force_of_wrench(jacobian: LegJacobian, wrench: Triple) -> Triple:
    """Return f of K' f = wrench on the pose. The determinant must not be zero."""
    a, b, c = row_products(jacobian.cofactors, wrench)
    return a / jacobian.by_legs, b / jacobian.by_legs, c / jacobian.by_legs


def wrench_of_force(jacobian: LegJacobian, force: Triple) -> Triple:
    """Return K' f: N, N m, N m."""
    return column_products(jacobian.K, force)


def leg_speed(jacobian: LegJacobian, rate: Triple) -> Triple:
    """Return K pose', m/s; or K pose'', m/s^2, the accelerations without those of the rate."""
    return row_products(jacobian.K, rate)


class LeastSingularValue:
    """The least singular value of M by Jacobi rotations (eigenpy), with memory allocated once."""

    def __init__(self) -> None:
        self._memory = bytearray(_NINE.size)
        self._matrix = np.frombuffer(self._memory).reshape(3, 3, order="F")
        self._svd = eigenpy.HhJacobiSVD(3, 3)

    def __reduce__(self) -> tuple[Any, ...]:
        """Give copies memory of their own; there is no state."""
        return type(self), ()

    def of(self, jacobian: LegJacobian) -> float:
        """Return the distance to a type II singularity, `SingularityMeasures.type_ii`."""
        l_xx, l_yx, l_yy = jacobian.L
        rows: list[float] = []
        for k_z, k_x, k_y in jacobian.K:  # K L^-T: forwards through L
            m_x = k_x / l_xx
            rows += (k_z / _SQRT3, m_x, (k_y - l_yx * m_x) / l_yy)
        _NINE.pack_into(self._memory, 0, *rows)
        self._svd.compute(self._matrix)
        least: float = self._svd.singularValues().item(2)
        return least

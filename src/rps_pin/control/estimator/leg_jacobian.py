"""Jacobian of the leg lengths by the pose, and what it transforms: speeds, forces, wrenches.

Compositions of `rps_pin.rps.kernels` on floats, compiled as a whole. The names are those of
`rps_pin.rps.kinematics.rates` (K) and `rps_pin.rps.singularity.measures` (M).
"""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

import eigenpy
import numpy as np

from rps_pin.control.estimator.leg_geometry import LegGeometry
from rps_pin.numerics.compiled import compiled
from rps_pin.rps.kernels.forces import cofactors, column_products, row_products
from rps_pin.rps.kernels.legs import along_leg
from rps_pin.rps.kernels.tips import at_legs, speed_form, tip_slopes
from rps_pin.rps.kinematics.tracking import Triple

#: A 3 x 3 matrix, row by row.
Rows = tuple[Triple, Triple, Triple]
_NINE = struct.Struct("9d")


class LegJacobian(NamedTuple):
    """K, and M whose singular values are the distances to singularities."""

    K: Rows
    """d' = K pose', by legs: 1, m/rad, m/rad."""
    M: Rows
    """K L^-T, where |L' pose'|^2 is the sum of the ball joints' squared speeds."""
    determinant: float
    """Of M, -1 to 1: `SingularityMeasures.determinant`."""


@compiled
def leg_jacobian(geometry: LegGeometry, h: float) -> LegJacobian:
    """Return the Jacobian in a pose."""
    (_, x, y), (c1, c2, c3, s1, s2, s3) = geometry.pose, geometry.direction
    slopes = tip_slopes(x, y, geometry.tilt)
    (rx1, rx2, rx3), (ry1, ry2, ry3) = at_legs(slopes[0]), at_legs(slopes[1])
    (zx1, zx2, zx3), (zy1, zy2, zy3) = at_legs(slopes[2]), at_legs(slopes[3])
    # By h tilt, in which all columns are without unit.
    kx1, ky1 = along_leg(c1, s1, rx1, zx1), along_leg(c1, s1, ry1, zy1)
    kx2, ky2 = along_leg(c2, s2, rx2, zx2), along_leg(c2, s2, ry2, zy2)
    kx3, ky3 = along_leg(c3, s3, rx3, zx3), along_leg(c3, s3, ry3, zy3)
    xx, xy, yy = speed_form(slopes)
    l_x = math.sqrt(xx)
    l_xy = xy / l_x
    l_y, l_z = math.sqrt(yy - l_xy * l_xy), math.sqrt(3.0)
    mx1, mx2, mx3 = kx1 / l_x, kx2 / l_x, kx3 / l_x
    M = (
        (s1 / l_z, mx1, (ky1 - l_xy * mx1) / l_y),
        (s2 / l_z, mx2, (ky2 - l_xy * mx2) / l_y),
        (s3 / l_z, mx3, (ky3 - l_xy * mx3) / l_y),
    )
    K = ((s1, h * kx1, h * ky1), (s2, h * kx2, h * ky2), (s3, h * kx3, h * ky3))
    return LegJacobian(K, M, cofactors(M)[1])


@compiled
def pose_rate(jacobian: LegJacobian, speed: Triple) -> Triple:
    """Return pose' of K pose' = d'. The determinant must not be zero."""
    adjugate, det = cofactors(jacobian.K)
    a, b, c = column_products(adjugate, speed)
    return a / det, b / det, c / det


@compiled
def force_of_wrench(jacobian: LegJacobian, wrench: Triple) -> Triple:
    """Return f of K' f = wrench on the pose. The determinant must not be zero."""
    adjugate, det = cofactors(jacobian.K)
    a, b, c = row_products(adjugate, wrench)
    return a / det, b / det, c / det


@compiled
def wrench_of_force(jacobian: LegJacobian, force: Triple) -> Triple:
    """Return K' f: N, N m, N m."""
    return column_products(jacobian.K, force)


@compiled
def leg_speed(jacobian: LegJacobian, rate: Triple) -> Triple:
    """Return K pose', m/s; or K pose'', m/s^2, the accelerations without those of the rate."""
    return row_products(jacobian.K, rate)


class LeastSingularValue:
    """M's least singular value by one-sided Jacobi rotations (eigenpy), memory allocated once."""

    def __init__(self) -> None:
        self._memory = bytearray(_NINE.size)
        self._matrix = np.frombuffer(self._memory).reshape(3, 3, order="F")
        self._svd = eigenpy.HhJacobiSVD(3, 3)

    def of(self, jacobian: LegJacobian) -> float:
        """Return the distance to a type II singularity, `SingularityMeasures.type_ii`."""
        first, second, third = jacobian.M
        _NINE.pack_into(self._memory, 0, *first, *second, *third)
        self._svd.compute(self._matrix)
        least: float = self._svd.singularValues().item(2)
        return least

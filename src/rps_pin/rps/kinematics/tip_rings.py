"""The tips of many poses as rings: three numbers that give one for each leg.

With w the tilt, C = cos(|w|), e_i the radial directions and P the platform's centre, Eq. 1 and 4
put tip i in its leg's plane at

    rho_i = e_i . B_i = h (1 + C)/2 + 2 e_i . P,     z_i = z + e_i . U,     U = h A (-w_y, w_x)

(A, B, C, D of `rps_pin.rps.kinematics.pose`): a mean and a horizontal vector, three numbers for
three legs. So are their derivatives, and sums over the legs need only the sum of what is summed and
its first moment along e_i. Arrays are components of all samples of a block, contiguous.
"""

from __future__ import annotations

from math import factorial, sqrt
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array

#: Up to this squared tilt the functions of the tilt are power series, exact to rounding.
_SERIES_BELOW = 4.0
_C5 = [(-1.0) ** k / factorial(2 * k + 5) for k in range(11)]
_C6 = [(-1.0) ** k / factorial(2 * k + 6) for k in range(11)]
_HALF_ROOT_3 = sqrt(3.0) / 2

Triple = tuple[Array, Array, Array]


class Ring(NamedTuple):
    """A number for each leg, mean + e_i . (x, y): components of shape (n,)."""

    mean: Array
    x: Array
    y: Array

    def at_legs(self) -> Array:
        """Return the legs' numbers, shape (3, n)."""
        legs = np.empty((3, len(self.x)))
        between, apart = self.mean - 0.5 * self.x, _HALF_ROOT_3 * self.y
        np.add(self.mean, self.x, out=legs[0])
        np.add(between, apart, out=legs[1])
        np.subtract(between, apart, out=legs[2])
        return legs


class TiltFunctions(NamedTuple):
    """A, B and D of the squared tilt s, and their derivatives with respect to it."""

    a: Array
    b: Array
    c: Array
    d: Array
    a_s: Array
    b_s: Array
    d_s: Array
    a_ss: Array
    b_ss: Array


class Tips(NamedTuple):
    """The tips' rings rho and z: values, slopes by h tilt_x and h tilt_y, time derivatives."""

    radial: Ring
    height: Ring
    radial_slopes: tuple[Ring, Ring]
    height_slopes: tuple[Ring, Ring]
    radial_rate: Ring
    height_rate: Ring
    radial_acceleration: Ring
    height_acceleration: Ring


def tilt_functions(s: Array) -> TiltFunctions:
    """Return the functions of the squared tilt, from the Stumpff functions c_1 to c_6.

    c_k(s) = 1/k! - s c_(k+2)(s), c_0 = cos(sqrt(s)), c_1 = sin(sqrt(s)) / sqrt(s), and
    dc_k/ds = (k c_(k+2) - c_(k+1)) / 2.
    """
    near = np.minimum(s, _SERIES_BELOW)
    c5, c6 = np.full_like(s, _C5[-1]), np.full_like(s, _C6[-1])
    for term5, term6 in zip(_C5[-2::-1], _C6[-2::-1], strict=True):
        c5 *= near
        c5 += term5
        c6 *= near
        c6 += term6
    c4, c3 = 1 / 24 - near * c6, 1 / 6 - near * c5
    c2, c1 = 0.5 - near * c4, 1 - near * c3
    c0 = 1 - near * c2
    if s.max() > _SERIES_BELOW:
        far = s > _SERIES_BELOW
        values = [c0, c1, c2, c3, c4, c5, c6]
        for value, better in zip(values, _stumpff_by_recursion(s[far]), strict=True):
            value[far] = better
    b_s, d_s = c4 - 0.5 * c3, 1.5 * c5 - 0.5 * c4
    a_s = 0.5 * (c3 - c2)
    return TiltFunctions(
        c1, c2, c0, c3, a_s, b_s, d_s, 0.5 * (d_s - b_s), 2 * c6 - 1.25 * c5 + 0.25 * c4
    )


def _stumpff_by_recursion(s: Array) -> list[Array]:
    """Return c_0 to c_6, upwards: exact to rounding where s is not small."""
    root = np.sqrt(s)
    c = [np.cos(root), np.sin(root) / root]
    for k in range(5):
        c.append((1 / factorial(k) - c[k]) / s)
    return c


def tips_of(h: float, tilt: TiltFunctions, pose: Array, rate: Array, acceleration: Array) -> Tips:
    """Return the rings of rho and z: h (1 + C)/2 and 2 P; z and U."""
    z, x, y = pose
    dx, dy = rate[1], rate[2]
    ddx, ddy = acceleration[1], acceleration[2]
    a, b, c, _, a_s, b_s, _, a_ss, b_ss = tilt
    # s = |w|^2, f = w_x^2 - w_y^2 and k = w_x w_y; P = h B (f/2, -k), C_s = -A/2.
    xx, yy, k = x * x, y * y, x * y
    f = xx - yy
    bf, bk = b_s * f, 2 * b_s * k
    ak = 2 * a_s * k
    u_y, v_x = -2 * a_s * yy - a, 2 * a_s * xx + a
    slopes_radial = (
        Ring(-0.5 * a * x, 2 * x * (bf + b), -2 * (bk * x + b * y)),
        Ring(-0.5 * a * y, 2 * y * (bf - b), -2 * (bk * y + b * x)),
    )
    zero = np.zeros_like(a)
    slopes_height = Ring(zero, -ak, v_x), Ring(zero, u_y, ak)

    hx, hy = h * dx, h * dy
    first = [i * hx + j * hy for i, j in zip(*slopes_radial, strict=True)]
    up_x, up_y = u_y * hy - ak * hx, v_x * hx + ak * hy

    dxx, dyy = dx * dx, dy * dy
    ds = 2 * (x * dx + y * dy)
    px, py = x * ddx, y * ddy
    dds = 2 * (dxx + dyy + px + py)
    df, ddf = 2 * (x * dx - y * dy), 2 * (dxx - dyy + px - py)
    dk, ddk = dx * y + x * dy, ddx * y + 2 * dx * dy + x * ddy
    dss = ds * ds
    db2, ddb = 2 * b_s * ds, b_ss * dss + b_s * dds
    da2, dda = 2 * a_s * ds, a_ss * dss + a_s * dds
    return Tips(
        Ring((0.5 * h) * (1 + c), h * b * f, (-2 * h) * b * k),
        Ring(z, -h * a * y, h * a * x),
        slopes_radial,
        slopes_height,
        Ring(*first),
        Ring(rate[0], up_x, up_y),
        Ring(
            (-0.25 * h) * (a_s * dss + a * dds),
            h * (ddb * f + db2 * df + b * ddf),
            (-2 * h) * (ddb * k + db2 * dk + b * ddk),
        ),
        Ring(
            acceleration[0], -h * (dda * y + da2 * dy + a * ddy), h * (dda * x + da2 * dx + a * ddx)
        ),
    )


def resultant(legs: Array) -> Triple:
    """Return the sum of the legs' numbers and their sum along e_i, x and y, shape (n,) each."""
    both = legs[1] + legs[2]
    return legs[0] + both, legs[0] - 0.5 * both, _HALF_ROOT_3 * (legs[1] - legs[2])

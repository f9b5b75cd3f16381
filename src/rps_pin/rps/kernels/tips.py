"""The tips of the legs, the spherical joints, as means and horizontal vectors.

A *ring* (mean, x, y) stands for three numbers, mean + e_i . (x, y), one for each leg, with e_i the
legs' radial directions. With C = cos(beta) and P the platform's centre, Eq. 1 and 4 put tip i in
its leg's plane at

    rho_i = e_i . B_i = h (1 + C)/2 + 2 e_i . P,     P = h B ((x^2 - y^2) / 2, -x y),
    z_i   = z + e_i . U,                             U = h A (-y, x),

two rings. Their derivatives are rings too. Slopes are by (h tilt_x, h tilt_y), without unit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rps_pin.numerics.elementary import Number
from rps_pin.rps.kernels.tilt_functions import TiltFunctions

Ring = tuple[Number, Number, Number]
#: A number of each leg: a triple, or the rows of an array.
Three = Sequence[Number] | NDArray[Any]
#: Of rho by h tilt_x and h tilt_y, then of z_i by them.
Slopes = tuple[Ring, Ring, Ring, Ring]

_HALF_ROOT_3 = math.sqrt(3.0) / 2.0


def at_legs(ring: Ring) -> Three:
    """Return the numbers of legs 1, 2, 3; arrays are the rows of one array."""
    mean, x, y = ring
    between, apart = mean - 0.5 * x, _HALF_ROOT_3 * y
    if not isinstance(x, np.ndarray):
        return mean + x, between + apart, between - apart
    legs: NDArray[Any] = np.empty((3, *between.shape), between.dtype)
    np.add(mean, x, out=legs[0])
    np.add(between, apart, out=legs[1])
    np.subtract(between, apart, out=legs[2])
    return legs


def resultant(legs: Three) -> Ring:
    """Return the sum of three numbers, and their sum along e_i: x and y."""
    both = legs[1] + legs[2]
    return legs[0] + both, legs[0] - 0.5 * both, _HALF_ROOT_3 * (legs[1] - legs[2])


def tips(z: Number, x: Number, y: Number, tilt: TiltFunctions, h: Number) -> tuple[Ring, Ring]:
    """Return the rings of rho and z_i, m. The platform's centre is half of rho's vector."""
    a, b, c = tilt[0], tilt[1], tilt[2]
    bh, ah = h * b, h * a
    return (
        (0.5 * h * (1.0 + c), bh * (x * x - y * y), -2.0 * bh * x * y),
        (z, -ah * y, ah * x),
    )


def tip_slopes(x: Number, y: Number, tilt: TiltFunctions) -> Slopes:
    """Return the slopes of the rings by h tilt_x and h tilt_y; by z they are 0 and 1."""
    a, b, a_s, b_s = tilt[0], tilt[1], tilt[4], tilt[5]
    xx, yy, xy = x * x, y * y, x * y
    bf, bk, ak = b_s * (xx - yy), 2.0 * b_s * xy, 2.0 * a_s * xy
    return (
        (-0.5 * a * x, 2.0 * x * (bf + b), -2.0 * (bk * x + b * y)),
        (-0.5 * a * y, 2.0 * y * (bf - b), -2.0 * (bk * y + b * x)),
        (0.0, -ak, 2.0 * a_s * xx + a),
        (0.0, -2.0 * a_s * yy - a, ak),
    )


def tip_rates(slopes: Slopes, dz: Number, hdx: Number, hdy: Number) -> tuple[Ring, Ring]:
    """Return the time derivatives of the rings from those of z, h tilt_x and h tilt_y, m/s."""
    (rx_m, rx_x, rx_y), (ry_m, ry_x, ry_y), (_, zx_x, zx_y), (_, zy_x, zy_y) = slopes
    return (
        (rx_m * hdx + ry_m * hdy, rx_x * hdx + ry_x * hdy, rx_y * hdx + ry_y * hdy),
        (dz, zx_x * hdx + zy_x * hdy, zx_y * hdx + zy_y * hdy),
    )


def tip_accelerations(
    tilt_motion: tuple[Number, Number, Number, Number, Number, Number],
    ddz: Number,
    tilt: TiltFunctions,
    h: Number,
) -> tuple[Ring, Ring]:
    """Return the second time derivatives of the rings, m/s^2.

    `tilt_motion` holds (x, y), (dx, dy) and (ddx, ddy).
    """
    x, y, dx, dy, ddx, ddy = tilt_motion
    a, b, a_s, b_s, a_ss, b_ss = tilt[0], tilt[1], tilt[4], tilt[5], tilt[7], tilt[8]
    dxx, dyy, px, py = dx * dx, dy * dy, x * ddx, y * ddy
    ds, dds = 2.0 * (x * dx + y * dy), 2.0 * (dxx + dyy + px + py)
    f, df, ddf = x * x - y * y, 2.0 * (x * dx - y * dy), 2.0 * (dxx - dyy + px - py)
    k, dk, ddk = x * y, dx * y + x * dy, ddx * y + 2.0 * dx * dy + x * ddy
    dss = ds * ds
    db2, ddb = 2.0 * b_s * ds, b_ss * dss + b_s * dds
    da2, dda = 2.0 * a_s * ds, a_ss * dss + a_s * dds
    return (
        (
            (-0.25 * h) * (a_s * dss + a * dds),
            h * (ddb * f + db2 * df + b * ddf),
            (-2.0 * h) * (ddb * k + db2 * dk + b * ddk),
        ),
        (ddz, -h * (dda * y + da2 * dy + a * ddy), h * (dda * x + da2 * dx + a * ddx)),
    )


def tip_slope_rates(x: Number, y: Number, dx: Number, dy: Number, tilt: TiltFunctions) -> Slopes:
    """Return the time derivatives of the slopes, 1/s."""
    a, b, a_s, b_s, a_ss, b_ss = tilt[0], tilt[1], tilt[4], tilt[5], tilt[7], tilt[8]
    xx, yy, xy = x * x, y * y, x * y
    ds, dk = 2.0 * (x * dx + y * dy), dx * y + x * dy
    f, df = xx - yy, 2.0 * (x * dx - y * dy)
    da, db, das, dbs = a_s * ds, b_s * ds, a_ss * ds, b_ss * ds
    dbf, bk, dbk = dbs * f + b_s * df, 2.0 * b_s * xy, 2.0 * (dbs * xy + b_s * dk)
    dak = 2.0 * (das * xy + a_s * dk)
    return (
        (
            -0.5 * (da * x + a * dx),
            2.0 * (dx * (b_s * f + b) + x * (dbf + db)),
            -2.0 * (dbk * x + bk * dx + db * y + b * dy),
        ),
        (
            -0.5 * (da * y + a * dy),
            2.0 * (dy * (b_s * f - b) + y * (dbf - db)),
            -2.0 * (dbk * y + bk * dy + db * x + b * dx),
        ),
        (0.0, -dak, 2.0 * das * xx + 4.0 * a_s * x * dx + da),
        (0.0, -2.0 * das * yy - 4.0 * a_s * y * dy - da, dak),
    )


def speed_form(slopes: Slopes) -> Ring:
    """Return the tips' squared speeds summed, as a quadratic form of the tilt's rate.

    (xx, xy, yy) of h tilt_x and h tilt_y; of z it is 3, apart from the tilt. The sum over the legs
    of a product of rings is 3 times that of their means and 3/2 that of their vectors.
    """
    (rx_m, rx_x, rx_y), (ry_m, ry_x, ry_y), (_, zx_x, zx_y), (_, zy_x, zy_y) = slopes
    return (
        3.0 * rx_m * rx_m + 1.5 * (rx_x * rx_x + rx_y * rx_y + zx_x * zx_x + zx_y * zx_y),
        3.0 * rx_m * ry_m + 1.5 * (rx_x * ry_x + rx_y * ry_y + zx_x * zy_x + zx_y * zy_y),
        3.0 * ry_m * ry_m + 1.5 * (ry_x * ry_x + ry_y * ry_y + zy_x * zy_x + zy_y * zy_y),
    )

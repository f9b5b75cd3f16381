"""The leg equations of the 3-RPS (Eq. 8): which leg angles close the robot for given lengths.

A leg of length d_i at angle phi_i carries its tip ``w_i = d_i cos(phi_i)`` inwards and
``z_i = d_i sin(phi_i)`` up: the tip stands at ``rho_i = g - w_i`` along e_i. The platform keeps its
tips sqrt(3) h apart. With the legs' planes 120 degrees apart this is Eq. 8, for the pairs (i, j) =
(1, 2), (2, 3), (3, 1),

    f_ij = |B_i - B_j|^2 - 3 h^2 = rho_i^2 + rho_i rho_j + rho_j^2 + (z_i - z_j)^2 - 3 h^2
         = m_i m_j - 2 z_i z_j + d_i^2 + d_j^2 - 6 g^2 - 3 h^2,     m_i = 3 g - w_i,
    df_ij/dphi_i = m_j z_i - 2 z_j w_i.

Each equation has two of the three angles in it, so that the Jacobian is

    [ a1 a2  0 ]
    [  0 b2 b3 ]     determinant  a1 b2 c3 + a2 b3 c1.
    [ c1  0 c3 ]

Solutions come in pairs mirrored in the base plane (all phi to -phi). Those whose platform is turned
about an axis in the base plane have a pose (see `rps_pin.rps.kinematics.pose`); in the robot's
other operation mode the platform is turned by half a turn about any axis.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError

Triple = tuple[Array, Array, Array]

#: The pairs of legs in the order of the three equations.
PAIRS = ((0, 1), (1, 2), (2, 0))

#: Triples worked on at a time: few enough for their arrays to stay in the processor's cache.
_BLOCK = 8192
#: Tip distances can be right to this part of g + h, or of the longest leg: 1e-12 m for some metres.
_ACCURACY = 2.5e-13
#: Share of the tolerance that Newton's method goes for.
WITHIN = 1e-2
#: Half a step, rad, after which another one would only move rounding errors.
_LAST_STEP = 1e-8
#: Share of a block below which those that have not converged are worked on apart.
_FEW = 0.25
_SQRT3 = math.sqrt(3.0)
_TINY = 1e-300


class AngleSolution(NamedTuple):
    """Leg angles that Newton's method found, one triple for each triple of lengths."""

    angle: Array
    """The paper's phi, shape (..., 3), rad, in (-pi, pi]; the last iterate where not converged."""
    residual: Array
    """Largest error of a distance between two tips, shape (...), m."""
    converged: Bools
    """Whether the residual is within the tolerance, shape (...)."""
    determinant: Array
    """Of the Jacobian, shape (...), without unit: see `determinant`. Zero: a singularity."""


class Placement(NamedTuple):
    """Where leg angles put the platform; base axes."""

    position: Array
    """Of the centre, shape (..., 3), m."""
    rotation: Array
    """From platform axes to base axes, shape (..., 3, 3)."""
    pose: Array
    """``(z, tilt_x, tilt_y)``, shape (..., 3), m and rad; only where `in_plane_mode`, else NaN."""
    in_plane_mode: Bools
    """Whether the platform is turned about an axis in the base plane, shape (...)."""


def solve_angles(
    length: ArrayLike,
    start: ArrayLike,
    base_radius: float,
    platform_radius: float,
    *,
    tolerance: float = 1e-12,
    iterations: int = 25,
) -> AngleSolution:
    """Solve Eq. 8 for the leg angles by Newton's method, each triple from its own start.

    Plain Newton: it finds *a* solution near the start, usually the one that continues it; what
    guarantees that is `rps_pin.rps.kinematics.forward_kinematics`. A step turns leg i by ``2
    atan(t_i)``, where 2 t_i is Newton's step: the same to second order, so convergence stays
    quadratic, never more than a quarter turn, and without trigonometric functions. A triple that
    has converged is left alone.

    Parameters
    ----------
    length
        Leg lengths d, shape (..., 3), m.
    start
        Leg angles to start from, rad; a number, or a shape that broadcasts with that of `length`.
    base_radius, platform_radius
        The paper's g and h, m.
    tolerance
        Largest error of a tip distance that counts as solved, m.
    iterations
        Largest number of Newton steps.

    Raises
    ------
    InputError
        If an argument is not a finite number, a length, radius or the tolerance is not positive,
        or shapes do not go together.
    """
    lengths = checked_lengths(length)
    g, h = checked_radii(base_radius, platform_radius)
    steps = _checked_steps(tolerance, iterations)
    lengths, cosine, sine = _with_start(lengths, start)
    shape = lengths.shape
    flat, cosine, sine = lengths.reshape(-1, 3), cosine.reshape(-1, 3), sine.reshape(-1, 3)
    angle = np.empty_like(flat)
    residual, det = np.empty(len(flat)), np.empty(len(flat))
    for begin in range(0, len(flat), _BLOCK):
        part = slice(begin, begin + _BLOCK)
        d = np.ascontiguousarray(flat[part].T)
        w, z = d * cosine[part].T, d * sine[part].T
        newton(d, w, z, g, h, tolerance, steps)
        for leg in range(3):
            np.arctan2(z[leg], w[leg], out=angle[part, leg])
        residual[part] = largest(distance_errors(w, z, g, h))
        det[part] = cyclic_determinant(slopes(w, z, g)) / determinant_scale(d, h)
    batch = shape[:-1]
    return AngleSolution(
        angle.reshape(shape),
        residual.reshape(batch),
        np.asarray(residual <= tolerance).reshape(batch),
        det.reshape(batch),
    )


def residuals(
    length: ArrayLike, angle: ArrayLike, base_radius: float, platform_radius: float
) -> Array:
    """Return by how much the tips' distances differ from sqrt(3) h, shape (..., 3), m: Eq. 8.

    In the order of the equations, pairs (1, 2), (2, 3) and (3, 1).

    Parameters
    ----------
    length, angle
        Leg lengths (m) and angles (rad), shape (..., 3).
    base_radius, platform_radius
        The paper's g and h, m.

    Raises
    ------
    InputError
        As `solve_angles`.
    """
    g, h = checked_radii(base_radius, platform_radius)
    w, z, _ = _tips(length, angle)
    return np.stack(distance_errors(w, z, g, h), axis=-1)


def jacobian(
    length: ArrayLike, angle: ArrayLike, base_radius: float, platform_radius: float
) -> Array:
    """Return the derivative of the residuals by the angles, shape (..., 3, 3), m/rad.

    It is df_ij/dphi_k over 2 sqrt(3) h, which is the derivative of the distances where they are
    right. Arguments and errors as `residuals`.
    """
    g, h = checked_radii(base_radius, platform_radius)
    w, z, _ = _tips(length, angle)
    matrix = np.zeros((*w.shape[1:], 3, 3))
    for row, ((i, j), (by_i, by_j)) in enumerate(zip(PAIRS, slopes(w, z, g), strict=True)):
        matrix[..., row, i] = by_i / (2 * _SQRT3 * h)
        matrix[..., row, j] = by_j / (2 * _SQRT3 * h)
    return matrix


def determinant(
    length: ArrayLike, angle: ArrayLike, base_radius: float, platform_radius: float
) -> Array:
    """Return the determinant of the Jacobian over d_1 d_2 d_3, shape (...), without unit.

    The entries are then the cosines between the direction in which a leg's turning moves its tip
    and the side of the platform that ends there. Zero: the lengths do not hold the platform (a
    parallel, or type II, singularity). Arguments and errors as `residuals`.
    """
    g, h = checked_radii(base_radius, platform_radius)
    w, z, d = _tips(length, angle)
    return np.asarray(cyclic_determinant(slopes(w, z, g)) / determinant_scale(d, h))


def placement_from_angles(
    length: ArrayLike, angle: ArrayLike, base_radius: float, platform_radius: float
) -> Placement:
    """Return where leg lengths and angles that close the robot put its platform.

    The centre is the tips' mean; the platform's axes follow from u = (B_1 - P)/h and
    v = (B_2 - B_3)/(sqrt(3) h). Always u_y = v_x (the legs' planes); u_x + v_y is 1 + cos(beta)
    if the platform is turned by beta about an axis in the base plane, and negative in the other
    mode. Where it is zero, to rounding, the platform is in both modes.

    Parameters
    ----------
    length, angle
        Leg lengths (m) and angles (rad) that satisfy Eq. 8, shape (..., 3).
    base_radius, platform_radius
        The paper's g and h, m.

    Raises
    ------
    InputError
        As `solve_angles`.
    """
    g, h = checked_radii(base_radius, platform_radius)
    w, z, _ = _tips(length, angle)
    rho_1, rho_2, rho_3 = g - w[0], g - w[1], g - w[2]
    outwards, across = (rho_2 + rho_3) / 2, (rho_2 - rho_3) / 2

    position = np.empty((*w.shape[1:], 3))
    position[..., 0] = (rho_1 - outwards) / 3
    position[..., 1] = across / _SQRT3
    position[..., 2] = (z[0] + z[1] + z[2]) / 3

    rotation = np.empty((*w.shape[1:], 3, 3))
    u, v, normal = rotation[..., 0], rotation[..., 1], rotation[..., 2]
    u[..., 0] = (rho_1 - position[..., 0]) / h
    u[..., 1] = -position[..., 1] / h
    u[..., 2] = (z[0] - position[..., 2]) / h
    v[..., 0] = -across / (_SQRT3 * h)
    v[..., 1] = outwards / h
    v[..., 2] = (z[1] - z[2]) / (_SQRT3 * h)
    normal[..., 0] = u[..., 1] * v[..., 2] - u[..., 2] * v[..., 1]
    normal[..., 1] = u[..., 2] * v[..., 0] - u[..., 0] * v[..., 2]
    normal[..., 2] = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]

    in_plane = u[..., 0] + v[..., 1] >= -_ONE_MODE
    pose = np.empty_like(position)
    pose[..., 0] = position[..., 2]
    pose[..., 1], pose[..., 2] = _tilt(u, v)
    if not in_plane.all():
        pose[~in_plane] = np.nan
    return Placement(position, rotation, pose, np.asarray(in_plane))


# Checks -------------------------------------------------------------------------------------------


def checked_lengths(value: ArrayLike, name: str = "length") -> Array:
    """Return leg lengths as a finite, positive float array of shape (..., 3).

    Raises
    ------
    InputError
        If they are not; says which.
    """
    array = _checked_triples(value, name)
    if (array <= 0).any():
        where = tuple(int(i) for i in np.argwhere(array <= 0)[0])
        raise InputError(f"{name} of leg {where[-1] + 1} is {array[where]:.6g} m; it must be > 0")
    return array


def checked_radii(base_radius: float, platform_radius: float) -> tuple[float, float]:
    """Return g and h as positive, finite floats.

    Raises
    ------
    InputError
        If they are not.
    """
    return (
        checked_positive(base_radius, "base_radius"),
        checked_positive(platform_radius, "platform_radius"),
    )


def checked_positive(value: float, name: str) -> float:
    """Return a positive, finite float.

    Raises
    ------
    InputError
        If it is not.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a number") from None
    if not 0 < number < math.inf:
        raise InputError(f"{name} = {number:.6g}; it must be positive and finite")
    return number


def _checked_triples(value: ArrayLike, name: str) -> Array:
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be numbers of shape (..., 3)") from None
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(f"{name} has shape {array.shape}; it must be (..., 3): one a leg")
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{name} is not finite: entry {where} is {array[where]}")
    return array


def _with_start(lengths: Array, start: ArrayLike) -> Triple:
    """Return lengths, and cosines and sines of the starting angles, in one shape (..., 3)."""
    try:
        angles = np.asarray(start, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("start must be numbers") from None
    if not np.isfinite(angles).all():
        raise InputError("start must be finite")
    try:
        d, cosine, sine = np.broadcast_arrays(lengths, np.cos(angles), np.sin(angles))
    except ValueError:
        raise InputError(
            f"length and start have shapes {lengths.shape} and {angles.shape}, "
            "which do not go together"
        ) from None
    return d, cosine, sine


def _checked_steps(tolerance: float, iterations: int) -> int:
    checked_positive(tolerance, "tolerance")
    if isinstance(iterations, bool) or not isinstance(iterations, (int, np.integer)):
        raise InputError("iterations must be a whole number")
    if iterations < 1:
        raise InputError(f"iterations = {iterations}; it must be at least 1")
    return int(iterations)


# The equations, for arrays (3 legs, ...) ----------------------------------------------------------


def newton(
    d: Array, w: Array, z: Array, g: float, h: float, tolerance: ArrayLike, iterations: int
) -> None:
    """Turn the tips (w, z), shape (3, n), by Newton's steps until Eq. 8 holds; in place.

    The tolerance, m, is a number or one for each triple.

    A triple is done when its error is far within the tolerance, or when a step was so small that
    its square, which is what is left, is lost in rounding.
    """
    tolerance = np.broadcast_to(tolerance, d.shape[1:])
    small = 2 * _SQRT3 * h * tolerance * WITHIN
    constant = constants(d, g, h)
    wanting = np.ones(d.shape[1], dtype=bool)
    for step in range(iterations):
        f12, f23, f31 = left_sides(w, z, g, constant)
        wanting &= largest((f12, f23, f31)) > small
        left = np.count_nonzero(wanting)
        if left == 0:
            return
        if left < _FEW * len(wanting):
            few = np.flatnonzero(wanting)
            w_few, z_few = w[:, few], z[:, few]
            newton(d[:, few], w_few, z_few, g, h, tolerance[few], iterations - step)
            w[:, few], z[:, few] = w_few, z_few
            return
        (a1, a2), (b2, b3), (c3, c1) = by_angle = slopes(w, z, g)
        half_inverse = wanting * (-0.5) / _nonzero(cyclic_determinant(by_angle))
        # 2 t = -J^-1 f, by the adjugate of the cyclic matrix.
        t1 = (b2 * (c3 * f12) + a2 * (b3 * f31 - c3 * f23)) * half_inverse
        t2 = (c3 * (a1 * f23) + b3 * (c1 * f12 - a1 * f31)) * half_inverse
        t3 = (a1 * (b2 * f31) + c1 * (a2 * f23 - b2 * f12)) * half_inverse
        for leg, t in enumerate((t1, t2, t3)):
            turn(w[leg], z[leg], np.minimum(np.maximum(t, -1.0), 1.0))
        wanting &= largest((t1, t2, t3)) > _LAST_STEP


def closing_tolerance(d: Array, g: float, h: float) -> Array:
    """Return the error of a tip distance with which lengths (3, n) count as closed, (n,), m."""
    return np.asarray(_ACCURACY * np.maximum(g + h, d.max(axis=0, initial=0.0)))


def turn(w: Array, z: Array, t: Array) -> None:
    """Turn the vectors (w, z) by 2 atan(t), in place."""
    sine = 2 * t / (1 + t * t)
    across = sine * (z + t * w)  # 1 - cosine = t sine
    z += sine * (w - t * z)
    w -= across


def constants(d: Array, g: float, h: float) -> Triple:
    """Return what of f_12, f_23 and f_31 does not change with the angles, m^2."""
    square = d * d
    rest = 6 * g * g + 3 * h * h
    first, second, third = (square[i] + square[j] - rest for i, j in PAIRS)
    return first, second, third


def left_sides(w: Array, z: Array, g: float, constant: Triple) -> Triple:
    """Return f_12, f_23, f_31, m^2."""
    m, twice = 3 * g - w, 2 * z
    f12, f23, f31 = (
        m[i] * m[j] - twice[i] * z[j] + k for (i, j), k in zip(PAIRS, constant, strict=True)
    )
    return f12, f23, f31


def slopes(w: Array, z: Array, g: float) -> tuple[tuple[Array, Array], ...]:
    """Return (df_ij/dphi_i, df_ij/dphi_j) for each pair, m^2: (a1, a2), (b2, b3), (c3, c1)."""
    m, twice = 3 * g - w, 2 * w
    return tuple((m[j] * z[i] - z[j] * twice[i], m[i] * z[j] - z[i] * twice[j]) for i, j in PAIRS)


def cyclic_determinant(by_angle: tuple[tuple[Array, Array], ...]) -> Array:
    """Return the determinant of the three equations' slopes, m^6."""
    (a1, a2), (b2, b3), (c3, c1) = by_angle
    product: Array = a1 * b2 * c3 + a2 * b3 * c1
    return product


def determinant_scale(d: Array, h: float) -> Array:
    """Return what makes `cyclic_determinant` that of cosines, m^6."""
    scale: Array = (2 * _SQRT3 * h) ** 3 * d[0] * d[1] * d[2]
    return scale


def distance_errors(w: Array, z: Array, g: float, h: float) -> Triple:
    """Return |B_i - B_j| - sqrt(3) h for each pair, m, without the cancellation of Eq. 8."""
    rho = g - w
    first, second, third = (
        np.sqrt(rho[i] * rho[i] + rho[j] * (rho[i] + rho[j]) + np.square(z[i] - z[j])) - _SQRT3 * h
        for i, j in PAIRS
    )
    return first, second, third


def largest(values: Triple) -> Array:
    """Return the largest absolute value of the three."""
    return np.maximum(np.maximum(np.abs(values[0]), np.abs(values[1])), np.abs(values[2]))


def _nonzero(values: Array) -> Array:
    return np.where(np.abs(values) < _TINY, _TINY, values)


def _tips(length: ArrayLike, angle: ArrayLike) -> tuple[Array, Array, Array]:
    """Return w, z and d, shape (3 legs, ...), m."""
    d, phi = checked_lengths(length), _checked_triples(angle, "angle")
    try:
        d, phi = np.broadcast_arrays(d, phi)
    except ValueError:
        raise InputError(
            f"length and angle have shapes {d.shape} and {phi.shape}, which do not go together"
        ) from None
    d, phi = np.moveaxis(d, -1, 0), np.moveaxis(phi, -1, 0)
    return d * np.cos(phi), d * np.sin(phi), d


# The tilt -----------------------------------------------------------------------------------------

#: u_x + v_y from which the platform counts as turned about an axis in the base plane: rounding.
_ONE_MODE = 1e-12


def _tilt(u: Array, v: Array) -> tuple[Array, Array]:
    """Return the rotation vector (tilt_x, tilt_y) of axes u and v turned about the base plane.

    With the quaternion (q_x, q_y, 0, q_w): v_z = 2 q_x q_w, u_z = -2 q_y q_w, u_x = 1 - 2 q_y^2,
    v_y = 1 - 2 q_x^2, u_y = 2 q_x q_y, and sin(beta/2) is the length of (q_x, q_y).
    """
    doubled = np.clip(u[..., 0] + v[..., 1], 0.0, 2.0)  # 2 q_w^2: rounding may leave the interval
    q_w = np.sqrt(doubled / 2)
    # Up to a quarter turn q_w divides well; beyond, the larger of q_x and q_y does.
    small = doubled >= 1
    divisor = np.where(small, 2 * q_w, 1.0)
    x_leads = v[..., 1] <= u[..., 0]
    lead = np.sqrt(np.maximum(1 - np.minimum(u[..., 0], v[..., 1]), 0.0) / 2)
    other = u[..., 1] / np.where(small, 1.0, 2 * lead)
    sign = np.copysign(1.0, np.where(x_leads, v[..., 2], -u[..., 2]))
    q_x = np.where(small, v[..., 2] / divisor, sign * np.where(x_leads, lead, other))
    q_y = np.where(small, -u[..., 2] / divisor, sign * np.where(x_leads, other, lead))
    half_sine = np.hypot(q_x, q_y)
    # Near half a turn q_w is the root of a difference: the sine 2 |(q_x, q_y)| q_w has it sharp.
    sine = np.hypot(u[..., 2], v[..., 2])
    q_w = np.where(small, q_w, sine / np.where(small, 1.0, 2 * half_sine))
    half = np.arctan2(half_sine, q_w)
    # beta / sin(beta/2), which tends to 2.
    factor = np.where(half_sine < 1e-9, 2.0, 2 * half / np.where(half_sine < 1e-9, 1.0, half_sine))
    return q_x * factor, q_y * factor

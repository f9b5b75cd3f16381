"""Leg equations of the 3-RPS (Eq. 8): the leg angles that close the robot for given lengths.

The equations are in `rps_pin.rps.kernels.leg_equations`: a leg of length d_i at angle phi_i carries
its tip w_i = d_i cos(phi_i) inwards and z_i = d_i sin(phi_i) up, and the platform keeps its tips
sqrt(3) h apart. Solutions come in pairs mirrored in the base plane (all phi to -phi). Those whose
platform is turned about an axis in the base plane have a pose (see `rps_pin.rps.kinematics.pose`);
in the robot's other operation mode the platform is turned by half a turn about any axis.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError
from rps_pin.rps.kernels import leg_equations as eq
from rps_pin.rps.kernels.placement import platform_axes, tilt_of_axes
from rps_pin.rps.kinematics.pose import stacked
from rps_pin.validation import one_shape, positive_number, real_array, whole_number

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
_ROOT_3 = math.sqrt(3.0)
_TINY = 1e-300
#: u_x + v_y from which the platform counts as turned about an axis in the base plane: rounding.
ONE_MODE = 1e-12


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
    """Placement of the platform for given leg angles; base axes."""

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
    g, h = checked_radii(base_radius, platform_radius)
    positive_number(tolerance, "tolerance", "m")
    whole_number(iterations, "iterations")
    first = real_array(start, "start")
    lengths, _ = one_shape(length=checked_lengths(length), start=first)
    shape = lengths.shape
    flat = lengths.reshape(-1, 3)
    # Of the start as it is given: it may be one number for all triples.
    cosine, sine = (np.broadcast_to(f(first), shape).reshape(-1, 3) for f in (np.cos, np.sin))
    angle = np.empty_like(flat)
    residual, det = np.empty(len(flat)), np.empty(len(flat))
    for begin in range(0, len(flat), _BLOCK):
        part = slice(begin, begin + _BLOCK)
        d = np.ascontiguousarray(flat[part].T)
        w, z = d * cosine[part].T, d * sine[part].T
        newton(d, w, z, g, h, tolerance, iterations)
        angle[part] = np.arctan2(z, w).T
        residual[part] = eq.largest(eq.distance_errors(w, z, g, h))
        det[part] = cosines_determinant(d, w, z, g, h)
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
    return stacked(*eq.distance_errors(w, z, g, h))


def jacobian(
    length: ArrayLike, angle: ArrayLike, base_radius: float, platform_radius: float
) -> Array:
    """Return the derivative of the residuals by the angles, shape (..., 3, 3), m/rad.

    It is df_ij/dphi_k over 2 sqrt(3) h, which is the derivative of the distances where they are
    right. Arguments and errors as `residuals`.
    """
    g, h = checked_radii(base_radius, platform_radius)
    w, z, _ = _tips(length, angle)
    a1, a2, b2, b3, c3, c1 = eq.slopes(w, z, g)
    rows = stacked(a1, a2, 0.0, 0.0, b2, b3, c1, 0.0, c3).reshape(*w.shape[1:], 3, 3)
    return rows / (2 * _ROOT_3 * h)


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
    return np.asarray(cosines_determinant(d, w, z, g, h))


def placement_from_angles(
    length: ArrayLike, angle: ArrayLike, base_radius: float, platform_radius: float
) -> Placement:
    """Return the platform's placement for leg lengths and angles that close the robot.

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
    centre, u, v = platform_axes(g - w, z, h)
    normal = np.cross(stacked(*u), stacked(*v))
    rotation = np.stack([stacked(*u), stacked(*v), normal], axis=-1)
    in_plane = np.asarray(u[0] + v[1] >= -ONE_MODE)
    tilt = tilt_of_axes(u[0], u[1], u[2], v[1], v[2])
    pose = np.where(in_plane[..., None], stacked(centre[2], *tilt), np.nan)
    return Placement(stacked(*centre), rotation, pose, in_plane)


# Checks -------------------------------------------------------------------------------------------


def checked_lengths(value: ArrayLike, name: str = "length") -> Array:
    """Return leg lengths as finite, positive numbers of shape (..., 3).

    Raises
    ------
    InputError
        If they are not; says which.
    """
    array = real_array(value, name, (3,), "one a leg")
    if (array <= 0).any():
        where = tuple(int(i) for i in np.argwhere(array <= 0)[0])
        raise InputError(f"{name} of leg {where[-1] + 1} is {array[where]:.6g} m; it must be > 0")
    return array


def checked_radii(base_radius: float, platform_radius: float) -> tuple[float, float]:
    """Return g and h as positive, finite floats."""
    return (
        positive_number(base_radius, "base_radius", "metres"),
        positive_number(platform_radius, "platform_radius", "metres"),
    )


def _tips(length: ArrayLike, angle: ArrayLike) -> tuple[Array, Array, Array]:
    """Return w, z and d, shape (3 legs, ...), m."""
    angles = real_array(angle, "angle", (3,), "one a leg")
    d, phi = one_shape(length=checked_lengths(length), angle=angles)
    d, phi = np.moveaxis(d, -1, 0), np.moveaxis(phi, -1, 0)
    return d * np.cos(phi), d * np.sin(phi), d


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
    small = 2 * _ROOT_3 * h * tolerance * WITHIN
    constant = eq.constants(d, g, h)
    wanting = np.ones(d.shape[1], dtype=bool)
    for step in range(iterations):
        f = eq.residuals(w, z, g, constant)
        wanting &= eq.largest(f) > small
        left = np.count_nonzero(wanting)
        if left == 0:
            return
        if left < _FEW * len(wanting):
            few = np.flatnonzero(wanting)
            w_few, z_few = w[:, few], z[:, few]
            newton(d[:, few], w_few, z_few, g, h, tolerance[few], iterations - step)
            w[:, few], z[:, few] = w_few, z_few
            return
        by_angle = eq.slopes(w, z, g)
        det = eq.determinant(by_angle)
        half_inverse = wanting * (-0.5) / np.where(np.abs(det) < _TINY, _TINY, det)
        t = eq.matrix_times(eq.adjugate(by_angle), f, half_inverse)
        for leg in range(3):
            half_step = np.minimum(np.maximum(t[leg], -1.0), 1.0)
            w[leg], z[leg] = eq.turned(w[leg], z[leg], half_step)
        wanting &= eq.largest(t) > _LAST_STEP


def closing_tolerance(d: Array, g: float, h: float) -> Array:
    """Return the error of a tip distance with which lengths (3, n) count as closed, (n,), m."""
    return np.asarray(_ACCURACY * np.maximum(g + h, d.max(axis=0, initial=0.0)))


def cosines_determinant(d: Array, w: Array, z: Array, g: float, h: float) -> Array:
    """Return the determinant without unit (see `determinant`), of tips (3, ...)."""
    det: Array = eq.determinant(eq.slopes(w, z, g)) / eq.determinant_scale(d, h)
    return det

"""Singular poses of the 3-RPS: dimensionless distances to them, and the surfaces they form.

The legs and the platform move together by A pose' = B d', with row i of A the derivative of
|B_i - A_i|^2 / 2 with respect to the pose and B = diag(d_1, d_2, d_3); K = B^-1 A is d(length) /
d(pose). Three things can fail:

- **Type I**, B loses rank: a leg has no length. Turning it does not move its tip, so the platform
  loses a freedom. Measure: the shortest leg over h, that is the speed of a leg's tip over
  h |phi'| when the leg only turns; h is the platform's radius.
- **Type II**, K loses rank: the platform moves while every actuator stands still, and no actuator
  force resists it. Measure: the least ratio of leg speed to platform speed over all motions of the
  platform. The platform's speed is the root mean square speed of its three spherical joints
  (h carries its angular velocity over into m/s), the legs' the root mean square of d'. No leg is
  faster than its tip, so that it is a number between 0 and 1.
- **Constraint**, the loops' Jacobian J loses rank: the legs' planes no longer forbid torsion, and
  the robot's two operation modes meet. Unit forces across the three legs' planes have no resultant,
  only a couple, of 3 h cos(beta/2): sum_i B_i x t_i = 3 h cos(beta/2) n, n a unit vector. Where it
  vanishes, at beta = pi and nowhere else, they resist nothing. Measure: cos(beta/2), signed.

The relations between the determinants, with beta the tilt and K in (z, tilt_x, tilt_y):

    |det J_p|            = d_1 d_2 d_3 (3 sqrt(3)/4) h |beta cot(beta/2) det K|,
    |det df/dphi| (Eq. 8) = 8 |det J_p|.

(J_p has rows in m and platform columns in base axes about its centre. Follow B_i' = (tip
velocities) through the wrenches along the legs and across their planes for the first, and project
the tips' velocities on the changes of the triangle's sides for the second: the triangle's inertia
gives 27/2 h^3, its sides 108 h^3.) Below half a turn all three vanish together: that is type II. At
beta = pi, det J_p and Eq. 8's Jacobian vanish with the constraint's measure and det K need not;
and these two also vanish with a leg's length, type I.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.errors import InputError
from rps_pin.rps.kinematics.legs import RADIAL, cone_angles, within_limits
from rps_pin.rps.kinematics.pose import checked_motion, checked_pose, rotation
from rps_pin.rps.kinematics.rates import (
    Errors,
    LegJacobians,
    TipJacobians,
    check_errors_option,
    checked_legs,
    jacobian_rates_of_legs,
    masked_leg_jacobians,
    refuse_vanishing,
    tip_jacobian_rates,
    tip_jacobians,
)
from rps_pin.rps.parameters import RPSParameters

_MOST_GRID_POINTS = 20_000_000


class SingularityMeasures(NamedTuple):
    """How far poses are from each kind of singularity, shape (...) each; all dimensionless."""

    type_i: Array
    """Shortest leg over h: tip speed per h |phi'| of a leg that turns; 0 at a type I."""
    type_ii: Array
    """Least rms leg speed per rms speed of the platform's spherical joints, 0 to 1; 0 at a
    type II singularity, where the platform moves and no leg does."""
    constraint: Array
    """cos(beta/2), the couple of unit forces across the legs over 3 h; changes sign at half a
    turn, where the platform is free to twist."""
    determinant: Array
    """Signed and smooth: product of the three gains (leg speed per platform speed, as in `type_ii`)
    with the sign of det K, -1 to 1; changes sign where a path crosses a type II singularity."""

    @property
    def signed_type_ii(self) -> Array:
        """`type_ii` with the sign of `determinant`."""
        return np.copysign(self.type_ii, self.determinant)


class MeasureRates(NamedTuple):
    """Signed measures of poses on a path, and their time derivatives."""

    value: Array
    """Signed type II, constraint, and d_1/h, d_2/h, d_3/h, shape (..., 5)."""
    rate: Array
    """Their time derivatives, shape (..., 5), 1/s."""


class SingularSurface(NamedTuple):
    """The type II singular surface inside a box of poses, as a mesh of triangles."""

    vertices: Array
    """Poses (z, tilt_x, tilt_y) on the surface, shape (n, 3), m and rad."""
    triangles: Indices
    """Three vertices each, shape (m, 3)."""
    measure: Array
    """What is left of `SingularityMeasures.determinant` at the vertices, shape (n,)."""
    reachable: Bools
    """Whether a vertex keeps the robot's limits, shape (n,)."""


# Measures -----------------------------------------------------------------------------------------


def singularity_measures(
    parameters: RPSParameters, pose: ArrayLike, *, errors: Errors = "raise"
) -> SingularityMeasures:
    """Return how far poses are from type I, type II and constraint singularities.

    Parameters
    ----------
    pose
        Shape (..., 3), tilted by less than a whole turn.
    errors
        Where a leg has no length, its direction is not determined and neither is type II:
        ``"raise"`` refuses such a pose, ``"mask"`` answers 0 for its `type_ii` and `determinant`.

    Raises
    ------
    InputError
        If the pose has the wrong shape, is not finite, or is tilted by a whole turn or more (there
        the coordinates fail, not the robot).
    UnreachableError
        If a leg has no length.
    """
    check_errors_option(errors)
    x = checked_tilt(pose)
    tip = tip_jacobians(parameters, x)
    legs, vanishing = masked_leg_jacobians(parameters, x)
    if errors == "raise":
        refuse_vanishing(legs.length, vanishing)
    regular = ~vanishing.any(axis=-1)
    gains = np.linalg.svd(_gain_matrix(tip, legs)[0], compute_uv=False)
    return SingularityMeasures(
        legs.length.min(axis=-1) / parameters.platform_radius,
        np.where(regular, gains[..., 2], 0.0),
        np.cos(np.hypot(x[..., 1], x[..., 2]) / 2),
        np.where(regular, _determinant(tip, legs), 0.0),
    )


def measure_rates(parameters: RPSParameters, pose: ArrayLike, rate: ArrayLike) -> MeasureRates:
    """Return the signed measures and their exact time derivatives along a motion.

    With the gains' matrix M = K L^-T / sqrt(3), L L' = Q and Q the mean of the tips' squared speed
    as a quadratic form of pose', the least gain sigma with M v = sigma u has, for x = L^-T v,

        sigma' = u' K' x / sqrt(3) - sigma x' Q' x / 2.

    Where two gains are equal it is the derivative of one of them. A leg without length has 0 for
    its measure's and for type II's value and rate.

    Parameters
    ----------
    pose, rate
        Pose and its time derivative, shape (..., 3) each.

    Raises
    ------
    InputError
        As `singularity_measures`.
    """
    x, dx, _ = checked_motion(pose, rate, np.zeros(3))
    checked_tilt(x)
    h = parameters.platform_radius
    tip = tip_jacobians(parameters, x)
    legs, vanishing = masked_leg_jacobians(parameters, x)
    change = jacobian_rates_of_legs(parameters, x, dx, legs)
    sigma, dsigma = _least_gain(tip, legs, change.length_jacobian, parameters, x, dx)
    regular = ~vanishing.any(axis=-1)
    beta = np.hypot(x[..., 1], x[..., 2])
    # d/dt cos(beta/2) = -sin(beta/2) / (2 beta) w . w'
    couple_rate = -np.sinc(beta / (2 * np.pi)) / 4 * (x[..., 1:] * dx[..., 1:]).sum(axis=-1)
    speed = np.einsum("...ij,...j->...i", legs.length_jacobian, dx)
    return MeasureRates(
        np.concatenate(
            [
                np.where(regular, sigma, 0.0)[..., None],
                np.cos(beta / 2)[..., None],
                np.where(vanishing, 0.0, legs.length) / h,
            ],
            axis=-1,
        ),
        np.concatenate(
            [
                np.where(regular, dsigma, 0.0)[..., None],
                couple_rate[..., None],
                np.where(vanishing, 0.0, speed) / h,
            ],
            axis=-1,
        ),
    )


def passive_distance(parameters: RPSParameters, pose: ArrayLike) -> Array:
    """Return 1 / cond(J_p), J_p the loops' Jacobian of the passive joints, shape (...).

    The inverse of ``robot.mechanism.condition`` for whole batches: 0 at a singularity of any of the
    three kinds, 1 at best; angles are made lengths by h. It is the relative distance of J_p to the
    nearest singular matrix.

    Parameters
    ----------
    pose
        Shape (..., 3).

    Raises
    ------
    InputError
        If the pose has the wrong shape or is not finite.
    """
    x = checked_pose(pose)
    h = parameters.platform_radius
    legs, _ = masked_leg_jacobians(parameters, x)
    arm = RADIAL @ np.swapaxes(rotation(x), -1, -2)  # from the centre to each tip, over h
    upright = np.array([0.0, 0.0, 1.0])
    # A leg that turns moves its tip by d n: n = sin(phi) e_i + cos(phi) z.
    n = np.sin(legs.angle)[..., None] * RADIAL + np.cos(legs.angle)[..., None] * upright
    J = np.zeros((*x.shape[:-1], 9, 9))
    for i in range(3):
        rows = slice(3 * i, 3 * i + 3)
        J[..., rows, 0:3] = np.eye(3)
        J[..., rows, 3:6] = -_skew(arm[..., i, :])
        J[..., rows, 6 + i] = -legs.length[..., i, None] / h * n[..., i, :]
    values = np.linalg.svd(J, compute_uv=False)
    return np.asarray(values[..., -1] / values[..., 0])


def eq8_jacobian(parameters: RPSParameters, length: ArrayLike, angle: ArrayLike) -> Array:
    """Return the direct kinematics' Jacobian df/dphi of Eq. 8, shape (..., 3, 3), m^2.

    Its determinant is, in size, 8 times that of J_p (see the module's text): it vanishes at type II
    and constraint singularities, and with a leg's length.

    Parameters
    ----------
    length, angle
        The paper's d (m) and phi (rad), shape (..., 3) each.

    Raises
    ------
    InputError
        If they are not finite numbers of shapes (..., 3) that go together.
    """
    d, phi = np.broadcast_arrays(checked_legs(length, "length"), checked_legs(angle, "angle"))
    cosine, sine = np.cos(phi), np.sin(phi)
    J = np.zeros((*d.shape[:-1], 3, 3))
    for row, (i, j) in enumerate([(0, 1), (1, 2), (2, 0)]):
        for a, b in ((i, j), (j, i)):
            J[..., row, a] = d[..., a] * (
                3 * parameters.base_radius * sine[..., a]
                - d[..., b] * (sine[..., a] * cosine[..., b] + 2 * cosine[..., a] * sine[..., b])
            )
    return J


# Surfaces -----------------------------------------------------------------------------------------


def singular_surface(
    parameters: RPSParameters,
    *,
    z: tuple[float, float],
    tilt_x: tuple[float, float],
    tilt_y: tuple[float, float],
    points: int | tuple[int, int, int] = 25,
) -> SingularSurface:
    """Return the type II singular surface inside a box of poses.

    The signed `SingularityMeasures.determinant` is sampled on a grid, its zero level set taken from
    the grid's tetrahedra (six to a cell), and each vertex moved along its edge onto the surface, by
    bisection to rounding error. Sheets nearer to each other than the grid's spacing can be missed.

    Parameters
    ----------
    z, tilt_x, tilt_y
        The box: smallest and largest value, m, rad, rad. No corner may be tilted by a whole turn.
    points
        Grid points along z, tilt_x and tilt_y, at least 2 each.

    Returns
    -------
    SingularSurface
        Without vertices and triangles where the box holds no such pose.

    Raises
    ------
    InputError
        If a range is empty or not finite, or the grid has too few points or too many.
    """
    axes = _grid_axes({"z": z, "tilt_x": tilt_x, "tilt_y": tilt_y}, points)
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    checked_tilt(nodes.reshape(-1, 3))

    def measure(pose: Array) -> Array:
        return _measured_determinant(parameters, pose)

    grid = nodes.shape[:3]
    poses = nodes.reshape(-1, 3)
    values = np.concatenate([measure(part) for part in _parts(poses)])
    ends, triangles = _zero_triangles(values, grid)
    low, high = poses[ends[:, 0]], poses[ends[:, 1]]
    below, _ = bisected(
        lambda part, which: measure(low[which] + part[:, None] * (high - low)[which]),
        np.zeros(len(ends)),
        np.ones(len(ends)),
        values[ends[:, 0]],
        2.0**-52,
    )
    vertices = low + below[:, None] * (high - low)
    left = measure(vertices)
    # Where a leg's length passes through zero the sign jumps: that is no type II singularity.
    vertices, triangles, kept = _without(vertices, triangles, np.abs(left) > 1e-9)
    return SingularSurface(vertices, triangles, left[kept], _reachable(parameters, vertices))


def bisected(
    function: Callable[[Array, Indices], Array],
    low: Array,
    high: Array,
    at_low: Array,
    width: float,
) -> tuple[Array, Array]:
    """Return brackets no wider than `width` around sign changes, all halved together.

    Parameters
    ----------
    function
        Of arguments (n,) and of which bracket each belongs to (n,); it has another sign at `high`
        than at `low`. Zero counts as positive.
    low, high
        Brackets, shape (n,) each.
    at_low
        The function at `low`, shape (n,).
    width
        Widest bracket to end with; at the least the spacing of floats.

    Returns
    -------
    low, high : arrays
        Shape (n,) each.
    """
    low, high = low.copy(), high.copy()
    negative = at_low < 0
    which = np.arange(low.size)
    while True:
        middle = (low[which] + high[which]) / 2
        # Down to the width, and no further than floats go.
        wide = (high - low)[which] > width
        wide &= (low[which] < middle) & (middle < high[which])
        which, middle = which[wide], middle[wide]
        if not which.size:
            break
        stays = (function(middle, which) < 0) == negative[which]
        low[which[stays]], high[which[~stays]] = middle[stays], middle[~stays]
    return low, high


# Inner workings: measures -------------------------------------------------------------------------


def checked_tilt(pose: ArrayLike) -> Array:
    """Return poses as `checked_pose`; refuse tilts of a whole turn, where (tilt_x, tilt_y) fail."""
    x = checked_pose(pose)
    tilt = np.hypot(x[..., 1], x[..., 2])
    beyond = tilt > 2 * math.pi * (1 - 1e-6)
    if beyond.any():
        raise InputError(
            f"pose is tilted by {tilt[beyond].flat[0]:.6g} rad; here it must be below 2 pi, where "
            "(tilt_x, tilt_y) are singular coordinates. The same placement has a tilt up to pi"
        )
    return x


def _gain_matrix(tip: TipJacobians, legs: LegJacobians) -> tuple[Array, Array]:
    """Return M = K L^-T / sqrt(3) and L, L L' = Q: leg speeds per unit platform speed."""
    L = np.asarray(np.linalg.cholesky(_speed_form(tip)), dtype=np.float64)
    transposed = np.linalg.solve(L, np.swapaxes(legs.length_jacobian, -1, -2))
    return np.asarray(np.swapaxes(transposed, -1, -2) / math.sqrt(3), dtype=np.float64), L


def _speed_form(tip: TipJacobians) -> Array:
    """Return Q with pose' . Q pose' the mean of the tips' squared speed, shape (..., 3, 3)."""
    U, W = tip.radial_jacobian, tip.height_jacobian
    form: Array = (np.swapaxes(U, -1, -2) @ U + np.swapaxes(W, -1, -2) @ W) / 3
    return form


def _determinant(tip: TipJacobians, legs: LegJacobians) -> Array:
    """Return det K / sqrt(det Q) / 3^(3/2), the product of the gains with its sign."""
    size = np.sqrt(np.linalg.det(_speed_form(tip)))
    product: Array = np.linalg.det(legs.length_jacobian) / (3 * math.sqrt(3) * size)
    return product


def _measured_determinant(parameters: RPSParameters, pose: Array) -> Array:
    legs, vanishing = masked_leg_jacobians(parameters, pose)
    determinant = _determinant(tip_jacobians(parameters, pose), legs)
    return np.where(vanishing.any(axis=-1), 0.0, determinant)


def _least_gain(
    tip: TipJacobians,
    legs: LegJacobians,
    K_rate: Array,
    parameters: RPSParameters,
    pose: Array,
    rate: Array,
) -> tuple[Array, Array]:
    """Return the least gain with the sign of det K, and its time derivative (`measure_rates`)."""
    M, L = _gain_matrix(tip, legs)
    left, gains, right = np.linalg.svd(M)
    u, v = left[..., :, 2], right[..., 2, :]
    x = np.linalg.solve(np.swapaxes(L, -1, -2), v[..., None])[..., 0]
    dU, dW = tip_jacobian_rates(parameters, pose, rate)
    moving = [np.einsum("...ij,...j->...i", matrix, x) for matrix in (*tip[2:], dU, dW)]
    # x' Q' x = 2/3 ((U x) . (U' x) + (W x) . (W' x))
    x_dQ_x = 2 / 3 * (moving[0] * moving[2] + moving[1] * moving[3]).sum(axis=-1)
    sigma = gains[..., 2]
    change = np.einsum("...i,...ij,...j->...", u, K_rate, x) / math.sqrt(3) - sigma * x_dQ_x / 2
    sign = np.where(np.linalg.det(M) < 0, -1.0, 1.0)
    return sign * sigma, sign * change


def _skew(vector: Array) -> Array:
    """Return [v]x, shape (..., 3, 3)."""
    matrix: Array = -np.cross(np.eye(3), vector[..., None, :])
    return np.swapaxes(matrix, -1, -2)


def _reachable(parameters: RPSParameters, pose: Array) -> Bools:
    legs, _ = masked_leg_jacobians(parameters, pose)
    cone = cone_angles(legs.angle, rotation(pose), parameters.spherical_rest_angle)
    return within_limits(parameters, legs.length, legs.angle, cone)


# Inner workings: surfaces -------------------------------------------------------------------------


def _grid_axes(
    ranges: dict[str, tuple[float, float]], points: int | tuple[int, int, int]
) -> list[Array]:
    counts = (points,) * 3 if isinstance(points, int) else tuple(points)
    if len(counts) != 3 or not all(isinstance(n, int) and n >= 2 for n in counts):
        raise InputError(f"points = {points!r}: it must be a whole number of 2 or more, or three")
    if math.prod(counts) > _MOST_GRID_POINTS:
        raise InputError(
            f"points = {points!r} makes a grid of {math.prod(counts):,} points; "
            f"at most {_MOST_GRID_POINTS:,} are accepted"
        )
    axes = []
    for (name, given), count in zip(ranges.items(), counts, strict=True):
        try:
            low, high = (float(x) for x in given)
        except (TypeError, ValueError):
            raise InputError(f"{name} = {given!r}: it must be two numbers") from None
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError(f"{name} = {given!r}: it must be finite, the smaller number first")
        axes.append(np.linspace(low, high, count))
    return axes


def _parts(poses: Array, most: int = 200_000) -> list[Array]:
    return [poses[start : start + most] for start in range(0, len(poses), most)]


def _zero_triangles(values: Array, grid: tuple[int, ...]) -> tuple[Indices, Indices]:
    """Return the zero level set on a grid's tetrahedra.

    Returns
    -------
    ends : (n, 2)
        The two nodes, of different sign, between which each vertex lies; the first's is negative.
    triangles : (m, 3)
        Indices of vertices.
    """
    negative = values < 0
    corners = []
    for tetrahedron in _tetrahedra(grid):
        below = negative[tetrahedron]
        count = below.sum(axis=1)
        # Sorted so that the negative nodes come first; the order within a kind does not matter.
        nodes = np.take_along_axis(tetrahedron, np.argsort(~below, axis=1, kind="stable"), axis=1)
        for negatives, faces in _CUTS.items():
            cut = nodes[count == negatives]
            corners += [cut[:, face] for face in faces]  # (k, 3 vertices, 2 ends)
    edges = np.concatenate([c.reshape(-1, 2) for c in corners])
    ends, index = np.unique(edges, axis=0, return_inverse=True)
    return ends, index.reshape(-1, 3)


#: By the number of negative nodes: the triangles that cut a tetrahedron's edges.
_CUTS = {
    1: [np.array([[0, 1], [0, 2], [0, 3]])],
    2: [np.array([[0, 2], [0, 3], [1, 2]]), np.array([[1, 2], [0, 3], [1, 3]])],
    3: [np.array([[0, 3], [1, 3], [2, 3]])],
}


def _tetrahedra(grid: tuple[int, ...]) -> list[Indices]:
    """Return the six tetrahedra of every cell, (cells, 4 nodes) each: one for each order of axes.

    Each goes from the cell's first corner to the opposite one along the axes in that order, so that
    neighbouring cells agree on the diagonals of their common faces.
    """
    index = np.arange(math.prod(grid)).reshape(grid)
    found = []
    for order in permutations(range(3)):
        step = np.zeros(3, dtype=int)
        nodes = [index[:-1, :-1, :-1]]
        for axis in order:
            step[axis] = 1
            part = tuple(slice(s, n - 1 + s) for s, n in zip(step, grid, strict=True))
            nodes.append(index[part])
        found.append(np.stack([node.ravel() for node in nodes], axis=1))
    return found


def _without(vertices: Array, triangles: Indices, dropped: Bools) -> tuple[Array, Indices, Bools]:
    """Return a mesh without some of its vertices and their triangles, and which vertices remain."""
    kept = ~dropped
    renumbered = np.cumsum(kept) - 1
    whole = kept[triangles].all(axis=1) if len(triangles) else np.zeros(0, dtype=bool)
    return vertices[kept], renumbered[triangles[whole]], kept

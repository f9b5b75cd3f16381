"""The type II singular surface of the 3-RPS, as a mesh of triangles in poses."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.errors import InputError
from rps_pin.numerics.bisection import bisected
from rps_pin.numerics.level_sets import without_vertices, zero_triangles
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics.legs import cone_angles, within_limits
from rps_pin.rps.kinematics.pose import rotation
from rps_pin.rps.kinematics.rates import masked_leg_jacobians
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.singularity.measures import checked_tilt, signed_determinant
from rps_pin.validation import whole_number

_MOST_GRID_POINTS = 20_000_000
#: Poses that are worked on at a time.
_CHUNK = 200_000
#: A vertex with more left than this lies on a jump of the determinant, not on a zero.
_JUMP = 1e-9


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


@refuses_other_kinds
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
    poses = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    checked_tilt(poses)

    determinant = partial(signed_determinant, parameters)
    values = [determinant(poses[i : i + _CHUNK]) for i in range(0, len(poses), _CHUNK)]
    first, second, third = map(len, axes)
    ends, triangles = zero_triangles(np.concatenate(values), (first, second, third))
    low, high = poses[ends[:, 0]], poses[ends[:, 1]]
    share, _ = bisected(
        lambda part, i: determinant(low[i] + part[:, None] * (high - low)[i]) < 0,
        np.zeros(len(ends)),
        np.ones(len(ends)),
        2.0**-52,
    )
    vertices = low + share[:, None] * (high - low)
    left = determinant(vertices)
    # Where a leg's length passes through zero the sign jumps: that is no type II singularity.
    kept = np.abs(left) <= _JUMP
    legs, _ = masked_leg_jacobians(parameters, vertices[kept])
    cone = cone_angles(legs.angle, rotation(vertices[kept]), parameters.spherical_rest_angle)
    return SingularSurface(
        vertices[kept],
        without_vertices(triangles, kept),
        left[kept],
        within_limits(parameters, legs.length, legs.angle, cone),
    )


def _grid_axes(
    ranges: dict[str, tuple[float, float]], points: int | tuple[int, int, int]
) -> list[Array]:
    given = (points,) * 3 if isinstance(points, int) else tuple(points)
    if len(given) != 3:
        raise InputError(f"points = {points!r}: it must be a whole number, or three")
    counts = [whole_number(count, "points", least=2) for count in given]
    if math.prod(counts) > _MOST_GRID_POINTS:
        raise InputError(
            f"points = {points!r} makes a grid of {math.prod(counts):,} points; "
            f"at most {_MOST_GRID_POINTS:,} are accepted"
        )
    axes = []
    for (name, ends), count in zip(ranges.items(), counts, strict=True):
        if np.shape(ends) != (2,) or not -math.inf < ends[0] < ends[1] < math.inf:
            raise InputError(f"{name} = {ends!r}: it must be two numbers, the smaller number first")
        axes.append(np.linspace(*ends, count))
    return axes

"""Cylinders and boxes of full tilt: heights at which every tilt up to a size is inside."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, UnreachableError
from rps_pin.numerics.bisection import bisected
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics.pose import stacked
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.compute import checked_start, parameters_of
from rps_pin.rps.workspace.evaluate import evaluate, side_of_singularity
from rps_pin.rps.workspace.grids import pose_grid
from rps_pin.task.workspace.evaluate import MIN_CONDITIONING
from rps_pin.validation import choice, whole_number

if TYPE_CHECKING:
    from rps_pin.rps.robot import RPSRobot

Shape = Literal["cylinder", "box"]

#: Steps in which a ray of tilts is searched for its first way out, before bisection.
_RAY_STEPS = 64
#: Width of the brackets of its end, over the step.
_BRACKET = 2.0**-40
_LEVEL_SAMPLES = 2001


class TiltRange(NamedTuple):
    """A cylinder or a box inscribed in the workspace's poses (z, tilt_x, tilt_y)."""

    shape: Shape
    lower: float
    """Least height, m."""
    upper: float
    """Greatest height, m."""
    tilt: float
    """Rad. Cylinder: every tilt of at most this size is free. Box: every |tilt_x| and |tilt_y|."""
    volume: float
    """(upper - lower) pi tilt^2, or (upper - lower) 4 tilt^2, m rad^2."""


@refuses_other_kinds
def free_tilt(
    robot: RPSRobot | RPSParameters,
    z: ArrayLike,
    shape: Shape = "cylinder",
    *,
    directions: int = 96,
    largest: float = math.pi / 2,
    start: ArrayLike | None = None,
    min_conditioning: float = MIN_CONDITIONING,
) -> Array:
    """Return for each height the tilt up to which every tilt is in the workspace, shape (n,), rad.

    Rays of tilts in equally spaced directions are followed from the level pose to their first way
    out, in 64 steps of `largest`, which is then bisected to rounding.

    Parameters
    ----------
    robot
        A robot, or its parameters.
    z
        Heights, m, shape (n,), increasing, or one number.
    shape
        ``"cylinder"``: tilts of a size; ``"box"``: |tilt_x| and |tilt_y|, so that its
        corners are farther.
    directions
        Rays, a multiple of 24 so that the robot's planes of symmetry and the corners are among
        them.
    largest
        Farthest tilt looked at along a ray, rad, up to pi.
    start, min_conditioning
        As for `workspace`.

    Raises
    ------
    InputError
        If an argument is not what it should be.
    """
    choice(shape, "shape", ("cylinder", "box"))
    if directions < 24 or directions % 24:
        raise InputError(f"directions = {directions}; it must be a multiple of 24")
    if not 0 < largest <= math.pi:
        raise InputError(f"largest = {largest!r} rad; it must be in (0, pi]")
    parameters = parameters_of(robot)
    grid = pose_grid(z, [0.0])
    inside = _inside(parameters, checked_start(parameters, grid, start), min_conditioning)
    heights = grid.axes[0]
    way = 2 * np.pi * np.arange(directions) / directions

    # The last step of each ray before its first way out.
    sizes = np.linspace(0.0, largest, _RAY_STEPS + 1)
    steps = np.meshgrid(heights, way, sizes, indexing="ij")
    unbroken = np.logical_and.accumulate(inside(*steps), axis=-1)
    count = unbroken.sum(axis=-1)
    low = sizes[np.maximum(count - 1, 0)]
    high = sizes[np.minimum(count, _RAY_STEPS)]
    height, angle = (a.ravel() for a in np.meshgrid(heights, way, indexing="ij"))
    ends, _ = bisected(
        lambda size, ray: inside(height[ray], angle[ray], size),
        low.ravel(),
        high.ravel(),
        sizes[1] * _BRACKET,
    )
    low = np.where(count == 0, 0.0, ends.reshape(low.shape))  # 0: not even the level pose
    # The size of the box whose side the ray's end lies on.
    gauge = np.maximum(np.abs(np.cos(way)), np.abs(np.sin(way))) if shape == "box" else 1.0
    free: Array = (low * gauge).min(axis=-1)
    return free


@refuses_other_kinds
def largest_tilt_range(
    robot: RPSRobot | RPSParameters,
    shape: Shape = "cylinder",
    *,
    points: int = 51,
    start: ArrayLike | None = None,
    min_conditioning: float = MIN_CONDITIONING,
) -> TiltRange:
    """Return the largest cylinder, or box, of full tilt that fits into the workspace's poses.

    Of all ranges between `points` heights at which the level pose is in the workspace, the one
    with the largest volume, its tilt the least `free_tilt` of its heights.

    Parameters
    ----------
    robot
        A robot, or its parameters; its leg lengths must have an upper limit.
    shape
        ``"cylinder"`` or ``"box"``.
    points
        Heights to choose from, at least 3.
    start, min_conditioning
        As for `workspace`.

    Raises
    ------
    InputError
        If an argument is not what it should be, or the leg lengths have no upper limit.
    UnreachableError
        If no level pose is in the workspace.
    """
    parameters = parameters_of(robot)
    whole_number(points, "points", least=3)
    z = np.linspace(*_level_heights(parameters, start, min_conditioning), points)
    tilt = free_tilt(parameters, z, shape, start=start, min_conditioning=min_conditioning)
    area = math.pi if shape == "cylinder" else 4.0
    best = TiltRange(shape, float(z[0]), float(z[0]), 0.0, 0.0)
    for i in range(points):
        least = np.minimum.accumulate(tilt[i:])
        volumes = (z[i:] - z[i]) * area * least**2
        j = int(np.argmax(volumes))
        if volumes[j] > best.volume:
            best = TiltRange(shape, *map(float, (z[i], z[i + j], least[j], volumes[j])))
    return best


def _inside(
    parameters: RPSParameters, start: Array, min_conditioning: float
) -> Callable[..., Bools]:
    """Return the test whether poses by height, direction and size of tilt are in the workspace."""
    side = side_of_singularity(parameters, start)

    def inside(height: Array, angle: Array | float = 0.0, size: Array | float = 0.0) -> Bools:
        pose = stacked(height, size * np.cos(angle), size * np.sin(angle))
        fields = evaluate(parameters, pose, side, min_conditioning=min_conditioning)
        return np.asarray(fields.reason == 0)

    return inside


def _level_heights(
    parameters: RPSParameters, start: ArrayLike | None, min_conditioning: float
) -> tuple[float, float]:
    """Return the ends of the heights, around the start's, at which the level pose is inside."""
    longest = parameters.leg_length_limits[1]
    if not math.isfinite(longest):
        raise InputError("leg_length_limits has no upper end: the heights have none either")
    first = checked_start(parameters, pose_grid([0.0], [0.0]), start)
    inside = _inside(parameters, first, min_conditioning)
    if not inside(first[:1]).all():
        raise UnreachableError(
            f"the level pose at the start's height, {first[0]:.6g} m, is not in the workspace; "
            "give the start another height"
        )
    ends = []
    for limit in (-longest, longest):
        z = np.linspace(first[0], limit, _LEVEL_SAMPLES)
        out = np.flatnonzero(~inside(z))
        last = out[0] - 1 if len(out) else len(z) - 1
        bad = z[last + 1 : last + 2] if len(out) else z[-1:]
        good, _ = bisected(
            lambda z, _: inside(z), z[last : last + 1], bad, abs(z[1] - z[0]) * _BRACKET
        )
        ends.append(float(good[0]))
    return ends[0], ends[1]

"""Forward kinematics: the pose of given leg lengths that continues a known one.

Leg lengths alone leave up to 16 poses open (`rps_pin.rps.kinematics.assembly_modes`); a robot that
moves stays in the one it is in. So the leg angles are followed from the lengths of a known pose to
those wanted, on the straight line between them, in steps that the Newton-Kantorovich theorem
allows: see `rps_pin.rps.kernels.continuation`. Where the line meets a parallel singularity it ends,
or crosses to where the lengths no longer tell which way the platform goes. It is refused.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from rps_pin.arrays import Array, Bools
from rps_pin.errors import ClosureError, SingularityError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kernels.continuation import follow_legs, newton_step
from rps_pin.rps.kinematics import leg_equations as equations
from rps_pin.rps.kinematics.assembly_modes import assembly_modes, longest_leg
from rps_pin.rps.kinematics.legs import geometry_of_pose, refuse_vanishing
from rps_pin.rps.kinematics.pose import checked_pose
from rps_pin.rps.kinematics.samples import Errors, maskable, refuse
from rps_pin.rps.kinematics.tracking import LegDirections, Lengths, condition_of, follow, pose_of
from rps_pin.validation import one_shape, positive_number, real_vector, whole_number

#: Largest condition number of Eq. 8's Jacobian through which a pose is followed.
CONDITION_LIMIT = 1e6
#: Steps tried before a line counts as ending in a singularity: towards one, each step covers about
#: a tenth of what is left.
MOST_STEPS = 1000
_SQRT3 = math.sqrt(3.0)


class ForwardKinematics(NamedTuple):
    """Poses that continue known ones."""

    pose: Array
    """``(z, tilt_x, tilt_y)``, shape (..., 3), m and rad, the tilt at most pi; where not `reached`,
    the last one reached."""
    angle: Array
    """Leg angles phi, shape (..., 3), rad, of the pose."""
    reached: Bools
    """Whether the pose has the lengths asked for, shape (...)."""
    fraction: Array
    """Part of the line of lengths that was followed, shape (...): 1 where reached."""
    condition: Array
    """Condition number of Eq. 8's Jacobian at the pose, shape (...)."""


@maskable(length=1, near=1)
def forward_kinematics(
    length: ArrayLike,
    near: ArrayLike,
    base_radius: float,
    platform_radius: float,
    *,
    errors: Errors = "raise",
    condition_limit: float = CONDITION_LIMIT,
) -> ForwardKinematics:
    """Return the poses with given leg lengths that continue known poses.

    Parameters
    ----------
    length
        Leg lengths d wanted, shape (..., 3), m.
    near
        Poses to continue, of a shape that broadcasts with that of `length`: they are followed
        while the lengths change, straight and evenly, from theirs to those wanted.
    base_radius, platform_radius
        The paper's g and h, m.
    errors
        ``"raise"`` refuses lengths that cannot be followed to their end; with ``"mask"``
        `ForwardKinematics.reached` is false there; its other fields are NaN where a leg has no
        length in `near`.
    condition_limit
        Largest condition number of Eq. 8's Jacobian (by leg angles, greatest row sums) that is
        followed through.

    Raises
    ------
    InputError
        If an argument is not finite, a length not positive, or shapes do not go together.
    SingularityError
        If a line of lengths meets a parallel singularity; says how far along.
    ClosureError
        If no pose has the lengths; its `gap` is the error of a tip distance, m.
    UnreachableError
        If a leg has no length in a pose of `near`.
    """
    g, h = equations.checked_radii(base_radius, platform_radius)
    limit = positive_number(condition_limit, "condition_limit")
    wanted, start = one_shape(
        length=equations.checked_lengths(length), near=checked_pose(near, "near")
    )
    shape = wanted.shape
    goal = wanted.reshape(-1, 3)
    begin, *legs = (array.reshape(-1, 3) for array in _legs_of(start, g, h))
    direction = np.concatenate(legs, axis=-1).T
    direction, fraction, condition = follow_many(begin.T, goal.T, direction, (g, h), limit)
    angle = np.arctan2(direction[3:], direction[:3]).T
    reached, batch = fraction == 1.0, shape[:-1]

    def error(_: tuple[int, ...], where: str) -> ClosureError | SingularityError:
        i = int(np.argmin(reached))
        d = goal[i]
        asked = f"leg lengths ({d[0]:.6g}, {d[1]:.6g}, {d[2]:.6g}) m{where}"
        if d.max() <= longest_leg(g, h) and not len(assembly_modes(d, g, h).angle):
            off = partial(equations.residuals, d, base_radius=g, platform_radius=h)
            best = least_squares(off, angle[i])
            gap = float(np.abs(best.fun).max())
            return ClosureError(
                f"{asked} cannot close: no pose of the platform has them; nearest to the one "
                f"continued, a distance between two tips is {gap:.3g} m off {_SQRT3 * h:.6g} m",
                gap,
            )
        return SingularityError(
            f"{asked} cannot be reached from the pose given: after {fraction[i]:.4%} of the line a "
            f"parallel singularity is met (condition {condition[i]:.3g}, limit {limit:.3g}). "
            "assembly_modes lists the poses that have such lengths",
            float(condition[i]),
            limit,
        )

    if errors == "raise":
        refuse(~reached.reshape(batch), error)
    there = np.where(reached[:, None], goal, begin + fraction[:, None] * (goal - begin))
    found = equations.placement_from_angles(there, angle, g, h).pose
    return ForwardKinematics(
        found.reshape(shape),
        angle.reshape(shape),
        reached.reshape(batch),
        fraction.reshape(batch),
        condition.reshape(batch),
    )


def start_of(
    near: ArrayLike, g: float, h: float, limit: float
) -> tuple[Array, Lengths, LegDirections, float]:
    """Return what following begins with: a pose (3,), lengths, directions, and the condition.

    Raises
    ------
    InputError
        If the pose is not three finite numbers.
    UnreachableError
        If a leg has no length in it.
    SingularityError
        If its condition is above the limit.
    """
    pose = real_vector(near, 3, "near")
    (d1, d2, d3), (c1, c2, c3), (s1, s2, s3) = (array.tolist() for array in _legs_of(pose, g, h))
    d, directions = (d1, d2, d3), (c1, c2, c3, s1, s2, s3)
    condition = condition_of(d, directions, g, h)
    if condition > limit:
        raise SingularityError(
            f"the pose to start from is singular: condition {condition:.3g}, limit {limit:.3g}",
            condition,
            limit,
        )
    return pose, d, directions, condition


@refuses_other_kinds
class EncoderTracker:
    """Follows the platform from encoder readings, one call a tick, with the same guarantees.

    Starts from a known pose and follows leg lengths from one reading to the next. A reading that
    cannot be followed is refused and changes nothing: the next one continues from the last pose.
    One object serves one thread; a call allocates no arrays.

    Parameters
    ----------
    near
        The pose to start from, shape (3,): ``(z, tilt_x, tilt_y)``, m and rad.
    base_radius, platform_radius
        The paper's g and h, m.
    condition_limit
        Largest condition number of Eq. 8's Jacobian that is followed through.
    most_steps
        Steps that one reading may be divided into: what bounds the time of a call.

    Attributes
    ----------
    condition : float
        Condition number at the last pose.

    Raises
    ------
    InputError
        If an argument has the wrong shape, or is not finite and, where it must be, positive.
    UnreachableError
        If a leg has no length in the pose.
    SingularityError
        If the pose is singular.
    """

    def __init__(
        self,
        near: ArrayLike,
        base_radius: float,
        platform_radius: float,
        *,
        condition_limit: float = CONDITION_LIMIT,
        most_steps: int = 100,
    ) -> None:
        self._g, self._h = equations.checked_radii(base_radius, platform_radius)
        self._limit = positive_number(condition_limit, "condition_limit")
        self._most = whole_number(most_steps, "most_steps")
        self._pose = np.empty(3)
        self.reset(near)

    @property
    def pose(self) -> Array:
        """The last pose, shape (3,), m and rad: a view that the next call overwrites."""
        view = self._pose.view()
        view.flags.writeable = False
        return view

    def reset(self, near: ArrayLike) -> None:
        """Start anew from a pose. Raises what the constructor does."""
        pose, d, directions, self.condition = start_of(near, self._g, self._h, self._limit)
        self._length, self._directions = d, directions
        self._pose[:] = pose
        # Where functions are compiled, now and not in the loop.
        follow(d, directions, d, self._g, self._h, self._limit, self._most)
        pose_of(d, directions, self._g, self._h)

    def update(self, length: ArrayLike, out: Array | None = None) -> Array:
        """Return the pose (3,) at a new reading of the leg lengths (3,), m.

        Parameters
        ----------
        length
            Leg lengths d, shape (3,), m: an array, a list or a tuple.
        out
            Array (3,) to put the pose in; without it, the tracker's own, which the next call
            overwrites.

        Raises
        ------
        InputError
            If the reading is not three finite, positive numbers.
        SingularityError
            If the line to the reading meets a singularity, or needs more than `most_steps`.
        """
        goal = _reading(length)
        directions, condition, done = follow(
            self._length, self._directions, goal, self._g, self._h, self._limit, self._most
        )
        if done < 1.0:
            condition = condition if done > 0.0 else self.condition
            raise SingularityError(
                f"leg lengths ({goal[0]:.6g}, {goal[1]:.6g}, {goal[2]:.6g}) m cannot be followed "
                f"in {self._most} steps: {done:.4%} of the line was followed; the condition "
                f"there is {condition:.3g} (limit {self._limit:.3g}). The last pose is kept",
                condition,
                self._limit,
            )
        pose = self._pose
        pose[0], pose[1], pose[2] = pose_of(goal, directions, self._g, self._h)
        self._length, self._directions, self.condition = goal, directions, condition
        if out is None:
            return pose
        out[:] = pose
        return out


def _legs_of(pose: Array, g: float, h: float) -> tuple[Array, Array, Array]:
    """Return lengths, cosines and sines of the legs, or refuse a leg without length."""
    legs = geometry_of_pose(pose, g, h)
    refuse_vanishing(legs.length, legs.vanishing)
    return legs.length, legs.cosine, legs.sine


# Many at once -------------------------------------------------------------------------------------


def follow_many(
    begin: Array, goal: Array, direction: Array, radii: tuple[float, float], limit: float
) -> tuple[Array, Array, Array]:
    """Return directions, the part of each line gone and the condition there.

    Parameters
    ----------
    begin, goal
        Leg lengths at both ends of the lines, shape (3, n), m.
    direction
        Of the legs at the beginning: cosines, then sines, shape (6, n).
    radii
        The paper's g and h, m.
    limit
        Largest condition number that is followed through.

    Returns
    -------
    direction, fraction, condition : arrays
        Shapes (6, n), (n,) and (n,).
    """
    direction = direction.copy()
    with np.errstate(all="ignore"):  # where a step is not trusted, its numbers are not used
        condition = np.array(newton_step(begin, tuple(direction), *radii)[2])
        done, share = np.zeros_like(condition), np.ones_like(condition)
        going = np.flatnonzero(condition <= limit)
        for _ in range(MOST_STEPS):
            if not len(going):
                break
            found, progress = follow_legs(
                begin[:, going],
                tuple(direction[:, going]),
                goal[:, going],
                radii,
                limit,
                (done[going], share[going], condition[going]),
                1,
            )
            direction[:, going] = found
            done[going], share[going], condition[going] = progress
            going = going[(done[going] < 1.0) & (share[going] >= 1e-14)]
    return direction, done, condition


def _reading(length: ArrayLike) -> Lengths:
    """Return a reading as three floats, checked."""
    if not (type(length) is np.ndarray and length.shape == (3,) and length.dtype == np.float64):
        length = real_vector(length, 3, "length")
    d1, d2, d3 = length.tolist()
    if not (0 < d1 < math.inf and 0 < d2 < math.inf and 0 < d3 < math.inf):
        equations.checked_lengths(length)
    return d1, d2, d3

"""The direct kinematics that matters: the pose that continues a known one (Eq. 8, followed).

Leg lengths alone leave up to 16 poses open (`rps_pin.rps.kinematics.assembly_modes`); a robot that
moves stays in the one it is in. So the leg angles are followed from the lengths of a known pose to
those wanted, on the straight way between them, in steps that the Newton-Kantorovich theorem allows.
With the Jacobian J of Eq. 8 at the angles so far and at the lengths of the step's end,

    beta = |J^-1|,  eta = |J^-1 f|,  L >= |f''|,     beta L eta <= 1/2  (here 1/4)

there is exactly one solution within 2 eta, J is regular all the way to it, and Newton's method
finds it. All norms are the greatest row sum (angles in rad), and

    L = max over (i, j) of 3 g (d_i + d_j) + 8 d_i d_j.

At a parallel singularity beta grows without bound and the steps shrink to nothing: the way ends
there, or crosses to where the lengths no longer tell which way the platform goes. It is refused.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from rps_pin.arrays import Array, Bools
from rps_pin.errors import ClosureError, InputError, SingularityError
from rps_pin.rps.kinematics import leg_equations as eq
from rps_pin.rps.kinematics.assembly_modes import assembly_modes, longest_leg
from rps_pin.rps.kinematics.leg_equations import (
    checked_lengths,
    checked_positive,
    checked_radii,
    placement_from_angles,
)
from rps_pin.rps.kinematics.legs import leg_angles_and_lengths, tips
from rps_pin.rps.kinematics.pose import checked_pose, position, rotation
from rps_pin.rps.kinematics.tracking import (
    TRUST,
    Lengths,
    Way,
    condition_of,
    direction_of_legs,
    follow,
    pose_of,
)

#: Largest condition number of Eq. 8's Jacobian through which a pose is followed.
CONDITION_LIMIT = 1e6
#: Steps tried before the way counts as ending in a singularity: towards one that ends it, each
#: covers about a tenth of what is left.
_MOST_STEPS = 1000
_MOST_NEWTON = 12
_SQRT3 = math.sqrt(3.0)


class ForwardKinematics(NamedTuple):
    """Poses that continue known ones."""

    pose: Array
    """``(z, tilt_x, tilt_y)``, shape (..., 3), m and rad, the tilt at most pi; where not `reached`,
    the last one on the way."""
    angle: Array
    """Leg angles phi, shape (..., 3), rad, of the pose."""
    reached: Bools
    """Whether the pose has the lengths asked for, shape (...)."""
    fraction: Array
    """How much of the way was gone, shape (...): 1 where reached."""
    condition: Array
    """Condition number of Eq. 8's Jacobian at the pose, shape (...)."""


def forward_kinematics(
    length: ArrayLike,
    near: ArrayLike,
    base_radius: float,
    platform_radius: float,
    *,
    errors: Literal["raise", "mask"] = "raise",
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
        ``"raise"`` refuses where a way cannot be followed to its end; ``"mask"`` says so in
        `ForwardKinematics.reached`.
    condition_limit
        Largest condition number of Eq. 8's Jacobian (by leg angles, greatest row sums) on the way.

    Raises
    ------
    InputError
        If an argument is not finite, a length not positive, or shapes do not go together.
    SingularityError
        If a way meets a parallel singularity; says how far along, and how near it came.
    ClosureError
        If no pose whatever has the lengths; its `gap` is by how much a tip distance misses, m.
    UnreachableError
        If a leg has no length in a pose of `near`.
    """
    if errors not in ("raise", "mask"):
        raise InputError(f"errors = {errors!r}; it must be 'raise' or 'mask'")
    g, h = checked_radii(base_radius, platform_radius)
    limit = checked_positive(condition_limit, "condition_limit")
    wanted, start = _together(checked_lengths(length), checked_pose(near, "near"))
    shape = wanted.shape
    goal, pose = wanted.reshape(-1, 3), start.reshape(-1, 3)
    begin, angle = leg_angles_and_lengths(tips(position(pose, h), rotation(pose), h), g)
    angle, fraction, condition = _followed(begin.T, goal.T, angle.T, g, h, limit)
    reached = fraction == 1.0
    if errors == "raise" and not reached.all():
        first = int(np.argmin(reached))
        where = tuple(int(i) for i in np.unravel_index(first, shape[:-1]))
        _refuse(goal[first], angle[first], fraction[first], condition[first], limit, g, h, where)
    on_the_way = np.where(reached[:, None], goal, begin + fraction[:, None] * (goal - begin))
    found = placement_from_angles(on_the_way, angle, g, h).pose
    batch = shape[:-1]
    return ForwardKinematics(
        found.reshape(shape),
        angle.reshape(shape),
        reached.reshape(batch),
        fraction.reshape(batch),
        condition.reshape(batch),
    )


def start_of(
    near: ArrayLike, g: float, h: float, limit: float
) -> tuple[Array, Lengths, Way, float]:
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
    pose = checked_pose(near, "near")
    if pose.shape != (3,):
        raise InputError(f"near has shape {pose.shape}; it must be (3,)")
    length, angle = leg_angles_and_lengths(tips(position(pose, h), rotation(pose), h), g)
    (d1, d2, d3), (phi1, phi2, phi3) = length.tolist(), angle.tolist()
    d, way = (d1, d2, d3), direction_of_legs((phi1, phi2, phi3))
    condition = condition_of(d, way, g, h)
    if condition > limit:
        raise SingularityError(
            f"the pose to start from is singular: condition {condition:.3g}, limit {limit:.3g}",
            condition,
            limit,
        )
    return pose, d, way, condition


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
        self._g, self._h = checked_radii(base_radius, platform_radius)
        self._limit = checked_positive(condition_limit, "condition_limit")
        self._most = int(checked_positive(most_steps, "most_steps"))
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
        pose, d, way, self.condition = start_of(near, self._g, self._h, self._limit)
        self._length, self._way = d, way
        self._pose[:] = pose
        # Where functions are compiled, now and not in the loop.
        follow(d, way, d, self._g, self._h, self._limit, self._most)
        pose_of(d, way, self._g, self._h)

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
            If the way to the reading meets a singularity, or is too long for `most_steps`.
        """
        goal = _reading(length)
        way, condition, done = follow(
            self._length, self._way, goal, self._g, self._h, self._limit, self._most
        )
        if done < 1.0:
            condition = condition if done > 0.0 else self.condition
            raise SingularityError(
                f"leg lengths ({goal[0]:.6g}, {goal[1]:.6g}, {goal[2]:.6g}) m cannot be followed "
                f"in {self._most} steps: {done:.4%} of the way was gone, where the condition is "
                f"{condition:.3g} (limit {self._limit:.3g}). The last pose is kept",
                condition,
                self._limit,
            )
        pose = self._pose
        pose[0], pose[1], pose[2] = pose_of(goal, way, self._g, self._h)
        self._length, self._way, self.condition = goal, way, condition
        if out is None:
            return pose
        out[:] = pose
        return out


# Many at once -------------------------------------------------------------------------------------


def _followed(
    begin: Array, goal: Array, angle: Array, g: float, h: float, limit: float
) -> tuple[Array, Array, Array]:
    """Return angles (n, 3), the part of the way gone (n,) and the condition there (n,)."""
    n = begin.shape[1]
    cosine, sine = np.cos(angle), np.sin(angle)
    done, share = np.zeros(n), np.ones(n)
    condition, sign = _condition_and_sign(begin, cosine, sine, g)
    going = np.flatnonzero(condition <= limit)
    for _ in range(_MOST_STEPS):
        if not len(going):
            break
        to = np.minimum(1.0, done[going] + share[going])
        start, end = begin[:, going], goal[:, going]
        d = np.where(to == 1.0, end, start + to * (end - start))
        w, z = d * cosine[:, going], d * sine[:, going]
        small, kantorovich, moved = _trusted(d, w, z, g, h, sign[going])
        good = np.flatnonzero(small)
        w, z, d_good = w[:, good], z[:, good], d[:, good]
        before = cosine[:, going[good]], sine[:, going[good]]
        tolerance = eq.closing_tolerance(d_good, g, h)
        eq.newton(d_good, w, z, g, h, tolerance, _MOST_NEWTON)
        error = eq.largest(eq.distance_errors(w, z, g, h))
        w, z = w / d_good, z / d_good
        shift = np.abs(np.arcsin(np.clip(z * before[0] - w * before[1], -1, 1))).max(axis=0)
        there, same = _condition_and_sign(d_good, w, z, g)
        # To rounding: a step of nothing moves by nothing.
        right = (error <= tolerance) & (shift <= 2 * moved[good] + 1e-12)
        right &= (there <= limit) & (same == sign[going[good]])
        accepted = good[right]
        share[going] *= np.clip(0.8 * TRUST / np.maximum(kantorovich, 1e-300), 0.02, 0.5)
        at = going[accepted]
        cosine[:, at], sine[:, at] = w[:, right], z[:, right]
        gained = to[accepted] - done[at]
        done[at], condition[at] = to[accepted], there[right]
        growth = np.clip(0.8 * TRUST / np.maximum(kantorovich[accepted], 1e-300), 0.5, 4.0)
        share[at] = gained * growth
        ended = (done[going] == 1.0) | (share[going] < 1e-14)
        going = going[~ended]
    return np.arctan2(sine, cosine).T, done, condition


def _trusted(
    d: Array, w: Array, z: Array, g: float, h: float, sign: Array
) -> tuple[Bools, Array, Array]:
    """Return whether Newton's method is sure to converge, beta L eta, and eta, (n,) each."""
    f12, f23, f31 = eq.left_sides(w, z, g, eq.constants(d, g, h))
    by_angle = eq.slopes(w, z, g)
    det = eq.cyclic_determinant(by_angle)
    turned = np.abs(det) > 0
    inverse = _adjugate(by_angle) / np.where(turned, det, 1.0)
    beta = np.abs(inverse).sum(axis=1).max(axis=0)
    f = np.stack([f12, f23, f31])
    eta = np.abs((inverse * f).sum(axis=1)).max(axis=0)
    kantorovich = np.where(turned, beta * eta * _bend(d, g), np.inf)
    return (kantorovich <= TRUST) & (np.sign(det) == sign), kantorovich, eta


def _condition_and_sign(d: Array, cosine: Array, sine: Array, g: float) -> tuple[Array, Array]:
    """Return the condition number of the Jacobian, and its determinant's sign, (n,) each."""
    (a1, a2), (b2, b3), (c3, c1) = by_angle = eq.slopes(d * cosine, d * sine, g)
    det = eq.cyclic_determinant(by_angle)
    size = eq.largest((np.abs(a1) + np.abs(a2), np.abs(b2) + np.abs(b3), np.abs(c1) + np.abs(c3)))
    inverse = np.abs(_adjugate(by_angle)).sum(axis=1).max(axis=0)
    regular = np.abs(det) > 0
    return np.where(regular, size * inverse / np.where(regular, np.abs(det), 1.0), np.inf), np.sign(
        det
    )


def _adjugate(by_angle: tuple[tuple[Array, Array], ...]) -> Array:
    """Return the adjugate of the cyclic Jacobian, shape (3, 3, n)."""
    (a1, a2), (b2, b3), (c3, c1) = by_angle
    return np.array(
        [
            [b2 * c3, -a2 * c3, a2 * b3],
            [b3 * c1, a1 * c3, -a1 * b3],
            [-b2 * c1, a2 * c1, a1 * b2],
        ]
    )


def _bend(d: Array, g: float) -> Array:
    """Return L: f_ij'' is m_j w_i + 2 z_i z_j and its like, and twice z_i z_j - 2 w_i w_j."""
    first, second, third = (3 * g * (d[i] + d[j]) + 8 * d[i] * d[j] for i, j in eq.PAIRS)
    return eq.largest((first, second, third))


def _together(lengths: Array, near: Array) -> tuple[Array, Array]:
    try:
        wanted, start = np.broadcast_arrays(lengths, near)
    except ValueError:
        raise InputError(
            f"length and near have shapes {lengths.shape} and {near.shape}, which do not go "
            "together"
        ) from None
    return wanted, start


def _refuse(
    goal: Array,
    angle: Array,
    fraction: float,
    condition: float,
    limit: float,
    g: float,
    h: float,
    where: tuple[int, ...],
) -> None:
    """Raise the error that says why lengths cannot be reached."""
    asked = f"leg lengths ({goal[0]:.6g}, {goal[1]:.6g}, {goal[2]:.6g}) m"
    if where:
        asked += f" (entry {where if len(where) > 1 else where[0]})"
    if goal.max() <= longest_leg(g, h) and not len(assembly_modes(goal, g, h).angle):
        best = least_squares(_residuals_of, angle, args=(goal, g, h))
        gap = float(np.abs(best.fun).max())
        raise ClosureError(
            f"{asked} cannot close: no pose of the platform has them; nearest to the one "
            f"continued, a distance between two tips is {gap:.3g} m off {_SQRT3 * h:.6g} m",
            gap,
        )
    raise SingularityError(
        f"{asked} cannot be reached from the pose given: after {fraction:.4%} of the way a "
        f"parallel singularity is met (condition {condition:.3g}, limit {limit:.3g}). "
        "assembly_modes lists the poses that have such lengths",
        float(condition),
        limit,
    )


def _residuals_of(angle: Array, length: Array, g: float, h: float) -> Array:
    return eq.residuals(length, angle, g, h)


def _reading(length: ArrayLike) -> Lengths:
    """Return a reading as three floats, checked."""
    if type(length) is np.ndarray and length.shape == (3,) and length.dtype == np.float64:
        d1, d2, d3 = length.tolist()
    else:
        array = checked_lengths(length)
        if array.shape != (3,):
            raise InputError(f"length has shape {array.shape}; it must be (3,)")
        d1, d2, d3 = array.tolist()
    if not (0 < d1 < math.inf and 0 < d2 < math.inf and 0 < d3 < math.inf):
        checked_lengths(length)
    return d1, d2, d3

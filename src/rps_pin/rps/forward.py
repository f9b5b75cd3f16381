"""The direct kinematics that matters: the pose that continues a known one (Eq. 8, followed).

Leg lengths alone leave up to 16 poses open (`rps_pin.rps.assembly`); a robot that moves stays in
the one it is in. So the leg angles are followed from the lengths of a known pose to those wanted,
on the straight way between them, in steps that the Newton-Kantorovich theorem allows. With the
Jacobian J of Eq. 8 at the angles so far and at the lengths of the step's end,

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
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from rps_pin.errors import ClosureError, InputError, SingularityError
from rps_pin.rps import leg_equations as eq
from rps_pin.rps.assembly import assembly_modes
from rps_pin.rps.leg_equations import (
    Array,
    checked_lengths,
    checked_positive,
    checked_radii,
    placement_from_angles,
)
from rps_pin.rps.legs import leg_angles_and_lengths, tips
from rps_pin.rps.pose import checked_pose, position, rotation

#: Largest condition number of Eq. 8's Jacobian through which a pose is followed.
CONDITION_LIMIT = 1e6
#: Largest beta L eta of a step: half of what the theorem asks for.
_TRUST = 0.25
#: Steps tried before the way counts as ending in a singularity: towards one that ends it, each
#: covers about a tenth of what is left.
_MOST_STEPS = 1000
_MOST_NEWTON = 12
#: Half a Newton step, rad, after which another would only move rounding errors.
_LAST_STEP = 1e-8
#: Tip distances are right to this part of g + h.
_TOLERANCE = 2.5e-13
_SQRT3 = math.sqrt(3.0)


class ForwardKinematics(NamedTuple):
    """Poses that continue known ones."""

    pose: Array
    """``(z, tilt_x, tilt_y)``, shape (..., 3), m and rad, the tilt at most pi; where not `reached`,
    the last one on the way."""
    angle: Array
    """Leg angles phi, shape (..., 3), rad, of the pose."""
    reached: NDArray[np.bool_]
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
        pose = checked_pose(near, "near")
        if pose.shape != (3,):
            raise InputError(f"near has shape {pose.shape}; it must be (3,)")
        tip = tips(position(pose, self._h), rotation(pose), self._h)
        length, angle = leg_angles_and_lengths(tip, self._g)
        (d1, d2, d3), (phi1, phi2, phi3) = length.tolist(), angle.tolist()
        d = d1, d2, d3
        way = (
            *(math.cos(phi1), math.cos(phi2), math.cos(phi3)),
            *(math.sin(phi1), math.sin(phi2), math.sin(phi3)),
        )
        step = _step(d, way, self._g, self._h)
        if step.condition > self._limit:
            raise SingularityError(
                f"the pose to start from is singular: condition {step.condition:.3g}, "
                f"limit {self._limit:.3g}",
                step.condition,
                self._limit,
            )
        self._length, self._way = d, way
        self.condition = step.condition
        self._pose[:] = pose

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
        begin, way, condition = self._length, self._way, self.condition
        done, share = 0.0, 1.0
        for _ in range(self._most):
            to = min(1.0, done + share)
            d = goal if to == 1.0 else _between(begin, goal, to)
            solved = _solved(d, way, self._g, self._h, self._limit)
            if isinstance(solved, _Solved):
                done, way, condition = to, solved.way, solved.condition
                if done == 1.0:
                    break
                share *= solved.growth
            else:
                share *= solved
        else:
            raise SingularityError(
                f"leg lengths ({goal[0]:.6g}, {goal[1]:.6g}, {goal[2]:.6g}) m cannot be followed "
                f"in {self._most} steps: {done:.4%} of the way was gone, where the condition is "
                f"{condition:.3g} (limit {self._limit:.3g}). The last pose is kept",
                condition,
                self._limit,
            )
        pose = self._pose
        pose[0], pose[1], pose[2] = _scalar_pose(goal, way, self._g, self._h)
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
        eq.newton(d_good, w, z, g, h, _TOLERANCE * (g + h), _MOST_NEWTON)
        error = eq.largest(eq.distance_errors(w, z, g, h))
        w, z = w / d_good, z / d_good
        shift = np.abs(np.arcsin(np.clip(z * before[0] - w * before[1], -1, 1))).max(axis=0)
        there, same = _condition_and_sign(d_good, w, z, g)
        # To rounding: a step of nothing moves by nothing.
        right = (error <= _TOLERANCE * (g + h)) & (shift <= 2 * moved[good] + 1e-12)
        right &= (there <= limit) & (same == sign[going[good]])
        accepted = good[right]
        share[going] *= np.clip(0.8 * _TRUST / np.maximum(kantorovich, 1e-300), 0.02, 0.5)
        at = going[accepted]
        cosine[:, at], sine[:, at] = w[:, right], z[:, right]
        gained = to[accepted] - done[at]
        done[at], condition[at] = to[accepted], there[right]
        growth = np.clip(0.8 * _TRUST / np.maximum(kantorovich[accepted], 1e-300), 0.5, 4.0)
        share[at] = gained * growth
        ended = (done[going] == 1.0) | (share[going] < 1e-14)
        going = going[~ended]
    return np.arctan2(sine, cosine).T, done, condition


def _trusted(
    d: Array, w: Array, z: Array, g: float, h: float, sign: Array
) -> tuple[NDArray[np.bool_], Array, Array]:
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
    return (kantorovich <= _TRUST) & (np.sign(det) == sign), kantorovich, eta


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
    if not len(assembly_modes(goal, g, h).angle):
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
        "assembly_modes lists the poses that have these lengths",
        float(condition),
        limit,
    )


def _residuals_of(angle: Array, length: Array, g: float, h: float) -> Array:
    return eq.residuals(length, angle, g, h)


# One at a time, in plain floats: ten times faster than arrays of three --------------------------


Lengths = tuple[float, float, float]
#: Cosines, then sines, of the three leg angles.
Way = tuple[float, float, float, float, float, float]


class _Step(NamedTuple):
    """Newton's step of one triple, and what it is worth."""

    t1: float
    t2: float
    t3: float
    det: float
    condition: float
    kantorovich: float


class _Solved(NamedTuple):
    """Where a trusted step led, and by how much the next may be longer."""

    way: Way
    condition: float
    growth: float


def _step(d: Lengths, way: Way, g: float, h: float) -> _Step:
    """Return half Newton's step of Eq. 8 in each angle; see `rps_pin.rps.leg_equations`."""
    d1, d2, d3 = d
    w1, w2, w3 = d1 * way[0], d2 * way[1], d3 * way[2]
    z1, z2, z3 = d1 * way[3], d2 * way[4], d3 * way[5]
    m1, m2, m3 = 3 * g - w1, 3 * g - w2, 3 * g - w3
    rest = 6 * g * g + 3 * h * h
    f12 = m1 * m2 - 2 * z1 * z2 + d1 * d1 + d2 * d2 - rest
    f23 = m2 * m3 - 2 * z2 * z3 + d2 * d2 + d3 * d3 - rest
    f31 = m3 * m1 - 2 * z3 * z1 + d3 * d3 + d1 * d1 - rest
    a1, a2 = m2 * z1 - 2 * z2 * w1, m1 * z2 - 2 * z1 * w2
    b2, b3 = m3 * z2 - 2 * z3 * w2, m2 * z3 - 2 * z2 * w3
    c3, c1 = m1 * z3 - 2 * z1 * w3, m3 * z1 - 2 * z3 * w1
    det = a1 * b2 * c3 + a2 * b3 * c1
    if det == 0.0:
        return _Step(0.0, 0.0, 0.0, 0.0, math.inf, math.inf)
    b2c3, a2c3, a2b3 = b2 * c3, a2 * c3, a2 * b3
    b3c1, a1c3, a1b3 = b3 * c1, a1 * c3, a1 * b3
    b2c1, a2c1, a1b2 = b2 * c1, a2 * c1, a1 * b2
    half = -0.5 / det
    t1 = (b2c3 * f12 - a2c3 * f23 + a2b3 * f31) * half
    t2 = (b3c1 * f12 + a1c3 * f23 - a1b3 * f31) * half
    t3 = (a2c1 * f23 - b2c1 * f12 + a1b2 * f31) * half
    beta = max(
        abs(b2c3) + abs(a2c3) + abs(a2b3),
        abs(b3c1) + abs(a1c3) + abs(a1b3),
        abs(b2c1) + abs(a2c1) + abs(a1b2),
    ) / abs(det)
    size = max(abs(a1) + abs(a2), abs(b2) + abs(b3), abs(c3) + abs(c1))
    bend = max(
        3 * g * (d1 + d2) + 8 * d1 * d2,
        3 * g * (d2 + d3) + 8 * d2 * d3,
        3 * g * (d3 + d1) + 8 * d3 * d1,
    )
    eta = 2 * max(abs(t1), abs(t2), abs(t3))
    return _Step(t1, t2, t3, det, size * beta, beta * eta * bend)


def _solved(d: Lengths, way: Way, g: float, h: float, limit: float) -> _Solved | float:
    """Return the solution a trusted step away, or by how much to shorten the step."""
    step = first = _step(d, way, g, h)
    if not (first.kantorovich <= _TRUST and first.condition <= limit):
        return max(0.02, min(0.5, 0.8 * _TRUST / first.kantorovich)) if first.kantorovich else 0.5
    at = way
    for _ in range(_MOST_NEWTON):
        at = _turned(at, step)
        moved = max(abs(step.t1), abs(step.t2), abs(step.t3))
        step = _step(d, at, g, h)
        if moved < _LAST_STEP:
            # What is left is its square: lost in rounding.
            if step.condition <= limit and (step.det > 0) == (first.det > 0):
                growth = 0.8 * _TRUST / max(first.kantorovich, 1e-9)
                return _Solved(at, step.condition, max(0.5, min(4.0, growth)))
            return 0.5
    return 0.5


def _turned(way: Way, step: _Step) -> Way:
    """Return the legs' directions turned by 2 atan(t) each."""
    c1, c2, c3, s1, s2, s3 = way
    t1, t2, t3 = step.t1, step.t2, step.t3
    sine1, sine2, sine3 = 2 * t1 / (1 + t1 * t1), 2 * t2 / (1 + t2 * t2), 2 * t3 / (1 + t3 * t3)
    c1, s1 = c1 - sine1 * (s1 + t1 * c1), s1 + sine1 * (c1 - t1 * s1)
    c2, s2 = c2 - sine2 * (s2 + t2 * c2), s2 + sine2 * (c2 - t2 * s2)
    c3, s3 = c3 - sine3 * (s3 + t3 * c3), s3 + sine3 * (c3 - t3 * s3)
    # Back to length one: the errors of millions of turns would add up.
    k1, k2, k3 = (3 - c * c - s * s for c, s in ((c1, s1), (c2, s2), (c3, s3)))
    return 0.5 * k1 * c1, 0.5 * k2 * c2, 0.5 * k3 * c3, 0.5 * k1 * s1, 0.5 * k2 * s2, 0.5 * k3 * s3


def _scalar_pose(d: Lengths, way: Way, g: float, h: float) -> tuple[float, float, float]:
    """Return the pose: as `placement_from_angles`, where the formulas are explained."""
    rho_1, rho_2, rho_3 = g - d[0] * way[0], g - d[1] * way[1], g - d[2] * way[2]
    z1, z2, z3 = d[0] * way[3], d[1] * way[4], d[2] * way[5]
    z = (z1 + z2 + z3) / 3
    outwards, across = (rho_2 + rho_3) / 2, (rho_2 - rho_3) / 2
    u_x, u_y, u_z = (2 * rho_1 + outwards) / (3 * h), -across / (_SQRT3 * h), (z1 - z) / h
    v_y, v_z = outwards / h, (z2 - z3) / (_SQRT3 * h)
    q_w = math.sqrt(max(0.0, u_x + v_y) / 2)
    if u_x + v_y >= 1:
        q_x, q_y = v_z / (2 * q_w), -u_z / (2 * q_w)
    elif v_y <= u_x:
        q_x = math.copysign(math.sqrt((1 - v_y) / 2), v_z)
        q_y = u_y / (2 * q_x)
    else:
        q_y = math.copysign(math.sqrt((1 - u_x) / 2), -u_z)
        q_x = u_y / (2 * q_y)
    half_sine = math.hypot(q_x, q_y)
    if u_x + v_y < 1:
        q_w = math.hypot(u_z, v_z) / (2 * half_sine)
    factor = 2 * math.atan2(half_sine, q_w) / half_sine if half_sine > 1e-9 else 2.0
    return z, q_x * factor, q_y * factor


def _between(begin: Lengths, goal: Lengths, part: float) -> Lengths:
    return (
        begin[0] + part * (goal[0] - begin[0]),
        begin[1] + part * (goal[1] - begin[1]),
        begin[2] + part * (goal[2] - begin[2]),
    )


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

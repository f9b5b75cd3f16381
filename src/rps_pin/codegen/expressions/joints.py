"""Motion of each Pinocchio joint as CasADi expressions of its coordinates.

A joint moves its frame to the placement (R(q), p(q)) in the frame where the joint stands; with

    R' = R skew(S_a v),    p' = R S_l v,

the motion subspace (S_l, S_a), in the moving frame's axes, is constant. Coordinates are those of
Pinocchio: angles and lengths; (cos, sin) of an unbounded turn; (x, y, cos, sin) of a planar joint;
quaternions (x, y, z, w), which are taken as of unit length.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.errors import MechanismError

#: A CasADi SX matrix.
Expression = Any
#: Rotation (3, 3) and translation (3, 1), m.
Placement = tuple[Expression, Expression]

#: Numbers are rounding errors of 0 or of a unit within this many units.
ROUNDING = 1e-15
_Z = np.array([0.0, 0.0, 1.0])
#: Squared angles, rad^2, below which sine and cosine are replaced by their series.
_SMALL = 1e-2
#: The same for series with three terms.
_TINY = 1e-4


def clean(numbers: Any, unit: float = 1.0) -> Array:
    """Return numbers as floats, those within `ROUNDING` units of 0 or of +-unit set to it."""
    result = np.array(numbers, dtype=float)
    for value in (0.0, unit, -unit):
        result[np.abs(result - value) < ROUNDING * unit] = value
    return result


def sparse(numbers: Any) -> Expression:
    """Return numbers as an expression without its zeros."""
    return ca.sparsify(ca.SX(np.asarray(numbers, dtype=float)))


class Joint:
    """Motion, integration and tangent of one joint.

    Parameters
    ----------
    model
        Joint model of Pinocchio, as in ``model.joints``.
    name
        Of the joint, for messages.

    Attributes
    ----------
    nq, nv : int
    linear, angular : arrays
        S_l and S_a, each of shape (3, nv).

    Raises
    ------
    MechanismError
        If the joint's motion subspace is not constant, it mimics another one, or its type is
        unknown.
    """

    def __init__(self, model: Any, name: str) -> None:
        self._parts = [_part(at, member, name) for at, member in _members(model)]
        self.nq, self.nv = model.nq, model.nv
        self.linear, self.angular = _subspace(model, name)

    def placement(self, q: Expression) -> Placement:
        """Return R and p at q (nq, 1)."""
        rotation, translation, start = ca.SX.eye(3), ca.SX(3, 1), 0
        for part in self._parts:
            turn, shift = part.family.placement(q[start : start + part.nq], *part.subspace)
            translation += rotation @ (part.at[1] + part.at[0] @ shift)
            rotation, start = rotation @ part.at[0] @ turn, start + part.nq
        return rotation, translation

    def unit_lengths(self, q: Expression) -> Expression:
        """Return the squared lengths, less 1, of quaternions and (cos, sin) pairs, (nq - nv, 1).

        A part that turns about k axes by more coordinates than velocities has k + 1 of them, last.
        """
        lengths, start = [ca.SX(0, 1)], 0
        for part in self._parts:
            start += part.nq
            if part.nq > part.nv:
                axes = int(np.linalg.matrix_rank(part.subspace[1]))
                lengths.append(ca.sumsqr(q[start - axes - 1 : start]) - 1)
        return ca.vertcat(*lengths)

    def integrate(self, q: Expression, dv: Expression) -> Expression:
        """Return q moved by the tangent vector dv, as `pinocchio.integrate` does: (nq, 1)."""
        moved, i, k = [], 0, 0
        for part in self._parts:
            moved.append(part.family.integrate(q[i : i + part.nq], dv[k : k + part.nv]))
            i, k = i + part.nq, k + part.nv
        return ca.vertcat(*moved)

    def difference(self, q: Expression, other: Expression) -> Expression:
        """Return the tangent vector from q to another configuration, as `pinocchio.difference`."""
        parts, start = [], 0
        for part in self._parts:
            here = slice(start, start + part.nq)
            parts.append(part.family.difference(q[here], other[here]))
            start += part.nq
        return ca.vertcat(*parts)

    def tangent(self, q: Expression) -> Expression:
        """Return the derivative of `integrate` by dv at dv = 0, (nq, nv): q' = tangent v."""
        blocks, start = [], 0
        for part in self._parts:
            blocks.append(part.family.tangent(q[start : start + part.nq]))
            start += part.nq
        return ca.diagcat(*blocks)


class _Family(NamedTuple):
    """Joints with coordinates of one kind."""

    placement: Callable[[Expression, Array, Array], Placement]
    """Of q and the subspace."""
    integrate: Callable[[Expression, Expression], Expression]
    difference: Callable[[Expression, Expression], Expression]
    tangent: Callable[[Expression], Expression]


class _Part(NamedTuple):
    """A joint, or one of those in a row that a composite joint consists of."""

    at: Placement
    """Where it stands in the part before."""
    family: _Family
    subspace: tuple[Array, Array]
    nq: int
    nv: int


# Joints of one coordinate -------------------------------------------------------------------------


def _screw(q: Expression, linear: Array, angular: Array) -> Placement:
    """Turn by q about, and shift by q along, the axes of the subspace."""
    turn = _turn(angular[:, 0], ca.cos(q), ca.sin(q)) if angular.any() else ca.SX.eye(3)
    return turn, sparse(linear) * q


def _turn(axis: Array, c: Expression, s: Expression) -> Expression:
    """Return the rotation about a unit axis by the angle with this cosine and sine.

    c 1 + s skew(n) + (1 - c) n n', without products where n is along a coordinate axis.
    """
    if np.count_nonzero(axis) > 1:
        n = ca.SX(axis)
        return c * ca.SX.eye(3) + s * sparse(ca.skew(ca.DM(axis))) + (1 - c) * (n @ n.T)
    along = int(np.flatnonzero(axis)[0])
    first, second = (along + 1) % 3, (along + 2) % 3
    rotation = ca.SX.eye(3)
    rotation[first, first] = rotation[second, second] = c
    rotation[first, second], rotation[second, first] = -axis[along] * s, axis[along] * s
    return rotation


def _sum(q: Expression, dv: Expression) -> Expression:
    return q + dv


def _minus(q: Expression, other: Expression) -> Expression:
    return other - q


def _identity(q: Expression) -> Expression:
    return ca.SX.eye(q.numel())


def _unbounded(q: Expression, linear: Array, angular: Array) -> Placement:
    return _turn(angular[:, 0], q[0], q[1]), ca.SX(3, 1)


def _unbounded_moved(q: Expression, dv: Expression) -> Expression:
    c, s = ca.cos(dv), ca.sin(dv)
    return _near_unit(ca.vertcat(c * q[0] - s * q[1], s * q[0] + c * q[1]))


def _unbounded_difference(q: Expression, other: Expression) -> Expression:
    (c, s), (other_c, other_s) = q.elements(), other.elements()
    return ca.atan2(c * other_s - s * other_c, c * other_c + s * other_s)


def _near_unit(x: Expression) -> Expression:
    """Return x scaled to unit length, to first order in the error of its length."""
    return x * ((3 - ca.sumsqr(x)) / 2)


def _unbounded_tangent(q: Expression) -> Expression:
    return ca.vertcat(-q[1], q[0])


# Joints of several coordinates --------------------------------------------------------------------


def _translation(q: Expression, linear: Array, angular: Array) -> Placement:
    return ca.SX.eye(3), q


def _planar(q: Expression, linear: Array, angular: Array) -> Placement:
    return _turn(_Z, q[2], q[3]), ca.vertcat(q[0], q[1], ca.SX(1, 1))


def _planar_moved(q: Expression, dv: Expression) -> Expression:
    """With the arc's chord u = (sin w, 1 - cos w) / w: (x, y) + R (u_1 d + u_2 z x d)."""
    (x, y, c, s), (dx, dy, w) = q.elements(), dv.elements()
    sinc, cosine, _ = _half_angle(w * w)
    along, across = sinc * cosine, w * sinc * sinc / 2
    dx, dy = along * dx - across * dy, across * dx + along * dy
    cw, sw = 1 - w * across, w * along
    return ca.vertcat(x + c * dx - s * dy, y + s * dx + c * dy, c * cw - s * sw, s * cw + c * sw)


def _planar_difference(q: Expression, other: Expression) -> Expression:
    """Undo the arc's chord: (d_1, d_2) = (u_1 e - u_2 z x e) / |u|^2, e = R' (p - p_q)."""
    w = _unbounded_difference(q[2:], other[2:])
    ex, ey = (_turn(_Z, q[2], q[3])[:2, :2].T @ (other[:2] - q[:2])).elements()
    sinc, cosine, _ = _half_angle(w * w)
    along, across, squared = sinc * cosine, w * sinc * sinc / 2, sinc * sinc
    dx, dy = (along * ex + across * ey) / squared, (along * ey - across * ex) / squared
    return ca.vertcat(dx, dy, w)


def _planar_tangent(q: Expression) -> Expression:
    return ca.diagcat(_turn(_Z, q[2], q[3])[:2, :2], _unbounded_tangent(q[2:]))


def _spherical(q: Expression, linear: Array, angular: Array) -> Placement:
    return rotation_of(q), ca.SX(3, 1)


def rotation_of(quaternion: Expression) -> Expression:
    """Return the rotation matrix of a unit quaternion (x, y, z, w)."""
    x, y, z, w = quaternion.elements()
    x2, y2, z2 = 2 * x, 2 * y, 2 * z
    xx, yy, zz = x * x2, y * y2, z * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    return ca.blockcat(
        [
            [1 - (yy + zz), xy - wz, xz + wy],
            [xy + wz, 1 - (xx + zz), yz - wx],
            [xz - wy, yz + wx, 1 - (xx + yy)],
        ]
    )


def _spherical_moved(q: Expression, dv: Expression) -> Expression:
    sinc, cosine, _ = _half_angle(ca.sumsqr(dv))
    return _near_unit(_product(q, sinc / 2 * dv, cosine))


def _product(q: Expression, vector: Expression, scalar: Expression) -> Expression:
    """Return the quaternion product of q and (vector, scalar)."""
    u, w = q[:3], q[3]
    return ca.vertcat(w * vector + scalar * u + ca.cross(u, vector), w * scalar - ca.dot(u, vector))


def turn_between(q: Expression, other: Expression) -> Expression:
    """Return the rotation vector of q^-1 other, of at most half a turn."""
    relative = _product(ca.vertcat(-q[:3], q[3]), other[:3], other[3])
    relative = ca.if_else(relative[3] < 0, -1, 1) * relative
    return _angle_by_sine(ca.sumsqr(relative[:3]), relative[3]) * 2 * relative[:3]


def _spherical_tangent(q: Expression) -> Expression:
    """Return the matrix of half the product of q and (v, 0)."""
    x, y, z, w = (q / 2).elements()
    return ca.blockcat([[w, -z, y], [z, w, -x], [-y, x, w], [-x, -y, -z]])


def _free(q: Expression, linear: Array, angular: Array) -> Placement:
    return rotation_of(q[3:]), q[:3]


def _free_moved(q: Expression, dv: Expression) -> Expression:
    """Move along a screw: p + R (v + (1 - cos t)/t^2 w x v + (t - sin t)/t^3 w x (w x v)).

    The quaternion's sign is the one nearer to the old one's.
    """
    v, w = dv[:3], dv[3:]
    sinc, cosine, cubic = _half_angle(ca.sumsqr(w))
    across = ca.cross(w, v)
    chord = v + sinc * sinc / 2 * across + cubic * ca.cross(w, across)
    quaternion = _near_unit(_product(q[3:], sinc / 2 * w, cosine))
    sign = ca.if_else(cosine < 0, -1, 1)
    return ca.vertcat(q[:3] + rotation_of(q[3:]) @ chord, sign * quaternion)


def _free_difference(q: Expression, other: Expression) -> Expression:
    """Undo the screw's chord: v = e - w x e / 2 + k w x (w x e), e = R' (p - p_q)."""
    w = turn_between(q[3:], other[3:])
    e = rotation_of(q[3:]).T @ (other[:3] - q[:3])
    squared = ca.sumsqr(w)
    factor, _ = beta(squared)
    across = ca.cross(w, e)
    return ca.vertcat(e - across / 2 + factor * ca.cross(w, across), w)


def _free_tangent(q: Expression) -> Expression:
    return ca.diagcat(rotation_of(q[3:]), _spherical_tangent(q[3:]))


def _half_angle(squared: Expression) -> tuple[Expression, Expression, Expression]:
    """Return sin(t/2)/(t/2), cos(t/2) and (t - sin t)/t^3 of t^2, smooth at t = 0."""
    small = squared < _SMALL
    large = ca.fmax(squared, _SMALL)  # what is not chosen stays finite, and so its derivatives
    half = ca.sqrt(large) / 2
    sinc, cosine = ca.sin(half) / half, ca.cos(half)
    cubic = (1 - sinc * cosine) / large
    y = squared / 4
    return (
        ca.if_else(small, _series(y, (6, 20, 42, 72, 110)), sinc),
        ca.if_else(small, _series(y, (2, 12, 30, 56, 90)), cosine),
        ca.if_else(small, _series(squared, (20, 42, 72, 110, 156)) / 6, cubic),
    )


def beta(squared: Expression) -> tuple[Expression, Expression]:
    """Return beta and its derivative by t = r . r; see `constraints.rotation_vector`."""
    sinc, cosine, _ = _half_angle(squared)
    c, small, t = cosine / sinc, squared < _TINY, ca.fmax(squared, _TINY)
    value = (1 - c) / t
    slope = -((c - c * c) / (2 * t) - 1 / 8 + value) / t
    return (
        ca.if_else(small, 1 / 12 + squared / 720 + squared * squared / 30240, value),
        ca.if_else(small, 1 / 720 + squared / 15120 + squared * squared / 403200, slope),
    )


def _angle_by_sine(squared: Expression, cosine: Expression) -> Expression:
    """Return t / sin t of sin^2 t and cos t >= 0, smooth at t = 0."""
    sine = ca.sqrt(ca.fmax(squared, _TINY))
    series = 1 + squared * (1 / 6 + squared * (3 / 40 + squared * 15 / 336))
    return ca.if_else(squared < _TINY, series, ca.atan2(sine, cosine) / sine)


def _series(x: Expression, ratios: tuple[int, ...]) -> Expression:
    """Return 1 - x/r_1 (1 - x/r_2 (1 - ...))."""
    result = ca.SX(1)
    for ratio in reversed(ratios):
        result = 1 - x / ratio * result
    return result


# Types --------------------------------------------------------------------------------------------

_ONE = _Family(_screw, _sum, _minus, _identity)
_FAMILIES = {
    **dict.fromkeys(("RX", "RY", "RZ", "RevoluteUnaligned"), _ONE),
    **dict.fromkeys(("PX", "PY", "PZ", "PrismaticUnaligned"), _ONE),
    **dict.fromkeys(("HX", "HY", "HZ", "HelicalUnaligned"), _ONE),
    **dict.fromkeys(
        ("RUBX", "RUBY", "RUBZ", "RevoluteUnboundedUnaligned"),
        _Family(_unbounded, _unbounded_moved, _unbounded_difference, _unbounded_tangent),
    ),
    "Translation": _Family(_translation, _sum, _minus, _identity),
    "Planar": _Family(_planar, _planar_moved, _planar_difference, _planar_tangent),
    "Spherical": _Family(_spherical, _spherical_moved, turn_between, _spherical_tangent),
    "FreeFlyer": _Family(_free, _free_moved, _free_difference, _free_tangent),
}


def _type(joint: Any) -> str:
    return str(joint.shortname()).removeprefix("JointModel")


def _part(at: Any, joint: Any, name: str) -> _Part:
    kind = _type(joint)
    if kind not in _FAMILIES:
        raise MechanismError(
            f"no code can be generated for joint {name!r} of type {kind}; types that can be taken: "
            f"{', '.join(_FAMILIES)}, and those that split() makes of them"
        )
    placement = sparse(clean(at.rotation)), sparse(clean(at.translation))
    return _Part(placement, _FAMILIES[kind], _subspace(joint, name), joint.nq, joint.nv)


def _members(joint: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the placement of each part of a joint, in the part before, and its model."""
    here = pin.SE3.Identity()
    if _type(joint) != "Composite":
        yield here, joint
        return
    composite = joint.extract()
    for placement, member in zip(composite.jointPlacements, composite.joints, strict=True):
        for number, (at, part) in enumerate(_members(member)):
            yield at if number else placement * at, part


def _subspace(joint: Any, name: str) -> tuple[Array, Array]:
    """Return S_l and S_a, each (3, nv), or refuse a joint whose S depends on q."""
    alone = pin.Model()
    index = alone.addJoint(0, joint, pin.SE3.Identity(), "joint")
    model = alone.joints[index]
    neutral = pin.neutral(alone)
    tangents = [np.cos(1.0 + k + np.arange(alone.nv)) for k in range(3)]
    data, found = model.createData(), []
    for q in [neutral] + [pin.integrate(alone, neutral, tangent) for tangent in tangents]:
        model.calc(data, q)
        found.append(np.array(data.S).reshape(6, alone.nv))
    change = np.abs(np.subtract(found, found[0])).max()
    if change > 1e-9 * max(1.0, np.abs(found[0]).max()):
        raise MechanismError(
            f"no code can be generated for joint {name!r} of type {_type(joint)}: its motion "
            f"subspace changes with its coordinates (by {change:.2g}); pass the model through "
            "split() first"
        )
    subspace = clean(found[0])
    return subspace[:3], subspace[3:]

"""Gaps, Jacobian and constraint bias of loop closures as sparse CasADi expressions.

The rows are those of `closed_loop.constraints.rows`, unscaled. Let e be the vector from b's origin
to a's. Rows of spherical, rigid and distance closures come from the motions of a and of b relative
to the nearest joint that carries both, in that joint's axes; those of the other kinds from the
motion of b relative to a, in a's axes. Either way the columns of the joints that carry both ends
are structurally zero. Biases are accelerations at constant v; nothing is differentiated.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import casadi as ca
import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import JointCoupling, LoopClosure
from rps_pin.closed_loop.constraints.couplings import coupling_row
from rps_pin.closed_loop.constraints.equations import ClosureEquations
from rps_pin.closed_loop.constraints.frame_coordinates import FrameCoordinates
from rps_pin.closed_loop.constraints.rows import across
from rps_pin.codegen.expressions.chains import Chains, End, Motion, constant, cross, tidy
from rps_pin.codegen.expressions.joints import Expression, beta
from rps_pin.codegen.expressions.tree import Tree

#: A sine that vanishes beside rounding errors, in place of 0 in the quotient of an angle and its
#: sine. Its square is a normal number in single precision too.
_TINY = 2.0**-62
#: A direction that is perpendicular to no likely axis.
_ANY = np.array([1.0, 0.7, 0.4])


class _Rows(NamedTuple):
    """Rows of one closure."""

    gap: Expression
    jacobian: Expression
    rate: Expression
    bias: Expression
    apart: Expression = 0.0
    """Sum of the squared gaps of points, m^2."""
    turned: Expression = 0.0
    """Sum of the squared gaps of angles, rad^2, of which some are replaced by chords."""


class _InWorld(NamedTuple):
    """A closure whose rows are the package's when turned to world axes."""

    rows: slice
    joint: int
    """The nearest common ancestor, in whose axes they are."""
    is_point: bool
    """Whether it is spherical."""


class Carrier(NamedTuple):
    """Motion of the body in whose axes some rows are, in those axes; it is not the world."""

    rows: slice
    """Of one closure."""
    is_point: bool
    """Whether the closure is spherical."""
    spin_jacobian: Expression
    """Shape (3, nv)."""
    spin: Expression
    """Angular velocity, shape (3,)."""
    spin_rate: Expression
    """Its derivative at constant v, shape (3,)."""


class ClosureRows:
    """Rows of all closures of a mechanism, stacked in order.

    Attributes
    ----------
    gap, rate, bias : SX, (nc, 1)
        The gaps, m and rad; J v; and J' v, the derivative of J along the motion.
    jacobian : SX, (nc, nv)
        J, sparse.
    opening : SX, (1, 1)
        Sum of the squared gaps of all closures, m^2, to second order in the gaps, and cheaper than
        these: an angle t counts as 2 sin(t / 2) at the mechanism's characteristic length.
    """

    def __init__(
        self,
        tree: Tree,
        chains: Chains,
        parts: list[_Rows],
        in_world: list[_InWorld],
        length: float,
    ) -> None:
        self._tree, self._chains, self._in_world = tree, chains, in_world
        nv = tree.v.numel()
        self.gap = tidy(ca.vertcat(ca.SX(0, 1), *(part.gap for part in parts)))
        self.jacobian = tidy(ca.vertcat(ca.SX(0, nv), *(part.jacobian for part in parts)))
        self.rate = tidy(ca.vertcat(ca.SX(0, 1), *(part.rate for part in parts)))
        self.bias = tidy(ca.vertcat(ca.SX(0, 1), *(part.bias for part in parts)))
        turned = sum((part.turned for part in parts), ca.SX(1, 1))
        self.opening = tidy(sum((part.apart for part in parts), length**2 * turned))

    def in_package(self, x: Expression) -> Expression:
        """Turn rows (nc, k), or multipliers, from these axes to those of `ClosureEquations`.

        This is exact for gaps, multipliers, and the Jacobian and bias where the loops are closed
        and v keeps them closed; `package_jacobian` and `package_bias` are exact everywhere.
        """
        result = ca.SX(x)
        for closure in self._in_world:
            if closure.joint:
                turn, _ = self._tree.world(closure.joint)
                for start in range(closure.rows.start, closure.rows.stop, 3):
                    result[start : start + 3, :] = turn @ result[start : start + 3, :]
        return result

    def package_jacobian(self) -> Expression:
        """Return the J of `ClosureEquations`, (nc, nv), also where the loops are open.

        With w the angular velocity of the common ancestor, R its rotation and e a spherical
        closure's gap, all in world axes, the gap's rate has the additional term w x e.
        """
        result, gaps = self.in_package(self.jacobian), self.in_package(self.gap)
        for closure in self._in_world:
            if closure.joint and closure.is_point:
                carried = self._carrier(closure.joint).spin_jacobian
                result[closure.rows, :] -= ca.skew(gaps[closure.rows]) @ carried
        return tidy(result)

    def package_bias(self) -> Expression:
        """Return the J' v of `ClosureEquations`, (nc, 1), for any v and open loops too.

        In addition to R J' v: w x R J v for a rigid closure; 2 w x R J v + w' x e + w x (w x e)
        for a spherical one.
        """
        result, gaps = self.in_package(self.bias), self.in_package(self.gap)
        rates = self.in_package(self.rate)
        for closure in self._in_world:
            if not closure.joint:
                continue
            carrier = self._carrier(closure.joint)
            for start in range(closure.rows.start, closure.rows.stop, 3):
                here = slice(start, start + 3)
                result[here] += cross(carrier.spin, rates[here])
                if closure.is_point:
                    moved = rates[here] + cross(carrier.spin, gaps[here])
                    result[here] += cross(carrier.spin, moved)
                    result[here] += cross(carrier.spin_rate, gaps[here])
        return tidy(result)

    def carriers(self) -> list[Carrier]:
        """Return the moving common ancestors of spherical and rigid closures."""
        found = []
        for closure in self._in_world:
            if closure.joint:
                turn, _ = self._tree.world(closure.joint)
                motion = self._carrier(closure.joint)
                own = (motion.spin_jacobian, motion.spin, motion.spin_rate)
                turned = (tidy(turn.T @ one) for one in own)
                found.append(Carrier(closure.rows, closure.is_point, *turned))
        return found

    def _carrier(self, joint: int) -> Motion:
        """Return a joint's motion relative to the world."""
        return self._chains.from_joint(0, End(joint, ca.SX.eye(3), ca.SX(3, 1)))


def closure_rows(tree: Tree, equations: ClosureEquations) -> ClosureRows:
    """Return the rows of all closures of a mechanism.

    Parameters
    ----------
    tree
        Of the split model. The closures' frames stand where its `parameters` say.
    equations
        The mechanism's closures; their model may be the one before `split`.

    Raises
    ------
    MechanismError
        If a frame or joint of a closure is not in the tree.
    """
    chains, parts, in_world, start = Chains(tree), [], [], 0
    for closure in equations.closures:
        rows = slice(start, start + closure.size)
        start = rows.stop
        if isinstance(closure, JointCoupling):
            parts.append(_coupling(tree, closure, bool(equations.angular_rows[rows.start])))
            continue
        ends = _ends(tree, closure)
        if isinstance(closure, FrameCoordinates):
            parts.append(_coordinates(tree, chains, ends, closure))
            continue
        parts.append(_KINDS[closure.kind](chains, ends, closure))
        if closure.kind in ("spherical", "rigid"):
            root = chains.ancestor(ends[0].joint, ends[1].joint)
            in_world.append(_InWorld(rows, root, closure.kind == "spherical"))
    return ClosureRows(tree, chains, parts, in_world, equations.length)


_Ends = tuple[End, End]


def _ends(tree: Tree, closure: LoopClosure) -> _Ends:
    """Return the two frames of a closure."""
    frames = closure.closed_frames(tree.model)
    placements = tree.parameters.closure_placements(closure.name)
    a, b = (
        End(frame.joint, tidy(ca.SX(rotation)), tidy(ca.SX(origin)))
        for frame, (rotation, origin) in zip(frames, placements, strict=True)
    )
    return a, b


def _coupling(tree: Tree, coupling: JointCoupling, angular: bool) -> _Rows:
    """Q_joint - offset - sum of p(q_other) = 0; its J' v is -sum of p'' v^2."""
    one = coupling_row(coupling, tree.model, 0)
    jacobian, bias = ca.SX(1, tree.v.numel()), ca.SX(1, 1)
    gap, jacobian[0, one.idx_v] = tree.q[one.idx_q] - one.constant, 1.0
    for term in one.terms:
        p, first, second, _ = term.derivatives(tree.q[term.idx_q])
        gap, jacobian[0, term.idx_v] = gap - p, -first
        bias -= second * tree.v[term.idx_v] ** 2
    rows = _Rows(gap, jacobian, jacobian @ tree.v, ca.sparsify(bias))
    return rows._replace(turned=gap**2) if angular else rows._replace(apart=gap**2)


# Rows in the common ancestor's axes ---------------------------------------------------------------


def _from_ancestor(chains: Chains, ends: _Ends) -> tuple[Motion, Motion]:
    """Return the motions of a and b, derivatives of b's origin with a changed sign."""
    root = chains.ancestor(ends[0].joint, ends[1].joint)
    return chains.from_joint(root, ends[0]), chains.from_joint(root, ends[1], sign=-1)


def _point_to_point(a: Motion, b: Motion) -> _Rows:
    """E = x_a - x_b and its derivatives."""
    gap = tidy(a.origin - b.origin)
    return _Rows(
        gap,
        tidy(a.jacobian + b.jacobian),
        tidy(a.velocity + b.velocity),
        tidy(a.acceleration + b.acceleration),
        apart=ca.sumsqr(gap),
    )


def _spherical(chains: Chains, ends: _Ends, closure: LoopClosure) -> _Rows:
    return _point_to_point(*_from_ancestor(chains, ends))


def _rigid(chains: Chains, ends: _Ends, closure: LoopClosure) -> _Rows:
    """Velocity of a less that of b, both at a's origin: e' - w_b x e; and w_a - w_b."""
    a, b = _from_ancestor(chains, ends)
    gap, jacobian, rate, bias, apart, _ = _point_to_point(a, b)
    turn, turned = _turn_between(a.rotation, b.rotation)
    return _Rows(
        ca.vertcat(gap, turn),
        ca.vertcat(jacobian + ca.skew(gap) @ b.spin_jacobian, a.spin_jacobian - b.spin_jacobian),
        ca.vertcat(rate - cross(b.spin, gap), a.spin - b.spin),
        ca.vertcat(bias - cross(b.spin_rate, gap) - cross(b.spin, rate), a.spin_rate - b.spin_rate),
        apart,
        turned,
    )


def _distance(chains: Chains, ends: _Ends, closure: LoopClosure) -> _Rows:
    """L - |e|, with u = -e / |e|: rate u . e'; J' v = u . e'' - (e'^2 - (u . e')^2) / |e|."""
    rod = chains.tree.parameters.rod(closure.name)
    a, b = _from_ancestor(chains, ends)
    e, _, rate, bias, square, _ = _point_to_point(a, b)
    length = ca.sqrt(square)
    u = e / -length
    along = u.T @ rate
    across_square = (rate.T @ rate - along**2) / length
    gap, jacobian = rod - length, a.along(u) + b.along(u)
    return _Rows(gap, jacobian, along, u.T @ bias - across_square, apart=gap**2)


# Rows in frame a's axes ---------------------------------------------------------------------------


def _selected(
    points: Callable[[LoopClosure], Array],
    turns: Callable[[Motion, LoopClosure], _Rows] | None = None,
) -> Callable[[Chains, _Ends, LoopClosure], _Rows]:
    """Return rows that hold b's origin across directions in a, and rows that hold b's rotation."""

    def rows(chains: Chains, ends: _Ends, closure: LoopClosure) -> _Rows:
        motion, directions = chains.between(*ends, sign=-1), constant(points(closure))
        gap, jacobian = -directions @ motion.origin, directions @ motion.jacobian
        rate, bias = directions @ motion.velocity, directions @ motion.acceleration
        if turns is None:
            return _Rows(gap, jacobian, rate, bias, ca.sumsqr(gap))
        turning = turns(motion, closure)
        return _Rows(
            ca.vertcat(gap, turning.gap),
            ca.vertcat(jacobian, turning.jacobian),
            ca.vertcat(rate, turning.rate),
            ca.vertcat(bias, turning.bias),
            ca.sumsqr(gap),
            turning.turned,
        )

    return rows


def _coordinates(tree: Tree, chains: Chains, ends: _Ends, closure: FrameCoordinates) -> _Rows:
    """Coordinates of b in a, less what joints hold: x - p, and x - r with r' = A w.

    A' w = -r' x w / 2 + beta (r' x (r x w) + r x (r' x w)) + beta' r x (r x w).
    """
    motion = chains.between(*ends, sign=-1)
    joints = [tree.model.joints[tree.model.getJointId(name)] for name in closure.joints]
    held = ca.vertcat(*(tree.q[joint.idx_q] for joint in joints))
    columns = ca.SX(closure.size, tree.v.numel())
    for row, joint in enumerate(joints):
        columns[row, joint.idx_v] = 1
    axes, count = np.eye(3), len(closure.linear)
    directions, turning = constant(axes[[*closure.linear]]), constant(axes[[*closure.angular]])
    gap = held[:count] - directions @ motion.origin
    jacobian, rate = directions @ motion.jacobian, directions @ motion.velocity
    bias, turned = directions @ motion.acceleration, ca.SX(1, 1)
    if closure.angular:
        r, spin = _nearer_vector(motion.rotation, held[count:], turning), motion.spin
        squared = ca.sumsqr(r)
        value, slope = beta(squared)
        rates = ca.SX.eye(3) - ca.skew(r) / 2 + value * (r @ r.T - squared * ca.SX.eye(3))
        r_rate = rates @ spin
        across, moved = cross(r, spin), cross(r_rate, spin)
        change = value * (cross(r_rate, across) + cross(r, moved)) - moved / 2
        change += 2 * slope * (r.T @ r_rate) * cross(r, across)
        away = held[count:] - turning @ r
        gap, turned = ca.vertcat(gap, away), ca.sumsqr(away)
        jacobian = ca.vertcat(jacobian, -turning @ (rates @ motion.spin_jacobian))
        rate = ca.vertcat(rate, -turning @ r_rate)
        bias = ca.vertcat(bias, -turning @ (change + rates @ motion.spin_rate))
    apart = ca.sumsqr(gap[:count])
    return _Rows(gap, jacobian + columns, rate + columns @ tree.v, bias, apart, turned)


def _nearer_vector(rotation: Expression, near: Expression, chosen: Expression) -> Expression:
    """Return the rotation vector whose chosen components are nearer: r, or r less a whole turn."""
    x, y, z, w = ca.vertsplit(_quaternion(rotation))
    sine = ca.vertcat(x, y, z) * ca.copysign(1, w)
    length = ca.sqrt(ca.sumsqr(sine))
    shorter = length < _TINY  # beside w, which is 1 at least where it is the largest
    angle = 2 * ca.atan2(length, ca.fabs(w))
    r = ca.if_else(shorter, 2 / ca.fmax(ca.fabs(w), 1), angle / ca.fmax(length, _TINY)) * sine
    other = r * (1 - 2 * np.pi / angle)
    nearer = ca.sumsqr(chosen @ other - near) < ca.sumsqr(chosen @ r - near)
    return ca.if_else(nearer, other, r)


def _whole(closure: LoopClosure) -> Array:
    return np.eye(3)


def _line(closure: LoopClosure) -> Array:
    return across(np.array(closure.axis))


def _plane(closure: LoopClosure) -> Array:
    return np.array([closure.axis])


def _frame(motion: Motion, closure: LoopClosure) -> _Rows:
    """-log R, -w: the frames stay parallel."""
    gap, turned = _turn_between(ca.SX.eye(3), motion.rotation)
    return _Rows(gap, -motion.spin_jacobian, -motion.spin, -motion.spin_rate, turned=turned)


def _crosswise(motion: Motion, closure: LoopClosure) -> _Rows:
    """M . n: the axes stay perpendicular."""
    m = constant(np.array([closure.axis]))
    n = tidy(motion.rotation @ constant(np.array(closure.axis_b)))
    gap = m @ n
    return _Rows(gap, *_turning(m, n, motion), turned=gap**2)


def _parallel(motion: Motion, closure: LoopClosure) -> _Rows:
    """Rotation vector from b's axis n to a's: the axes stay parallel."""
    axis = np.array(closure.axis)
    n = tidy(motion.rotation @ constant(np.array(closure.axis_b)))
    sines = constant(np.cross(axis, across(axis)))  # (n x axis) . t = n . (axis x t)
    turn, cosine = tidy(sines @ n), constant(axis).T @ n
    # Opposite axes have no sine, and any direction across will do.
    gap = _rotation_vector(turn, cosine, constant(np.array([1.0, 0.0])))
    return _Rows(gap, *_turning(sines, n, motion), turned=2 * (1 - cosine))


def _turning(
    m: Expression, n: Expression, motion: Motion
) -> tuple[Expression, Expression, Expression]:
    """Return J, J v and J' v of m . n, m (k, 3) fixed: n' = w x n, n'' = w' x n + w x n'."""
    moving = cross(motion.spin, n)
    lever = tidy(-m @ ca.skew(n))  # m . (w x n) = (n x m) . w
    return (
        lever @ motion.spin_jacobian,
        m @ moving,
        m @ tidy(cross(motion.spin_rate, n) + cross(motion.spin, moving)),
    )


def _turn_between(a: Expression, b: Expression) -> tuple[Expression, Expression]:
    """Return -log(R_b R_a') of the rotations (3, 3) of two frames, (3, 1), rad, and its chord^2.

    The sine is half the sum of b_i x a_i over their columns, and 2 (1 - cosine) = 3 - trace.
    """
    columns = list(zip(ca.horzsplit(a), ca.horzsplit(b), strict=True))
    sine: Expression = ca.SX(3, 1)
    trace: Expression = ca.SX(1, 1)
    for of_a, of_b in columns:
        sine, trace = sine + cross(of_b, of_a) / 2, trace + of_b.T @ of_a
    # Half a turn has no sine; (R + 1) projects on its axis.
    axis = (b @ a.T + ca.SX.eye(3)) @ constant(_ANY)
    return _rotation_vector(sine, (trace - 1) / 2, axis), 3 - trace


def _rotation_vector(sine: Expression, cosine: Expression, otherwise: Expression) -> Expression:
    """Return the rotation vector along `sine`, or along `otherwise` where its angle is half a turn.

    angle * sine / |sine|; the quotient of angle and sine is 1 at 0, with finite derivatives.
    """
    backward = cosine < 0
    sine = sine + _TINY * backward * otherwise
    length = ca.sqrt(ca.sumsqr(sine) + _TINY**2 * (1 - backward))
    return ca.atan2(length, cosine) / length * sine


def _quaternion(rotation: Expression) -> Expression:
    """Return a multiple of (x, y, z, w), from the largest of them: so no digits are lost."""
    (a, d, g), (b, e, h), (c, f, i) = (ca.vertsplit(one) for one in ca.horzsplit(rotation))
    columns = [
        ca.vertcat(1 + a - e - i, b + d, c + g, h - f),
        ca.vertcat(b + d, 1 - a + e - i, f + h, c - g),
        ca.vertcat(c + g, f + h, 1 - a - e + i, d - b),
        ca.vertcat(h - f, c - g, d - b, 1 + a + e + i),
    ]
    found, square = columns[3], columns[3][3]
    for k in range(3):
        larger = columns[k][k] > square
        found = ca.if_else(larger, columns[k], found)
        square = ca.fmax(square, columns[k][k])
    return found


_KINDS: dict[str, Callable[[Chains, _Ends, LoopClosure], _Rows]] = {
    "spherical": _spherical,
    "rigid": _rigid,
    "revolute": _selected(_whole, _parallel),
    "prismatic": _selected(_line, _frame),
    "cylindrical": _selected(_line, _parallel),
    "universal": _selected(_whole, _crosswise),
    "planar": _selected(_plane, _parallel),
    "point_on_line": _selected(_line),
    "point_on_plane": _selected(_plane),
    "distance": _distance,
}

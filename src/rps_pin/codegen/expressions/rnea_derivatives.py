"""Derivatives of a tree's inverse dynamics in closed form.

With the twists S of a joint's velocities, and with its parent's motion v_p, a_p and its own v,

    S1 = v_p x S,    S2 = a_p x S + v_p x S1,    Z = (v_p + v) x S,

with the inertia I and force f of all bodies from joint i on, and with the matrix 2 C of the forces
2 mu (m x u) that act on points of mass mu and velocity u when they turn by m,

    d tau_i / d q_j = S_i' (2 C S1_j + I S2_j),             d tau_i / d v_j = S_i' (2 C S_j + I Z_j)
    d tau_j / d q_i = S_j' (2 C S1_i + I S2_i + S_i x f),   d tau_j / d v_i = S_j' (2 C S_i + I Z_i)

where joint j carries i, or in the first line is i (Singh, Russell and Wensing, "Efficient
analytical derivatives of rigid-body dynamics using spatial vector algebra", 2022). Derivatives by q
are along the tangent of the configuration. For trees with many joints these are half as many
operations as CasADi's derivative of the algorithm; for those with few, as many.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from rps_pin.codegen.expressions.joints import Expression
from rps_pin.codegen.expressions.parameters import Inertia, moved_inertia, summed
from rps_pin.codegen.expressions.tree import BodyMotion, Tree, Wrench, cross, inertial_force, skew

#: Linear and angular velocities or accelerations of several motions, each of shape (3, k).
_Twist = tuple[Expression, Expression]


def rnea_derivatives(
    tree: Tree, v: Expression, a: Expression, gravity: bool = True
) -> tuple[Expression, Expression]:
    """Return the derivatives of ``tree.rnea(v, a, gravity)`` by q and by v, each (nv, nv), sparse.

    Parameters
    ----------
    tree
        The open tree.
    v, a
        Shape (nv, 1); structural zeros save operations.
    gravity
        Whether bodies have weight.
    """
    motions, nv = tree.body_motions(v, a, gravity), tree.model.nv
    velocities = _velocities(tree, v, motions)
    bodies = [
        _Composite(body, inertial_force(body, motion), *_moving(body, motion.turning.w, linear))
        for body, motion, (linear, _) in zip(tree.bodies, motions, velocities, strict=True)
    ]
    columns = [_Columns(*(ca.SX(3, nv) for _ in range(7))) for _ in tree.parents]
    by_q, by_v = ca.SX(nv, nv), ca.SX(nv, nv)
    for i in range(len(tree.parents) - 1, 0, -1):
        twists, (linear, angular, own) = (
            _twists(tree, i, motions[i], velocities[i]),
            tree.motions[i],
        )
        all_, (s1, s2, z) = columns[i], twists
        all_.set(own, bodies[i], (linear, angular), twists)
        by_q[own, :] = linear.T @ all_.force_q + angular.T @ all_.moment_q
        by_v[own, :] = linear.T @ all_.force_v + angular.T @ all_.moment_v
        by_q[:, own] = all_.momentum.T @ s2[0] + all_.about.T @ s2[1] + all_.turning.T @ s1[1]
        by_v[:, own] = all_.momentum.T @ z[0] + all_.about.T @ z[1] + all_.turning.T @ angular
        if parent := tree.parents[i]:
            bodies[parent] = bodies[parent].with_child(tree, i, bodies[i])
            columns[parent] = columns[parent].with_child(tree, i, all_)
    return ca.sparsify(by_q), ca.sparsify(by_v)


def _twists(
    tree: Tree, joint: int, motion: BodyMotion, velocities: _Twist
) -> tuple[_Twist, _Twist, _Twist]:
    """Return S1, S2 and Z of a joint, given the velocities of its origin and its parent there."""
    linear, angular, _ = tree.motions[joint]
    (of_body, of_parent), w, subspace = velocities, motion.carried.w, (linear, angular)
    s1 = _crossed((of_parent, w), subspace)
    acceleration = motion.carried_acceleration - cross(w, of_parent)
    by_acceleration = _crossed((acceleration, motion.carried.dw), subspace)
    s2 = _plus(by_acceleration, _crossed((of_parent, w), s1))
    return s1, s2, _crossed((of_parent + of_body, w + motion.turning.w), subspace)


class _Columns(NamedTuple):
    """Of each velocity of a joint and of those it carries, in its axes, shape (3, nv) each."""

    momentum: Expression
    about: Expression
    """I S."""
    turning: Expression
    """The moment of (2 C)' S; its force is zero."""
    force_q: Expression
    moment_q: Expression
    """2 C S1 + I S2 + S x f."""
    force_v: Expression
    moment_v: Expression
    """2 C S + I Z."""

    def set(
        self,
        own: slice,
        bodies: _Composite,
        subspace: _Twist,
        twists: tuple[_Twist, _Twist, _Twist],
    ) -> None:
        """Set the columns of the joint itself; its parts are changed in place."""
        (linear, angular), (s1, s2, z), (force, moment) = subspace, twists, bodies.force
        turned = -skew(force) @ angular, -skew(moment) @ angular - skew(force) @ linear
        new = (
            *bodies.times(subspace),
            bodies.transposed_turning(subspace),
            *_plus(_plus(bodies.turning(s1[1]), bodies.times(s2)), turned),
            *_plus(bodies.turning(angular), bodies.times(z)),
        )
        for part, columns in zip(self, new, strict=True):
            part[:, own] = columns

    def with_child(self, tree: Tree, joint: int, child: _Columns) -> _Columns:
        """Return these, of the parent of a joint, with the joint's own."""
        momentum = tree.onto_parent(joint, (child[0], child[1]), (self[0], self[1]))
        turning = self.turning + tree.placement[joint][0] @ child.turning
        by_q = tree.onto_parent(joint, (child[3], child[4]), (self[3], self[4]))
        by_v = tree.onto_parent(joint, (child[5], child[6]), (self[5], self[6]))
        return _Columns(*momentum, turning, *by_q, *by_v)


class _Composite(NamedTuple):
    """Bodies that are carried by a joint as one, in the joint's axes about its origin."""

    inertia: Inertia
    force: Wrench
    momentum: Expression
    """Sum of mu u, kg m/s, shape (3, 1)."""
    moment: Expression
    """K, the sum of mu skew(r) skew(u) over points at r, shape (3, 3)."""

    def times(self, twist: _Twist) -> Wrench:
        """Return I m."""
        (mass, first, inertia), (linear, angular) = self.inertia, twist
        lever = skew(first)
        return mass * linear - lever @ angular, lever @ linear + inertia @ angular

    def turning(self, angular: Expression) -> Wrench:
        """Return 2 C m: -2 skew(momentum) m and -2 K m."""
        return skew(-2 * self.momentum) @ angular, -2 * self.moment @ angular

    def transposed_turning(self, twist: _Twist) -> Expression:
        """Return the moment of (2 C)' m."""
        linear, angular = twist
        return skew(2 * self.momentum) @ linear - 2 * self.moment.T @ angular

    def with_child(self, tree: Tree, joint: int, child: _Composite) -> _Composite:
        """Return these bodies, of the parent of a joint, with the joint's own."""
        rotation, origin = tree.placement[joint]
        momentum = rotation @ child.momentum
        moment = rotation @ child.moment @ rotation.T + skew(origin) @ skew(momentum)
        return _Composite(
            summed(self.inertia, moved_inertia(child.inertia, tree.placement[joint])),
            tree.onto_parent(joint, child.force, self.force),
            self.momentum + momentum,
            self.moment + moment,
        )


def _velocities(tree: Tree, v: Expression, motions: list[BodyMotion]) -> list[_Twist]:
    """Return the velocity of each joint's origin, and of its parent's point there."""
    none = ca.SX(3, 1)
    result = [(none, none)]
    for i in range(1, len(tree.parents)):
        parent, (rotation, origin) = tree.parents[i], tree.placement[i]
        linear, _, own = tree.motions[i]
        carried = rotation.T @ (result[parent][0] + cross(motions[parent].turning.w, origin))
        result.append((carried + linear @ v[own], carried))
    return result


def _moving(body: Inertia, w: Expression, linear: Expression) -> tuple[Expression, Expression]:
    """Return momentum and K = skew(h) skew(linear) + skew(w) (tr(I)/2 1 - I) of one body."""
    mass, first, inertia = body
    second_moment = ca.trace(inertia) / 2 * ca.SX.eye(3) - inertia
    return mass * linear + cross(w, first), skew(first) @ skew(linear) + skew(w) @ second_moment


def _crossed(by: _Twist, twist: _Twist) -> _Twist:
    """Return the product by x twist of a motion (3, 1) and several."""
    (v, w), (linear, angular) = by, twist
    return skew(w) @ linear + skew(v) @ angular, skew(w) @ angular


def _plus(one: _Twist, other: _Twist) -> _Twist:
    return one[0] + other[0], one[1] + other[1]

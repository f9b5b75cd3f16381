"""Kinematics and dynamics of an open tree as sparse CasADi expressions.

All vectors of a body are in the axes of its joint's frame, at its origin. With E = R' the rotation
from the parent's axes, p the joint's origin in the parent's frame, w and dw the angular velocity
and acceleration, and A the classical acceleration of the origin, gravity subtracted,

    w = E w_p + S_a v,    dw = E dw_p + S_a a + w x S_a v,
    A = E (A_p + B_p p) + S_l a + (w + E w_p) x S_l v,    B = skew(dw) + skew(w)^2,
    f = m A + B h,        n = I dw + w x I w + h x A,

with mass m, first moment h = m c and inertia I about the origin. No linear velocity is needed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rps_pin.arrays import Array
from rps_pin.codegen.expressions.joints import Expression, Joint, Placement, sparse
from rps_pin.codegen.expressions.parameters import Inertia, Parameters, moved_inertia, summed
from rps_pin.errors import MechanismError

#: Force and moment about a point, each of shape (3, k).
Wrench = tuple[Expression, Expression]


class Turning:
    """Angular velocity w and acceleration dw of a body, and what points of it have from them."""

    def __init__(self, w: Expression, dw: Expression) -> None:
        self.w, self.dw = w, dw

    @cached_property
    def squares(self) -> list[Expression]:
        """Of w's entries."""
        return [x * x for x in ca.vertsplit(self.w)]

    @cached_property
    def products(self) -> list[Expression]:
        """Of the two other entries of w: w_y w_z, w_z w_x, w_x w_y."""
        x, y, z = ca.vertsplit(self.w)
        return [y * z, z * x, x * y]

    @cached_property
    def tensor(self) -> Expression:
        """B = skew(dw) + skew(w)^2: points at r are accelerated by B r against the origin."""
        (xx, yy, zz), (yz, zx, xy) = self.squares, self.products
        x, y, z = ca.vertsplit(self.dw)
        return ca.blockcat(
            [
                [-(yy + zz), xy - z, zx + y],
                [xy + z, -(zz + xx), yz - x],
                [zx - y, yz + x, -(xx + yy)],
            ]
        )


class BodyMotion(NamedTuple):
    """Motion of a body, in its joint's axes; accelerations of points with gravity subtracted."""

    turning: Turning
    acceleration: Expression
    """A, of the origin."""
    carried: Turning
    """Of the parent."""
    carried_acceleration: Expression
    """Of the parent's point at the origin."""


def inertial_force(body: Inertia, motion: BodyMotion) -> Wrench:
    """Return f and n of one body: the products of w are those that B holds already."""
    mass, first, inertia = body
    dw, tensor, moments = motion.turning.dw, motion.turning.tensor, []
    for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        # Row x of I dw + w x I w.
        moments.append(
            inertia[x, x] * dw[x]
            + (inertia[z, z] - inertia[y, y]) * motion.turning.products[x]
            + inertia[y, z] * (motion.turning.squares[y] - motion.turning.squares[z])
            - inertia[x, y] * tensor[z, x]
            + inertia[x, z] * tensor[y, x]
        )
    moment = ca.vertcat(*moments) + cross(first, motion.acceleration)
    return mass * motion.acceleration + tensor @ first, moment


class Tree:
    """An open tree whose joints have constant motion subspaces.

    Parameters
    ----------
    model
        A `pinocchio.Model` that passed through `closed_loop.editing.split.split`.
    parameters
        Its placements, inertias and gravity, some of them symbols.

    Attributes
    ----------
    q, v, a : SX
        Symbols of shapes (nq, 1), (nv, 1) and (nv, 1).
    parents : list of int
        Of each joint; joint 0 is the world.
    columns : list of range
        Velocities of each joint.
    placement : list of (SX, SX)
        R (3, 3) and p (3, 1), m, of each joint's frame in its parent's, as functions of q.
    subspace : list of (array, array)
        S_l and S_a, each (3, k), of each joint in its own frame's axes.

    Raises
    ------
    MechanismError
        If a joint is of a type that has no constant motion subspace, or gravity turns.
    """

    def __init__(self, model: Any, parameters: Parameters) -> None:
        if np.any(model.gravity.angular):
            raise MechanismError(
                f"gravity has an angular part, {np.array(model.gravity.angular)}; it must be zero"
            )
        self.model, self.parameters = model, parameters
        self.q = ca.SX.sym("q", model.nq)
        self.v, self.a = ca.SX.sym("v", model.nv), ca.SX.sym("a", model.nv)
        self.parents = [int(parent) for parent in model.parents]
        self.columns = [range(0)]
        self.placement: list[Placement] = [(ca.SX.eye(3), ca.SX(3, 1))]
        self.subspace: list[tuple[Array, Array]] = [(np.zeros((3, 0)), np.zeros((3, 0)))]
        self._joints: list[tuple[Joint, slice, slice]] = []
        self.bodies: list[Inertia] = [(ca.SX(1, 1), ca.SX(3, 1), ca.SX(3, 3))]
        for index in range(1, model.njoints):
            self._add(index)
        #: S_l, S_a and the velocities of each joint.
        self.motions = [
            (sparse(linear), sparse(angular), slice(own.start, own.stop))
            for (linear, angular), own in zip(self.subspace, self.columns, strict=True)
        ]
        self._world: dict[int, Placement] = {0: self.placement[0]}

    def _add(self, index: int) -> None:
        model = self.model.joints[index]
        joint = Joint(model, self.model.names[index])
        coordinates = slice(model.idx_q, model.idx_q + model.nq)
        velocities = slice(model.idx_v, model.idx_v + model.nv)
        turn, shift = joint.placement(self.q[coordinates])
        rotation, translation = self.parameters.joint_placement(index)
        self.placement.append((rotation @ turn, translation + rotation @ shift))
        self.subspace.append((joint.linear, joint.angular))
        self.bodies.append(self.parameters.inertia(index))
        self.columns.append(range(velocities.start, velocities.stop))
        self._joints.append((joint, coordinates, velocities))

    # Dynamics -------------------------------------------------------------------------------------

    def rnea(
        self,
        v: Expression,
        a: Expression,
        gravity: bool = True,
        external: Mapping[int, tuple[Expression, Expression]] | None = None,
    ) -> Expression:
        """Return the joint forces of a motion (recursive Newton-Euler), shape (nv, 1).

        Parameters
        ----------
        v, a
            Shape (nv, 1); structural zeros save operations.
        gravity
            Whether bodies have weight.
        external
            Force and moment (3, 1) on bodies from outside, by joint, in its axes at its origin.
        """
        motions = self.body_motions(v, a, gravity)
        forces = [(ca.SX(3, 1), ca.SX(3, 1)) for _ in self.parents]
        for i in range(1, len(self.parents)):
            force, moment = inertial_force(self.bodies[i], motions[i])
            if external and i in external:
                force, moment = force - external[i][0], moment - external[i][1]
            forces[i] = force, moment
        tau = sparse(self.model.armature) * a
        for i in range(len(self.parents) - 1, 0, -1):
            (force, moment), (linear, angular, own) = forces[i], self.motions[i]
            tau[own] += linear.T @ force + angular.T @ moment
            forces[self.parents[i]] = self.onto_parent(i, forces[i], forces[self.parents[i]])
        return ca.densify(tau)

    def body_motions(self, v: Expression, a: Expression, gravity: bool = True) -> list[BodyMotion]:
        """Return the motions of all bodies, as the module's formulas have them."""
        none = ca.SX(3, 1)
        start = -self.parameters.gravity if gravity else none
        result = [BodyMotion(Turning(none, none), start, Turning(none, none), start)]
        for i in range(1, len(self.parents)):
            parent, (rotation, origin) = result[self.parents[i]], self.placement[i]
            linear, angular, own = self.motions[i]
            back, turn, slide = rotation.T, angular @ v[own], linear @ v[own]
            carried = Turning(back @ parent.turning.w, back @ parent.turning.dw)
            at_origin = back @ (parent.acceleration + parent.turning.tensor @ origin)
            w = carried.w + turn
            dw = carried.dw + angular @ a[own] + cross(carried.w, turn)
            acceleration = at_origin + linear @ a[own] + cross(w + carried.w, slide)
            result.append(BodyMotion(Turning(w, dw), acceleration, carried, at_origin))
        return result

    def onto_parent(self, joint: int, wrench: Wrench, others: Wrench) -> Wrench:
        """Return the sum of a joint's force and moment, in its parent's axes, and others."""
        rotation, origin = self.placement[joint]
        force = rotation @ wrench[0]
        moment = rotation @ wrench[1] + skew(origin) @ force
        return others[0] + force, others[1] + moment

    def mass_matrix(self) -> Expression:
        """Return M, shape (nv, nv), sparse and symmetric (composite rigid bodies).

        A velocity of joint j alone moves the composite body of j with momentum (F, L); column j of
        M is what the joints between j and the world see of it.
        """
        return ca.SX(self._mass_matrix)  # a copy: SX can be changed in place

    @cached_property
    def _mass_matrix(self) -> Expression:
        bodies = list(self.bodies)
        mass_matrix, nv = ca.SX(self.model.nv, self.model.nv), self.model.nv
        # Momenta of the velocities of each joint and those beyond it, in the joint's axes.
        momenta = [(ca.SX(3, nv), ca.SX(3, nv)) for _ in self.parents]
        for i in range(len(self.parents) - 1, 0, -1):
            (mass, first, inertia), (linear, angular, own) = bodies[i], self.motions[i]
            lever, (momentum, about) = skew(first), momenta[i]
            momentum[:, own] = mass * linear - lever @ angular
            about[:, own] = lever @ linear + inertia @ angular
            rows = linear.T @ momentum + angular.T @ about
            mass_matrix[own, :] = rows
            mass_matrix[:, own] = rows.T
            if parent := self.parents[i]:
                bodies[parent] = summed(bodies[parent], moved_inertia(bodies[i], self.placement[i]))
                momenta[parent] = self.onto_parent(i, momenta[i], momenta[parent])
        return ca.sparsify(mass_matrix + ca.diag(sparse(self.model.armature)))

    def kinetic_energy(self) -> Expression:
        """Return the kinetic energy of bodies and rotors, J, shape (1, 1)."""
        none = ca.SX(3, 1)
        velocities = [(none, none)]
        energy = ca.dot(sparse(self.model.armature) * self.v, self.v)
        for i in range(1, len(self.parents)):
            (linear, w), (rotation, origin) = velocities[self.parents[i]], self.placement[i]
            slide, turn, own = self.motions[i]
            linear = rotation.T @ (linear + cross(w, origin)) + slide @ self.v[own]
            w = rotation.T @ w + turn @ self.v[own]
            velocities.append((linear, w))
            mass, first, inertia = self.bodies[i]
            momentum = mass * linear + 2 * cross(w, first)
            energy += ca.dot(linear, momentum) + ca.dot(w, inertia @ w)
        return ca.densify(energy / 2)

    def potential_energy(self) -> Expression:
        """Return the bodies' energy of weight, J, zero at the world's origin, shape (1, 1)."""
        moment = ca.SX(3, 1)
        for i in range(1, len(self.parents)):
            mass, first, _ = self.bodies[i]
            rotation, origin = self.world(i)
            moment += mass * origin + rotation @ first
        return ca.densify(-ca.dot(self.parameters.gravity, moment))

    # Configurations -------------------------------------------------------------------------------

    def integrate(self, q: Expression, dv: Expression) -> Expression:
        """Return q (nq, 1) moved by dv (nv, 1), as `pinocchio.integrate` does: shape (nq, 1)."""
        moved = ca.SX(self.model.nq, 1)
        for joint, coordinates, velocities in self._joints:
            moved[coordinates] = joint.integrate(q[coordinates], dv[velocities])
        return moved

    def difference(self, q: Expression, other: Expression) -> Expression:
        """Return the tangent vector from q to another configuration, (nv, 1), as Pinocchio does."""
        result = ca.SX(self.model.nv, 1)
        for joint, coordinates, velocities in self._joints:
            result[velocities] = joint.difference(q[coordinates], other[coordinates])
        return result

    def tangent(self, q: Expression) -> Expression:
        """Return the derivative of integrate(q, dv) by dv at 0, shape (nq, nv): q' = tangent v."""
        result = ca.SX(self.model.nq, self.model.nv)
        for joint, coordinates, velocities in self._joints:
            result[coordinates, velocities] = joint.tangent(q[coordinates])
        return ca.sparsify(result)

    def unit_lengths(self, q: Expression) -> Expression:
        """Return the squared lengths, less 1, of q's quaternions and (cos, sin), (nq - nv, 1)."""
        own = (joint.unit_lengths(q[coordinates]) for joint, coordinates, _ in self._joints)
        return ca.vertcat(ca.SX(0, 1), *own)

    # Placements and Jacobians ---------------------------------------------------------------------

    def world(self, joint: int) -> Placement:
        """Return R (3, 3) and p (3, 1), m, of a joint's frame in the world."""
        for i in reversed(list(self._to_world(joint))):
            if i not in self._world:
                rotation, origin = self._world[self.parents[i]]
                turn, shift = self.placement[i]
                self._world[i] = rotation @ turn, origin + rotation @ shift
        return self._world[joint]

    def _to_world(self, joint: int) -> Iterator[int]:
        """Yield a joint and those that carry it."""
        while joint:
            yield joint
            joint = self.parents[joint]

    def frame_placement(self, frame: int) -> Placement:
        """Return R (3, 3) and p (3, 1), m, of a frame, by its index in the model, in the world."""
        rotation, origin = self.world(self._joint_of(frame))
        turn, shift = self.parameters.frame_placement(frame)
        return rotation @ turn, origin + rotation @ shift

    def frame_jacobian(self, frame: int) -> Expression:
        """Return the Jacobian of a frame in the world's axes, shape (6, nv), sparse.

        J v is the velocity of the frame's origin, m/s, and the angular velocity, rad/s.
        """
        jacobian = ca.SX(6, self.model.nv)
        _, point = self.frame_placement(frame)
        _, lever = self.parameters.frame_placement(frame)
        for i in self._to_world(self._joint_of(frame)):
            rotation, origin = self.world(i)
            linear, angular, own = self.motions[i]
            axes = rotation @ angular
            # From the joint to the frame's origin: in the joint's axes as long as that is one step,
            # so that columns of axes through the point vanish exactly.
            if lever is not None:
                jacobian[:3, own] = rotation @ (linear - skew(lever) @ angular)
                lever = None if lever.nnz() else self.placement[i][1]
            else:
                jacobian[:3, own] = rotation @ linear - skew(point - origin) @ axes
            jacobian[3:, own] = axes
        return ca.sparsify(jacobian)

    def _joint_of(self, frame: int) -> int:
        return int(self.model.frames[frame].parentJoint)


def skew(r: Expression) -> Expression:
    """Return the matrix of the cross product with r (3, 1), without its zeros."""
    return ca.sparsify(ca.skew(r))


def cross(r: Expression, s: Expression) -> Expression:
    """Return r x s, of shape (3, 1), without its zeros."""
    return ca.cross(r, s) if r.nnz() and s.nnz() else ca.SX(3, 1)

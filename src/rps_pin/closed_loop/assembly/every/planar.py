"""Planar mechanisms of hinges and slides as bilinear equations, in isotropic coordinates.

A point of the plane is a complex number, and t_b the turn of link b from a configuration of
reference: exp(i angle). A point of a chain is linear in the turns of its links, and in u = s t for
a slide by s along a link that is turned by t. With X = (t, u) and the conjugates Z = (t*, u*), as
variables of their own,

    t_b t*_b = 1,    u t* = u* t,    and for each closure: A X + a = 0,   A* Z + a* = 0,

or one equation in X and Z for a distance or a point on a line (Wampler, Solving the kinematics of
planar mechanisms, 1999). Each is linear in X and in Z.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools, ComplexArray
from rps_pin.closed_loop.assembly.every.solutions import NoFormulationError
from rps_pin.closed_loop.constraints.closures import ClosedFrame, LoopClosure
from rps_pin.closed_loop.constraints.system import ConstraintSystem

#: Parallel up to this; distances are compared in characteristic lengths.
_NONE = 1e-9


class Planar(NamedTuple):
    """A planar mechanism's equations; X of n numbers, and 1 as the last."""

    linear: ComplexArray
    """Rows (A, a) with A X + a = 0, shape (m, n + 1)."""
    bilinear: ComplexArray
    """Matrices H with (X, 1)' H (Z, 1) = 0, Hermitian, shape (k, n + 1, n + 1)."""
    joints: list[tuple[int, int, int, float]]
    """Of each joint that moves: its velocity's index; its own number in X; the one of the link
    that it hangs on, or -1 for what stands; and the sign of its axis, 0 for a slide."""
    unit: float
    """Of lengths, m."""


def planar(system: ConstraintSystem, held: Bools, about: Array) -> Planar:
    """Return the equations of a planar mechanism with given joint values.

    Parameters
    ----------
    system
        The system.
    held
        Which velocities stand, shape (nv,).
    about
        A configuration with the given values, of reference, shape (nq,).

    Raises
    ------
    NoFormulationError
        If it is no planar mechanism of hinges and slides; says why.
    """
    return _Reader(system, held, about).read()


class _Reader:
    """Reads the chains in the configuration of reference."""

    def __init__(self, system: ConstraintSystem, held: Bools, about: Array) -> None:
        self._system, model, data = system, system.model, system.data
        pin.forwardKinematics(model, data, about)
        pin.updateFramePlacements(model, data)
        self._unit = system.equations.length
        motions = self._motions(held)
        turning = [motion[3:] for motion in motions.values() if motion[3:].any()]
        if not turning:
            raise NoFormulationError("it has no hinge that moves")
        self._normal = turning[0]
        first = np.eye(3)[int(np.argmin(np.abs(self._normal)))]
        x = np.cross(self._normal, first)
        self._x = x / np.linalg.norm(x)
        self._y = np.cross(self._normal, self._x)
        self._count = len(motions)
        #: Of each joint's frame: its link's number in X, and its place as a row of X and 1.
        self._link, self._place = [-1], [self._constant(0.0)]
        self.joints: list[tuple[int, int, int, float]] = []
        self._products: list[ComplexArray] = []
        self._linear: list[ComplexArray] = []
        for index in range(1, model.njoints):
            self._add(index, motions.get(index))

    def _motions(self, held: Bools) -> dict[int, Array]:
        """Return the motions of the joints that move, in world axes: slide and turn."""
        model, data, found = self._system.model, self._system.data, {}
        for index in range(1, model.njoints):
            joint = model.joints[index]
            if held[joint.idx_v : joint.idx_v + joint.nv].all():
                continue
            name = model.names[index]
            if joint.nv != 1:
                raise NoFormulationError(f"joint {name!r} is neither a hinge nor a slide")
            description = joint.createData()
            joint.calc(description, pin.neutral(model))
            local = np.asarray(description.S).reshape(2, 3)
            if local[0].any() and local[1].any():
                raise NoFormulationError(f"joint {name!r} is a screw")
            found[index] = (local @ data.oMi[index].rotation.T).ravel()
        return found

    def _constant(self, value: complex) -> ComplexArray:
        row = np.zeros(self._count + 1, dtype=np.complex128)
        row[-1] = value
        return row

    def _add(self, index: int, motion: Array | None) -> None:
        """Find a joint's place, and what it turns or moves."""
        model, data = self._system.model, self._system.data
        parent, own = model.parents[index], len(self.joints)
        link, name = self._link[parent], model.names[index]
        away = self._plane(data.oMi[index].translation - data.oMi[parent].translation)
        place = self._place[parent] + self._along(link, away)
        if motion is not None and motion[3:].any():
            sign = float(motion[3:] @ self._normal)
            if abs(abs(sign) - 1.0) > _NONE:
                raise NoFormulationError(f"the axis of {name!r} is not parallel to the others")
            self.joints.append((model.joints[index].idx_v, own, link, float(np.sign(sign))))
            self._products.append(self._hermitian(own, own, 1.0, -1.0))
            link = own
        elif motion is not None:
            if abs(float(motion[:3] @ self._normal)) > _NONE:
                raise NoFormulationError(f"joint {name!r} leads out of the plane")
            place[own] += self._direction(motion[:3])
            self.joints.append((model.joints[index].idx_v, own, link, 0.0))
            self._products.append(self._hermitian(own, link, 1j, 0.0))
        self._link.append(link)
        self._place.append(place)

    def _hermitian(self, i: int, j: int, factor: complex, constant: float) -> ComplexArray:
        """Return the matrix of Re(factor X_i Z_j), and a constant."""
        form = np.zeros((self._count + 1, self._count + 1), dtype=np.complex128)
        form[i, j] += factor / 2
        form[j, i] += np.conj(factor) / 2
        form[-1, -1] += constant
        return form

    def _direction(self, vector: Array) -> complex:
        return complex(vector @ self._x, vector @ self._y)

    def _plane(self, vector: Array) -> complex:
        return self._direction(vector) / self._unit

    def _along(self, link: int, vector: complex) -> ComplexArray:
        """Return a vector of a link as a row."""
        row = self._constant(0.0)
        row[link] = vector
        return row

    def _at(self, end: ClosedFrame) -> tuple[ComplexArray, float, int]:
        """Return a closed frame's place as a row, its height over the plane, and its link."""
        data, joint = self._system.data, end.joint
        away = end.at(data).translation - data.oMi[joint].translation
        row = self._place[joint] + self._along(self._link[joint], self._plane(away))
        height = float(end.at(data).translation @ self._normal) / self._unit
        return row, height, self._link[joint]

    def read(self) -> Planar:
        """Return the equations of all closures."""
        for closure in self._system.equations.closures:
            if not isinstance(closure, LoopClosure):
                raise NoFormulationError("it has a coupling")
            self._close(closure)
        linear = np.array(self._linear).reshape(-1, self._count + 1)
        return Planar(linear, np.array(self._products), self.joints, self._unit)

    def _close(self, closure: LoopClosure) -> None:
        """Add the equations of a closure."""
        a, b = closure.closed_frames(self._system.model)
        (at_a, height_a, link_a), (at_b, height_b, _) = self._at(a), self._at(b)
        gap, rise, kind = at_b - at_a, height_b - height_a, closure.kind
        if closure.distance is not None:
            form = np.outer(gap, gap.conj())
            form[-1, -1] += rise**2 - (closure.distance / self._unit) ** 2
            self._products.append(form)
            return
        axis = self._axis(closure, a)
        normal = abs(float(axis @ self._normal)) > 1.0 - _NONE
        if abs(rise) > _NONE and not (normal and kind in ("point_on_line", "cylindrical")):
            raise NoFormulationError(f"closure {closure.name!r} is open across the plane")
        if kind in ("rigid", "prismatic", "revolute", "cylindrical"):
            turned = self._turned(closure, a, b)
            if kind in ("rigid", "prismatic"):
                self._linear.append(turned)
        if kind in ("spherical", "rigid") or (
            normal and kind in ("revolute", "point_on_line", "cylindrical")
        ):
            self._linear.append(gap)
        elif kind in ("point_on_line", "prismatic") and abs(float(axis @ self._normal)) < _NONE:
            e = self._along(link_a, self._direction(axis))
            self._products.append((np.outer(gap, e.conj()) - np.outer(e, gap.conj())) / 2j)
        else:
            raise NoFormulationError(f"closure {closure.name!r} is of kind {kind!r}")

    def _axis(self, closure: LoopClosure, a: ClosedFrame) -> Array:
        """Return a closure's axis in the world; the plane's normal where it has none."""
        if closure.axis is None:
            return self._normal
        return np.asarray(a.at(self._system.data).rotation @ np.array(closure.axis))

    def _turned(self, closure: LoopClosure, a: ClosedFrame, b: ClosedFrame) -> ComplexArray:
        """Return the row by which two frames are parallel; refuse what cannot be."""
        data = self._system.data
        at_a, at_b = a.at(data).rotation, b.at(data).rotation
        if closure.axis_b is not None:
            away = at_b @ np.array(closure.axis_b) - self._axis(closure, a)
        else:
            turn = pin.log3(at_b @ at_a.T)
            away = turn - (turn @ self._normal) * self._normal
        if np.abs(away).max() > _NONE:
            raise NoFormulationError(f"closure {closure.name!r} is oblique to the plane")
        angle = float(pin.log3(at_b @ at_a.T) @ self._normal)
        of_b = self._along(self._link[b.joint], np.exp(1j * angle))
        return np.asarray(of_b - self._along(self._link[a.joint], 1.0))

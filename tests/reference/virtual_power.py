"""d'Alembert's principle, for a mechanism whose bodies' motion is known in closed form.

In independent coordinates q, with v_j and omega_j the velocities of a body at unit rate of q_j::

    tau_j = sum over bodies of  m (c'' - g) . v_j + (I alpha + omega x I omega) . omega_j

No constraint, no multiplier and no Jacobian of a closure appears: only the closed forms of where
the bodies are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.closed_loop.mechanisms import Bar
from tests.reference import jets
from tests.reference.newton_euler import Jet

Array = NDArray[np.float64]

EARTH = np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True)
class Body:
    """A rigid body in motion; its inertia is about its centre of mass, in its own axes."""

    mass: float
    inertia: Array
    com: Jet
    rotation: Jet

    def wrench(self, gravity: Array) -> tuple[Array, Array]:
        """Force m (c'' - g) and moment I alpha + omega x I omega that its motion takes."""
        R = self.rotation.value
        inertia = R @ self.inertia @ R.T
        omega, alpha = jets.spin(self.rotation), jets.spin_rate(self.rotation)
        moment = inertia @ alpha + np.cross(omega, inertia @ omega)
        return self.mass * (self.com.second - gravity), moment

    def energy(self, gravity: Array) -> float:
        """Kinetic and potential."""
        spin = self.rotation.value.T @ jets.spin(self.rotation)
        c = self.com
        moving = self.mass * c.first @ c.first / 2 + spin @ self.inertia @ spin / 2
        return float(moving - self.mass * gravity @ c.value)


Bodies = Callable[[Jet], Sequence[Body]]


def body(mass: float, com: ArrayLike, inertia: ArrayLike, origin: Jet, rotation: Jet) -> Body:
    """A body by its frame; inertia (xx, yy, zz) or (xx, yy, zz, xy, xz, yz), as in a URDF."""
    xx, yy, zz, xy, xz, yz = (*np.asarray(inertia, dtype=float), 0.0, 0.0, 0.0)[:6]
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Body(mass, tensor, origin + jets.applied(rotation, com), rotation)


def plane_body(bar: Bar, place: Jet, u: Jet) -> Body:
    """A bar in the x-z plane from a place (x, z), along u (x, z)."""

    def spatial(plane: Array) -> Array:
        return np.array([plane[0], 0.0, plane[1]])

    across = jets.turned(u)
    rotation = jets.frame(u.map(spatial), jets.constant([0, 1, 0]), across.map(spatial))
    com = place + u.map(lambda x: bar.along * x) + across.map(lambda x: bar.across * x)
    return Body(bar.mass, bar.inertia * np.eye(3), com.map(spatial), rotation)


def generalised_forces(
    bodies: Bodies, q: Array, v: Array, a: Array, gravity: Array = EARTH
) -> Array:
    """The forces tau (n,) that the motion takes in the independent coordinates q (n,)."""
    wrenches = [one.wrench(gravity) for one in bodies(Jet(q, v, a))]
    tau = np.zeros(len(q))
    for j, unit in enumerate(np.eye(len(q))):
        virtual = bodies(Jet(q, unit, np.zeros(len(q))))
        for (force, moment), one in zip(wrenches, virtual, strict=True):
            tau[j] += force @ one.com.first + moment @ jets.spin(one.rotation)
    return tau


def drive_forces(
    bodies: Bodies,
    drives: Callable[[Jet], Jet],
    q: Array,
    v: Array,
    a: Array,
    gravity: Array = EARTH,
) -> Array:
    """Those of drives whose positions depend on q, G^-T of the forces in q, G = d(drives)/dq."""
    forces = generalised_forces(bodies, q, v, a, gravity)
    return np.linalg.solve(gain(drives, q).T, forces)


def gain(drives: Callable[[Jet], Jet], q: Array) -> Array:
    """G = d(drives)/dq, from unit rates."""
    still = np.zeros(len(q))
    return np.column_stack([drives(Jet(q, unit, still)).first for unit in np.eye(len(q))])


def energy(bodies: Bodies, q: Array, v: Array, gravity: Array = EARTH) -> float:
    """Kinetic and potential energy."""
    return sum(one.energy(gravity) for one in bodies(Jet(q, v, np.zeros(len(q)))))

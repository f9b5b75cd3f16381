"""The Stewart-Gough platform of urdf/stewart.urdf: closed forms and Newton-Euler, without a tree.

For leg i, with A its universal joint, B its ball, s = (B - A) / d the unit vector along it, e the
base's axis of the universal joint, y the other one::

    y = s x e / |s x e|,   x = y x s,   rotation of cylinder and rod (x, y, s)
    rotation of the cross (e, y, e x y)

**Newton-Euler of a leg.** Let f be its force on the platform at B. The universal joint gives no
moment along e to the cross, and none along y to the leg::

    e . [moment about A of cross, cylinder and rod]   = e . (d s x -f)
    y . [moment about A of cylinder and rod]          = y . (d s x -f)
    s . [force of the rod, m (c'' - g)]               = F - s . f

(the moment of a body about A is (c - A) x m (c'' - g) + I alpha + omega x I omega). The first two
give f across s, and f = F s + k with k known. **Of the platform**, with P its frame's origin::

    sum f_i             = m (c'' - g)
    sum (B_i - P) x f_i = (c - P) x m (c'' - g) + I alpha + omega x I omega

six equations for the six F.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.reference import jets, virtual_power
from tests.reference.newton_euler import Jet
from tests.reference.virtual_power import Body, body

Array = NDArray[np.float64]

BASE, PLATFORM = 0.5, 0.3
BASE_HALF, PLATFORM_HALF = 0.2, 0.28
PLATFORM_BODY = (12.0, (0.02, -0.01, 0.05), (0.4, 0.45, 0.7, 0.02, -0.03, 0.01))
CROSS_BODY = (0.3, (0, 0, 0), (0.0002, 0.00015, 0.0003))
CYLINDER_BODY = (3.0, (0.01, -0.015, 0.17), (0.045, 0.047, 0.004, 0.001, -0.002, 0.0015))
ROD_BODY = (1.2, (0.002, 0.003, -0.19), (0.02, 0.0203, 0.0006, 0.0002, 0.0004, -0.0003))


def _circle(radius: float, angle: float) -> Array:
    return radius * np.array([np.cos(angle), np.sin(angle), 0.0])


#: Pairs of legs: neighbours on the base, far apart on the platform.
_CENTRES = np.repeat(np.deg2rad([0.0, 120.0, 240.0]), 2)
_SIGNS = np.tile([1.0, -1.0], 3)
_ANGLES = _CENTRES + _SIGNS * BASE_HALF
ANCHORS = [_circle(BASE, t) for t in _ANGLES]
AXES = [_circle(1.0, t) for t in _ANGLES]
BALLS = [_circle(PLATFORM, t) for t in _CENTRES + _SIGNS * (np.pi / 3 - PLATFORM_HALF)]


@dataclass(frozen=True)
class Leg:
    """The motion of one leg."""

    anchor: Array
    axis: Array
    length: Jet
    rotation: Jet
    cross: Jet

    def angles(self) -> tuple[Jet, Jet]:
        """Those of the universal joint: about e, then about y.

        With t the base's tangent at the joint and u up, y = cos t1 t + sin t1 u; and about y, s
        turns from e x y towards e.
        """
        tangent = np.cross([0.0, 0.0, 1.0], self.axis)
        y, s = (self.rotation.map(lambda R, k=k: R[:, k]) for k in (1, 2))
        third = self.cross.map(lambda R: R[:, 2])
        first = jets.stacked(y.map(lambda u: u @ tangent), y.map(lambda u: u[2]))
        second = jets.stacked(jets.dot(s, third), s.map(lambda u: u @ self.axis))
        return jets.angle_of(first), jets.angle_of(second)

    def bodies(self) -> list[Body]:
        """Cross, cylinder, rod."""
        anchor = jets.constant(self.anchor)
        s = self.rotation.map(lambda R: R[:, 2])
        ball = anchor + jets.scaled(self.length, s)
        return [
            body(*CROSS_BODY, anchor, self.cross),
            body(*CYLINDER_BODY, anchor, self.rotation),
            body(*ROD_BODY, ball, self.rotation),
        ]


def leg(i: int, position: Jet, rotation: Jet) -> Leg:
    """Inverse kinematics of leg i (0 to 5)."""
    along = (position + jets.applied(rotation, BALLS[i])).shift(-ANCHORS[i])
    d = jets.length(along)
    s, e = jets.over(along, d), jets.constant(AXES[i])
    y = jets.unit(jets.cross(s, e))
    x = jets.cross(y, s)
    return Leg(ANCHORS[i], AXES[i], d, jets.frame(x, y, s), jets.frame(e, y, jets.cross(e, y)))


@dataclass(frozen=True)
class Motion:
    """The platform's motion: origin of its frame, and rotation."""

    position: Jet
    rotation: Jet

    @staticmethod
    def of(
        position: Array, rotation: Array, linear: Array, spin: Array, pull: Array, turn: Array
    ) -> Motion:
        """By velocity and acceleration, linear and angular, all in the base's axes.

        R' = [omega] R and R'' = ([alpha] + [omega][omega]) R.
        """
        omega, alpha = _skew(spin), _skew(turn)
        return Motion(
            Jet(position, linear, pull),
            Jet(rotation, omega @ rotation, (alpha + omega @ omega) @ rotation),
        )

    def legs(self) -> list[Leg]:
        return [leg(i, self.position, self.rotation) for i in range(6)]

    def platform(self) -> Body:
        return body(*PLATFORM_BODY, self.position, self.rotation)

    def bodies(self) -> list[Body]:
        return [self.platform()] + [one for each in self.legs() for one in each.bodies()]


def joints(motion: Motion) -> dict[str, Jet]:
    """Every joint of urdf/stewart.urdf but the platform's."""
    found = {}
    for i, one in enumerate(motion.legs(), start=1):
        first, second = one.angles()
        found[f"leg_{i}_cross_joint"] = first
        found[f"leg_{i}_cylinder_joint"] = second
        found[f"leg_{i}_rod_joint"] = one.length
    return found


def random_motion(rng: np.random.Generator, tilt: float = 0.25, speed: float = 1.0) -> Motion:
    """Well inside the workspace; fast enough that velocity products weigh."""
    position = np.array([0, 0, 0.65]) + rng.uniform(-0.08, 0.08, size=3)
    rotation = Rotation.from_rotvec(rng.uniform(-tilt, tilt, size=3)).as_matrix()
    linear, spin = speed * rng.normal(size=(2, 3))
    pull, turn = 10 * speed * rng.normal(size=(2, 3))
    return Motion.of(position, rotation, linear, spin, pull, turn)


def newton_euler(motion: Motion, gravity: Array = virtual_power.EARTH) -> tuple[Array, Array]:
    """Actuator forces (6,), positive lengthens, and forces of the legs on the platform (6, 3)."""
    ways, known = [], []
    for one in motion.legs():
        s = one.rotation.value[:, 2]
        ways.append(s)
        known.append(_known_force(one, s, gravity))
    P, R = motion.position.value, motion.rotation.value
    arms = [R @ ball for ball in BALLS]
    platform = motion.platform()
    force, moment = platform.wrench(gravity)
    moment = moment + np.cross(platform.com.value - P, force)
    required = np.concatenate([force, moment])
    columns = np.column_stack(
        [np.concatenate([s, np.cross(b, s)]) for s, b in zip(ways, arms, strict=True)]
    )
    given = sum(np.concatenate([k, np.cross(b, k)]) for k, b in zip(known, arms, strict=True))
    forces = np.linalg.solve(columns, required - given)
    return forces, forces[:, None] * np.array(ways) + np.array(known)


def _known_force(one: Leg, s: Array, gravity: Array) -> Array:
    """k of f = F s + k: across s by the two moment equations, along s by the rod's own."""
    e, y = one.axis, one.rotation.value[:, 1]
    moments, forces = [], []
    for part in one.bodies():
        force, moment = part.wrench(gravity)
        forces.append(force)
        moments.append(moment + np.cross(part.com.value - one.anchor, force))
    d = one.length.value
    # w . (d s x -f) = f . (d s x w), for w = e and w = y; and s . k = -s . (rod's force)
    matrix = np.array([d * np.cross(s, e), d * np.cross(s, y), s])
    return np.linalg.solve(
        matrix, [e @ sum(moments), y @ (moments[1] + moments[2]), -s @ forces[2]]
    )


def virtual_power_forces(motion: Motion, gravity: Array = virtual_power.EARTH) -> Array:
    """The same actuator forces by d'Alembert's principle, G^-T of the platform's wrench.

    The six virtual motions are unit velocities of the platform's origin and unit spins.
    """
    P, R = motion.position.value, motion.rotation.value
    wrenches = [part.wrench(gravity) for part in motion.bodies()]
    work, gain = np.zeros(6), np.zeros((6, 6))
    for j, unit in enumerate(np.eye(6)):
        virtual = Motion.of(P, R, unit[:3], unit[3:], np.zeros(3), np.zeros(3))
        gain[:, j] = [one.length.first for one in virtual.legs()]
        for (force, moment), part in zip(wrenches, virtual.bodies(), strict=True):
            work[j] += force @ part.com.first + moment @ jets.spin(part.rotation)
    return np.linalg.solve(gain.T, work)


def _skew(w: Array) -> Array:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])

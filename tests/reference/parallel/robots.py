"""Closed forms of all parallel robots, by the coordinates of their tasks, under the same names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.reference import delta, five_bar, jets, stewart, virtual_power
from tests.reference.newton_euler import Jet
from tests.reference.parallel import ankle, linear_delta, planar_rrr, rotary_stewart, rrs
from tests.reference.parallel.legs import part, two_bars
from tests.reference.virtual_power import Body

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClosedForm:
    """A robot, by a motion of its task's coordinates."""

    drives: Callable[[Jet], Jet]
    """Positions of the actuators, (na,)."""
    joints: Callable[[Jet], dict[str, Jet]]
    """All joints of one coordinate."""
    bodies: Callable[[Jet], list[Body]]
    output: Callable[[Jet], tuple[Jet, Jet]] | None
    """Place and rotation of the task's frame."""
    free: bool = True
    """Whether that is also the floating body ``platform``."""
    armature: float = 0.0
    """Of each drive."""

    def gain(self, x: Array) -> Array:
        """d(drives)/dx, (na, m)."""
        return virtual_power.gain(self.drives, x)

    def forces(self, x: Array, rate: Array, acceleration: Array) -> Array:
        """Of the drives, by d'Alembert's principle."""
        found = virtual_power.drive_forces(self.bodies, self.drives, x, rate, acceleration)
        return found + self.armature * self.drives(Jet(x, rate, acceleration)).second

    def twists(self, x: Array) -> Array:
        """Velocity of the output frame's origin and its spin, by unit rates, (6, m)."""
        assert self.output is not None
        found = []
        for unit in np.eye(len(x)):
            place, turn = self.output(Jet(x, unit, np.zeros(len(x))))
            found.append(np.concatenate([place.first, jets.spin(turn)]))
        return np.column_stack(found)


def _stewart(x: Jet) -> stewart.Motion:
    return stewart.Motion(*rotary_stewart.platform(x))


def _lengths(x: Jet) -> Jet:
    return jets.stacked(*(leg.length for leg in _stewart(x).legs()))


def _five_bar(x: Jet) -> Jet:
    """Inverse kinematics: the left bar ahead of its arm, the right one behind."""
    left, _ = two_bars(x, five_bar.LEFT.length, five_bar.LEFT_ARM.length, 1)
    ground = [-five_bar.GROUND, 0.0]
    right, _ = two_bars(x.shift(ground), five_bar.RIGHT.length, five_bar.RIGHT_ARM.length, -1)
    return jets.stacked(jets.angle_of(left), jets.angle_of(right))


def _tip(x: Jet) -> tuple[Jet, Jet]:
    """Of the left arm, whose angle is the sum of two."""
    found = five_bar.joints(_five_bar(x))
    u = jets.direction(found["left_joint"] + found["left_arm_joint"])

    def spatial(v: Array) -> Array:
        return np.array([v[0], 0.0, v[1]])

    y = jets.constant([0.0, 1.0, 0.0])
    return x.map(spatial), jets.frame(u.map(spatial), y, jets.turned(u).map(spatial))


def _of_arms(x: Jet) -> dict[str, Jet]:
    return {f"arm_{i + 1}_joint": part(delta.angles(x), i) for i in range(3)}


ROBOTS = {
    "stewart": ClosedForm(
        _lengths,
        lambda x: stewart.joints(_stewart(x)),
        lambda x: _stewart(x).bodies(),
        rotary_stewart.platform,
    ),
    "rotary_stewart": ClosedForm(
        rotary_stewart.drives, rotary_stewart.joints, rotary_stewart.bodies, rotary_stewart.platform
    ),
    "delta": ClosedForm(delta.angles, _of_arms, delta.bodies, linear_delta.platform),
    "linear_delta": ClosedForm(
        linear_delta.drives, linear_delta.joints, linear_delta.bodies, linear_delta.platform
    ),
    "rrs": ClosedForm(rrs.drives, rrs.joints, rrs.bodies, rrs.platform),
    "planar_rrr": ClosedForm(
        planar_rrr.drives, planar_rrr.joints, planar_rrr.bodies, planar_rrr.platform, free=False
    ),
    "five_bar": ClosedForm(
        _five_bar,
        lambda x: five_bar.joints(_five_bar(x)),
        lambda x: five_bar.bodies(_five_bar(x)),
        _tip,
        free=False,
    ),
    "ankle": ClosedForm(
        ankle.drives, ankle.joints, ankle.bodies, None, free=False, armature=ankle.ARMATURE
    ),
}

"""Targets of a control loop: taken as they come, or refused and the last good one held.

A target is refused if it is not finite, if a leg's length, angle or ball joint would be beyond its
limits there, or if it is nearer to a singularity than allowed, or beyond one: the sign of Eq. 8's
determinant must stay what it was at the start. A refused target is replaced by the pose of the last
good one, at rest.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from rps_pin.control.limit_check import LimitCheck
from rps_pin.control.numbers import three_floats
from rps_pin.control.place import Place, place_of, turning_determinant
from rps_pin.rps.scalar_tracking import Triple

_STILL = (0.0, 0.0, 0.0)
#: Below a whole turn (tilt_x, tilt_y) are coordinates; see `rps_pin.rps.singularity`.
LARGEST_TILT_SQUARED = (2 * math.pi * (1 - 1e-6)) ** 2


class Goal(NamedTuple):
    """A target that can be gone to."""

    place: Place
    rate: Triple
    acceleration: Triple


class Targets:
    """The targets of one robot.

    Parameters
    ----------
    limits
        The robot's.
    g, h
        Radii of base and platform, m.
    nearest
        Least size of Eq. 8's determinant, 0 to 1.
    farthest
        Heights beyond it, and rates and accelerations, make no sense; m, m/s, rad/s and so on.
    """

    def __init__(
        self, limits: LimitCheck, g: float, h: float, nearest: float, farthest: float
    ) -> None:
        self._limits, self._g, self._h = limits, g, h
        self._nearest, self._farthest = nearest, farthest
        self.refused: Triple | None = None

    def reset(self, place: Place) -> None:
        """Start from a place, at rest: what is held until there is a target."""
        self._goal = Goal(place, _STILL, _STILL)
        self._side = math.copysign(1.0, turning_determinant(place, self._g, self._h))

    @property
    def goal(self) -> Goal:
        """The last one taken, or what is held."""
        return self._goal

    def take(self, target: Any) -> bool:
        """Take a target, and return True; or hold the last good one (see `words`).

        Parameters
        ----------
        target
            Pose (m, rad, rad), rate and acceleration, three times (3,); None for the last one.
        """
        if target is None:
            return True
        try:
            pose, rate, acceleration = target
        except (TypeError, ValueError):
            return self._hold(None)
        x, dx, ddx = three_floats(pose), three_floats(rate), three_floats(acceleration)
        if x is None or dx is None or ddx is None:
            return self._hold(x)
        place = self._allowed(x)
        if place is None or not -self._farthest < min(*dx, *ddx) <= max(*dx, *ddx) < self._farthest:
            return self._hold(x)
        self._goal = Goal(place, dx, ddx)
        return True

    def _allowed(self, pose: Triple) -> Place | None:
        """Return where a pose puts the legs, if it can be gone to."""
        z, wx, wy = pose
        if not (wx * wx + wy * wy < LARGEST_TILT_SQUARED and abs(z) < self._farthest):
            return None
        place = place_of(pose, self._g, self._h)
        if place is None or self._limits.broken(place):
            return None
        inside = self._side * turning_determinant(place, self._g, self._h) >= self._nearest
        return place if inside else None

    def words(self) -> list[str]:
        """Return why the last refused target was refused."""
        x = self.refused
        if x is None:
            return ["the target is not three finite triples: pose, rate and acceleration"]
        shown = "(" + ", ".join(f"{value:.6g}" for value in x) + ")"
        place = place_of(x, self._g, self._h) if abs(x[0]) < self._farthest else None
        if place is None:
            return [f"the target {shown} m, rad, rad gives a leg no length"]
        words = [f"at the target {shown} m, rad, rad, {one}" for one in self._limits.words(place)]
        determinant = self._side * turning_determinant(place, self._g, self._h)
        if not determinant >= self._nearest:
            words.append(
                f"the target {shown} m, rad, rad is too near a singularity, or beyond one: "
                f"determinant {determinant:.3g}, at least {self._nearest:.3g} is asked for"
            )
        return words or [f"the target {shown} m, rad, rad has rates beyond all sense"]

    def _hold(self, pose: Triple | None) -> bool:
        self.refused = pose
        self._goal = Goal(self._goal.place, _STILL, _STILL)
        return False

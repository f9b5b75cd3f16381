"""Targets of a control loop: taken as they come, or refused and the last good one held.

A target is refused if it is not finite, if a leg's length, angle or ball joint would be beyond its
limits there, or if it is nearer to a singularity than allowed, or beyond one: the sign of Eq. 8's
determinant must stay what it was at the start. A refused target is replaced by the pose of the last
good one, at rest. From there the robot comes back to the next good one without a step
(`rps_pin.control.loop.rejoining`), if the way there is allowed.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from rps_pin.control.estimator.numbers import three_floats
from rps_pin.control.estimator.place import Place, place_of, turning_determinant
from rps_pin.control.loop.limit_check import LimitCheck
from rps_pin.control.loop.rejoining import Rejoining, rejoining_time
from rps_pin.rps.kinematics.tracking import Triple

_STILL = (0.0, 0.0, 0.0)
#: Below a whole turn (tilt_x, tilt_y) are coordinates; see `rps_pin.rps.singularity.measures`.
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
    speed_limit
        Of the actuators, m/s: half of it is for coming back to a target.
    """

    def __init__(
        self,
        limits: LimitCheck,
        g: float,
        h: float,
        nearest: float,
        farthest: float,
        speed_limit: float,
    ) -> None:
        self._limits, self._g, self._h = limits, g, h
        self._nearest, self._farthest, self._fastest = nearest, farthest, speed_limit

    def reset(self, place: Place) -> None:
        """Start from a place, at rest: what is held until there is a target."""
        self._goal = self._asked = Goal(place, _STILL, _STILL)
        self._side = math.copysign(1.0, turning_determinant(place, self._g, self._h))
        self._held = False
        self._refused: Triple | None = None
        self._back: Rejoining | None = None

    @property
    def goal(self) -> Goal:
        """The last one taken, the way back to it, or what is held."""
        return self._goal

    def take(self, target: Any, elapsed: float) -> bool:
        """Take a target, and return whether `goal` is it: it may be held, or not yet reached again.

        Parameters
        ----------
        target
            Pose (m, rad, rad), rate and acceleration, three times (3,); None for the last good one.
        elapsed
            Time since the last call, s.
        """
        if target is None:
            if not self._held and self._back is None:
                return True
            return self._follow(self._asked, elapsed)
        asked = self._good(target)
        if asked is None:
            self._hold()
            return False
        if self._held or self._back is not None:
            return self._follow(asked, elapsed)
        self._goal = self._asked = asked
        return True

    def _good(self, target: Any) -> Goal | None:
        """Return a target as floats, if it can be gone to; else note it."""
        self._refused = None
        try:
            pose, rate, acceleration = target
        except (TypeError, ValueError):
            return None
        x, dx, ddx = three_floats(pose), three_floats(rate), three_floats(acceleration)
        if x is None or dx is None or ddx is None:
            return None
        self._refused = x
        place = self._allowed(x)
        if place is None or not -self._farthest < min(*dx, *ddx) <= max(*dx, *ddx) < self._farthest:
            return None
        return Goal(place, dx, ddx)

    def _follow(self, asked: Goal, elapsed: float) -> bool:
        """Go on towards a good target from where it was held."""
        self._asked = asked
        if self._held or self._back is None:
            self._held, self._back = False, self._way_back(asked)
        gap = self._back.after(elapsed if 0.0 < elapsed < math.inf else 0.0)
        if gap is None:
            self._back, self._goal = None, asked
            return True
        pose = _sum(asked.place.pose, gap[0])
        place = self._allowed(pose)
        if place is None:
            self._refused = pose
            self._hold()
            return False
        self._goal = Goal(place, _sum(asked.rate, gap[1]), _sum(asked.acceleration, gap[2]))
        return False

    def _way_back(self, asked: Goal) -> Rejoining:
        held = self._goal
        far = max(map(abs, difference(held.place.length, asked.place.length)))
        return Rejoining(
            difference(held.place.pose, asked.place.pose),
            difference(held.rate, asked.rate),
            difference(held.acceleration, asked.acceleration),
            rejoining_time(far, self._fastest),
        )

    def _allowed(self, pose: Triple) -> Place | None:
        """Return where a pose puts the legs, if it can be gone to."""
        if not self._sensible(pose):
            return None
        place = place_of(pose, self._g, self._h)
        if place is None or self._limits.broken(place):
            return None
        inside = self._side * turning_determinant(place, self._g, self._h) >= self._nearest
        return place if inside else None

    def _sensible(self, pose: Triple) -> bool:
        z, wx, wy = pose
        return wx * wx + wy * wy < LARGEST_TILT_SQUARED and abs(z) < self._farthest

    def words(self) -> list[str]:
        """Return why the goal is not the last target."""
        if self._back is not None:
            return [f"coming back to the target: {self._back.left:.3g} s to go"]
        return [*self._words_of(self._refused), "the last good target is held"]

    def _words_of(self, x: Triple | None) -> list[str]:
        if x is None:
            return ["the target is not three finite triples: pose, rate and acceleration"]
        shown = "the target (" + ", ".join(f"{value:.6g}" for value in x) + ") m, rad, rad"
        if not self._sensible(x):
            return [f"{shown} is beyond all sense"]
        place = place_of(x, self._g, self._h)
        if place is None:
            return [f"{shown} gives a leg no length"]
        words = [f"at {shown}, {one}" for one in self._limits.words(place)]
        determinant = self._side * turning_determinant(place, self._g, self._h)
        if not determinant >= self._nearest:
            words.append(
                f"{shown} is too near a singularity, or beyond one: determinant "
                f"{determinant:.3g}, at least {self._nearest:.3g} is asked for"
            )
        return words or [f"{shown} has rates beyond all sense"]

    def _hold(self) -> None:
        self._held, self._back = True, None
        self._goal = Goal(self._goal.place, _STILL, _STILL)


def _sum(a: Triple, b: Triple) -> Triple:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def difference(a: Triple, b: Triple) -> Triple:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]

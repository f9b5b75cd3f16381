"""The robot's limits in a control loop: checks on floats in each tick, messages on demand."""

from __future__ import annotations

import math

import numpy as np

from rps_pin.control.estimator.place import Place
from rps_pin.rps.kinematics.legs import RADIAL, cone_angles, violations
from rps_pin.rps.kinematics.pose import rotation
from rps_pin.rps.kinematics.tracking import Triple
from rps_pin.rps.parameters import RPSParameters

#: Limits are kept to rounding error, m or rad (as in `rps_pin.rps.kinematics.legs`).
_ROUNDING = 1e-12
(_E1, _E2, _E3) = ((float(x), float(y)) for x, y, _ in RADIAL)


class RobotLimits:
    """The limits of one robot.

    Parameters
    ----------
    parameters
        The robot's.
    """

    def __init__(self, parameters: RPSParameters) -> None:
        self._parameters = parameters
        low, high = parameters.leg_length_limits
        self._shortest, self._longest = low - _ROUNDING, high + _ROUNDING
        low, high = parameters.leg_angle_limits
        self._least_angle, self._greatest_angle = low - _ROUNDING, high + _ROUNDING
        self._greatest_speed = parameters.actuator_speed_limit
        self._greatest_force = parameters.actuator_force_limit
        self._cones = parameters.spherical_cone_limit < math.pi
        self._least_cosine = math.cos(min(parameters.spherical_cone_limit + _ROUNDING, math.pi))
        rest = parameters.spherical_rest_angle
        self._along, self._across = math.cos(rest), math.sin(rest)

    def violated(self, geometry: Place) -> bool:
        """Return whether a leg's length, angle or ball joint is beyond its limits."""
        _, (d1, d2, d3), (phi1, phi2, phi3), _, _ = geometry
        low, high = self._shortest, self._longest
        if not (low <= d1 <= high and low <= d2 <= high and low <= d3 <= high):
            return True
        low, high = self._least_angle, self._greatest_angle
        if not (low <= phi1 <= high and low <= phi2 <= high and low <= phi3 <= high):
            return True
        return self._cones and self._cone_violated(geometry)

    def _cone_violated(self, geometry: Place) -> bool:
        """Return whether a leg leaves its ball joint's cone.

        With e and t of `rps_pin.rps.kinematics.rates` and the leg's direction l = -cos(phi) e_i +
        sin(phi) z, l . n = C sin(phi) - A t cos(phi) and l . R e_i = -(C + B e^2) cos(phi) - A t
        sin(phi).
        """
        (_, wx, wy), _, _, way, coefficient = geometry
        a, b, c = coefficient[:3]
        c1, c2, c3, s1, s2, s3 = way
        along, across, least = self._along, self._across, self._least_cosine
        for ex, ey, cosine, sine in ((*_E1, c1, s1), (*_E2, c2, s2), (*_E3, c3, s3)):
            e, at = wx * ex + wy * ey, a * (wy * ex - wx * ey)
            normal, radial = c * sine - at * cosine, -(c + b * e * e) * cosine - at * sine
            # The rest axis is cos(r) n - sin(r) R e_i.
            if along * normal - across * radial < least:
                return True
        return False

    def too_fast(self, speed: Triple) -> bool:
        """Return whether an actuator is beyond its speed limit."""
        return max(speed) > self._greatest_speed or min(speed) < -self._greatest_speed

    def too_strong(self, force: list[float]) -> bool:
        """Return whether an actuator is beyond its force limit."""
        return max(force) > self._greatest_force or min(force) < -self._greatest_force

    def messages(self, geometry: Place) -> list[str]:
        """Return a sentence for each violated limit of length, angle or ball joint."""
        p = self._parameters
        length, angle = np.array(geometry.length), np.array(geometry.angle)
        cone = cone_angles(angle, rotation(np.array(geometry.pose)), p.spherical_rest_angle)
        return [str(one) for one in violations(p, length, angle, cone)]

    def speed_messages(self, speed: Triple) -> list[str]:
        """Return a sentence for each actuator beyond its speed limit."""
        return _beyond("speed", speed, self._greatest_speed, "m/s")

    def force_messages(self, force: Triple) -> list[str]:
        """Return a sentence for each actuator beyond its force limit."""
        return _beyond("force", force, self._greatest_force, "N")


def _beyond(quantity: str, values: Triple, limit: float, unit: str) -> list[str]:
    return [
        f"leg {leg}: {quantity} is {value:.6g} {unit}; its limit is {limit:.6g} {unit}"
        for leg, value in enumerate(values, start=1)
        if abs(value) > limit
    ]

"""The robot's limits in a control loop: checks on floats in each tick, messages on demand."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from rps_pin.control.estimator.leg_geometry import LegGeometry
from rps_pin.numerics.elementary import Number
from rps_pin.rps.kernels.legs import cone_cosine, rest_axis
from rps_pin.rps.kernels.limits import LIMIT_TOLERANCE, length_within, within
from rps_pin.rps.kinematics.legs import RADIAL, cone_angles, violations
from rps_pin.rps.kinematics.pose import rotation
from rps_pin.rps.kinematics.tracking import Triple
from rps_pin.rps.parameters import RPSParameters

_E = tuple((x, y) for x, y, _ in RADIAL.tolist())
#: Least and greatest length, least and greatest angle, cosine of the cone's limit, cosine and sine
#: of the rest angle.
Bounds = tuple[float, float, float, float, float, float, float]


class RobotLimits:
    """The limits of one robot.

    Parameters
    ----------
    parameters
        The robot's.
    """

    def __init__(self, parameters: RPSParameters) -> None:
        self._parameters = p = parameters
        self.greatest_speed = p.actuator_speed_limit
        self.greatest_force = p.actuator_force_limit
        cone, rest = p.spherical_cone_limit, p.spherical_rest_angle
        least_cosine = math.cos(cone + LIMIT_TOLERANCE) if cone < math.pi else -2.0
        lengths, angles = p.leg_length_limits, p.leg_angle_limits
        self.bounds: Bounds = (*lengths, *angles, least_cosine, math.cos(rest), math.sin(rest))

    def violated(self, geometry: LegGeometry) -> bool:
        """Return whether a leg's length, angle or ball joint is beyond its limits."""
        return not within_limits(geometry, self.bounds)

    def too_fast(self, speed: Triple) -> bool:
        """Return whether an actuator is beyond its speed limit."""
        return not none_beyond(speed, self.greatest_speed)

    def too_strong(self, force: Triple) -> bool:
        """Return whether an actuator is beyond its force limit."""
        return not none_beyond(force, self.greatest_force)

    @np.errstate(all="ignore")  # a caller's setting must not make a message raise
    def messages(self, geometry: LegGeometry) -> list[str]:
        """Return a sentence for each violated limit of length, angle or ball joint."""
        p = self._parameters
        length, angle = np.array(geometry.length), np.array(geometry.angle)
        cone = cone_angles(angle, rotation(np.array(geometry.pose)), p.spherical_rest_angle)
        return [str(one) for one in violations(p, length, angle, cone)]

    def actuator_messages(self, quantity: str, values: Iterable[float]) -> list[str]:
        """Return a sentence for each actuator beyond its limit of ``speed`` or ``force``."""
        speed, force = (self.greatest_speed, "m/s"), (self.greatest_force, "N")
        limit, unit = speed if quantity == "speed" else force
        return [
            f"leg {leg}: {quantity} is {value:.6g} {unit}; its limit is {limit:.6g} {unit}"
            for leg, value in enumerate(values, start=1)
            if abs(value) > limit
        ]


def none_beyond(values: Triple, limit: Number) -> Number:
    """Return whether no number's size is beyond a limit."""
    a, b, c = values
    return (abs(a) <= limit) * (abs(b) <= limit) * (abs(c) <= limit)


def within_limits(geometry: LegGeometry, bounds: Bounds) -> Number:
    """Return whether every leg keeps its limits, to rounding."""
    shortest, longest, least, greatest, least_cosine, cos_r, sin_r = bounds
    (_, x, y), length, angle, direction, tilt = geometry
    inside: Number = 1.0
    for leg, (e_x, e_y) in enumerate(_E):
        axis = rest_axis(x * e_x + y * e_y, y * e_x - x * e_y, tilt, cos_r, sin_r)
        cosine = cone_cosine(direction[leg], direction[leg + 3], axis[0], axis[2])
        kept = length_within(length[leg], shortest, longest)
        kept = kept * within(angle[leg], least, greatest)
        inside = inside * kept * (cosine >= least_cosine)  # a product: whether all hold
    return inside

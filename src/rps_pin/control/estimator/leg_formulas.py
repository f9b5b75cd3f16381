"""What a law needs of the 3-RPS's kinematics: on floats in a loop, on CasADi expressions."""

from __future__ import annotations

from rps_pin.control.estimator.leg_geometry import LegGeometry
from rps_pin.control.estimator.leg_jacobian import (
    force_of_wrench,
    leg_speed,
    pose_rate,
    wrench_of_force,
)
from rps_pin.control.estimator.robot_state import leg_motion
from rps_pin.control.loop.vectors import TRIPLES
from rps_pin.numerics.elementary import Number
from rps_pin.rps.kinematics.tracking import Triple


class LegFormulas:
    """See `rps_pin.control.laws.Formulas`.

    Parameters
    ----------
    h
        The platform's radius, m.
    """

    vectors = TRIPLES
    pose_rate = staticmethod(pose_rate)
    force_of_wrench = staticmethod(force_of_wrench)
    speed_of_rate = staticmethod(leg_speed)
    wrench_of_force = staticmethod(wrench_of_force)

    def __init__(self, h: Number) -> None:
        self._h = h

    def motion(
        self, geometry: LegGeometry, rate: Triple, acceleration: Triple
    ) -> tuple[Triple, Triple]:
        """Return the legs' speeds and accelerations."""
        return leg_motion(geometry, rate, acceleration, self._h)

"""The first calls of what Numba compiles, so that none of them falls into a loop."""

from __future__ import annotations

from rps_pin.control.estimator.place import Place, place_of, turning_determinant
from rps_pin.control.estimator.scalar_rates import (
    LegGains,
    force_of_wrench,
    leg_speed,
    wrench_of_force,
)
from rps_pin.control.estimator.scalar_state import leg_motion, state_at
from rps_pin.rps.kinematics.tracking import follow

_STILL = (0.0, 0.0, 0.0)


def warm_up(place: Place, gains: LegGains, g: float, h: float) -> None:
    """Call what a loop calls, with arguments of the same types; see `rps_pin.numerics.compiled`."""
    follow(place.length, place.way, place.length, g, h, 1.0, 1)
    place_of(place.pose, g, h)
    turning_determinant(place, g, h)
    state_at(place, _STILL, _STILL, h)
    leg_motion(place, _STILL, _STILL, h)
    for transform in (leg_speed, force_of_wrench, wrench_of_force):
        transform(gains, _STILL)

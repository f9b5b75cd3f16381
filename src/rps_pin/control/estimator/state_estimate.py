"""The state estimate of a control loop, in floats."""

from __future__ import annotations

from typing import NamedTuple

from rps_pin.control.estimator.place import Place
from rps_pin.control.estimator.scalar_rates import LegGains
from rps_pin.rps.kinematics.tracking import Triple


class StateEstimate(NamedTuple):
    """The motion of the robot by its last good reading."""

    geometry: Place
    """Pose and legs."""
    rate: Triple
    """Of the pose, m/s, rad/s."""
    speed: Triple
    """Of the legs, m/s."""
    jacobian: LegGains
    """Of the leg lengths by the pose."""

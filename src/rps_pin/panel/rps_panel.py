"""Panel of a 3-RPS: sliders of its pose, and of its leg lengths."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, RPSPinError
from rps_pin.panel.panel import Slider, quantity, slider_values
from rps_pin.rps.kinematics.legs import cone_angles, violations
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.measures import singularity_measures
from rps_pin.validation import real_vector

_MM, _DEGREE = 1e3, 180.0 / math.pi
_STILL = np.zeros(3)
#: Tilts that can be asked for, rad.
_LARGEST_TILT = math.radians(60.0)


class RPSPanel:
    """Sliders of a 3-RPS, in two groups: ``"pose"`` and ``"lengths"``.

    A pose beyond the robot's limits is shown, and the limits are listed in `trouble`. Leg lengths
    are followed in the current assembly mode. Where there is no such pose, or the path to it meets
    a singularity, the last pose stays, and `trouble` says why.

    Parameters
    ----------
    robot
        The robot, with its payload.
    pose
        Its first pose, shape (3,), m and rad. Default: level, in the middle of its stroke.

    Raises
    ------
    InputError
        If the pose has the wrong shape, or is left out and the stroke has no end.
    UnreachableError, SingularityError
        If the robot cannot be there.
    """

    def __init__(self, robot: RPSRobot, pose: ArrayLike | None = None) -> None:
        self.robot, self.mechanism = robot, robot.mechanism
        self._free = RPSRobot(robot.parameters.without_limits()).with_payload(robot.payload)
        start = _middle(robot.parameters) if pose is None else real_vector(pose, 3, "pose")
        self.groups = _groups(robot.parameters, float(start[0]))
        self.trouble: list[str] = []
        self._take(start)

    def values(self, group: str) -> Array:
        """Return pose (m, rad, rad) or leg lengths (m), shape (3,)."""
        return (self.pose if group == "pose" else self.length).copy()

    def move(self, group: str, values: Any) -> bool:
        """Go to a pose, or to leg lengths; return whether the robot can."""
        try:
            asked = slider_values(self.groups, group, values)
            if group == "lengths":
                asked = self._free.forward_kinematics(asked, near=self.pose)
            self._take(asked)
        except RPSPinError as error:
            self.trouble = [*self._limits(), f"not followed: {error}"]
            return False
        return True

    def readings(self) -> list[tuple[str, str]]:
        """Return pose, lengths, angles, forces that hold the weight, and the distances."""
        measure = singularity_measures(self.robot.parameters, self.pose, errors="mask")
        return [
            ("height", quantity(self.pose[0], _MM, "mm")),
            ("tilt about x, y", quantity(self.pose[1:], _DEGREE, "degrees")),
            ("centre sideways, x, y", quantity(self.position[:2], 1e6, "um", 1)),
            ("leg lengths", quantity(self.length, _MM, "mm")),
            ("leg angles", quantity(self.angle, _DEGREE, "degrees", 2)),
            ("forces that hold it", quantity(self.force, 1.0, "N")),
            ("distance to type II", f"{float(measure.type_ii):.4f} (0 singular, 1 best)"),
        ]

    @property
    def configuration(self) -> Array:
        """Pinocchio's q, shape (13,)."""
        return self._q

    def visual_model(self) -> pin.GeometryModel:
        """Return the robot's visual geometry."""
        return self.robot.visual_model()

    def _take(self, pose: Array) -> None:
        """Go to a pose."""
        q = self._free.state(pose, _STILL, _STILL)[0]
        legs = self._free.inverse_kinematics(pose)
        force = self._free.actuator_forces(pose, _STILL, _STILL)
        self.position, self._rotation = self._free.platform_placement(pose)
        self.pose, self._q, self.force = pose.copy(), q, force
        self.length, self.angle = legs.length, legs.angle
        self.trouble = self._limits()

    def _limits(self) -> list[str]:
        """Return a sentence for each limit that is broken."""
        p = self.robot.parameters
        cone = cone_angles(self.angle, self._rotation, p.spherical_rest_angle)
        words = [str(one) for one in violations(p, self.length, self.angle, cone)]
        limit = p.actuator_force_limit
        return words + [
            f"leg {leg}: force would be {force:.6g} N; its limit is {limit:.6g} N"
            for leg, force in enumerate(self.force.tolist(), start=1)
            if abs(force) > limit
        ]


def _middle(parameters: RPSParameters) -> Array:
    """Return the level pose whose legs are in the middle of their stroke."""
    low, high = parameters.leg_length_limits
    if math.isinf(high):
        high = 1.2 * max(parameters.base_radius, parameters.platform_radius) + low
        low = 0.5 * high
    length, inwards = (low + high) / 2, parameters.base_radius - parameters.platform_radius
    if length <= abs(inwards):
        raise InputError("there is no level pose in the middle of the stroke; give a first pose")
    return np.array([math.sqrt(length**2 - inwards**2), 0.0, 0.0])


def _groups(parameters: RPSParameters, height: float) -> dict[str, tuple[Slider, ...]]:
    low, high = parameters.leg_length_limits
    if math.isinf(high):
        low, high = 0.3 * height, 2.0 * height
    room = 0.2 * (high - low)
    lowest, highest = max(low - room, 0.01 * high), high + room
    tilt = _DEGREE * _LARGEST_TILT
    step = round(_MM * (highest - lowest) / 2000, 3) or 0.001
    height_slider, *legs = (
        Slider(f"{name} (mm)", _MM * lowest, _MM * highest, step, _MM)
        for name in ("height", "leg 1", "leg 2", "leg 3")
    )
    tilts = [Slider(f"tilt about {axis} (degrees)", -tilt, tilt, 0.05, _DEGREE) for axis in "xy"]
    return {"pose": (height_slider, *tilts), "lengths": tuple(legs)}

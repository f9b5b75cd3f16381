"""Panel of a 3-RPS: its pose, and its leg lengths, with closed forms."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.panel.panel import Actuator, Panel
from rps_pin.panel.slider import DEGREE, MM, Slider, quantity, slider
from rps_pin.rps.kinematics.legs import cone_angles, violations
from rps_pin.rps.leg_frames import LEGS
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.measures import singularity_measures
from rps_pin.task.maps import TaskState
from rps_pin.trajectories.path import Trajectory
from rps_pin.validation import real_vector

_STILL = np.zeros(3)
#: Tilts that can be asked for, rad.
_LARGEST_TILT = math.radians(60.0)
#: The joint whose links show that a limit is broken.
_SHOWS = {"length": "prismatic", "angle": "revolute", "spherical joint": "prismatic"}


class RPSPanel(Panel):
    """Panel of a 3-RPS, with sliders in two groups: ``"pose"`` and ``"lengths"``.

    A pose beyond the robot's limits is shown, and the limits are listed in `trouble`. Leg lengths
    are followed in the current assembly mode. Where there is no such pose, or the path to it meets
    a singularity, the last pose stays, and `trouble` says why.

    Parameters
    ----------
    robot
        The robot, with its payload.
    pose
        Its first pose, shape (3,), m and rad. Default: level, in the middle of its stroke.

    Attributes
    ----------
    pose, length, angle, force : ndarray, shape (3,)
        Pose (m, rad, rad); lengths (m), angles (rad) and forces (N) of the legs.
    place : ndarray, shape (3,)
        Of the platform's centre, m.

    Raises
    ------
    InputError
        If the pose has the wrong shape, or is left out and the stroke has no end.
    UnreachableError, SingularityError
        If the robot cannot be there.
    """

    task_group, actuator_group = "pose", "lengths"

    def __init__(self, robot: RPSRobot, pose: ArrayLike | None = None) -> None:
        self.robot = robot
        self._free = RPSRobot(robot.parameters.without_limits()).with_payload(robot.payload)
        start = _middle(robot.parameters) if pose is None else real_vector(pose, 3, "pose")
        actuators = tuple(Actuator(f"leg {leg}", MM, "mm", "N") for leg in LEGS)
        q = self._free.state(start, _STILL, _STILL)[0]
        super().__init__(robot.mechanism, robot.task, actuators, q)

    def visual_model(self) -> pin.GeometryModel:
        """Return the robot's visual geometry."""
        return self.robot.visual_model()

    def coordinates(self) -> list[tuple[str, str]]:
        """Return height and tilt."""
        return [
            ("height", quantity(self.pose[0], MM, "mm")),
            ("tilt about x, y", quantity(self.pose[1:], DEGREE, "degrees")),
        ]

    def of_actuators(self) -> list[tuple[str, str]]:
        """Return leg lengths, and the forces that hold the weight or move it."""
        return [
            ("leg lengths", quantity(self.length, MM, "mm")),
            ("forces that hold it", quantity(self.force, 1.0, "N")),
        ]

    def remarks(self) -> list[tuple[str, str]]:
        """Return the centre's place, the legs' angles, and the distances to singularities."""
        measure = singularity_measures(self.robot.parameters, self.pose, errors="mask")
        return [
            ("centre sideways, x, y", quantity(self.place[:2], 1e6, "um", 1)),
            ("leg angles", quantity(self.angle, DEGREE, "degrees", 2)),
            ("distance to type II", f"{float(measure.type_ii):.4f} (0 singular, 1 best)"),
            *super().remarks(),
        ]

    def _sliders(self) -> dict[str, tuple[Slider, ...]]:
        height, limits = float(self.pose[0]), self.robot.parameters.leg_length_limits
        low, high = (0.3 * height, 2.0 * height) if math.isinf(limits[1]) else limits
        room = 0.2 * (high - low)
        ends = max(low - room, 0.01 * high), high + room
        tilts = [slider(f"tilt about {axis}", True, -_LARGEST_TILT, _LARGEST_TILT) for axis in "xy"]
        legs = [slider(f"leg {leg}", False, *ends, limits) for leg in LEGS]
        return {"pose": (slider("height", False, *ends), *tilts), "lengths": tuple(legs)}

    def _read(self, path: str | os.PathLike[str]) -> Trajectory:
        from rps_pin.rps.motion.trajectory_file import load_trajectory  # noqa: PLC0415

        return load_trajectory(path, self.robot)

    def _of_task(self, x: Array, near: Array) -> Array:
        return self._free.state(x, _STILL, _STILL)[0]

    def _of_actuators(self, position: Array) -> Array:
        pose = self._free.forward_kinematics(position, near=self.pose)
        return self._of_task(np.asarray(pose), self._q)

    def _moving(self, q: Array, x: Array, rate: Array, acceleration: Array) -> TaskState:
        return TaskState(*self._free.state(x, rate, acceleration))

    def _dynamics(self, state: TaskState) -> Array:
        return np.asarray(self._free.inverse_dynamics(*state).tau)

    def _take(self, q: Array, x: Array | None = None, state: TaskState | None = None) -> None:
        pose = self._free.task.at(q) if x is None else x.copy()
        self._free.actuator_forces(pose, _STILL, _STILL)  # or refuses: it is singular
        legs = self._free.inverse_kinematics(pose)
        self.place, self._rotation = self._free.platform_placement(pose)
        self.pose, self.length, self.angle = pose, legs.length, legs.angle
        super()._take(q, pose, state)

    @property
    def force(self) -> Array:
        """Forces of the legs, shape (3,), N."""
        return self.forces

    def _broken(self) -> Iterable[tuple[str, str]]:
        p = self.robot.parameters
        cone = cone_angles(self.angle, self._rotation, p.spherical_rest_angle)
        for one in violations(p, self.length, self.angle, cone):
            scale, unit = (DEGREE, "degrees") if one.unit == "rad" else (MM, "mm")
            value, lower, upper = (scale * part for part in (one.value, one.lower, one.upper))
            said = one._replace(value=value, lower=lower, upper=upper, unit=unit)
            yield str(said), f"leg_{one.leg}_{_SHOWS[one.quantity]}"

    def _too_weak(self) -> Iterable[tuple[str, str]]:
        limit = self.robot.parameters.actuator_force_limit
        for leg, force in zip(LEGS, self.force.tolist(), strict=True):
            if abs(force) > limit:
                said = f"leg {leg}: force would be {force:.6g} N; its limit is {limit:.6g} N"
                yield said, f"leg_{leg}_prismatic"


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

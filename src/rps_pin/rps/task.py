"""The task of the 3-RPS, its pose, with closed forms behind the names of `Task`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.rps.kinematics.legs import leg_motion, legs_of_pose
from rps_pin.rps.kinematics.pose import checked_motion, platform_motion, platform_pose
from rps_pin.rps.kinematics.rates import leg_jacobian_rates, leg_jacobians
from rps_pin.rps.kinematics.samples import Errors
from rps_pin.rps.singularity.measures import singularity_measures
from rps_pin.rps.singularity.path_signals import RobotLimits
from rps_pin.task import SingularityMeasures, Task, TaskState


class RPSTask(Task):
    """The pose ``(z, tilt_x, tilt_y)`` of a 3-RPS as a `Task`: coordinates z, rx and ry.

    A pose has one set of leg lengths and angles, so that no configuration is needed to continue
    from; `near` counts in `to_task`. Errors are those of `RPSRobot`, and with
    ``within_limits=True`` its limits are the robot's: leg lengths, leg angles and cones of the
    spherical joints. Singularity measures are those of `rps_pin.rps.singularity.measures`.
    """

    def __init__(self, robot: Any) -> None:  # an `RPSRobot`, whose module imports this one
        super().__init__(robot.mechanism, "platform", ["z", "rx", "ry"])
        self._robot = robot

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._robot,)

    @property
    def robot(self) -> Any:
        """The `RPSRobot`."""
        return self._robot

    def compile(self, **options: Any) -> RPSTask:
        """Return the same task of the robot in generated code; see `RPSRobot.compile`."""
        return RPSTask(self._robot.compile(**options))

    def with_mechanism(self, mechanism: ClosedLoopModel) -> Any:
        """Return the task of another mechanism, without closed forms; see `Task`."""
        return Task(mechanism, **self._options)

    def at(self, q: ArrayLike, near: ArrayLike | None = None, *, errors: Errors = "raise") -> Array:
        """Return poses of configurations; see `Task.at`."""
        return platform_pose(self._rows(q, self._nq, "q"))

    def to_actuators(
        self,
        x: ArrayLike,
        near: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        errors: Errors = "raise",
    ) -> Array:
        """Return leg lengths of poses, shape (..., 3); see `Task.to_actuators`."""
        refuse = within_limits and errors == "raise"
        legs = self._robot.inverse_kinematics(x, errors="raise" if refuse else "mask")
        if not within_limits:
            return np.asarray(legs.length)
        return np.where(legs.reachable[..., None], legs.length, np.nan)

    def configuration(
        self,
        x: ArrayLike,
        near: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        errors: Errors = "raise",
    ) -> Array:
        """Return configurations of poses, shape (..., 13); see `Task.configuration`."""
        if not within_limits:
            return super().configuration(x, near, within_limits=False, errors=errors)
        still = np.zeros(self.size)
        return self.state(x, still, still, errors=errors).q

    def to_task(
        self,
        a: ArrayLike,
        near: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        errors: Errors = "raise",
    ) -> Array:
        """Return poses of leg lengths, shape (..., 3); see `Task.to_task`."""
        start = self.home if near is None else self.at(near)
        found = self._robot.forward_kinematics(self._rows(a, 3, "a"), start, errors=errors)
        pose = np.ma.filled(found, np.nan)
        reached = np.isfinite(pose).all(axis=-1, keepdims=True)
        if not within_limits:
            return pose
        whole = np.where(reached, pose, self.home)
        within = self._robot.inverse_kinematics(whole, errors=errors).reachable
        return np.where(reached & within[..., None], pose, np.nan)

    def jacobian(
        self, q: ArrayLike, *, x: ArrayLike | None = None, errors: Errors = "raise"
    ) -> Array:
        """Return K = d(lengths)/d(pose), shape (..., 3, 3)."""
        return leg_jacobians(self._robot.parameters, self.at(q)).length_jacobian

    def bias(
        self,
        q: ArrayLike,
        rate: ArrayLike,
        *,
        x: ArrayLike | None = None,
        errors: Errors = "raise",
    ) -> Array:
        """Return K' pose', shape (..., 3)."""
        pose, rate_ = self.at(q), self._rows(rate, self.size, "rate")
        change = leg_jacobian_rates(self._robot.parameters, pose, rate_).length_jacobian
        return np.asarray((change @ rate_[..., None])[..., 0])

    def state(
        self,
        x: ArrayLike,
        rate: ArrayLike,
        acceleration: ArrayLike,
        near: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        errors: Errors = "raise",
    ) -> TaskState:
        """Return q, v and a of motions of the pose; see `Task.state`."""
        if not within_limits:
            return super().state(x, rate, acceleration, near, within_limits=False, errors=errors)
        return TaskState(*self._robot.state(x, rate, acceleration, errors=errors))

    def motion(
        self,
        q: ArrayLike,
        rate: ArrayLike,
        acceleration: ArrayLike,
        *,
        x: ArrayLike | None = None,
        errors: Errors = "raise",
    ) -> TaskState:
        """Return q, v and a at configurations, within limits or not; see `Task.motion`."""
        pose, dx, ddx = checked_motion(self.at(q), rate, acceleration)
        p = self._robot.parameters
        of_pose = legs_of_pose(pose, p.base_radius, p.platform_radius)
        gone = of_pose.geometry.vanishing.any(axis=-1, keepdims=True)
        if errors == "mask" and gone.any():
            pose = np.where(gone, self.home, pose)
            of_pose = legs_of_pose(pose, p.base_radius, p.platform_radius)
        legs = leg_motion(pose, dx, ddx, p.platform_radius, p.base_radius, of_pose)
        moved = platform_motion(pose, dx, ddx, p.platform_radius)
        found = self._robot.state_of(pose, moved, legs)
        return TaskState(*(np.where(gone, np.nan, part) for part in found))

    def position_limits(self) -> RobotLimits:
        """Return the robot's limits: lengths, angles and cones of the legs."""
        return RobotLimits(self._robot.parameters)

    def rate(
        self,
        q: ArrayLike,
        v: ArrayLike,
        *,
        x: ArrayLike | None = None,
        errors: Errors = "raise",
    ) -> Array:
        """Return the poses' rates, from the free platform's velocity; see `Task.rate`."""
        q_, v_ = self._rows(q, self._nq, "q"), self._rows(v, self._nv, "v")
        batch = np.broadcast_shapes(q_.shape[:-1], v_.shape[:-1])
        every = np.broadcast_to(q_, (*batch, self._nq)), np.broadcast_to(v_, (*batch, self._nv))
        found = np.empty((*batch, 3))
        for index in np.ndindex(batch):
            found[index] = _platform_rate(every[0][index], every[1][index])
        return found

    def singularities(self, q: ArrayLike) -> SingularityMeasures:
        """Return how far configurations are from singularities, in closed form."""
        return singularity_measures(self._robot.parameters, self.at(q), errors="mask")


def _platform_rate(q: Array, v: Array) -> Array:
    """Return the pose's rate at one configuration, (3,)."""
    rotation = pin.Quaternion(q[9:13]).matrix()
    tilting = pin.Jlog3(rotation) @ v[9:12]
    return np.array([rotation[2] @ v[6:9], tilting[0], tilting[1]])

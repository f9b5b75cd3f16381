"""What a controller knows of any mechanism with a task; see `rps_pin.control.model`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.control.any_task.estimate import FARTHEST, REFUSED, TaskEstimate
from rps_pin.control.any_task.motion import TaskGeometry, TaskJacobian, TaskMotion
from rps_pin.control.any_task.tick import generated_task_tick
from rps_pin.control.estimator.loop_arguments import floats
from rps_pin.control.generated.code import GeneratedTick
from rps_pin.control.generated.proof import MakeLoop
from rps_pin.control.loop.rejoining import rejoining_time
from rps_pin.control.loop.vectors import arrays
from rps_pin.errors import ClosureError, CompileError
from rps_pin.task import Task

_LARGEST = 1e6


class TaskModel:
    """A task, and its state estimate, on arrays.

    Parameters
    ----------
    task, near
        As for `TaskEstimate`.
    **settings
        Likewise.
    """

    rows = "rows of numbers, one for each coordinate"

    def __init__(self, task: Task, near: ArrayLike, **settings: Any) -> None:
        self.task = task
        self.estimate = TaskEstimate(task, near, **settings)
        self.size, self.vectors = task.size, arrays(task.size)
        self.actuators = task.of_actuators.size
        self._per_length = task.scale / task.characteristic_length
        self.units = tuple("rad" if one else "m" for one in task.angular)
        if task.compiled:  # what is generated when it is first called, is so before the loop
            self.mass(self.estimate.state.geometry)
        self.engine = "generated code" if task.compiled else "the Pinocchio engine"
        self.largest = _LARGEST * max(1.0, task.characteristic_length)

    def coordinates(self, values: Any) -> Array | None:
        """Return finite numbers, one for each coordinate."""
        return floats(values, self.size)

    # Positions ------------------------------------------------------------------------------------

    def geometry(self, pose: Array, near: TaskGeometry) -> TaskGeometry | None:
        """Return the geometry of a pose in the assembly mode of another."""
        try:
            return self._continued(pose, near)
        except REFUSED:
            return None

    def out_of_reach(self, pose: Array, near: TaskGeometry) -> str:
        """Return why there is none."""
        try:
            self._continued(pose, near)
        except REFUSED as error:
            return f"is out of reach: {error}"
        return "is out of reach"

    def _continued(self, pose: Array, near: TaskGeometry) -> TaskGeometry:
        away = float((np.abs(pose - near.pose) * self._per_length).max())
        if not away <= FARTHEST:
            raise ClosureError(
                f"it is {away:.3g} rad or characteristic lengths from the last one; at most "
                f"{FARTHEST:g} are followed in a tick",
                away,
            )
        q = self.task.configuration(pose, near.configuration, within_limits=False)
        return self.estimate.geometry_of(q, pose)

    def violated(self, geometry: TaskGeometry) -> bool:
        """Return whether a joint is beyond its limits."""
        return self.estimate.beyond(geometry.configuration)

    def messages(self, geometry: TaskGeometry) -> list[str]:
        """Return a sentence for each such joint."""
        return self.estimate.messages(geometry.configuration)

    def determinant(self, geometry: TaskGeometry) -> float:
        """Return the distance to a singularity, with the sign of K's determinant."""
        return geometry.side * geometry.distance

    def near_singular(self, state: TaskMotion, least: float) -> bool:
        """Return whether the distance is at most that."""
        return not state.geometry.distance > least

    def rejoining_time(self, held: TaskGeometry, target: TaskGeometry) -> float:
        """Return the duration at half of the actuators' speed limits."""
        way = np.abs(held.length - target.length) / self.estimate.speed_limit
        return rejoining_time(float(way.max()), 1.0)

    def extrapolated(self, state: TaskMotion, time: float) -> TaskMotion | None:
        """Return the state after a time at the last rate."""
        geometry = self.geometry(state.geometry.pose + time * state.rate, state.geometry)
        if geometry is None:
            return None
        try:
            K = self.task.jacobian(geometry.configuration, x=geometry.pose)
        except REFUSED:
            return None
        jacobian = TaskJacobian(K, self.determinant(geometry))
        return TaskMotion(geometry, state.rate, state.speed, jacobian)

    # Generated code -------------------------------------------------------------------------------

    def generated_tick(
        self, law: str, near: ArrayLike, make: MakeLoop, answers: Any, own: Any, given: Any = None
    ) -> tuple[GeneratedTick | None, str]:
        """Return machine code of ticks, if there is any, and what runs; see `generated_task_tick`.

        Without it, the maps and the dynamics are generated code all the same, if the task is.
        """
        if not self.task.compiled:
            return None, self.engine
        try:
            tick = generated_task_tick(self.task, law, near, make, answers, own, given)
        except (CompileError, ImportError) as error:
            words = str(error).splitlines()[0]
            return None, f"{self.engine}, called by an interpreted tick: {words}"
        return tick, tick.engine

    def numbers(self) -> dict[str, Any]:
        """Return what generated code takes of the robot."""
        return {**self.estimate.numbers(), "largest": self.largest}

    def setpoint_memory(self, geometry: TaskGeometry) -> dict[str, Any]:
        """Return what the next tick takes of the target's geometry."""
        names = ("target", "target_reference", "target_values")
        place = self.estimate.place_of(geometry, names)
        return {**place, "target_pose": geometry.pose.tolist()}

    def setpoint_geometry(self, memory: dict[str, Any]) -> TaskGeometry:
        """Return the geometry of the target in generated code's memory."""
        q = np.array(memory["target"], ndmin=1)[: self.task.mechanism.model.nq]
        return self.estimate.geometry_of(q, np.array(memory["target_pose"], ndmin=1))

    # Motions and forces ---------------------------------------------------------------------------

    def motion(self, geometry: TaskGeometry, rate: Array, acceleration: Array) -> Any:
        """Return the actuators' speeds and accelerations, NaN if they are not determined."""
        indices = self.task.mechanism.actuated_indices
        try:
            q, x = geometry.configuration, geometry.pose
            state = self.task.motion(q, rate, acceleration, x=x)
        except REFUSED:
            unknown = np.full(self.actuators, np.nan)
            return unknown, unknown
        return state.v[indices], state.a[indices]

    def forces(self, geometry: TaskGeometry, rate: Array, acceleration: Array) -> Array | None:
        """Return the actuator forces of a motion, None if they are not determined."""
        try:
            q, x = geometry.configuration, geometry.pose
            state = self.task.motion(q, rate, acceleration, x=x)
            return self.task.actuator_forces(*state)
        except REFUSED:
            return None

    def mass(self, geometry: TaskGeometry) -> Array:
        """Return the task's mass matrix."""
        return self.task.mass_matrix(geometry.configuration, x=geometry.pose)

    def pose_rate(self, jacobian: TaskJacobian, speed: Array) -> Array:
        """Return x' of K x' = the actuators' speeds, NaN if it is not determined."""
        try:
            return self.estimate.least_rate(jacobian.K, speed)
        except np.linalg.LinAlgError:
            return np.full(self.size, np.nan)

    def force_of_wrench(self, jacobian: TaskJacobian, wrench: Array) -> Array:
        """Return f of K' f = wrench, of the least norm; NaN if it is not determined."""
        try:
            return self.estimate.least_force(jacobian.K, wrench)
        except np.linalg.LinAlgError:
            return np.full(self.actuators, np.nan)

    def speed_of_rate(self, jacobian: TaskJacobian, rate: Array) -> Array:
        """Return K x'."""
        return jacobian.K @ np.asarray(rate)

    def wrench_of_force(self, jacobian: TaskJacobian, force: Array) -> Array:
        """Return K' f."""
        return jacobian.K.T @ np.asarray(force)

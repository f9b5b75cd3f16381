"""What a controller knows of its robot: that of the 3-RPS in closed form, or that of any task.

``rps_pin.control.estimator.leg_model.LegModel`` is the 3-RPS's, on triples of floats;
``rps_pin.control.any_task.model.TaskModel`` that of a task, on arrays.
"""

from __future__ import annotations

from typing import Any, Protocol

from rps_pin.arrays import Array
from rps_pin.control.loop.vectors import Vectors


class ControlModel(Protocol):
    """A robot as setpoints, laws and limits see it.

    A geometry is a pose with all that follows from it alone: `LegGeometry` or `TaskGeometry`; a
    Jacobian is `LegJacobian` or `TaskJacobian`. No method raises for the values of its arguments.
    """

    vectors: Vectors
    size: int
    """Number of coordinates."""
    actuators: int
    """Number of actuators."""
    units: tuple[str, ...]
    """Of the coordinates."""
    rows: str
    """What a pose, a rate and an acceleration are."""
    largest: float
    """Largest entry of a rate and an acceleration, in SI units."""
    estimate: Any
    """`RealTimeRobot` or `TaskEstimate`."""

    def coordinates(self, values: Any) -> Any:
        """Return finite numbers, one for each coordinate; None if the argument is anything else."""
        ...

    def geometry(self, pose: Any, near: Any) -> Any:
        """Return the geometry of a pose, continued from another; None where there is none."""
        ...

    def out_of_reach(self, pose: Any, near: Any) -> str:
        """Return why there is no geometry of a pose."""
        ...

    def violated(self, geometry: Any) -> bool:
        """Return whether a limit of position is violated."""
        ...

    def messages(self, geometry: Any) -> list[str]:
        """Return a sentence for each such limit."""
        ...

    def determinant(self, geometry: Any) -> float:
        """Return the signed distance to where forces are not determined, 0 there."""
        ...

    def near_singular(self, state: Any, least: float) -> bool:
        """Return whether a state is nearer to a singularity than that."""
        ...

    def rejoining_time(self, held: Any, target: Any) -> float:
        """Return the duration of the way from a held setpoint to a target, s."""
        ...

    def extrapolated(self, state: Any, time: float) -> Any:
        """Return the state after a time at the last rate; None where there is none."""
        ...

    def numbers(self) -> dict[str, Any]:
        """Return what generated code takes of the robot."""
        ...

    def setpoint_memory(self, geometry: Any) -> dict[str, Any]:
        """Return what generated code's next tick takes of the target's geometry."""
        ...

    def setpoint_geometry(self, memory: dict[str, Any]) -> Any:
        """Return the geometry of the target in generated code's memory."""
        ...

    def forces(self, geometry: Any, rate: Any, acceleration: Any) -> Any:
        """Return the actuator forces of a motion; None where they are not determined."""
        ...

    def mass(self, geometry: Any) -> Array:
        """Return the mass matrix of the pose, (m, m)."""
        ...

    def motion(self, geometry: Any, rate: Any, acceleration: Any) -> tuple[Any, Any]:
        """Return the actuators' speeds and accelerations."""
        ...

    def pose_rate(self, jacobian: Any, speed: Any) -> Any:
        """Return x' of K x' = the actuators' speeds."""
        ...

    def force_of_wrench(self, jacobian: Any, wrench: Any) -> Any:
        """Return f of K' f = wrench on the pose."""
        ...

    def speed_of_rate(self, jacobian: Any, rate: Any) -> Any:
        """Return K x'."""
        ...

    def wrench_of_force(self, jacobian: Any, force: Any) -> Any:
        """Return K' f."""
        ...

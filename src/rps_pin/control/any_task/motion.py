"""A task's pose, Jacobian and state in a control loop, on arrays."""

from __future__ import annotations

from typing import Any, NamedTuple

from rps_pin.arrays import Array


class TaskGeometry(NamedTuple):
    """A pose, and what follows from it and its assembly mode."""

    pose: Array
    """Coordinates, (m,)."""
    length: Array
    """Positions of the actuators, (na,), m or rad."""
    configuration: Array
    """All joints', (nq,)."""
    distance: float
    """`SingularityMeasures.distance`."""
    side: float
    """Sign of `SingularityMeasures.determinant`."""


class TaskJacobian(NamedTuple):
    """K = d(actuators)/d(task)."""

    K: Array
    """Shape (na, m)."""
    determinant: float
    """`TaskGeometry.distance`, with the sign of K's determinant."""


class TaskMotion(NamedTuple):
    """The motion of a mechanism by its last good reading."""

    geometry: TaskGeometry
    rate: Array
    """Of the coordinates, (m,)."""
    speed: Array
    """Of the actuators, (na,)."""
    jacobian: TaskJacobian


class TaskAnswers(NamedTuple):
    """Float arrays that a `TaskEstimate` writes its results to; SI units."""

    pose: Array
    """The task's coordinates, shape (m,)."""
    rate: Array
    """Their time derivatives, shape (m,)."""
    position: Array
    """Positions of the actuators, as read, shape (na,)."""
    speed: Array
    """Their speeds, measured or filtered, shape (na,)."""
    configuration: Array
    """Positions of all joints, shape (nq,)."""


def departure(position: Any, last: Any, speed: Any, elapsed: Any) -> Any:
    """Return positions less the last ones, moved at their speed, m or rad; of arrays or columns."""
    return position - last - speed * elapsed

"""Inertia of the robot in task and actuator space: M_x = T' M T.

T is the tree's velocity per unit rate of the pose. With K = d(length)/d(pose), actuator forces f
accelerate the pose by

    x'' = M_x^-1 (K' f - ...),

and the inertia in actuator space, with d' = K x', is K^-T M_x K^-1.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.control.estimator.leg_geometry import LegGeometry, leg_geometry
from rps_pin.control.estimator.leg_jacobian import leg_jacobian
from rps_pin.control.estimator.robot_state import robot_state
from rps_pin.control.robots import Robot, task_of
from rps_pin.errors import SingularityError, UnreachableError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.robot import RPSRobot
from rps_pin.validation import choice, real_vector

_UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_ZERO = (0.0, 0.0, 0.0)
#: T (12, 3), column by column, and q (13) in one buffer: faster to fill at once.
_NUMBERS = struct.Struct("49d")


class TaskSpaceInertia:
    """M_x of one robot, with its memory allocated once; for use in one thread.

    Parameters
    ----------
    robot
        The robot, with its payload.
    """

    def __init__(self, robot: RPSRobot) -> None:
        self._robot = robot
        self._model = robot.mechanism.model
        self._data = self._model.createData()
        self._h = robot.parameters.platform_radius
        self._memory = bytearray(_NUMBERS.size)
        numbers = np.frombuffer(self._memory)
        self._basis, self._q = numbers[:36].reshape(12, 3, order="F"), numbers[36:]
        self._half = np.triu(np.ones((12, 12)), 1) + np.eye(12) / 2

    def __reduce__(self) -> tuple[Any, ...]:
        """Give copies scratch memory of their own; there is no state."""
        return type(self), (self._robot,)

    def of(self, geometry: LegGeometry) -> Array:
        """Return M_x in a pose, shape (3, 3): kg, kg m and kg m^2."""
        numbers: list[float] = []
        for unit in _UNITS:
            state = robot_state(geometry, unit, _ZERO, self._h)
            numbers += state[13:25]
        _NUMBERS.pack_into(self._memory, 0, *numbers, *state[:13])
        # crba fills the upper triangle only: M = U + U', U with half of the diagonal.
        upper = pin.crba(self._model, self._data, self._q) * self._half
        reduced: Array = self._basis.T @ upper @ self._basis
        return reduced + reduced.T


@refuses_other_kinds
def effective_inertia(robot: Robot, pose: ArrayLike, *, space: str = "actuator") -> Array:
    """Return the inertia of each error of a control law in a pose, shape (m,).

    Argument of `Gains.times`, which gives a law that commands forces the stiffness of one that
    commands accelerations. It is the diagonal of the inertia matrix: the coupling between the
    errors, which computed torque compensates, is not in it.

    Parameters
    ----------
    robot
        The robot, with its payload; an `RPSRobot`, a `Task`, or a `ClosedLoopModel` that has one.
    pose
        Shape (m,), m and rad; of a task in the assembly mode of home.
    space
        ``"actuator"``: of the legs, kg. ``"task"``: of (z, tilt_x, tilt_y), kg and kg m^2. Of a
        task: of the actuators and of the coordinates.

    Raises
    ------
    InputError
        If the pose has another shape, or there is no such space.
    UnreachableError, ClosureError
        If the pose is out of reach.
    SingularityError
        If the pose is singular, in actuator space.
    """
    choice(space, "space", ("actuator", "task"))
    if not isinstance(robot, RPSRobot):
        task = task_of(robot)
        q = task.configuration(real_vector(pose, task.size, "pose"))
        mass = task.mass_matrix(q) if space == "task" else task.mechanism.mass_matrix(q)
        return mass.diagonal().copy()
    p = robot.parameters
    z, tilt_x, tilt_y = real_vector(pose, 3, "pose").tolist()
    geometry = leg_geometry((z, tilt_x, tilt_y), p.base_radius, p.platform_radius)
    if geometry is None:
        raise UnreachableError("a leg has no length in the pose", ())
    mass = TaskSpaceInertia(robot).of(geometry)
    if space == "task":
        return mass.diagonal().copy()
    jacobian = leg_jacobian(geometry, p.platform_radius)
    determinant = jacobian.determinant
    if abs(determinant) < 1e-8:
        message = f"the pose is singular: determinant {determinant:.3g}"
        raise SingularityError(message, 1 / max(abs(determinant), 1e-300), 1e8)
    inverse = np.linalg.inv(np.array(jacobian.K))
    return np.asarray(np.einsum("ji,jk,ki->i", inverse, mass, inverse))

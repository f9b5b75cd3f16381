"""The robot's inertia by its pose: M_x = T' M T, with T the tree's velocity for a unit rate each.

With K the legs' speeds by the pose's rate, actuator forces f accelerate the pose by

    x'' = M_x^-1 (K' f - ...),

and the inertia that the actuators see, with d' = K x', is K^-T M_x K^-1.
"""

from __future__ import annotations

import struct

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.control.estimator.place import Place, place_of
from rps_pin.control.estimator.scalar_rates import leg_gains
from rps_pin.control.estimator.scalar_state import state_at
from rps_pin.errors import InputError, SingularityError, UnreachableError
from rps_pin.rps.kinematics.pose import checked_pose
from rps_pin.rps.robot import RPSRobot

_UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_STILL = (0.0, 0.0, 0.0)
#: T (12, 3), column by column, and q (13), one after the other: packed at once.
_NUMBERS = struct.Struct("49d")


class ReducedMass:
    """M_x of one robot; for use in one thread. Its memory is allocated once.

    Parameters
    ----------
    robot
        The robot, with its payload.
    """

    def __init__(self, robot: RPSRobot) -> None:
        self._model = robot.mechanism.model
        self._data = self._model.createData()
        self._h = robot.parameters.platform_radius
        self._memory = bytearray(_NUMBERS.size)
        numbers = np.frombuffer(self._memory)
        self._basis, self._q = numbers[:36].reshape(12, 3, order="F"), numbers[36:]
        self._half = np.triu(np.ones((12, 12)), 1) + np.eye(12) / 2

    def of(self, place: Place) -> Array:
        """Return M_x at a place, shape (3, 3): kg, kg m and kg m^2."""
        numbers: list[float] = []
        for unit in _UNITS:
            state = state_at(place, unit, _STILL, self._h)
            (w1, s1, _, _), (w2, s2, _, _), (w3, s3, _, _) = state.legs
            numbers += (w1, s1, w2, s2, w3, s3, *state.velocity)
        (phi1, phi2, phi3), (d1, d2, d3) = place.angle, place.length
        numbers += (phi1, d1, phi2, d2, phi3, d3, *state.placement)
        _NUMBERS.pack_into(self._memory, 0, *numbers)
        # crba fills the upper triangle only: M = U + U', U with half of the diagonal.
        upper = pin.crba(self._model, self._data, self._q) * self._half
        reduced: Array = self._basis.T @ upper @ self._basis
        return reduced + reduced.T


def effective_inertia(robot: RPSRobot, pose: ArrayLike, *, space: str = "actuator") -> Array:
    """Return the inertia that each error of a control law sees in a pose, shape (3,).

    What `Gains.times` takes, to make a law that commands forces as stiff as one that commands
    accelerations, at this pose. It is the diagonal of the inertia matrix; the rest, by which one
    error moves another, is what computed torque takes care of and such a law does not.

    Parameters
    ----------
    robot
        The robot, with its payload.
    pose
        Shape (3,), m and rad.
    space
        ``"actuator"``: of the legs, kg. ``"task"``: of (z, tilt_x, tilt_y), kg and kg m^2.

    Raises
    ------
    InputError
        If the pose has another shape, or there is no such space.
    UnreachableError
        If a leg has no length in the pose.
    SingularityError
        If the pose is singular, in actuator space.
    """
    if space not in ("actuator", "task"):
        raise InputError(f"space = {space!r}; it must be 'actuator' or 'task'")
    x = checked_pose(pose)
    if x.shape != (3,):
        raise InputError(f"pose has shape {x.shape}; it must be (3,)")
    p = robot.parameters
    z, tilt_x, tilt_y = x.tolist()
    place = place_of((z, tilt_x, tilt_y), p.base_radius, p.platform_radius)
    if place is None:
        raise UnreachableError("a leg has no length in the pose", ())
    mass = ReducedMass(robot).of(place)
    if space == "task":
        return mass.diagonal().copy()
    gains = leg_gains(place.pose, place.way, place.coefficient, p.platform_radius)
    if abs(gains.determinant) < 1e-8:
        raise SingularityError(
            f"the pose is singular: determinant {gains.determinant:.3g}",
            1 / max(abs(gains.determinant), 1e-300),
            1e8,
        )
    inverse = np.linalg.inv(np.array(gains.K))
    diagonal: Array = np.einsum("ji,jk,ki->i", inverse, mass, inverse)
    return diagonal

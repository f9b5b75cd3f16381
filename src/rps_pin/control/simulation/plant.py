"""Simulated machine with actuators, delay and encoders, for a controller.

It is integrated by the closed-loop model in full coordinates, with the loops closed at each step,
and shares only Pinocchio with the controllers. A command passes a delay of whole ticks and the
actuators' limits; a length passes the encoders.
"""

from __future__ import annotations

from collections import deque

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.bounds import DELAY, SUBSTEPS, check_size
from rps_pin.closed_loop import Stepper
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.simulation.motion import WrenchesInTime
from rps_pin.control.simulation.encoders import Encoders
from rps_pin.copies import DeepCopied
from rps_pin.errors import InputError, shown
from rps_pin.one_thread import one_thread
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics.pose import platform_pose
from rps_pin.rps.robot import RPSRobot
from rps_pin.validation import positive_number, real_vector, whole_number

#: Indices of the prismatic joints in q and v.
_LENGTHS = [1, 3, 5]
_EXACT = Encoders()


@one_thread("_stepper._system.guard")
class Plant(DeepCopied):
    """A 3-RPS under control.

    Parameters
    ----------
    robot
        The machine, which may differ from the controller's model (see `wrong_parameters`).
    pose
        At the start, at rest, shape (3,), m and rad.
    period
        Time between two ticks, s.
    substeps
        Integration steps in a tick.
    delay
        Ticks between a command and its effect; before the first, the weight is held.
    encoders
        Default: exact ones.
    wrenches
        External wrenches on its frames: as for `simulate`.

    Attributes
    ----------
    applied : (3,) array
        The actuators' forces in the last tick, N.

    Raises
    ------
    InputError
        If an argument has the wrong shape or type, or is out of its range.
    UnreachableError
        If a leg has no length in the pose.
    """

    @refuses_other_kinds
    def __init__(
        self,
        robot: RPSRobot,
        pose: ArrayLike,
        *,
        period: float = 1e-3,
        substeps: int = 2,
        delay: int = 0,
        encoders: Encoders = _EXACT,
        wrenches: Wrenches | WrenchesInTime | None = None,
    ) -> None:
        x = real_vector(pose, 3, "pose")
        self._substeps = whole_number(substeps, "substeps")
        delay = whole_number(delay, "delay", 0)
        check_size(self._substeps, SUBSTEPS, f"substeps = {shown(self._substeps)}")
        check_size(delay, DELAY, f"delay = {shown(delay)} ticks")
        if not isinstance(encoders, Encoders):
            raise InputError(f"encoders is a {type(encoders).__name__}; it must be Encoders")
        self.robot, self.encoders = robot, encoders
        self.period = positive_number(period, "period", "s")
        q, v, a = robot.state(x, np.zeros(3), np.zeros(3))
        self._stepper = Stepper(robot.mechanism, q, v, wrenches=wrenches)
        hold = robot.inverse_dynamics(q, v, a).tau
        self._limit = robot.parameters.actuator_force_limit
        self.applied: Array = np.clip(hold, -self._limit, self._limit)
        self._queue = deque([hold] * delay)
        self._generator = encoders.generator()

    def step(self, forces: ArrayLike) -> None:
        """Take a command and advance by a period.

        Parameters
        ----------
        forces
            Shape (3,), N; limited to what the actuators can do.

        Raises
        ------
        InputError
            If a force is not finite.
        RPSPinError
            If the motion is no longer determined: see `Stepper.advance`.
        """
        self._queue.append(real_vector(forces, 3, "forces").copy())
        self.applied = np.clip(self._queue.popleft(), -self._limit, self._limit)
        self._stepper.advance(self.applied, self.period, self._substeps)

    def reading(self) -> Array:
        """Return the encoders' reading of the leg lengths, shape (3,), m."""
        return self.encoders.read(self.length, self._generator)

    # True state -----------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Since the start, s."""
        return self._stepper.time

    @property
    def configuration(self) -> Array:
        """Pinocchio's q, shape (13,)."""
        return self._stepper.q

    @property
    def length(self) -> Array:
        """Leg lengths, shape (3,), m."""
        return np.asarray(self._stepper.q[_LENGTHS])

    @property
    def speed(self) -> Array:
        """Leg speeds, shape (3,), m/s."""
        return np.asarray(self._stepper.v[_LENGTHS])

    @property
    def pose(self) -> Array:
        """(z, tilt_x, tilt_y) of the free platform, shape (3,), m and rad."""
        return platform_pose(self._stepper.q)

    @property
    def rate(self) -> Array:
        """Time derivative of the pose, shape (3,), from the free platform's velocity."""
        q, v = self._stepper.q, self._stepper.v
        rotation = pin.Quaternion(q[9:13]).matrix()
        tilting = pin.Jlog3(rotation) @ v[9:12]
        return np.array([rotation[2] @ v[6:9], tilting[0], tilting[1]])

    @property
    def gap(self) -> float:
        """Largest gap between closed frames, m."""
        return self._stepper.gap

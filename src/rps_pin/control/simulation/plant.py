"""Simulated machine with actuators, delay and encoders, for a controller.

It is integrated by the closed-loop model in full coordinates, with the loops closed at each step,
and shares only Pinocchio with the controllers. A command passes a delay of whole ticks and the
actuators' limits; a position passes the encoders.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.bounds import DELAY, SUBSTEPS, check_size
from rps_pin.closed_loop import Stepper
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.simulation.motion import WrenchesInTime
from rps_pin.control.robots import Robot, force_limits, task_of
from rps_pin.control.simulation.encoders import Encoders
from rps_pin.control.simulation.servo_drives import ServoDrives, ServoForces
from rps_pin.copies import DeepCopied
from rps_pin.errors import InputError, shown
from rps_pin.one_thread import one_thread
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import positive_number, real_vector, whole_number

_EXACT = Encoders()


@one_thread("_stepper._system.guard")
class Plant(DeepCopied):
    """A 3-RPS, or any mechanism with a task, under control.

    Parameters
    ----------
    robot
        The machine, which may differ from the controller's model (see `wrong_parameters`): an
        `RPSRobot`, a `Task`, or a `ClosedLoopModel` that has one.
    pose
        At the start, at rest: the task's coordinates, shape (m,), m and rad, in the assembly mode
        of home.
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
    force_limit
        Of the actuators, N or N m: one or na; default: the robot's.
    drives
        Of actuators that take positions or speeds as commands; default: commands are forces.

    Attributes
    ----------
    applied : (na,) array
        The actuators' forces in the last tick, N or N m; with `drives`, those at its end.

    Raises
    ------
    InputError
        If an argument has the wrong shape or type, or is out of its range.
    UnreachableError, ClosureError
        If the pose is out of reach.
    """

    @refuses_other_kinds
    def __init__(
        self,
        robot: Robot,
        pose: ArrayLike,
        *,
        period: float = 1e-3,
        substeps: int = 2,
        delay: int = 0,
        encoders: Encoders = _EXACT,
        wrenches: Wrenches | WrenchesInTime | None = None,
        force_limit: ArrayLike | None = None,
        drives: ServoDrives | None = None,
    ) -> None:
        task = task_of(robot)
        mechanism = task.mechanism
        x = real_vector(pose, task.size, "pose")
        self._substeps = whole_number(substeps, "substeps")
        delay = whole_number(delay, "delay", 0)
        check_size(self._substeps, SUBSTEPS, f"substeps = {shown(self._substeps)}")
        check_size(delay, DELAY, f"delay = {shown(delay)} ticks")
        if not isinstance(encoders, Encoders):
            raise InputError(f"encoders is a {type(encoders).__name__}; it must be Encoders")
        self.robot, self.encoders = robot, encoders
        self.period = positive_number(period, "period", "s")
        still = np.zeros(task.size)
        q, v, a = task.state(x, still, still)
        self._task, self._pose = task, x
        self._positions, self._actuated = task.of_actuators, mechanism.actuated_indices
        self._limit = force_limits(robot, force_limit)
        self._stepper = Stepper(mechanism, q, v, wrenches=wrenches)
        hold = mechanism.inverse_dynamics(q, v, a).tau
        self.applied: Array = np.clip(hold, -self._limit, self._limit)
        self._servo: ServoForces | None = None
        if drives is not None:
            where = task.of_actuators
            self._servo = ServoForces(mechanism, drives, self._limit, where)
            hold = drives.at_rest(q[where])
        self._queue = deque([hold] * delay)
        self._generator = encoders.generator()

    def step(self, command: ArrayLike) -> None:
        """Take a command and advance by a period.

        Parameters
        ----------
        command
            Forces, shape (na,), N or N m, limited to what the actuators can do; with `drives`,
            positions (m or rad) or speeds.

        Raises
        ------
        InputError
            If a number is not finite.
        RPSPinError
            If the motion is no longer determined: see `Stepper.advance`.
        """
        name = "forces" if self._servo is None else "command"
        self._queue.append(real_vector(command, self.applied.size, name).copy())
        given, servo = self._queue.popleft(), self._servo
        if servo is None:
            self.applied = np.clip(given, -self._limit, self._limit)
            self._stepper.advance(self.applied, self.period, self._substeps)
        else:
            servo.command = given
            self._stepper.advance(servo, self.period, self._substeps)
            self.applied = servo(self.time, self._stepper.q, self._stepper.v)
        if any(self._task.angular):  # of two rotation vectors, the one nearer to the last
            self._pose = self.pose

    def reading(self) -> Array:
        """Return the encoders' reading of the actuators' positions, shape (na,), m or rad."""
        return self.encoders.read(self.length, self._generator)

    # True state -----------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Since the start, s."""
        return self._stepper.time

    @property
    def configuration(self) -> Array:
        """Pinocchio's q, shape (nq,)."""
        return self._stepper.q

    @property
    def length(self) -> Array:
        """Positions of the actuators (the 3-RPS's leg lengths), shape (na,), m or rad."""
        return np.asarray(self._stepper.q[self._positions])

    @property
    def speed(self) -> Array:
        """Speeds of the actuators, shape (na,), m/s or rad/s."""
        return np.asarray(self._stepper.v[self._actuated])

    @property
    def pose(self) -> Array:
        """The task's coordinates, shape (m,), m and rad: (z, tilt_x, tilt_y) of the 3-RPS."""
        return self._task.at(self._stepper.q, self._pose)

    @property
    def rate(self) -> Array:
        """Time derivative of the pose, shape (m,)."""
        return self._task.rate(self._stepper.q, self._stepper.v, x=self._pose)

    @property
    def gap(self) -> float:
        """Largest gap between closed frames, m."""
        return self._stepper.gap

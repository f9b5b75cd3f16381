"""The machine itself, simulated: what a controller sends forces to and reads encoders of.

It moves by the closed-loop model in full coordinates, its loops closed at every step, and shares
with the controllers nothing but Pinocchio. Between a command and the actuators lie a delay of whole
ticks and the actuators' own limits; between the lengths and a reading, the encoders.
"""

from __future__ import annotations

from collections import deque
from numbers import Integral

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import Stepper
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.simulation.motion import WrenchesInTime
from rps_pin.control.simulation.encoders import Encoders
from rps_pin.errors import InputError
from rps_pin.rps.checks import finite_entries
from rps_pin.rps.kinematics.leg_equations import checked_positive
from rps_pin.rps.kinematics.pose import checked_pose
from rps_pin.rps.robot import RPSRobot

#: Of the prismatic joints, in q and in v.
_LENGTHS = [1, 3, 5]
#: Free of encoders' faults.
_PERFECT = Encoders()


class Plant:
    """A 3-RPS under control.

    Parameters
    ----------
    robot
        As it is, which is not what its controller believes (see `wrong_parameters`).
    pose
        Where it stands at the start, at rest, shape (3,), m and rad.
    period
        Time between two ticks, s.
    substeps
        Into how many integration steps a tick is divided.
    delay
        Ticks between a command and its effect; before the first, the weight is held.
    encoders
        Perfect ones if left out.
    wrenches
        What acts on its frames from outside: as for `simulate`.

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

    def __init__(
        self,
        robot: RPSRobot,
        pose: ArrayLike,
        *,
        period: float = 1e-3,
        substeps: int = 2,
        delay: int = 0,
        encoders: Encoders = _PERFECT,
        wrenches: Wrenches | WrenchesInTime | None = None,
    ) -> None:
        x = checked_pose(pose)
        if x.shape != (3,):
            raise InputError(f"pose has shape {x.shape}; it must be (3,)")
        for name, value, least in (("substeps", substeps, 1), ("delay", delay, 0)):
            whole = isinstance(value, Integral) and not isinstance(value, bool)
            if not (whole and value >= least):
                raise InputError(f"{name} = {value!r}: it must be a whole number, {least} or more")
        if not isinstance(encoders, Encoders):
            raise InputError(f"encoders is a {type(encoders).__name__}; it must be Encoders")
        self.robot, self.encoders = robot, encoders
        self.period = checked_positive(period, "period")
        self._substeps = int(substeps)
        still = np.zeros(3)
        q, v, a = robot.state(x, still, still)
        self._stepper = Stepper(robot.mechanism, q, v, wrenches=wrenches)
        hold = robot.inverse_dynamics(q, v, a).tau
        self._limit = robot.parameters.actuator_force_limit
        self.applied: Array = np.clip(hold, -self._limit, self._limit)
        self._queue = deque([hold] * delay)
        self._generator = encoders.generator()

    def step(self, forces: ArrayLike) -> None:
        """Take a command and move on by a period.

        Parameters
        ----------
        forces
            Shape (3,), N. What is beyond the actuators' limits is cut off, as they do.

        Raises
        ------
        InputError
            If a force is not finite.
        RPSPinError
            If the motion is not determined any more: see `Stepper.advance`.
        """
        command = finite_entries(forces, (3,), "forces")
        if command.shape != (3,):
            raise InputError(f"forces has shape {command.shape}; it must be (3,)")
        self._queue.append(command)
        self.applied = np.clip(self._queue.popleft(), -self._limit, self._limit)
        self._stepper.advance(self.applied, self.period, self._substeps)

    def reading(self) -> Array:
        """Return what the encoders say of the legs' lengths now, shape (3,), m."""
        return self.encoders.read(self.length, self._generator)

    # As it is -------------------------------------------------------------------------------------

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
        length: Array = self._stepper.q[_LENGTHS]
        return length

    @property
    def speed(self) -> Array:
        """Leg speeds, shape (3,), m/s."""
        speed: Array = self._stepper.v[_LENGTHS]
        return speed

    @property
    def pose(self) -> Array:
        """(z, tilt_x, tilt_y), shape (3,): that of the free platform, m and rad."""
        return platform_pose(self._stepper.q)

    @property
    def rate(self) -> Array:
        """The pose's time derivative, shape (3,), from the free platform's velocity."""
        q, v = self._stepper.q, self._stepper.v
        turn = pin.Quaternion(q[9:13]).matrix()
        rise = turn[2] @ v[6:9]
        tilting = pin.Jlog3(turn) @ v[9:12]
        return np.array([rise, tilting[0], tilting[1]])

    @property
    def gap(self) -> float:
        """Largest gap between closed frames, m."""
        return self._stepper.gap


def platform_pose(configuration: Array) -> Array:
    """Return (z, tilt_x, tilt_y) of Pinocchio configurations (..., 13), shape (..., 3).

    The tilt is the rotation vector of the platform's quaternion, whose third component is zero.
    """
    q = np.asarray(configuration)
    x, y, z, w = np.moveaxis(q[..., 9:13], -1, 0)
    sine = np.sqrt(x * x + y * y + z * z)
    side = np.where(w < 0, -1.0, 1.0)
    angle = 2 * np.arctan2(sine, np.abs(w))
    factor = side * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 1e-9)
    return np.stack([q[..., 8], factor * x, factor * y], axis=-1)

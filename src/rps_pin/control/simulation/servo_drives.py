"""Drives with loops of their own, which take positions or speeds as commands.

They accelerate the actuators, positions a and speeds a', by

    a'' = k_s (s - a'),   s = limited(k_p (c - a)) for commanded positions c,
                          s = limited(c)           for commanded speeds c,

where the speed s is limited to what the drives can do. Away from the limits this is

    a'' + 2 zeta w a' + w^2 a = w^2 c,  k_s = 2 zeta w,  k_p = w / (2 zeta),     (positions)
    (a')' = w (c - a'),                 k_s = w,                                 (speeds)

with w = 2 pi bandwidth. The drives know their load: the forces are the inverse dynamics of these
accelerations, limited one by one. Limited forces move the mechanism as they can.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import MechanismError
from rps_pin.validation import choice, positive_number

Command = Literal["position", "speed"]


@dataclass(frozen=True)
class ServoDrives:
    """The drives of all actuators of a mechanism.

    Parameters
    ----------
    command
        What they take: ``"position"`` (m or rad) or ``"speed"`` (m/s or rad/s).
    bandwidth
        Of their response, Hz: of order 2 for positions, of order 1 for speeds.
    damping
        zeta of the response of positions; 1 has no overshoot.
    speed_limit
        Largest speed, m/s or rad/s.

    Raises
    ------
    InputError
        If there is no such command, or a number is out of range.
    """

    command: Command = "position"
    bandwidth: float = 30.0
    damping: float = 1.0
    speed_limit: float = math.inf

    def __post_init__(self) -> None:
        choice(self.command, "command", get_args(Command))
        positive_number(self.bandwidth, "bandwidth", "Hz")
        positive_number(self.damping, "damping")
        positive_number(self.speed_limit, "speed_limit", "m/s or rad/s", infinite=True)

    def acceleration(self, command: Array, position: Array, speed: Array) -> Array:
        """Return the accelerations that the drives seek, shape (na,)."""
        w = 2 * math.pi * self.bandwidth
        if self.command == "speed":
            return w * (self._limited(command) - speed)
        wanted = self._limited(w / (2 * self.damping) * (command - position))
        return 2 * self.damping * w * (wanted - speed)

    def at_rest(self, position: Array) -> Array:
        """Return the command that holds positions, shape (na,)."""
        return position.copy() if self.command == "position" else np.zeros(position.size)

    def _limited(self, speed: Array) -> Array:
        return np.clip(speed, -self.speed_limit, self.speed_limit)


class ServoForces:
    """The forces of drives under a command, as `Stepper.advance` takes them.

    Parameters
    ----------
    mechanism
        The mechanism, with as many actuators as motions.
    drives, limit, command
        The drives, their forces' limits (na,), and the command (na,).
    positions
        Where the actuators' positions are in q.
    """

    def __init__(
        self, mechanism: ClosedLoopModel, drives: ServoDrives, limit: Array, positions: Indices
    ) -> None:
        self._mechanism, self._drives = mechanism, drives
        self._limit, self._positions = limit, positions
        self._actuated = mechanism.actuated_indices
        self.command: Array = np.zeros(len(positions))
        if mechanism.describe().mobility != len(positions):
            raise MechanismError(
                f"drives of {len(positions)} actuators: they do not determine the "
                "motion of a mechanism that has more motions or fewer"
            )

    def __call__(self, time: float, q: Array, v: Array) -> Array:
        """Return the forces, shape (na,)."""
        mechanism, speed = self._mechanism, v[self._actuated]
        wanted = self._drives.acceleration(self.command, q[self._positions], speed)
        # Within a step of integration v is closed to the step's order only.
        closed = mechanism.velocity(q, speed)
        a = mechanism.acceleration(q, closed, wanted)
        tau = mechanism.inverse_dynamics(q, closed, a).tau
        return np.clip(tau, -self._limit, self._limit)

"""Commands of drives that take positions or speeds: the target, within a controller's promises.

With a the actuators' positions and a_d those of the target, the command is

    c = a_d                                         of drives that take positions,
    c = a_d' + Kp (a_d - a) + Kd (a_d' - a') + I    of drives that take speeds, I' = Ki (a_d - a).

See `rps_pin.control.simulation.servo_drives` for what the drives do with it.
"""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.control.estimator.state_estimate import StateEstimate
from rps_pin.control.loop.controller import Controller
from rps_pin.control.loop.gains import Gains
from rps_pin.control.loop.setpoints import Setpoint
from rps_pin.control.robots import Robot
from rps_pin.control.simulation.servo_drives import Command
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import choice

_NONE = Gains(0.0, 0.0)


class DriveControl(Controller):
    """Positions or speeds for drives with loops of their own.

    Readings, refused targets, holds, returns and stops are those of `Controller`, with the same
    promises: no tick raises, and commands are finite. A stopped controller holds the last position.
    There are no force limits: those are the drives'.

    Parameters
    ----------
    robot, near
        As for `Controller`.
    gains
        For speeds: 1/s, and 1/s^2 for the integral (the derivative has no unit); default: none, the
        target's speeds alone. Not for positions.
    command
        What the drives take: ``"position"`` (m or rad) or ``"speed"`` (m/s or rad/s).
    **settings
        As for `Controller`, without `space` and `force_limit`.

    Attributes
    ----------
    forces : (na,) array
        The command, m or rad, or per second.
    """

    @refuses_other_kinds
    def __init__(
        self,
        robot: Robot,
        near: ArrayLike,
        gains: Gains | None = None,
        *,
        command: Command = "position",
        **settings: Any,
    ) -> None:
        self.command = choice(command, "command", get_args(Command))
        if command == "position" and gains is not None:
            raise InputError("gains are for drives that take speeds; those of positions have none")
        for name in ("space", "force_limit"):
            if name in settings:
                raise InputError(f"{name} is not for drives, which have loops of their own")
        given = _NONE if gains is None else gains
        super().__init__(robot, near, given, force_limit=np.inf, **settings)

    def _law(self, state: StateEstimate, setpoint: Setpoint) -> Any:
        if self.command == "position":
            return setpoint.geometry.length
        vectors = self._vectors
        wanted, _ = self._model.motion(*setpoint)
        e = vectors.difference(setpoint.geometry.length, state.geometry.length)
        return vectors.total(wanted, self._pid(e, wanted, state.speed))

    def _command_error(self, state: StateEstimate, force: Any, acceleration: Any) -> Any:
        return force  # of saturation, which there is none of

    def _weight(self) -> Any:
        """Return the command that holds the last position."""
        if self.command == "position":
            return self.estimate.state.geometry.length
        return self._vectors.zero

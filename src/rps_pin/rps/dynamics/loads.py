"""Loads of the platform: a payload fixed to it, and external wrenches.

A payload is a rigid body that moves with the platform: `RPSRobot.with_payload` returns the robot
that carries it, and everything which that robot computes includes it. A wrench is what something
else (a tool, the wind, a person) exerts on the platform: (force, moment), N and N m, in base axes,
the moment about the platform's centre. It is an argument of the dynamics, ``wrench=``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.task.loads import Payload
from rps_pin.validation import real_array

__all__ = ["Payload", "checked_wrench"]


def checked_wrench(value: ArrayLike, batch: tuple[int, ...]) -> Array:
    """Return a wrench on the platform for each sample of a batch, shape (*batch, 6).

    Parameters
    ----------
    value
        (force, moment), constant (6,) or of a shape (..., 6) that broadcasts to the batch; N, N m.
    batch
        The batch's shape.

    Raises
    ------
    InputError
        If it is not finite, or its shape does not fit.
    """
    wrench = real_array(value, "wrench", (6,), "force and moment")
    try:
        return np.broadcast_to(wrench, (*batch, 6))
    except ValueError:
        raise InputError(
            f"wrench has shape {wrench.shape}; it must be (6,) or go with {(*batch, 6)}: force and "
            "moment of each sample"
        ) from None

"""Pace of a target, 0.05 to 1 of its own speed: see `Controller.pace`."""

from __future__ import annotations

from rps_pin.numerics.elementary import Number, less, select

#: Least pace.
LEAST_PACE = 0.05
#: Time constant of its return to 1, s.
_RECOVERY = 0.2


def recovered_pace(pace: Number, elapsed: Number) -> Number:
    """Return the pace after a time (s) within the force limits."""
    share = elapsed / _RECOVERY
    return pace + (1.0 - pace) * select(less(share, 1.0), share, 1.0)

"""Reasons why a point is outside a workspace: one bit each, so that a point can have several."""

from __future__ import annotations

from collections.abc import Sequence

from rps_pin.errors import InputError
from rps_pin.numerics.bits import MOST_NAMES
from rps_pin.task.paths.findings import Signal

#: Names of the reasons that are no limits.
SINGULAR = "singular"
UNREACHABLE = "beyond the end of the assembly mode"
INTERFERENCE = "interference of links"


def limit_names(limits: Sequence[Signal]) -> list[str]:
    """Return limits in words, each once: the second of two cones of one name is ``"... (2)"``."""
    names: list[str] = []
    for limit in limits:
        name, number = limit_in_words(limit), 2
        while name in names:  # two cones of one name
            name, number = f"{limit_in_words(limit)} ({number})", number + 1
        names.append(name)
    return names


def reason_names(limits: Sequence[Signal], *, interference: bool) -> tuple[str, ...]:
    """Return the names of the reasons, in the order of their bits.

    Raises
    ------
    InputError
        If there are more limits than bits.
    """
    names = limit_names(limits)
    names += [SINGULAR, UNREACHABLE, *([INTERFERENCE] if interference else [])]
    if len(names) > MOST_NAMES:
        raise InputError(
            f"the mechanism has {len(limits)} limits; a workspace tells at most "
            f"{MOST_NAMES - 3} apart: leave out limits that cannot be met (infinite in the URDF)"
        )
    return tuple(names)


def limit_in_words(limit: Signal) -> str:
    """Return a limit as the reason of a point beyond it: ``"arm_1_joint above 1.2 rad"``.

    One of a magnitude is ``"leg_3 force beyond 400 N"``.
    """
    who = limit.joint or f"leg {limit.leg}"
    what = "" if limit.name == "position" else f" {limit.name}"
    side = {"lower": "below", "upper": "above", "both": "beyond"}[limit.side]
    return f"{who}{what} {side} {limit.limit:.6g} {limit.unit}"

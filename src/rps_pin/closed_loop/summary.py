"""What a mechanism is, in one line and in a few: `repr` and `print` of it."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence

from rps_pin.closed_loop.constraints.closures import JointCoupling
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.describe import MechanismDescription, counted
from rps_pin.errors import RPSPinError

_WIDTH = 100


def in_one_line(kind: str, name: str, system: ConstraintSystem) -> str:
    """Return class, name and numbers of parts, without computing anything."""
    model, equations = system.model, system.equations
    parts = [
        f"{counted(model.njoints - 1, 'joint')} (nq {model.nq}, nv {model.nv})",
        f"{counted(len(equations.closures), 'closure')} ({counted(equations.size, 'row')})",
        f"{len(system.actuated_names)} actuated",
    ]
    return f"<{kind} {name!r}: {', '.join(parts)}>"


def in_lines(
    name: str, system: ConstraintSystem, describe: Callable[[], MechanismDescription]
) -> str:
    """Return mobility and actuation, and the names of joints, closures and actuators.

    Where the loops do not close, the first line tells that in place of the mobility.
    """
    model, equations = system.model, system.equations
    try:
        found = describe()
        what = f"mobility {found.mobility}, actuation {found.verdict()}"
    except RPSPinError as error:
        what = f"mobility not known: {error}"
    lines = [f"{name or 'mechanism'}: {what}"]
    joints = list(model.names)[1:]
    lines += _listed(f"{counted(len(joints), 'joint')} (nq {model.nq}, nv {model.nv})", joints)
    closures = [
        f"{one.name} ({'coupling' if isinstance(one, JointCoupling) else one.kind})"
        for one in equations.closures
    ]
    rows = f" ({counted(equations.size, 'row')})" if closures else ""
    lines += _listed(f"{counted(len(closures), 'closure')}{rows}", closures)
    lines += _listed("actuated", system.actuated_names or ["nothing"])
    return "\n".join(lines)


def _listed(what: str, names: Sequence[str]) -> list[str]:
    text = f"{what}: {', '.join(names)}" if names else what
    return textwrap.wrap(
        text, _WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
    )

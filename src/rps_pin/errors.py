"""Errors of rps_pin: one small hierarchy under one base class.

Every message says what was asked, what is possible, and by how much it failed; the numbers are
attributes too, so that a program need not read the sentence.
"""

from __future__ import annotations

import math
import os
import reprlib
import sys
import warnings
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NamedTuple

from rps_pin.arrays import Array, Bools

_LONGEST = 400
_PACKAGE = str(Path(__file__).parent) + os.sep
_REPR = reprlib.Repr()
_REPR.maxlevel, _REPR.maxlist, _REPR.maxstring, _REPR.maxother = 3, 9, _LONGEST, _LONGEST


def shown(value: object) -> str:
    """Return a value's repr, shortened if it is large or deeply nested."""
    text = _REPR.repr(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ..."


def few(names: Sequence[str], most: int = 12) -> str:
    """Return names with commas, the first ones of many and how many more there are."""
    listed = ", ".join(names[:most])
    return listed if len(names) <= most else f"{listed} and {len(names) - most} more"


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return ``" (did you mean x?)"`` for a misspelt name, or nothing."""
    near = get_close_matches(name, list(names), n=1)
    return f" (did you mean {near[0]}?)" if near else ""


class RPSPinError(Exception):
    """Base class of the errors of rps_pin.

    Attributes
    ----------
    failed : array of bool or None
        Of a batch in which samples fail one by one: which samples fail, shape (...).
    """

    failed: Bools | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle without calling the constructor, whose arguments differ."""
        return _rebuilt, (type(self), self.args), self.__dict__


def _rebuilt(kind: type[RPSPinError], args: tuple[Any, ...]) -> RPSPinError:
    return kind.__new__(kind, *args)


class InputError(RPSPinError, ValueError):
    """An argument has the wrong shape, is not finite, or names something that does not exist."""


class ParameterError(InputError):
    """A parameter of a robot is not possible.

    Attributes
    ----------
    field : str
        Name of the offending field.
    value : object
        What was given.
    rule : str
        What the field has to satisfy.
    place : str
        The file and line, if it comes from a file.
    others : tuple of ParameterError
        Further parameters that are not possible.
    """

    def __init__(
        self,
        field: str,
        value: object,
        rule: str,
        place: str = "",
        others: Sequence[ParameterError] = (),
    ) -> None:
        self.field = field
        self.value = value
        self.rule = rule
        self.place = place
        self.others = tuple(others)
        where = f"{place}: " if place else ""
        super().__init__("; ".join([f"{where}{field} = {shown(value)}: {rule}", *_told(others)]))


def _told(errors: Sequence[ParameterError]) -> list[str]:
    """Return the errors after the first in words: with the line alone, and one for all missing."""
    missing = [error.field for error in errors if error.value is None]
    words = [
        f"{error.place.rpartition(', ')[2]}{': ' if error.place else ''}"
        f"{error.field} = {shown(error.value)}: {error.rule}"
        for error in errors
        if error.value is not None
    ]
    if missing:
        words.append(f"{', '.join(missing)}: required, and not given")
    return words


class MechanismError(InputError):
    """A mechanism's description is not consistent (unknown frame, joint, closure, file)."""


class LimitViolation(NamedTuple):
    """One quantity of one leg beyond its limits."""

    leg: int
    """Leg number, 1 to 3, as in the paper."""
    quantity: str
    """The quantity: ``"length"``, ``"angle"`` or ``"spherical joint"``."""
    value: float
    """Its value, in `unit`."""
    lower: float
    """Smallest allowed value, in `unit`."""
    upper: float
    """Largest allowed value, in `unit`."""
    unit: str
    """``"m"`` or ``"rad"``; ``"deg"`` of `in_degrees`."""

    def in_degrees(self) -> LimitViolation:
        """Return it with angles in degrees."""
        if self.unit != "rad":
            return self
        value, lower, upper = map(math.degrees, (self.value, self.lower, self.upper))
        return self._replace(value=value, lower=lower, upper=upper, unit="deg")

    def __str__(self) -> str:
        return (
            f"leg {self.leg}: {self.quantity} would be {self.value:.6g} {self.unit}; "
            f"its limits are {self.lower:.6g} to {self.upper:.6g} {self.unit}"
        )


class UnreachableError(RPSPinError, ValueError):
    """A pose is not reachable within the limits or the geometry of a leg.

    Attributes
    ----------
    violations : tuple of LimitViolation
        All limits that the first refused pose exceeds; empty if no limit is the reason.
    """

    def __init__(self, message: str, violations: Sequence[LimitViolation] = ()) -> None:
        self.violations = tuple(violations)
        super().__init__(message)


class ClosureError(RPSPinError):
    """A loop is open: at position, velocity or acceleration level.

    Attributes
    ----------
    gap : float
        Largest error of a closure, in the unit of the message.
    """

    def __init__(self, message: str, gap: float) -> None:
        self.gap = gap
        super().__init__(message)


class SingularityError(RPSPinError, ArithmeticError):
    """The actuators do not determine the motion, or the forces, at this configuration.

    Attributes
    ----------
    condition : float
        The condition number (``inf`` at an exact singularity).
    limit : float
        Largest condition number that is accepted.
    """

    def __init__(self, message: str, condition: float, limit: float) -> None:
        self.condition = condition
        self.limit = limit
        super().__init__(message)


class AccuracyWarning(UserWarning):
    """The numbers of a mechanism's file are rounded: nearly redundant rows count as redundant."""


def warn_caller(text: str, category: type[Warning] = UserWarning) -> None:
    """Warn at the last line outside the package that led here, however deep in it."""
    frame, level = sys._getframe(1), 2
    while frame.f_code.co_filename.startswith(_PACKAGE) and frame.f_back is not None:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, category, stacklevel=level)


class LimitExcess(NamedTuple):
    """A force beyond its limit."""

    name: str
    """Of the actuator, or of the bound."""
    value: float
    """The force, in `unit`."""
    limit: float
    """The limit that it exceeds, in `unit`."""
    unit: str
    """``"N"`` or ``"N m"``."""

    @property
    def excess(self) -> float:
        """How far beyond, in `unit`; positive."""
        return abs(self.value - self.limit)

    def __str__(self) -> str:
        side = "upper" if self.value > self.limit else "lower"
        return (
            f"{self.name} would need {self.excess:.6g} {self.unit} beyond its {side} limit of "
            f"{self.limit:.6g} {self.unit}"
        )


class InfeasibleError(RPSPinError, ArithmeticError):
    """No forces within the limits, or none of the actuators at all, produce the motion.

    Attributes
    ----------
    violations : tuple of LimitExcess
        The limits that must be exceeded, and by how much, for the smallest sum of excesses. Empty
        if no limit is the reason.
    unproduced : (nv,) array or None
        Where the actuators cannot do it even without limits: the smallest generalised force that
        would have to be added (see `least_effort.residual_force`).
    """

    def __init__(
        self,
        message: str,
        violations: Sequence[LimitExcess] = (),
        unproduced: Array | None = None,
    ) -> None:
        self.violations = tuple(violations)
        self.unproduced = unproduced
        super().__init__(message)


class ThreadError(RPSPinError, RuntimeError):
    """A second thread called an object while a call of another thread was running."""


class CompileError(RPSPinError, RuntimeError):
    """Code could not be compiled: there is no compiler, or it fails, is killed or takes too long.

    Attributes
    ----------
    compiler : str
        The compiler, with its version if it was found.
    output : str
        All that it said.
    """

    def __init__(self, message: str, compiler: str, output: str = "") -> None:
        self.compiler = compiler
        self.output = output
        super().__init__(message)

"""A `casadi.Function` of scalar expressions, evaluated over numbers of any type.

CasADi evaluates floats and symbols only. Its operations, one by one, are applied here to floats,
arrays (real and complex, one number a sample), intervals, and enclosures with slopes (see
`rps_pin.numerics.intervals`). Of complex numbers, comparisons read the real part; the functions are
those of NumPy.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.special import erf

from rps_pin.codegen.emit import Listing, listing
from rps_pin.errors import InputError
from rps_pin.numerics import interval_functions as of_intervals
from rps_pin.numerics.elementary import atan2
from rps_pin.numerics.intervals import Enclosure, Interval, is_enclosing

#: A float, an array, an `Interval` or an `Enclosure`.
Number = Any

_ALIKE: dict[str, Callable[..., Number]] = {
    "ADD": operator.add,
    "SUB": operator.sub,
    "MUL": operator.mul,
    "DIV": operator.truediv,
    "NEG": operator.neg,
    "TWICE": lambda x: 2.0 * x,
    "SQ": lambda x: x * x,
    "INV": lambda x: 1.0 / x,
}


def _sign(x: Number) -> Number:
    return np.sign(np.real(x))


#: Of floats and arrays.
_OF_ARRAYS: dict[str, Callable[..., Number]] = {
    **_ALIKE,
    **{
        name: getattr(np, function)
        for name, function in (
            *(("SQRT", "sqrt"), ("SIN", "sin"), ("COS", "cos"), ("TAN", "tan")),
            *(("ASIN", "arcsin"), ("ACOS", "arccos"), ("ATAN", "arctan"), ("SINH", "sinh")),
            *(("COSH", "cosh"), ("TANH", "tanh"), ("ASINH", "arcsinh"), ("ACOSH", "arccosh")),
            *(("ATANH", "arctanh"), ("EXP", "exp"), ("LOG", "log"), ("EXPM1", "expm1")),
            *(("LOG1P", "log1p"), ("POW", "power"), ("CONSTPOW", "power"), ("HYPOT", "hypot")),
            *(("FMOD", "fmod"), ("COPYSIGN", "copysign"), ("FLOOR", "floor"), ("CEIL", "ceil")),
        )
    },
    "ATAN2": atan2,
    "ERF": erf,
    "FABS": lambda x: x * np.where(np.real(x) < 0, -1.0, 1.0),
    "SIGN": _sign,
    "FMIN": lambda x, y: np.where(np.real(x) < np.real(y), x, y),
    "FMAX": lambda x, y: np.where(np.real(x) > np.real(y), x, y),
    "LT": lambda x, y: np.where(np.real(x) < np.real(y), 1.0, 0.0),
    "LE": lambda x, y: np.where(np.real(x) <= np.real(y), 1.0, 0.0),
    "EQ": lambda x, y: np.where(x == y, 1.0, 0.0),
    "NE": lambda x, y: np.where(x != y, 1.0, 0.0),
    "AND": lambda x, y: np.where((x != 0) & (y != 0), 1.0, 0.0),
    "OR": lambda x, y: np.where((x != 0) | (y != 0), 1.0, 0.0),
    "NOT": lambda x: np.where(x == 0, 1.0, 0.0),
    "IF_ELSE_ZERO": lambda condition, x: np.where(condition != 0, x, 0.0),
}


def _truth(surely: Any, possibly: Any) -> Interval:
    """Return conditions as intervals: 1, 0, or from 0 to 1 where they are not decided."""
    return Interval(np.where(surely, 1.0, 0.0), np.where(possibly, 1.0, 0.0))


def _if_else_zero(condition: Interval, x: Interval) -> Interval:
    """Return x, 0, or what holds both."""
    sure, impossible = condition.lower > 0, condition.upper <= 0
    low = np.where(sure, x.lower, np.minimum(x.lower, 0.0))
    high = np.where(sure, x.upper, np.maximum(x.upper, 0.0))
    return Interval(np.where(impossible, 0.0, low), np.where(impossible, 0.0, high))


#: Of intervals.
_OF_INTERVALS: dict[str, Callable[..., Number]] = {
    **_ALIKE,
    "SQRT": lambda x: x.sqrt(),
    "SIN": of_intervals.sin,
    "COS": of_intervals.cos,
    "TAN": of_intervals.tan,
    "ATAN": of_intervals.atan,
    "EXP": of_intervals.exp,
    "FABS": of_intervals.fabs,
    "ATAN2": of_intervals.atan2,
    "FMIN": of_intervals.fmin,
    "FMAX": of_intervals.fmax,
    "LT": lambda x, y: _truth(x.upper < y.lower, x.lower < y.upper),
    "LE": lambda x, y: _truth(x.upper <= y.lower, x.lower <= y.upper),
    "AND": lambda x, y: _truth((x.lower > 0) & (y.lower > 0), (x.upper > 0) & (y.upper > 0)),
    "OR": lambda x, y: _truth((x.lower > 0) | (y.lower > 0), (x.upper > 0) | (y.upper > 0)),
    "NOT": lambda x: _truth(x.upper <= 0, x.lower <= 0),
    "IF_ELSE_ZERO": _if_else_zero,
}
#: Operations whose operands are all made intervals: what they read are bounds.
_BOUNDS = frozenset({"ATAN2", "FMIN", "FMAX", "LT", "LE", "AND", "OR", "NOT", "IF_ELSE_ZERO"})
#: Those that enclosures have; the others are not smooth.
_SMOOTH = frozenset({*_ALIKE, "SQRT", "SIN", "COS", "TAN", "ATAN", "EXP", "FABS", "CONSTPOW"})


class Evaluator:
    """A function of SX expressions that takes numbers of any type.

    Parameters
    ----------
    function
        A `casadi.Function` of SX expressions, of any sparsity.

    Raises
    ------
    InputError
        For a function that is not of SX expressions, and for an unknown operation.
    """

    def __init__(self, function: Any) -> None:
        self.name = function.name()
        self._listing: Listing = listing(function)
        self._sizes = [function.numel_in(i) for i in range(function.n_in())]
        self._out = [function.numel_out(i) for i in range(function.n_out())]
        self._last = _last_reads(self._listing)

    def __call__(self, *arguments: Sequence[Number] | Any) -> list[list[Number]]:
        """Return the outputs, the entries of each in the order of a dense row-major array.

        Parameters
        ----------
        *arguments
            Of each input its entries, in the same order: a sequence of numbers, or an array or
            interval of shape (entries, n).

        Returns
        -------
        list of lists of numbers
            Entries that do not depend on the inputs are floats; structural zeros are 0.0.

        Raises
        ------
        InputError
            If the number of arguments is not that of the inputs, or an operation has no version for
            numbers of a type.
        """
        if len(arguments) != len(self._sizes):
            raise InputError(
                f"{self.name} takes {len(self._sizes)} arguments, not {len(arguments)}"
            )
        names, operands = self._listing.names, self._listing.operands
        found: list[list[Number]] = [[0.0] * size for size in self._out]
        values: dict[int, Number] = {}

        def read(k: int) -> Number:
            if names[k] == "CONST":
                return operands[k][0]
            if names[k] == "INPUT":
                argument, position = operands[k]
                return arguments[argument][position]
            return values[k]

        for place, step in enumerate(self._listing.steps):
            if not isinstance(step, int):
                output, position, k = step
                found[output][position] = read(k)
            else:
                values[step] = self._apply(names[step], [read(k) for k in operands[step]])
            for k in self._last.get(place, ()):
                values.pop(k, None)  # memory for what is still to be read only
        return found

    def _apply(self, name: str, given: list[Number]) -> Number:
        if not any(is_enclosing(one) for one in given):
            if name not in _OF_ARRAYS:
                raise InputError(f"{self.name} uses the operation OP_{name}, which arrays have not")
            return _OF_ARRAYS[name](*given)
        if any(isinstance(one, Enclosure) for one in given) and name not in _SMOOTH:
            raise InputError(f"{self.name} uses the operation OP_{name}, which has no slopes")
        if name == "CONSTPOW":
            return of_intervals.power(*given)
        if name not in _OF_INTERVALS:
            raise InputError(
                f"{self.name} uses the operation OP_{name}, which intervals have not; those that "
                f"they have: {', '.join(sorted(_OF_INTERVALS))}"
            )
        if name in _BOUNDS:
            given = [one if isinstance(one, Interval) else Interval(one) for one in given]
        return _OF_INTERVALS[name](*given)


def _last_reads(found: Listing) -> dict[int, list[int]]:
    """Return the values that are read for the last time at each step."""
    last: dict[int, int] = {}
    for place, step in enumerate(found.steps):
        for k in found.needs(step):
            last[k] = place
    ends: dict[int, list[int]] = {}
    for k, place in last.items():
        ends.setdefault(place, []).append(k)
    return ends

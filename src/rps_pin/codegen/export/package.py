"""What is exported: functions of a unit of C, their words, and states with known answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.codegen.units import Unit

Real = Literal["double", "float"]
#: Of a function: results from arguments.
Evaluate = Callable[[Sequence[Array]], Sequence[Array]]

#: Step of the central differences behind a condition number, relative to an argument's size.
_STEP = 1e-6


class Case(NamedTuple):
    """Arguments of a function and its answers."""

    given: tuple[Array, ...]
    expected: tuple[Array | None, ...]
    """None for a result without a known answer."""
    condition: tuple[float, ...]
    """Of each result: the largest of its entries', see `conditions`."""


@dataclass(frozen=True)
class Function:
    """An entry point of the exported file.

    Attributes
    ----------
    name : str
        Of the function in the unit.
    sentence : str
        What it computes.
    arguments : mapping
        What each input and output is, with its unit.
    operations : int
        About how many operations of arithmetic a result takes.
    cases : sequence of Case
        For the self-test.
    opened : sequence of arrays
        Arguments for which the status tells open loops; none if there is no such bit.
    """

    name: str
    sentence: str
    arguments: Mapping[str, str]
    operations: int
    cases: Sequence[Case]
    opened: Sequence[Array] = ()


class Order(NamedTuple):
    """What the numbers of some vectors are, in order."""

    heading: str
    lines: tuple[str, ...]


class Constant(NamedTuple):
    """A number that the header defines: ``NAME_KEY``."""

    key: str
    value: int
    what: str


@dataclass(frozen=True)
class Package:
    """All that the exported files are made from.

    Attributes
    ----------
    name : str
        Of the files; public names begin with it. An identifier of C.
    title : str
        The mechanism's name, fit for comments.
    real : "double" or "float"
    unit : Unit
        Of the same name.
    functions : sequence of Function
        Of all entries of the unit.
    constants, orders : sequences
    parameters : sequence of (label, nominal number)
    notes : sequence of str
        Sentences about all functions: gravity, frames, limits.
    """

    name: str
    title: str
    real: Real
    unit: Unit
    functions: Sequence[Function]
    constants: Sequence[Constant]
    orders: Sequence[Order]
    parameters: Sequence[tuple[str, float]]
    notes: Sequence[str]

    def macro(self, key: str) -> str:
        """Return the name of a macro."""
        return f"{self.name}_{key}".upper()


def conditions(evaluate: Evaluate, given: Sequence[Array], scales: Sequence[Array]) -> list[Array]:
    """Return the condition numbers of each entry of each result.

    For an entry f of a result of arguments x_i of size X_i: |f| + sum over i of |df/dx_i| X_i.
    Rounding of the arguments changes f by at most half the machine's epsilon times this, whatever
    the algorithm.

    Parameters
    ----------
    evaluate
        The function, in double precision.
    given
        Its arguments.
    scales
        Sizes X_i, like the arguments; of 0 for one that does not count.
    """
    total = [np.abs(result) for result in evaluate(given)]
    for i, (argument, scale) in enumerate(zip(given, scales, strict=True)):
        for k in np.flatnonzero(scale):
            step = _STEP * scale[k]
            ends = []
            for sign in (-1.0, 1.0):
                moved = argument.copy()
                moved[k] += sign * step
                ends.append(evaluate([*given[:i], moved, *given[i + 1 :]]))
            for j, (low, high) in enumerate(zip(*ends, strict=True)):
                total[j] = total[j] + np.abs(high - low) / (2 * _STEP)
    return total

"""All solutions of equations with parameters, by loops in the complex parameters.

Along a loop in the parameters a solution leads to another one of the same parameters. If the pairs
of parameters and solutions are one irreducible set, loops connect all solutions (Duff, Hill,
Jensen, Lee, Leykin, Sommars, Solving polynomial systems via homotopy continuation and monodromy,
2019). Loops are drawn until some of them, in a row, lead to no new one: that does not prove that
none is missing. From there, one path of each solution leads to any other parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from rps_pin.arrays import Array, Bools, ComplexArray, Indices
from rps_pin.numerics.homotopy.tracking import Accuracy, Homotopy, tracked

#: Loops at a time, and in a row without a new solution after which the search ends.
LOOPS, QUIET = 16, 16
#: Solutions of random parameters that are followed to one set first.
_SEEDS = 32
#: Solutions whose places differ by less, relative to their size, are one.
_SAME = 1e-6
#: A path that jumps to another one leads to a solution all the same, and those that take many steps
#: are left: other loops lead to their ends.
_LOOSE = Accuracy(prediction=1e-2, correction=1e-6, least_step=1e-4, most_steps=60)


class Family(Protocol):
    """Equations H(x, p) = 0 of as many unknowns, with parameters p."""

    def seeds(self, rng: np.random.Generator, count: int) -> tuple[ComplexArray, ComplexArray]:
        """Return generic solutions (k, n), each with parameters of its own (k, m)."""

    def drawn(self, rng: np.random.Generator, count: int) -> ComplexArray:
        """Return generic parameters (k, m)."""

    def alike(self, rng: np.random.Generator, parameters: ComplexArray) -> ComplexArray:
        """Return parameters (k, m) of the same equations as these, of other turns."""

    def places(self, x: ComplexArray) -> ComplexArray:
        """Return numbers (k, l) by which solutions are told apart."""

    def evaluated(
        self, x: ComplexArray, parameters: ComplexArray, rates: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return H (k, n), dH/dx (k, n, n) and the rate of H (k, n) with that of p (k, m)."""


class Fibre(NamedTuple):
    """Solutions of one set of generic parameters."""

    parameters: ComplexArray
    """Shape (m,)."""
    x: ComplexArray
    """Shape (k, n)."""
    loops: int
    """How many were drawn."""


class Between:
    """The homotopies from parameters to others on arcs, p = p_0 + (s + i b s (1 - s)) (p_1 - p_0).

    Each path has its own.
    """

    def __init__(self, family: Family, start: ComplexArray, end: ComplexArray, bend: Array) -> None:
        self._family, self._start, self._end, self._bend = family, start, end, bend

    def of(self, which: Indices) -> Homotopy:
        """Return the homotopies of some paths."""
        return Between(self._family, self._start[which], self._end[which], self._bend[which])

    def __call__(
        self, x: ComplexArray, s: Array
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return the values and derivatives; see `Homotopy`."""
        bend, change = 1j * self._bend, self._end - self._start
        share, rate = s + bend * s * (1 - s), 1 + bend * (1 - 2 * s)
        return self._family.evaluated(
            x, self._start + share[:, None] * change, rate[:, None] * change
        )


def all_by_loops(
    family: Family,
    rng: np.random.Generator,
    most: int,
    progress: Callable[[float], None] | None = None,
) -> Fibre | None:
    """Return the solutions that loops lead to; none if there are more than `most`.

    Parameters
    ----------
    family
        The equations.
    rng
        Of the parameters, arcs and loops.
    most
        Solutions that are looked for at most.
    progress
        Called with the share of the loops without a new solution that end the search.
    """
    x, parameters = family.seeds(rng, _SEEDS)
    base = parameters[0]
    more, good = _moved(family, x[1:], parameters[1:], np.tile(base, (_SEEDS - 1, 1)), rng)
    found = distinct(family, np.concatenate([x[:1], more[good]]))
    quiet = loops = 0
    while quiet < QUIET:
        count = len(found)
        if count > most:
            return None
        start = np.tile(found, (LOOPS, 1))
        about = np.tile(base, (len(start), 1))
        away = np.repeat(family.drawn(rng, LOOPS), count, axis=0)
        back = np.repeat(family.alike(rng, np.tile(base, (LOOPS, 1))), count, axis=0)
        there, good = _moved(family, start, about, away, rng)
        ends, home = _moved(family, there[good], away[good], back[good], rng)
        found = distinct(family, np.concatenate([found, ends[home]]))
        loops += LOOPS
        quiet = quiet + LOOPS if len(found) == count else 0
        if progress is not None:
            progress(quiet / QUIET)
    return Fibre(base, found, loops)


def _moved(
    family: Family,
    x: ComplexArray,
    start: ComplexArray,
    end: ComplexArray,
    rng: np.random.Generator,
) -> tuple[ComplexArray, Bools]:
    """Return where paths from solutions end, and which have reached a regular solution."""
    bend = rng.uniform(-1.0, 1.0, len(x))
    with np.errstate(all="ignore"):  # of paths that stop
        ends = tracked(Between(family, start, end, bend), x, _LOOSE)
    return ends.x, ends.regular


def distinct(family: Family, x: ComplexArray) -> ComplexArray:
    """Return one each of solutions that are the same, in their order."""
    places = family.places(x)
    kept: list[int] = []
    for i, place in enumerate(places):
        apart = np.abs(places[kept] - place).max(axis=1, initial=0.0)
        if not kept or apart.min() > _SAME * np.abs(place).max():
            kept.append(i)
    return x[kept]

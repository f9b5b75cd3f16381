"""Assembly modes: the closed configurations with given joint values, as far as a search finds them.

The loops are closed from random configurations (`random_starts`), in batches (`many`). The given
joints are held, and those that no closure moves. What comes out is closed to rounding (`closing`)
and counted once (`sameness`).

The search has no proof: it finds what starts lead to. Each mode has a share of the starts that end
in it. If nothing is known about these shares, and w modes were found in n closed starts, the
expected number of modes, found or not, is

    w (n - 1) / (n - w - 2)

(Boender and Rinnooy Kan, Bayesian stopping rules for multistart global optimization methods, 1987).
The search ends where that is at most w + 1/2, which takes n = 2 w^2 + 3 w + 2 closed starts,
`LEAST_CLOSED` at least, and where each mode was found by `LEAST_HITS` starts: if some were found by
one, there are likely others of their kind. A mode of a share far below 1/n is missed, as one is
that no start near it leads to.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.closed_loop.assembly.closing import close_gaps, is_closed
from rps_pin.closed_loop.assembly.completion import (
    beyond_limits,
    by_name,
    refuse_values_outside,
    with_values,
)
from rps_pin.closed_loop.assembly.many import Equations, close_many, equations_of
from rps_pin.closed_loop.assembly.random_starts import RandomStarts
from rps_pin.closed_loop.assembly.sameness import Sameness
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.freedoms import in_words, open_motions, rest_of
from rps_pin.errors import ClosureError, InputError
from rps_pin.numerics.linear_algebra import rank, singular_values
from rps_pin.validation import positive_number, whole_number

#: Closed starts that a search takes at least; starts without any closed one that it gives up after.
LEAST_CLOSED, MOST_OPEN = 100, 1000
#: Starts that each mode is found by before the search ends.
LEAST_HITS = 3
_BATCH = 128
#: Modes whose places differ by less are one; near a singularity they are less sharp.
_SAME, _SAME_SINGULAR, _SINGULAR = 1e-6, 1e-3, 1e5

Stopped = Literal["settled", "starts", "time", "interrupted"]


class FoundModes(NamedTuple):
    """The assembly modes that a search has found, those nearest to its first guess first."""

    q: Array
    """Closed configurations, shape (k, nq)."""
    hits: Indices
    """How many of the starts ended in each, shape (k,)."""
    condition: Array
    """Condition number of the closures by the joints that are not given, shape (k,): infinite or
    huge at a singularity, where modes coincide."""
    starts: int
    """Random starts."""
    closed: int
    """Starts whose loops closed."""
    outside: int
    """Modes that were left out since they are outside joint limits."""
    expected: float
    """Expected number of modes, found or not, those outside the limits included; infinite where
    the starts are too few to tell."""
    stopped: Stopped
    """What ended the search: its rule (``"settled"``), the most ``"starts"`` or the ``"time"`` that
    was given, or Ctrl-C (``"interrupted"``)."""

    def __str__(self) -> str:
        """Say what was found, and how sure that is."""
        rarest = f", the rarest in {self.hits.min()} of them" if self.hits.size else ""
        left_out = f"; {self.outside} more outside joint limits" if self.outside else ""
        ended = {
            "settled": "the search has settled",
            "starts": "the search ended at the most starts it was given",
            "time": "the search ended at the time it was given",
            "interrupted": "the search was interrupted",
        }[self.stopped]
        return (
            f"{self.hits.size} found in {self.starts} random starts, of which {self.closed} closed"
            f"{rarest}{left_out}. Expected in all: {self.expected:.4g}; {ended}"
        )


def assembly_modes(
    system: ConstraintSystem,
    values: Mapping[str, ArrayLike] | ArrayLike | None,
    guess: Array,
    *,
    equations: Equations | None = None,
    frames: Sequence[str] | None = None,
    seed: int = 0,
    starts: int = 20_000,
    seconds: float | None = None,
    within_limits: bool = True,
    progress: Callable[[float], None] | None = None,
) -> FoundModes:
    """Return the assembly modes that a search finds; see `ClosedLoopModel.assembly_modes`."""
    whole_number(starts, "starts")
    whole_number(seed, "seed", 0)
    longest = np.inf if seconds is None else positive_number(seconds, "seconds", "s", infinite=True)
    given, about = system.actuated, guess
    if values is not None:
        named = by_name(system, values)
        given = system.velocity_indices(list(named), "to give a value")
        about = with_values(system, guess, named)
        if within_limits:
            refuse_values_outside(system, about, named)
    held = np.zeros(system.model.nv, dtype=bool)
    held[given] = held[system.unmoving()] = True
    system.settle_rule(about)
    equations = equations or equations_of(system)
    chosen = [frames] if isinstance(frames, str) else frames
    if chosen is not None and not len(chosen):
        raise InputError("frames is empty: name one by whose place modes differ, or leave it out")
    same = Sameness(system, about, chosen)
    search = _Search(system, about, held, equations, same, within_limits)
    rng, begin = np.random.default_rng(seed), time.monotonic()
    stopped: Stopped = "starts"
    try:
        while search.starts < starts:
            search.take(rng, min(_BATCH, starts - search.starts))
            spent = time.monotonic() - begin
            if progress is not None:
                shares = search.closed / search.needed, search.starts / starts, spent / longest
                progress(min(max(shares), 1.0))
            if search.has_settled:
                stopped = "settled"
                break
            if spent >= longest:
                stopped = "time"
                break
            if not search.closed and search.starts >= MOST_OPEN:
                break
    except KeyboardInterrupt:
        stopped = "interrupted"
    return search.found(stopped)


class _Search:
    """A search and what it has found so far."""

    def __init__(
        self,
        system: ConstraintSystem,
        about: Array,
        held: Bools,
        equations: Equations,
        same: Sameness,
        within_limits: bool,
    ) -> None:
        self._system, self._about, self._held = system, about, held
        self._equations, self._within_limits = equations, within_limits
        self._draw = RandomStarts(system, about, held, within_limits)
        self._same = same
        self._q: list[Array] = []
        self._places: list[Array] = []
        self._values: list[Array] = []  # singular values
        self._inside: list[bool] = []
        self._hits: list[int] = []
        self._least_gap, self._nearest = np.inf, about
        self.starts = self.closed = 0

    @property
    def needed(self) -> int:
        """Closed starts after which the search ends with the modes found so far."""
        count = len(self._q)
        return max(LEAST_CLOSED, 2 * count * count + 3 * count + 2)

    @property
    def has_settled(self) -> bool:
        """Whether no further mode is expected."""
        return self.closed >= self.needed and min(self._hits) >= LEAST_HITS

    def take(self, rng: np.random.Generator, count: int) -> None:
        """Close the loops from some more starts; the first of all is the guess itself."""
        guesses = self._draw.drawn(rng, count)
        if not self.starts:
            guesses[0] = self._about
        q, closed = close_many(self._system, self._equations, guesses, self._held)
        if not self.closed and closed.any():
            self._leave_out_idle(q[closed])
        if not (self.closed or closed.any()):
            self._keep_nearest(q)
        for one in q[closed]:
            self._add(one)
        self.starts += count

    def _leave_out_idle(self, closed: Array) -> None:
        """Find what idle freedoms move, or refuse if other motions are left open.

        By the configuration of the largest rank.
        """
        system, free = self._system, ~self._held
        ranks = [self._rank(values) for values in map(self._singular_values, closed)]
        q = closed[int(np.argmax(ranks))]
        if max(ranks) == np.count_nonzero(free):
            return
        rest = rest_of(system, system.equations.jacobian(q), np.flatnonzero(self._held))
        idle, lacking = open_motions(system, q, rest.left_open())
        if lacking.shape[1]:
            raise InputError(
                f"the given values leave {lacking.shape[1]} motion(s) open, of "
                f"{in_words(system, lacking)}: closed configurations are not single ones then; "
                "give values of more joints"
            )
        self._same.leave_out(q, idle)

    def _add(self, q: Array) -> None:
        """Count a start that has closed the loops nearly, and keep its mode if it is new.

        Or if it is the first within the joint limits at the places that are compared.
        """
        k = self._known(self._same.places(q), _SAME)
        if k is None or not (self._inside[k] or self._is_outside(q)):
            q = close_gaps(self._system, q, self._held, False)
            if not is_closed(self._system, q):
                return
            k = self._keep(q)
        self._hits[k] += 1
        self.closed += 1

    def _keep(self, q: Array) -> int:
        """Keep a closed configuration, and return which mode it is."""
        values, places = self._singular_values(q), self._same.places(q)
        near = _SAME_SINGULAR if _condition(values, self._rank(values)) > _SINGULAR else _SAME
        within, inside = self._same.within_a_turn(q, self._held), not self._is_outside(q)
        k = self._known(places, near)
        if k is None:
            k = len(self._q)
            self._q.append(within)
            self._places.append(places)
            self._values.append(values)
            self._inside.append(inside)
            self._hits.append(0)
        elif inside and not self._inside[k]:
            self._q[k], self._places[k], self._values[k] = within, places, values
            self._inside[k] = True
        return k

    def _is_outside(self, q: Array) -> bool:
        if not self._within_limits:
            return False
        within = self._same.within_a_turn(q, self._held)
        return bool(beyond_limits(self._system, within).any())

    def _known(self, places: Array, near: float) -> int | None:
        """Return which mode found so far is at these places."""
        if not self._q:
            return None
        apart = np.abs(np.array(self._places) - places).max(axis=1, initial=0.0)
        k = int(np.argmin(apart))
        return k if apart[k] <= near else None

    def _singular_values(self, q: Array) -> Array:
        jacobian = self._system.scaled(self._system.equations.jacobian(q))
        return singular_values(jacobian[:, ~self._held])

    def _rank(self, values: Array) -> int:
        return rank(values, self._system.rule.tolerance)

    def _keep_nearest(self, q: Array) -> None:
        equations = self._system.equations
        for one in q:
            gap = equations.largest_gap(equations.gaps(one))
            if gap < self._least_gap:
                self._least_gap, self._nearest = gap, one

    def found(self, stopped: Stopped) -> FoundModes:
        """Return what was found, nearest to the guess first, if anything was."""
        if not self._q:
            gaps = self._system.equations.gaps(self._nearest)
            raise ClosureError(
                f"no closed configuration with these values was found in {self.starts} starts: "
                f"where it comes nearest, {self._system.equations.open_closure(gaps)}",
                self._least_gap,
            )
        q, hits = np.array(self._q), np.array(self._hits, dtype=np.intp)
        largest = max(map(self._rank, self._values))
        condition = np.array([_condition(values, largest) for values in self._values])
        apart = np.linalg.norm(np.array(self._places) - self._same.places(self._about), axis=1)
        order = np.argsort(apart, kind="stable")
        order = order[np.array(self._inside)[order]]
        count, n = len(hits), self.closed
        expected = count * (n - 1) / (n - count - 2) if n > count + 2 else np.inf
        return FoundModes(
            q[order],
            hits[order],
            condition[order],
            self.starts,
            n,
            count - order.size,
            float(expected),
            stopped,
        )


def _condition(values: Array, count: int) -> float:
    """Return the condition number by the first singular values."""
    if not count:
        return 1.0
    return float(values[0] / values[count - 1]) if values[count - 1] > 0 else np.inf

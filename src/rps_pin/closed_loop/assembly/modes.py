"""Assembly modes: the closed configurations with given joint values, as far as a search finds them.

The loops are closed from random configurations (`random_starts`), in batches (`many`). The given
joints are held, and those that no closure moves. What comes out is closed to rounding (`closing`)
and counted once (`sameness`).

The search has no proof: it finds what starts lead to. Each mode has a share of the starts that end
in it. If nothing is known about these shares, and w modes were found in n closed starts, the
expected number of modes, found or not, and the probability that all are found, are

    w (n - 1) / (n - w - 2)   and   (n - 2)/n (n - 3)/(n + 1) ... (n - 1 - w)/(n - 1 + w)

(Boender and Rinnooy Kan, Bayesian stopping rules for multistart global optimization methods, 1987).
The search ends where a probability that was asked for is reached. If none was, it ends where the
expected number is at most w + 1/2, which takes n = 2 w^2 + 3 w + 2 closed starts. It takes
`LEAST_CLOSED` closed starts at least, and goes on until each mode was found by `LEAST_HITS` starts:
if some were found by one, there are likely others of their kind. A mode of a share far below 1/n is
missed, as one is that no start near it leads to.

`every` finds all modes by homotopy instead, where it can.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.assembly.closing import close_gaps, is_closed
from rps_pin.closed_loop.assembly.completion import (
    beyond_limits,
    by_name,
    refuse_values_outside,
    with_values,
)
from rps_pin.closed_loop.assembly.every.all_modes import every_mode
from rps_pin.closed_loop.assembly.every.conditions import (
    condition_of,
    conditions,
    rank_of,
    values_at,
)
from rps_pin.closed_loop.assembly.every.found_modes import FoundModes, Stopped
from rps_pin.closed_loop.assembly.every.solutions import NoFormulationError
from rps_pin.closed_loop.assembly.many import Equations, close_many, equations_of
from rps_pin.closed_loop.assembly.random_starts import RandomStarts
from rps_pin.closed_loop.assembly.sameness import Sameness
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.freedoms import in_words, open_motions, rest_of
from rps_pin.errors import ClosureError, InputError
from rps_pin.validation import positive_number, real, whole_number

#: Closed starts that a search takes at least; starts without any closed one that it gives up after.
LEAST_CLOSED, MOST_OPEN = 100, 1000
#: Starts that each mode is found by before the search ends.
LEAST_HITS = 3
_BATCH = 128
#: Modes whose places differ by less are one; near a singularity they are less sharp.
_SAME, _SAME_SINGULAR, _SINGULAR = 1e-6, 1e-3, 1e5

Method = Literal["search", "all"]


def assembly_modes(
    system: ConstraintSystem,
    values: Mapping[str, ArrayLike] | ArrayLike | None,
    guess: Array,
    *,
    equations: Equations | None = None,
    frames: Sequence[str] | None = None,
    method: Method = "search",
    probability: float | None = None,
    seed: int = 0,
    starts: int = 20_000,
    seconds: float | None = None,
    within_limits: bool = True,
    progress: Callable[[float], None] | None = None,
) -> FoundModes:
    """Return the assembly modes that are found; see `ClosedLoopModel.assembly_modes`."""
    if method not in get_args(Method):
        raise InputError(f"method = {method!r}: there are 'search' and 'all'")
    if probability is not None and not 0 < real(probability) < 1:
        raise InputError(f"probability = {probability!r} must be a number between 0 and 1")
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
    told = ""
    if method == "all":
        try:
            found = every_mode(system, about, held, same, within_limits, longest, progress)
        except NoFormulationError as refusal:
            told = f"searched, not solved as polynomials, since {refusal}"
        else:
            if progress is not None:
                progress(1.0)
            return found
    search = _Search(system, about, held, equations, same, within_limits)
    stopped = search.run(np.random.default_rng(seed), starts, longest, probability, progress)
    return search.found(stopped)._replace(known=told)


def probability_of_all(count: int, closed: int) -> float:
    """Return the probability that all modes are found, of `count` in `closed` closed starts."""
    if closed < count + 2:
        return 0.0
    return math.prod((closed - 1 - i) / (closed - 1 + i) for i in range(1, count + 1))


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

    def needed(self, probability: float | None) -> int:
        """Return the closed starts after which the search ends with the modes found so far."""
        count = len(self._q)
        if probability is None:
            return max(LEAST_CLOSED, 2 * count * count + 3 * count + 2)
        # log of the product: about - w (w + 1) / (n - 1)
        return max(LEAST_CLOSED, math.ceil(1 - count * (count + 1) / math.log(probability)))

    @property
    def probability(self) -> float:
        """Of all modes being among those found, after these starts."""
        return probability_of_all(len(self._q), self.closed)

    def ended(self, probability: float | None) -> Stopped | None:
        """Return by which rule the search has ended, if it has."""
        if self.closed < LEAST_CLOSED or min(self._hits) < LEAST_HITS:
            return None
        if probability is not None:
            return "probable" if self.probability >= probability else None
        return "settled" if self.closed >= self.needed(None) else None

    def run(
        self,
        rng: np.random.Generator,
        starts: int,
        longest: float,
        probability: float | None,
        progress: Callable[[float], None] | None,
    ) -> Stopped:
        """Search, and return what ended it."""
        begin = time.monotonic()
        try:
            while self.starts < starts:
                self.take(rng, min(_BATCH, starts - self.starts))
                spent = time.monotonic() - begin
                if progress is not None:
                    needed = self.needed(probability)
                    shares = self.closed / needed, self.starts / starts, spent / longest
                    progress(min(max(shares), 1.0))
                if (rule := self.ended(probability)) is not None:
                    return rule
                if spent >= longest:
                    return "time"
                if not self.closed and self.starts >= MOST_OPEN:
                    break
        except KeyboardInterrupt:
            return "interrupted"
        return "starts"

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
        ranks = [rank_of(system, values_at(system, one, self._held)) for one in closed]
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
        values, places = values_at(self._system, q, self._held), self._same.places(q)
        condition = condition_of(values, rank_of(self._system, values))
        near = _SAME_SINGULAR if condition > _SINGULAR else _SAME
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
        condition = conditions(self._system, self._values)
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
            self.probability,
        )

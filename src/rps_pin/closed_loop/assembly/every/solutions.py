"""What a formulation of the closures as polynomials returns: solutions, as guesses of modes."""

from __future__ import annotations

from typing import NamedTuple

from rps_pin.arrays import Array, Bools
from rps_pin.errors import MechanismError


class NoFormulationError(MechanismError):
    """The closures are not of a kind whose solutions can all be followed; says why."""


class Solutions(NamedTuple):
    """All solutions of a formulation."""

    guesses: Array
    """Configurations with the real solutions in them, shape (m, nq)."""
    solved: Bools
    """Velocities whose joints the solutions give; the others follow from them, shape (nv,)."""
    certified: Bools
    """Of which real solutions are proven, shape (m,)."""
    complex_count: int
    """Regular solutions over the complex numbers."""
    paths: int
    """Paths that were followed."""
    singular: int
    """Paths that end in no regular solution."""
    known: str
    """How the count is known, in words."""

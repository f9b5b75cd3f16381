"""What the searches for assembly modes return."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools, Indices

Stopped = Literal["settled", "probable", "starts", "time", "interrupted", "paths"]


class FoundModes(NamedTuple):
    """Assembly modes, those nearest to the guess first."""

    q: Array
    """Closed configurations, shape (k, nq)."""
    hits: Indices
    """How many of the random starts ended in each, shape (k,); zeros where none were drawn."""
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
    """What ended the search: its rule (``"settled"``), the ``probability`` that was asked for
    (``"probable"``), the most ``"starts"`` or the ``"time"`` that was given, or Ctrl-C
    (``"interrupted"``); ``"paths"`` where all paths of a homotopy were followed."""
    probability: float = np.nan
    """Probability that all modes are found, after the random starts; see `modes`. NaN for paths."""
    complex_count: int | None = None
    """Regular solutions over the complex numbers, of which the modes are the real ones; None for
    random starts."""
    paths: int = 0
    """Paths that were followed."""
    singular: int = 0
    """Paths that end in no regular solution: at infinity, or in solutions that coincide."""
    known: str = ""
    """How the count is known, in words; empty for random starts."""
    certified: Bools | None = None
    """Of which modes an interval test proves that there is one near q, and only one, shape (k,);
    None for random starts."""

    def __str__(self) -> str:
        """Say what was found, and how sure that is."""
        left_out = f"; {self.outside} more outside joint limits" if self.outside else ""
        if self.complex_count is not None and self.certified is not None:
            ends = f", {self.singular} of which end in no regular solution" if self.singular else ""
            return (
                f"{len(self.q)} found on {self.paths} paths{ends}{left_out}; "
                f"{np.count_nonzero(self.certified)} certified. "
                f"Complex solutions: {self.complex_count}; {self.known}"
            )
        rarest = f", the rarest in {self.hits.min()} of them" if self.hits.size else ""
        ended = {
            "settled": "the search has settled",
            "probable": "the search has reached the probability asked for",
            "starts": "the search ended at the most starts it was given",
            "time": "the search ended at the time it was given",
            "interrupted": "the search was interrupted",
        }[self.stopped]
        told = f"{self.known}; " if self.known else ""
        return (
            f"{told}{self.hits.size} found in {self.starts} random starts, of which {self.closed} "
            f"closed{rarest}{left_out}. Expected in all: {self.expected:.4g}, probability that all "
            f"are found: {self.probability:.3g}; {ended}"
        )

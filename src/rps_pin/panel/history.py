"""The last seconds of what a panel shows, for plots."""

from __future__ import annotations

from collections import deque

import numpy as np

from rps_pin.arrays import Array

WINDOW = 20.0
"""Seconds that are kept."""
_HELD = 0.25
"""A pause of so many seconds between moves is drawn as one, s."""
_LEAST = 0.02
"""Moves that follow each other faster count as one, s."""


class History:
    """Rows of numbers at times, those of the last seconds."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, Array]] = deque()

    def add(self, now: float, row: Array) -> None:
        """Add a row of numbers, shape (n,), at a time, s, not before the last one's."""
        if self._rows:
            last, before = self._rows[-1]
            if now - last > _HELD:
                self._rows.append((now - _LEAST, before))
            elif now - last < _LEAST and len(self._rows) > 1:
                self._rows.pop()
        self._rows.append((now, row))
        while self._rows[0][0] < now - WINDOW:
            self._rows.popleft()

    def clear(self) -> None:
        """Forget all."""
        self._rows.clear()

    def arrays(self) -> tuple[Array, Array]:
        """Return times before the last one, shape (k,), s, at most zero; and rows, (k, n)."""
        times = np.array([now for now, _ in self._rows])
        return times - times[-1], np.array([row for _, row in self._rows])

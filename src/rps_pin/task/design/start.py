"""Candidates closed in the assembly mode of home, at the middle of the region.

From the file's robot at home, dimensions and task coordinates are changed together in small steps,
each closed by Newton's steps that must contract; where that fails, in smaller steps, and first the
dimensions and then the coordinates. The singularities that lie between are told by the sign of the
determinant of K (`measures`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.task.design.space import Space

#: Steps of the ways that are tried, in order, and the share of a way in which the dimensions
#: change.
_WAYS = ((12, 1.0), (96, 1.0), (96, 0.5))

#: Coordinates below this, m or rad, are 0 but for rounding.
_ROUNDING = 1e-15


class Started(NamedTuple):
    """Configurations at the middle of the region."""

    q: Array
    """Of the extended mechanism, shape (n, nq)."""
    done: Array
    """How much of the way was done, shape (n,): 1 where it is all."""


def packed(engine: Any, numbers: dict[str, Array], count: int) -> Array:
    """Return numbers of groups in the order of an engine's parameters, shape (n, np)."""
    parts = [numbers[group] for group in engine.code.parameters]
    return np.concatenate(parts, axis=-1) if parts else np.zeros((count, 0))


def started(space: Space, engine: Any, values: Array, goal: Array) -> Started:
    """Return candidates (n, d) at task coordinates (m,)."""
    task = space.task
    home = task.joined(task.mechanism.home, task.home)
    count = len(values)
    found = np.tile(home, (count, 1))
    best, left = np.zeros(count), np.arange(count)
    for steps, share in _WAYS:
        if not left.size:
            break
        q, done = _followed(space, engine, values[left], home, goal, steps, share)
        whole = done >= 1.0
        better = done > best[left]
        found[left[better]] = q[better]
        best[left] = np.maximum(best[left], done)
        left = left[~whole]
    # Continuations from quaternions with parts such as 1e-50 were seen to fail; from 0 they do not.
    found[np.abs(found) < _ROUNDING] = 0.0
    return Started(found, best)


def _followed(
    space: Space, engine: Any, values: Array, home: Array, goal: Array, steps: int, share: float
) -> tuple[Array, Array]:
    """Return where candidates end on one way, and how much of it was done."""
    q, done = np.tile(home, (len(values), 1)), np.zeros(len(values))
    alive = np.arange(len(values))
    start = space.task.home
    for step in range(1, steps + 1):
        of_all = step / steps
        of_values = min(of_all / share, 1.0)
        of_goal = of_all if share == 1.0 else max(0.0, (of_all - share) / (1.0 - share))
        now = space.nominal + of_values * (values[alive] - space.nominal)
        x = np.tile(start + of_goal * (goal - start), (len(alive), 1))
        numbers = packed(engine, space.candidates(now).numbers, len(alive))
        moved, ok = engine.continued(x, q[alive], numbers)
        alive = alive[ok]
        q[alive], done[alive] = moved[ok], of_all
        if not alive.size:
            break
    return q, done

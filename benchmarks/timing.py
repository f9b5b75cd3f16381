"""Times of calls measured in turns, so that a change of the machine's speed meets all of them.

Times are the processor's for this process: what other processes run meanwhile is not counted.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np

ROUNDS = 31
BLOCK = 2e-3
"""Time of one block of calls, s."""


def medians(calls: Mapping[str, Callable[[], object]], rounds: int = ROUNDS) -> dict[str, float]:
    """Return the median time of a call, in us: one block of each call in turn, `rounds` times."""
    counts = {name: _count(call) for name, call in calls.items()}
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            times[name].append(_block(call, counts[name]))
    return {name: 1e6 * float(np.median(found)) for name, found in times.items()}


def _count(call: Callable[[], object]) -> int:
    """Return how many calls take about one block, after some calls to warm up."""
    began = time.process_time()
    call()
    first = time.process_time() - began
    if first > BLOCK:
        return 1
    for _ in range(20):
        call()
    return max(1, round(BLOCK / min(_block(call, 5), _block(call, 5))))


def _block(call: Callable[[], object], count: int) -> float:
    """Return the time of one of `count` calls, s."""
    each = range(count)
    began = time.process_time()
    for _ in each:
        call()
    return (time.process_time() - began) / count

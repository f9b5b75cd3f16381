"""Threads that call at once, and what became of each call."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from rps_pin.errors import ThreadError


def at_once(works: Sequence[Callable[[], Any]], count: int) -> tuple[list[list[Any]], int]:
    """Call each of some functions in a thread of its own, with frequent changes of threads.

    Each is called until it has given `count` answers; a call that is refused is made again.

    Returns
    -------
    answers of each function, number of calls that were refused with a `ThreadError`
    """
    found: list[list[Any]] = [[] for _ in works]
    refused, foreign = [0] * len(works), []
    begin = threading.Barrier(len(works))

    def work(k: int) -> None:
        begin.wait(240)
        while len(found[k]) < count and not foreign:
            try:
                found[k].append(works[k]())
            except ThreadError:
                refused[k] += 1
                time.sleep(1e-6)
            except BaseException as error:
                foreign.append(error)

    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        threads = [threading.Thread(target=work, args=(k,)) for k in range(len(works))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(usual)
    assert not foreign, foreign[0]
    return found, sum(refused)

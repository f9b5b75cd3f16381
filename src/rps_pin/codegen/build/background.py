"""Builds in the background, which end quietly with Python."""

from __future__ import annotations

import atexit
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

T = TypeVar("T")

#: How long Python's end waits for a build to stop, s.
_PATIENCE = 5.0
_stop = threading.Event()
_threads: set[threading.Thread] = set()


class StoppedError(Exception):
    """Python ends: so does the build."""


def watch(*_: int) -> None:
    """Raise `StoppedError` when Python ends."""
    if _stop.is_set():
        raise StoppedError


def start(work: Callable[[], T], name: str) -> Future[T]:
    """Do work in a thread that Python does not wait for; it has to call `watch` often."""
    future: Future[T] = Future()
    future.set_running_or_notify_cancel()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:
            future.set_exception(error)
        finally:
            _threads.discard(threading.current_thread())

    thread = threading.Thread(target=run, name=name, daemon=True)
    _threads.add(thread)
    thread.start()
    return future


@atexit.register
def _end() -> None:
    _stop.set()
    for thread in list(_threads):
        thread.join(_PATIENCE)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_threads.clear)

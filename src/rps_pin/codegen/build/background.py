"""Builds in the background, which end quietly with Python."""

from __future__ import annotations

import atexit
import ctypes
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

T = TypeVar("T")

#: How long Python's end waits for a build to stop, s.
_PATIENCE = 5.0
_PAUSE = 0.1
_stop = threading.Event()
_turn = threading.Lock()
_threads: set[threading.Thread] = set()


class StoppedError(Exception):
    """Python ends: so does the build."""


def watch(*_: int) -> None:
    """Raise `StoppedError` when Python ends."""
    if _stop.is_set():
        raise StoppedError


def start(work: Callable[[], T], name: str) -> Future[T]:
    """Do work in a thread that Python does not wait for; it has to call `watch` often.

    One work after the other: each uses all cores.
    """
    future: Future[T] = Future()
    future.set_running_or_notify_cancel()

    def run() -> None:
        try:
            while not _turn.acquire(timeout=_PAUSE):
                watch()
            try:
                future.set_result(work())
            finally:
                _turn.release()
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
        thread.join(_PAUSE)
        if thread.is_alive():  # a proof runs, which does not call `watch`
            _raise_in(thread)
            thread.join(_PATIENCE)


def _raise_in(thread: threading.Thread) -> None:
    """Raise `StoppedError` in a thread, at its next instruction of Python."""
    identity, kind = ctypes.c_ulong(thread.ident or 0), ctypes.py_object(StoppedError)
    ctypes.pythonapi.PyThreadState_SetAsyncExc(identity, kind)


def _forget() -> None:
    """Forget the threads: a forked process has none."""
    global _turn  # noqa: PLW0603 - one of them may have held it
    _threads.clear()
    _turn = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)

"""Ends from outside: SIGTERM and SIGHUP as Ctrl-C, and workers that end with their parent."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

#: Signals whose default action ends a process without a word to Python.
_DEADLY = (signal.SIGTERM, signal.SIGHUP)
#: Time until a signal is sent again whose exception was lost, s.
_AGAIN = 0.01
#: How often a worker looks whether its parent lives, s.
_PAUSE = 0.25


class Interrupted(KeyboardInterrupt):
    """Raised by a signal where Ctrl-C raises `KeyboardInterrupt`."""


@contextmanager
def signals_as_ctrl_c() -> Iterator[None]:
    """Let SIGTERM and SIGHUP interrupt the block as Ctrl-C does, so that it clears up.

    They raise `KeyboardInterrupt`; where the block passes it on, the process ends with the exit
    status that a shell gives for the signal, 143 or 129. A signal that the caller handles, or
    ignores, is left alone, and so are all of them in a thread: only the main thread receives
    signals.

    Raises
    ------
    SystemExit
        At the end of a block that a signal interrupted.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ours = [number for number in _DEADLY if signal.getsignal(number) == signal.SIG_DFL]
    received: list[int] = []
    hook = sys.unraisablehook

    def interrupt(number: int, _: object) -> None:
        received.append(number)
        raise Interrupted

    def lost(found: sys.UnraisableHookArgs) -> None:
        # Raised where Python can only report it, in a destructor: the signal is sent again.
        if isinstance(found.exc_value, Interrupted):
            threading.Timer(_AGAIN, _to_main_thread, (received[-1],)).start()
        else:
            hook(found)

    try:
        sys.unraisablehook = lost
        for number in ours:
            signal.signal(number, interrupt)
        yield
    except BaseException as error:
        ended_well = isinstance(error, SystemExit) and not error.code
        if received and not ended_well:
            raise SystemExit(128 + received[0]) from None
        raise
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)
        sys.unraisablehook = hook


def _to_main_thread(number: int) -> None:
    signal.pthread_kill(threading.main_thread().ident or 0, number)


def end_with_parent(parent: int) -> None:
    """End this process when its parent has ended, however that happened; leave Ctrl-C to it.

    Parameters
    ----------
    parent
        The parent's process number.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_PAUSE)
        os._exit(1)

    threading.Thread(target=watch, name="end with the parent", daemon=True).start()

"""Ends from outside: SIGTERM and SIGHUP as Ctrl-C, workers that end with their parent, leftovers.

A process that is killed cannot clear up. Its temporary files and folders have names that say which
process made them, so that the next one can remove them.
"""

from __future__ import annotations

import _thread
import functools
import hashlib
import os
import platform
import re
import secrets
import shutil
import signal
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

#: Signals whose default action ends a process without a word to Python.
_DEADLY = (signal.SIGTERM, signal.SIGHUP)
#: Time until a signal is sent again whose exception was lost, s.
_AGAIN = 0.01
#: How often a worker looks whether its parent lives, s.
_PAUSE = 0.25
#: Names of temporary files (hidden, beside the file that is written) and folders.
_WHO = r"rps_pin-(?P<place>[0-9a-f]{8})-(?P<process>[0-9]+)-[0-9a-f]{8}"
_FILE, _FOLDER = re.compile(rf"\..*\.{_WHO}(\..*)?", re.DOTALL), re.compile(_WHO)
_DAY = 86400.0


class Interrupted(KeyboardInterrupt):
    """Raised by a signal where Ctrl-C raises `KeyboardInterrupt`; `args` holds its number."""


@contextmanager
def signals_as_ctrl_c() -> Iterator[None]:
    """Let SIGTERM and SIGHUP interrupt the block as Ctrl-C does, so that it clears up.

    They raise `KeyboardInterrupt`; where the block passes it on, the process ends with the exit
    status that a shell gives for the signal, 143 or 129. A signal that the caller handles, or
    ignores, is left alone, and so are all of them in a thread: only the main thread receives
    signals. An interruption that is lost, as it came in a destructor, is repeated, Ctrl-C's too.

    Raises
    ------
    SystemExit
        At the end of a block that a signal interrupted.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ours = [number for number in _DEADLY if signal.getsignal(number) == signal.SIG_DFL]
    ctrl_c = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    received: list[int] = []
    hook = sys.unraisablehook

    def interrupt(number: int, _: object) -> None:
        received.append(number)
        raise Interrupted(number)

    def lost(found: sys.UnraisableHookArgs) -> None:
        # Raised where Python can only report it, in a destructor: the signal is sent again. An
        # outer block may have received it.
        if isinstance(found.exc_value, Interrupted):
            again = found.exc_value.args[0]
        elif isinstance(found.exc_value, KeyboardInterrupt) and ctrl_c:
            again = signal.SIGINT
        else:
            hook(found)
            return
        started = False
        while not started:
            with suppress(KeyboardInterrupt):  # it came while this was slow: once more
                _thread.start_new_thread(_to_main_thread, (again,))  # does not wait for the thread
                started = True

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
    time.sleep(_AGAIN)
    signal.pthread_kill(threading.main_thread().ident or 0, number)


@contextmanager
def interruptions_wait() -> Iterator[None]:
    """Let Ctrl-C, SIGTERM and SIGHUP wait for the end of the block, of a library that is called.

    Foreign code that calls Python back may not survive what a signal's handler raises there.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting: list[int] = []
    before = {one: signal.getsignal(one) for one in (signal.SIGINT, *_DEADLY)}
    ours = {one: handler for one, handler in before.items() if callable(handler)}
    try:
        for one in ours:
            signal.signal(one, lambda number, _: waiting.append(number))
        yield
    finally:
        for one, handler in ours.items():
            signal.signal(one, handler)
        for number in waiting:
            signal.raise_signal(number)


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


@contextmanager
def workers_without_signals() -> Iterator[None]:
    """Start processes in the block that never see Ctrl-C nor a terminal's end, not even at first.

    Their parent sees them, and ends its workers. In this process the signals wait for the end of
    the block.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# Temporary files and folders ----------------------------------------------------------------------


@contextmanager
def scratch_folder(place: Path | None = None) -> Iterator[Path]:
    """Give a folder for temporary files; remove it, and those that killed processes left.

    It lies in `place`; left out, in the system's folder for temporary files.
    """
    place = Path(tempfile.gettempdir()) if place is None else place
    remove_leftovers(place)
    folder = place / _who()
    folder.mkdir(mode=0o700)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def scratch_name(target: Path) -> str:
    """Return a hidden name for a file that becomes `target`."""
    # 40 characters of the name: a longer one could be too long for a file system.
    return f".{target.stem[:40]}.{_who()}{target.suffix}"


def remove_leftovers(folder: Path) -> None:
    """Remove files and folders of such names whose process has ended.

    Of other machines, those that are a day old.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            with suppress(OSError):  # another process was faster
                is_folder = entry.is_dir(follow_symlinks=False)
                found = (_FOLDER if is_folder else _FILE).fullmatch(entry.name)
                if found is None or not _left_behind(entry, found["place"], int(found["process"])):
                    continue
                if is_folder:
                    shutil.rmtree(entry)
                else:
                    Path(entry).unlink()


def _who() -> str:
    return f"rps_pin-{_place()}-{os.getpid()}-{secrets.token_hex(4)}"


@functools.cache
def _place() -> str:
    """Return eight digits of this machine or container: process numbers are unique within it."""
    try:
        numbers = str(Path("/proc/self/ns/pid").readlink())
    except OSError:  # not Linux
        numbers = ""
    return hashlib.sha256(f"{platform.node()} {numbers}".encode()).hexdigest()[:8]


def _left_behind(entry: os.DirEntry[str], place: str, process: int) -> bool:
    status = entry.stat(follow_symlinks=False)
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        return False
    if status.st_uid != os.geteuid():
        return False
    if place != _place():
        return time.time() - status.st_mtime > _DAY
    try:
        os.kill(process, 0)  # sends nothing
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):  # of another user, or no number of a process
        return False
    return False

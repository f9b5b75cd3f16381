"""A compiler's processes: several at once; Ctrl-C, a limit and this process's end end them."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

#: Called while processes run, with how many of how many have ended; it may raise to end them.
Watch = Callable[[int, int], None]

#: A shell that runs a command, and a watcher that ends all of it when our end of its input is
#: closed: however this process ends.
_GUARD = """
exec 3<&0
(read _ <&3; kill -9 0) >/dev/null 2>&1 &
"$@" </dev/null 3<&-
status=$?
kill $! 2>/dev/null
wait $! 2>/dev/null
exit $status
"""
_PAUSE = 0.005


class Ended(NamedTuple):
    """How a process ended."""

    status: int | None
    """Its exit status, 128 and more if a signal ended it; None if it took longer than allowed."""
    words: str
    """What it wrote, without empty lines."""


def run(
    commands: Iterable[Sequence[str]], count: int, folder: Path, limit: float, watch: Watch
) -> list[Ended]:
    """Run commands, as many at once as there are cores, until all have ended or one has failed.

    Parameters
    ----------
    commands : iterable of sequence of str
        The programs with their arguments, asked for one by one while the others run.
    count : int
        How many there are.
    folder : Path
        Where they run; their temporary files are here too.
    limit : float
        The longest time of all together, s.
    watch : function
        See `Watch`.

    Returns
    -------
    list of Ended
        Of all commands, or only of the one that failed.
    """
    environment = {**os.environ, "TMPDIR": str(folder), "LC_ALL": "C"}
    waiting = enumerate(commands)
    running: dict[int, subprocess.Popen[bytes]] = {}
    ended: dict[int, Ended] = {}
    end = time.monotonic() + limit
    try:
        while len(ended) < count:
            while len(running) < cores() and (next_one := next(waiting, None)) is not None:
                number, command = next_one
                running[number] = _start(command, folder, folder / f"{number}.txt", environment)
            for number, process in list(running.items()):
                late = time.monotonic() > end
                if process.poll() is None and not late:
                    continue
                status = None if late else abs(process.returncode) + 128 * (process.returncode < 0)
                _end(running.pop(number))
                ended[number] = Ended(status, _words(folder / f"{number}.txt"))
                if status != 0:
                    return [ended[number]]
            watch(len(ended), count)
            time.sleep(_PAUSE)
    finally:
        for process in running.values():
            _end(process)
    return [ended[number] for number in sorted(ended)]


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _start(
    command: Sequence[str], folder: Path, words: Path, environment: dict[str, str]
) -> subprocess.Popen[bytes]:
    with words.open("wb") as file:
        return subprocess.Popen(
            ["/bin/sh", "-c", _GUARD, "sh", *command],
            cwd=folder,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=file,
            stderr=file,
            start_new_session=True,
        )


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process with its children and its watcher."""
    with suppress(ProcessLookupError, PermissionError):  # macOS: the latter of a dead group
        os.killpg(process.pid, signal.SIGKILL)
    if process.stdin is not None:
        process.stdin.close()
    process.wait()


def _words(file: Path) -> str:
    lines = file.read_text("utf-8", "replace").splitlines()
    return "\n".join(line for line in lines if line.strip())

"""Processes that tests start. Ctrl-C reaches each of them as it does one started in a terminal.

A shell starts its background jobs with SIGINT ignored (``nohup make test &``), and a child keeps
that: without `start`, a test's Ctrl-C would be lost on it there.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

#: The command line's entry point, in a process of its own.
RPS_PIN = (
    *(sys.executable, "-u", "-c"),
    "import sys; sys.argv[0] = 'rps-pin'; from rps_pin.cli import main; main()",
)


def start(command: Sequence[str | Path], **options: Any) -> subprocess.Popen[str]:
    """Start a process with SIGINT and SIGHUP at their defaults; its output is piped, unless told.

    Call it from the main thread: only there Python sets signals.
    """
    piped = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    # A handler of this process becomes the default in the child; what is ignored stays ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    hung_up = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # which nohup ignores
    try:
        return subprocess.Popen(list(command), **(piped | options))
    finally:
        signal.signal(signal.SIGINT, before)
        signal.signal(signal.SIGHUP, hung_up)


def run(
    command: Sequence[str | Path], *, timeout: float = 240.0, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Start a process as `start`, and return what it said when it has ended."""
    with start(command, **options) as process:
        try:
            output, errors = process.communicate(timeout=timeout)
        except BaseException:
            process.kill()
            raise
    return subprocess.CompletedProcess(process.args, process.returncode, output, errors)


def lives(process: int) -> bool:
    """Return whether a process runs: one that ended, and whose parent did not ask, does not."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{process}/stat")
    return not status.exists() or status.read_text().rpartition(")")[2].split()[0] != "Z"


def wait_for_end(processes: Sequence[int], timeout: float = 60.0) -> None:
    """Wait until processes have ended that this one did not start."""
    end = time.monotonic() + timeout
    while living := [one for one in processes if lives(one)]:
        assert time.monotonic() < end, f"still alive: {living}"
        time.sleep(0.05)


def wait_for_work(process: int, seconds: float, timeout: float = 240.0) -> None:
    """Wait until a process has used so much more time of a processor.

    On a loaded machine a process may do next to nothing in a second that passes.
    """
    wanted, end = _used(process) + seconds, time.monotonic() + timeout
    while lives(process) and _used(process) < wanted:
        assert time.monotonic() < end, f"process {process} does not work"
        time.sleep(0.02)


def _used(process: int) -> float:
    """Return the processor's time of a process, s; infinite if it has ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return math.inf
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

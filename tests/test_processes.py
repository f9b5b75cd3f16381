"""Processes that tests start can be interrupted, also where this process ignores Ctrl-C."""

from __future__ import annotations

import signal
import subprocess
import sys

from tests.processes import run, start

SLEEPER = """
import time
try:
    print("sleeps", flush=True)
    time.sleep(60)
except KeyboardInterrupt:
    print("woken", flush=True)
"""


def test_ctrl_c_reaches_a_child_of_a_process_that_ignores_it() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as in a shell's background job
    try:
        with start([sys.executable, "-c", SLEEPER]) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "sleeps\n"
            process.send_signal(signal.SIGINT)
            output, errors = process.communicate(timeout=240)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
    assert (process.returncode, output, errors) == (0, "woken\n", "")


def test_a_process_is_run_to_its_end() -> None:
    ended = run([sys.executable, "-c", "print(input())"], stdin=subprocess.DEVNULL)
    assert ended.returncode == 1
    assert "EOFError" in ended.stderr

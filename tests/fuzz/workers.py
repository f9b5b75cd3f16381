"""Cases run in a process of their own, which a crash, a hang or a lack of memory may end."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import resource
import signal
import time
import warnings
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.fuzz.case import FINDING, LONG, Case, Outcome, judged
from tests.fuzz.formats import FORMATS
from tests.fuzz.formats import case as case_of

#: Longest time of a case, and until Ctrl-C has ended it, s; of the processor, which others share.
LIMIT, GRACE = 10.0, 5.0
#: Longest time by the clock, for what only waits, s.
LONGEST, _WAIT = 60.0, 0.5
#: Address space of a worker, bytes.
MEMORY = 8 * 2**30
_SPAWN = multiprocessing.get_context("spawn")

Item = tuple[str, int] | Case


def outcomes(items: Iterator[Item] | Sequence[Item]) -> Iterator[tuple[Item, Outcome]]:
    """Yield items, each a case or a format and a number, with what becomes of them."""
    with contextlib.closing(_Worker()) as worker:
        for item in items:
            yield item, worker.outcome(item)


def made(item: Item) -> Case:
    """Return the case of an item."""
    return item if isinstance(item, Case) else case_of(*item)


class _Worker:
    """A process that runs one case after the other, and is replaced when it ends."""

    def __init__(self) -> None:
        self._start()

    def _start(self) -> None:
        self._end, theirs = _SPAWN.Pipe()
        self._process: Any = _SPAWN.Process(target=_work, args=(theirs,), daemon=False)
        self._process.start()
        theirs.close()
        self._end.recv()  # it has imported what it needs, which no case is charged with

    def outcome(self, item: Item) -> Outcome:
        """Return what becomes of an item."""
        self._end.send(item)
        try:
            if self._answers_within(LIMIT, LONGEST):
                return self._received()
            os.kill(self._process.pid, signal.SIGINT)
            if self._answers_within(GRACE, LONGEST):
                name = item.format if isinstance(item, Case) else item[0]
                found = self._received()
                long = name == "command" and (found.kind == LONG or "status 130" in found.message)
                return Outcome(LONG, "ended by Ctrl-C") if long else Outcome(FINDING, *_HANG)
        except (EOFError, ConnectionError):
            self._process.join()
            status = self._process.exitcode
            self._start()
            return Outcome(FINDING, f"the process ended with {status}", f"ended with {status}")
        self.close()
        self._start()
        return Outcome(FINDING, *_HANG)

    def _answers_within(self, processor: float, clock: float) -> bool:
        """Return whether an answer comes before so much time of the processor, or of the clock.

        The clock is counted in waits, since a machine that is halted goes on with its time.
        """
        used = self._processor_time()
        for _ in range(round(clock / _WAIT)):
            if self._end.poll(_WAIT):
                return True
            if self._processor_time() - used > processor:
                break
        return False

    def _processor_time(self) -> float:
        try:
            words = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:  # no such system, or the process has ended
            return time.monotonic()
        return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")

    def _received(self) -> Outcome:
        found: Outcome = self._end.recv()
        return found

    def close(self) -> None:
        """End the process."""
        if self._process.is_alive():
            self._process.kill()
        self._process.join()
        self._end.close()


_HANG = f"more than {LIMIT:g} s", "hang"


def _work(end: Connection) -> None:
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(null, stream)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**30, 2**30))
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")
    parent = os.getppid()
    end.send(None)
    while True:
        while not end.poll(1.0):
            if os.getppid() != parent:
                return
        try:
            item = end.recv()
        except EOFError:
            return
        end.send(_tried(item))


def _tried(item: Item) -> Outcome:
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            case = made(item)
            return judged(case, Path(folder), FORMATS[case.format].use)
        except KeyboardInterrupt:
            return Outcome(LONG, "ended by Ctrl-C")
        finally:
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def run_for(seconds: float, formats: Sequence[str], first: int) -> Iterator[tuple[Item, Outcome]]:
    """Yield cases of formats in turn, from a number on, for a time."""
    ends = time.monotonic() + seconds

    def items() -> Iterator[Item]:
        number = first
        while True:
            for name in formats:
                if time.monotonic() > ends:
                    return
                yield name, number
            number += 1

    return outcomes(items())

"""One thread that does what a page asks for: of what is asked repeatedly, the last alone."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Hashable


class Worker:
    """A thread that runs jobs in order, and in between something that is due from time to time.

    A job that is submitted again before it began replaces the earlier one: of the positions of a
    drag only the last is solved.

    Parameters
    ----------
    due
        Called between jobs; does what is due, and returns the seconds until it is called again if
        no job comes before.
    """

    def __init__(self, due: Callable[[], float | None]) -> None:
        self._due, self._jobs = due, dict[Hashable, Callable[[], object]]()
        self._change, self._ended = threading.Condition(), False
        self._thread = threading.Thread(target=self._run, name="rps_pin panel", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def submit(self, key: Hashable, job: Callable[[], object]) -> None:
        """Run a job soon, in place of one with the same key that has not begun."""
        with self._change:
            self._jobs[key] = job
            self._change.notify()

    def end(self) -> None:
        """End after the job that runs; wait for it."""
        with self._change:
            self._ended = True
            self._change.notify()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(5.0)

    def _run(self) -> None:
        while not self._ended:
            wait = self._safely(self._due)
            with self._change:
                if not self._jobs and not self._ended:
                    self._change.wait(wait if isinstance(wait, float) else None)
                jobs, self._jobs = list(self._jobs.values()), {}
            for job in jobs:
                if self._ended:
                    return
                self._safely(job)

    def _safely(self, job: Callable[[], object]) -> object:
        """Run a job; a mistake in it is printed, and the page goes on."""
        try:
            return job()
        except Exception:
            if not self._ended:
                traceback.print_exc()
            return 1.0

"""A bar on a terminal's stderr, for builds that take more than a second."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from rps_pin.plain_text import plain

_AFTER = 1.0


class Bar:
    """A bar with the time that has passed; call it with how many of how many steps are done."""

    def __init__(self, words: str) -> None:
        self._words = plain(words)
        self._begin = time.monotonic()
        self._shown: Progress | None = None

    def __call__(self, done: int, total: int) -> None:
        """Show how far it is, from the first second on."""
        if self._shown is None:
            if time.monotonic() - self._begin < _AFTER:
                return
            console = Console(stderr=True)
            self._shown = Progress(
                SpinnerColumn(),
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                TimeElapsedColumn(),
                console=console,
                transient=True,
                disable=not console.is_terminal,
            )
            self._shown.add_task(self._words)
            self._shown.start()
        self._shown.update(self._shown.task_ids[0], completed=done, total=total or None)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._shown is not None:
            self._shown.stop()

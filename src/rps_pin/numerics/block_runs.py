"""Blocks of a long computation: here, by threads, by own processes, or by any executor.

Blocks are given back in the order asked for, whoever computes them. Those of processes that die are
computed again; those that were kept (`rps_pin.numerics.kept_blocks`) are read instead.
"""

from __future__ import annotations

import multiprocessing.resource_tracker
import os
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any, Self

from loky import ProcessPoolExecutor, cpu_count
from loky.backend import resource_tracker
from numpy.typing import NDArray

from rps_pin.interruption import end_with_parent, workers_without_signals
from rps_pin.numerics.kept_blocks import KeptBlocks

#: Blocks under way for each worker: enough to keep it busy while another is written.
_AHEAD = 3
#: Processes that may die before the work is given up.
_MOST_DEATHS = 3
#: The cores are shared out among processes: none of them shall take more than one.
_ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}

#: A block's numbers by name, and what computes them from an argument.
Arrays = Mapping[str, NDArray[Any]]
Compute = Callable[[Any], Arrays]


def cores() -> int:
    """Return how many cores this process may use."""
    return int(cpu_count())


class Workers:
    """Blocks under way in the workers of an executor, or of processes or threads of our own.

    Processes of our own start again when one of them dies, with the blocks that were under way.

    Parameters
    ----------
    compute
        Computes a block; processes, and an executor, get it by pickle.
    count
        Workers.
    executor
        Computes the blocks in place of processes of our own; it is not shut down.
    threads
        Whether the workers are threads of this process.
    """

    def __init__(
        self,
        compute: Compute,
        count: int,
        executor: Executor | None = None,
        *,
        threads: bool = False,
    ) -> None:
        self._compute, self._count, self._given, self._threads = compute, count, executor, threads
        self._pool: Any = executor if executor is not None else self._started()
        self._pending: deque[tuple[Any, Future[Arrays]]] = deque()
        self._deaths = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None
    ) -> None:
        self._end(kill=kind is not None)

    def fill(self, blocks: Iterator[Any]) -> None:
        """Submit blocks' arguments until there are enough ahead."""
        while len(self._pending) < _AHEAD * self._count:
            try:
                block = next(blocks)
            except StopIteration:
                return
            self._submit(block)

    def next(self) -> Arrays:
        """Return the numbers of the block that was submitted first."""
        while True:
            try:
                found = self._pending[0][1].result()
            except BrokenExecutor as death:
                self._start_again(death)
                continue
            self._pending.popleft()
            return found

    def _started(self) -> Any:
        """Return an executor of our own."""
        if self._threads:
            return ThreadPoolExecutor(self._count)
        with workers_without_signals():  # these two unblock Ctrl-C: they must run before the rest
            multiprocessing.resource_tracker.ensure_running()
            resource_tracker.ensure_running()
        return ProcessPoolExecutor(
            self._count, initializer=end_with_parent, initargs=(os.getpid(),), env=_ONE_THREAD
        )

    def _end(self, *, kill: bool) -> None:
        """End our own workers, at once or when they are idle."""
        if self._given is None and self._threads:
            self._pool.shutdown(cancel_futures=kill)
        elif self._given is None:
            self._pool.shutdown(kill_workers=kill)
        elif kill:
            for _, future in self._pending:
                future.cancel()

    def _start_again(self, death: BrokenExecutor) -> None:
        """Replace processes of which one died, with the blocks under way; or raise its death."""
        self._deaths += 1
        if self._given is not None or self._deaths > _MOST_DEATHS:
            raise death
        self._end(kill=True)
        self._pool = self._started()
        lost = [block for block, _ in self._pending]
        self._pending.clear()
        for block in lost:
            self._submit(block)

    def _submit(self, block: Any) -> None:
        with workers_without_signals():  # the first call starts them
            try:
                future = self._pool.submit(self._compute, block)
            except BrokenExecutor as death:
                self._start_again(death)
                future = self._pool.submit(self._compute, block)
        self._pending.append((block, future))


def results(
    numbers: Sequence[int],
    argument: Callable[[int], Any],
    compute: Compute,
    workers: Workers | None,
    kept: KeptBlocks | None,
) -> Generator[Arrays, None, None]:
    """Give the numbers of blocks in their order.

    Parameters
    ----------
    numbers
        The blocks, as they are numbered in `kept`.
    argument
        Returns what a block is computed from, when it is needed.
    compute
        Computes a block here.
    workers
        Compute the blocks in its place.
    kept
        Blocks that are kept, where each is kept that is not there.
    """
    known = {i for i in numbers if kept is not None and kept.has(i)}
    ahead = (argument(i) for i in numbers if i not in known)
    for i in numbers:
        found = kept.get(i) if kept is not None and i in known else None
        if found is not None:
            yield found
            continue
        if workers is None or i in known:  # or a block that is spoilt
            computed = compute(argument(i))
        else:
            workers.fill(ahead)
            computed = workers.next()
        if kept is not None:
            kept.put(i, computed)
        yield computed

"""Workspaces too large for memory: computed block by block on every core, written to a file."""

from __future__ import annotations

import errno
import multiprocessing.resource_tracker
import os
import shutil
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import closing
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from loky import ProcessPoolExecutor, cpu_count
from loky.backend import resource_tracker
from numpy.typing import ArrayLike

from rps_pin.errors import InputError
from rps_pin.interruption import end_with_parent, workers_without_signals
from rps_pin.numerics.kept_blocks import KeptBlocks
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.compute import BLOCK, GridJob, Progress
from rps_pin.rps.workspace.evaluate import Fields
from rps_pin.rps.workspace.grids import Block, Grid
from rps_pin.rps.workspace.reasons import Reason
from rps_pin.rps.workspace.storage import (
    DType,
    bytes_per_point,
    checked_fields,
    new_workspace_file,
)
from rps_pin.task.workspace.evaluate import MIN_CONDITIONING
from rps_pin.validation import whole_number

if TYPE_CHECKING:
    from rps_pin.rps.robot import RPSRobot

#: Blocks under way for each worker: enough to keep it busy while another is written.
_AHEAD = 3
#: Workers that may die before the work is given up.
_MOST_DEATHS = 3
#: Points from which starting processes (a second or two) pays.
_WORTH_PROCESSES = 2_000_000
#: The cores are shared out among processes: none of them shall take more than one.
_ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
STORED = ("reason", "pose", "conditioning", "transmission")


class WorkspaceCounts(NamedTuple):
    """What a workspace that was written to a file amounts to."""

    points: int
    inside: int
    counts: dict[Reason, int]
    """Points that each single reason puts out; `Reason.INSIDE`: those inside."""
    bytes_per_point: int
    """In the file."""


@refuses_other_kinds
def workspace_to_file(
    robot: RPSRobot | RPSParameters,
    path: str | os.PathLike[str],
    grid: Grid | None = None,
    *,
    start: ArrayLike | None = None,
    min_conditioning: float = MIN_CONDITIONING,
    fields: Sequence[str] = STORED,
    dtype: DType = "float32",
    workers: int | None = None,
    executor: Executor | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress = iter,
) -> WorkspaceCounts:
    """Compute a workspace block by block on several cores and write it to an HDF5 file.

    Memory does not depend on the grid's size: a few blocks for each worker. Any interruption
    (Ctrl-C, SIGTERM and SIGHUP included) leaves no file, and what stood at `path` before untouched.
    If the process is killed its workers end too, and the next file that is written to the folder
    clears away what it left (see ``rps_pin.files.whole_file``). Of a worker that is killed the
    blocks under way are computed again.

    Parameters
    ----------
    robot, grid, start, min_conditioning
        As for `workspace`.
    path
        The file to write; `load_workspace` reads it, or blocks of it.
    fields
        Which fields to write; the others follow from the pose when the file is read.
    dtype
        ``"float32"`` keeps seven digits, 15 nm of 250 mm; ``"float64"`` is exact.
    workers
        Processes; by default one for each core this process may use, or none of their own for
        grids of less than two million points.
    executor
        Computes the blocks in place of processes of our own: any `concurrent.futures.Executor`,
        of threads, of MPI or of Dask (``Client.get_executor()``), which sends functions and their
        arguments by pickle. It is not shut down.
    resume
        Whether blocks are kept in a hidden folder beside `path` until the file is written, so that
        the same call, after an interruption or a full disk, goes on where it stopped.
    overwrite
        Whether a file that exists is replaced.
    progress
        Wraps the loop over the blocks, for a progress bar.

    Raises
    ------
    InputError, UnreachableError, SingularityError
        As `workspace`; also if the file exists, its folder does not, a field is unknown, both
        `workers` and `executor` are given, or blocks of another computation are kept there.
    BrokenExecutor
        If workers die again and again, or `executor` does not replace one that died.
    OSError
        If the disk has no room (asked before the start), or a write fails.
    """
    job = GridJob(robot, grid, start=start, min_conditioning=min_conditioning)
    if executor is not None:
        if workers is not None:
            raise InputError("give either workers or an executor, not both")
        count = int(cpu_count())
    elif workers is not None:
        count = whole_number(workers, "workers")
    else:  # the cores that this process may run on
        count = int(cpu_count()) if job.grid.size >= _WORTH_PROCESSES else 1
    names = checked_fields(fields)
    size = bytes_per_point(names, dtype)
    needed = size * job.grid.size
    with new_workspace_file(path, job, fields=names, dtype=dtype, overwrite=overwrite) as file:
        free = shutil.disk_usage(Path(path).parent).free
        if needed > free:
            words = f"{needed / 1e9:.3g} GB are needed and {free / 1e9:.3g} GB are free"
            raise OSError(errno.ENOSPC, words)
        tally = np.zeros(1 << len(Reason), dtype=np.int64)
        blocks = job.grid.blocks(BLOCK)
        kept = KeptBlocks(Path(path), _description(job, names, dtype)) if resume else None
        cast = partial(_cast_block, job, names, dtype)
        with closing(_computed(job, blocks, cast, count, executor, kept, progress)) as computed:
            for block, values in computed:
                file.write(block, values)
                tally += np.bincount(values.reason.ravel(), minlength=len(tally))
    if kept is not None:
        kept.remove()
    codes = np.arange(len(tally))
    counts = {reason: int(tally[(codes & int(reason)) != 0].sum()) for reason in Reason}
    inside = int(tally[0])
    return WorkspaceCounts(job.grid.size, inside, {Reason.INSIDE: inside} | counts, size)


def _computed(
    job: GridJob,
    blocks: list[Block],
    cast: Callable[[Block], Fields],
    workers: int,
    executor: Executor | None,
    kept: KeptBlocks | None,
    progress: Progress,
) -> Generator[tuple[Block, Fields], None, None]:
    """Compute blocks, in processes if there are several workers, and give them back in order."""
    known = [kept is not None and kept.has(i) for i in range(len(blocks))]
    pool = _Pool(cast, workers, executor) if executor is not None or workers > 1 else None
    ahead = (i for i in range(len(blocks)) if not known[i])
    try:
        for i in progress(range(len(blocks))):
            values = None
            if known[i] and kept is not None:
                values = kept.get(i)
            if values is not None:
                yield blocks[i], Fields(**values)
                continue
            if pool is None or known[i]:  # or a block that is spoilt
                found = job.compute(blocks[i]) if kept is None else cast(blocks[i])
            else:
                pool.fill(blocks[k] for k in ahead)
                found = pool.next()
            if kept is not None:
                kept.put(i, found._asdict())
            yield blocks[i], found
    except BaseException:
        if pool is not None:
            pool.end(kill=True)
        raise
    if pool is not None:
        pool.end(kill=False)


class _Pool:
    """Blocks under way in the workers of an executor, or of processes of our own.

    The processes start again when one of them dies, with the blocks that were under way.
    """

    def __init__(
        self, cast: Callable[[Block], Fields], workers: int, executor: Executor | None
    ) -> None:
        self._cast, self._workers, self._given = cast, workers, executor
        self._ahead = _AHEAD * workers
        self._pool: Any = _processes(workers) if executor is None else executor
        self._pending: deque[tuple[Block, Future[Fields]]] = deque()
        self._deaths = 0

    def fill(self, blocks: Iterator[Block]) -> None:
        """Submit blocks until there are enough ahead."""
        while len(self._pending) < self._ahead and (block := next(blocks, None)) is not None:
            self._submit(block)

    def next(self) -> Fields:
        """Return the fields of the block that was submitted first."""
        while True:
            try:
                found = self._pending[0][1].result()
            except BrokenExecutor as death:
                self._start_again(death)
                continue
            self._pending.popleft()
            return found

    def end(self, *, kill: bool) -> None:
        """End our own processes, at once or when they are idle."""
        if self._given is None:
            self._pool.shutdown(kill_workers=kill)
        elif kill:
            for _, future in self._pending:
                future.cancel()

    def _start_again(self, death: BrokenExecutor) -> None:
        """Replace processes of which one died, with the blocks under way; or raise its death."""
        self._deaths += 1
        if self._given is not None or self._deaths > _MOST_DEATHS:
            raise death
        self.end(kill=True)
        self._pool = _processes(self._workers)
        lost = [block for block, _ in self._pending]
        self._pending.clear()
        for block in lost:
            self._submit(block)

    def _submit(self, block: Block) -> None:
        with workers_without_signals():  # the first call starts them
            try:
                future = self._pool.submit(self._cast, block)
            except BrokenExecutor as death:
                self._start_again(death)
                future = self._pool.submit(self._cast, block)
        self._pending.append((block, future))


def _processes(workers: int) -> Any:
    """Return an executor of processes of our own."""
    with workers_without_signals():  # these two unblock Ctrl-C: they must run before the workers
        multiprocessing.resource_tracker.ensure_running()
        resource_tracker.ensure_running()
    return ProcessPoolExecutor(
        workers, initializer=end_with_parent, initargs=(os.getpid(),), env=_ONE_THREAD
    )


def _description(job: GridJob, names: Sequence[str], dtype: DType) -> dict[str, Any]:
    """Return what decides the numbers of a job's blocks."""
    return {
        "version": version("rps-pin"),
        "parameters": job.parameters.model_dump(mode="json"),
        "grid": [job.grid.kind, *job.grid.axes],
        "start": job.start,
        "min_conditioning": job.min_conditioning,
        "fields": list(names),
        "dtype": dtype,
        "block": BLOCK,
    }


def _cast_block(job: GridJob, names: Sequence[str], dtype: DType, block: Block) -> Fields:
    """Return a block's fields as the file will hold them: only that goes between processes."""
    fields = job.compute(block)
    kept = {
        name: value.astype(dtype) if name in names else value[:0]
        for name, value in fields._asdict().items()
    }
    return Fields(**kept | {"reason": fields.reason})

"""Workspaces too large for memory: computed block by block on every core, written to a file."""

from __future__ import annotations

import errno
import multiprocessing.resource_tracker
import os
import shutil
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from loky import ProcessPoolExecutor, cpu_count
from loky.backend import resource_tracker
from numpy.typing import ArrayLike

from rps_pin.interruption import end_with_parent, workers_without_signals
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
    overwrite: bool = False,
    progress: Progress = iter,
) -> WorkspaceCounts:
    """Compute a workspace block by block on several cores and write it to an HDF5 file.

    Memory does not depend on the grid's size: a few blocks for each worker. Any interruption
    (Ctrl-C, SIGTERM and SIGHUP included) leaves no file, and what stood at `path` before untouched.
    If the process is killed its workers end too, and the next file that is written to the folder
    clears away what it left (see ``rps_pin.files.whole_file``).

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
    overwrite
        Whether a file that exists is replaced.
    progress
        Wraps the loop over the blocks, for a progress bar.

    Raises
    ------
    InputError, UnreachableError, SingularityError
        As `workspace`; also if the file exists, its folder does not, or a field is unknown.
    OSError
        If the disk has no room (asked before the start), or a write fails.
    """
    job = GridJob(robot, grid, start=start, min_conditioning=min_conditioning)
    if workers is not None:
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
        cast = partial(_cast_block, job, names, dtype)
        with closing(_computed(job, blocks, cast, count, progress)) as computed:
            for block, values in computed:
                file.write(block, values)
                tally += np.bincount(values.reason.ravel(), minlength=len(tally))
    codes = np.arange(len(tally))
    counts = {reason: int(tally[(codes & int(reason)) != 0].sum()) for reason in Reason}
    inside = int(tally[0])
    return WorkspaceCounts(job.grid.size, inside, {Reason.INSIDE: inside} | counts, size)


def _computed(
    job: GridJob,
    blocks: list[Block],
    cast: Callable[[Block], Fields],
    workers: int,
    progress: Progress,
) -> Generator[tuple[Block, Fields], None, None]:
    """Compute blocks, in processes if there are several workers, and give them back in order."""
    if workers == 1:
        for i in progress(range(len(blocks))):
            yield blocks[i], job.compute(blocks[i])
        return
    with workers_without_signals():  # these two unblock Ctrl-C: they must run before the workers
        multiprocessing.resource_tracker.ensure_running()
        resource_tracker.ensure_running()
    pool = ProcessPoolExecutor(
        workers, initializer=end_with_parent, initargs=(os.getpid(),), env=_ONE_THREAD
    )
    pending: deque[Future[Fields]] = deque()
    try:
        ahead = iter(blocks)
        for i in progress(range(len(blocks))):
            while len(pending) < _AHEAD * workers and (block := next(ahead, None)) is not None:
                with workers_without_signals():  # the first call starts them
                    pending.append(pool.submit(cast, block))
            yield blocks[i], pending.popleft().result()
    except BaseException:
        pool.shutdown(kill_workers=True)
        raise
    pool.shutdown(kill_workers=False)


def _cast_block(job: GridJob, names: Sequence[str], dtype: DType, block: Block) -> Fields:
    """Return a block's fields as the file will hold them: only that goes between processes."""
    fields = job.compute(block)
    kept = {
        name: value.astype(dtype) if name in names else value[:0]
        for name, value in fields._asdict().items()
    }
    return Fields(**kept | {"reason": fields.reason})

"""Workspaces too large for memory: computed block by block on every core, written to a file."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.numerics.block_runs import Arrays, Workers, cores, results
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

#: Points from which starting processes (a second or two) pays.
_WORTH_PROCESSES = 2_000_000
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
        grids of less than two million points. With `executor`: how many workers it has; three
        blocks of each are under way.
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
        As `workspace`; also if the file exists, its folder does not, a field is unknown, or
        blocks of another computation are kept there, or of another process that goes on.
    BrokenExecutor
        If workers die again and again, or `executor` does not replace one that died.
    OSError
        If the disk has no room (asked before the start), or a write fails.
    """
    job = GridJob(robot, grid, start=start, min_conditioning=min_conditioning)
    if workers is not None:
        count = whole_number(workers, "workers")
    else:  # the cores that this process may run on
        count = cores() if executor is not None or job.grid.size >= _WORTH_PROCESSES else 1
    names = checked_fields(fields)
    size = bytes_per_point(names, dtype)
    needed = size * job.grid.size
    compute = partial(_cast_block, job, names, dtype)
    description = _description(job, names, dtype)
    with ExitStack() as stack:
        kept = stack.enter_context(KeptBlocks(path, description)) if resume else None
        made = new_workspace_file(path, job, fields=names, dtype=dtype, overwrite=overwrite)
        file = stack.enter_context(made)
        free = shutil.disk_usage(Path(path).parent).free
        if needed > free:
            words = f"{needed / 1e9:.3g} GB are needed and {free / 1e9:.3g} GB are free"
            raise OSError(errno.ENOSPC, words)
        pool = None
        if executor is not None or count > 1:
            pool = stack.enter_context(Workers(compute, count, executor))
        tally = np.zeros(1 << len(Reason), dtype=np.int64)
        blocks = job.grid.blocks(BLOCK)
        numbers = range(len(blocks))
        found = results(numbers, blocks.__getitem__, compute, pool, kept)
        for i, arrays in zip(progress(numbers), found, strict=True):
            values = Fields(**arrays)
            file.write(blocks[i], values)
            tally += np.bincount(values.reason.ravel(), minlength=len(tally))
    codes = np.arange(len(tally))
    counts = {reason: int(tally[(codes & int(reason)) != 0].sum()) for reason in Reason}
    inside = int(tally[0])
    return WorkspaceCounts(job.grid.size, inside, {Reason.INSIDE: inside} | counts, size)


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


def _cast_block(job: GridJob, names: Sequence[str], dtype: DType, block: Block) -> Arrays:
    """Return a block's fields as the file will hold them: only that goes between processes."""
    fields = job.compute(block)
    kept = {
        name: value.astype(dtype) if name in names else value[:0]
        for name, value in fields._asdict().items()
    }
    return kept | {"reason": fields.reason}

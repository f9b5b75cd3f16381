"""Workspaces too large for memory: computed block by block, by many workers, written to a file."""

from __future__ import annotations

import hashlib
import inspect
import os
import pickle
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from functools import cached_property, lru_cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rps_pin.errors import InputError
from rps_pin.interruption import scratch_folder
from rps_pin.numerics.block_runs import Arrays, Workers, cores, results
from rps_pin.numerics.kept_blocks import KeptBlocks
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.task import Task
from rps_pin.task.workspace.compute import Bar, Progress, workspace
from rps_pin.task.workspace.filling.flood import Seeds, Work
from rps_pin.task.workspace.filling.job import Found, Job
from rps_pin.task.workspace.filling.rounds import Rounds
from rps_pin.task.workspace.filling.seeds import OnDisk
from rps_pin.task.workspace.grids import TaskGrid
from rps_pin.task.workspace.reasons import UNREACHABLE
from rps_pin.task.workspace.result import INSIDE
from rps_pin.task.workspace.storage import DType, new_workspace_file
from rps_pin.validation import whole_number

_OPTIONS = set(inspect.signature(workspace).parameters) - {"task", "grid", "progress"}
#: Points from which more than one worker pays.
_WORTH_WORKERS = 300_000


class TaskCounts(NamedTuple):
    """What a workspace that was written to a file amounts to."""

    points: int
    inside: int
    counts: dict[str, int]
    """Points that are inside, and points that each single reason puts out, by name."""
    extents: dict[str, tuple[float, float]]
    """Least and largest value of each axis inside, m or rad; none if no point is."""


@refuses_other_kinds
def workspace_to_file(
    task: Task,
    path: str | os.PathLike[str],
    grid: TaskGrid,
    *,
    dtype: DType = "float64",
    description: str = "",
    executor: Executor | None = None,
    workers: int | None = None,
    threads: int | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress = iter,
    **options: Any,
) -> TaskCounts:
    """Compute a workspace block by block with several workers and write it to an HDF5 file.

    Memory does not depend on the grid's size, but for a bit a point: a few blocks for each worker.
    The file is the same, bit for bit, whoever computes the blocks, on processors of one kind. Any
    interruption (Ctrl-C, SIGTERM and SIGHUP included) leaves no file, and what stood at `path`
    before untouched. Of a process that is killed the blocks under way are computed again.

    Parameters
    ----------
    task, grid
        As for `workspace`.
    path
        The file to write; `load_workspace` reads it, or parts of it.
    dtype
        ``"float64"``, or ``"float32"``, half the size, seven digits.
    description
        Text that says which robot it is: that of its file, as an example.
    executor
        Computes the blocks: any `concurrent.futures.Executor`, of threads, of processes, of MPI or
        of Dask (``Client.get_executor()``), which sends functions and their arguments by pickle. It
        is not shut down.
    workers
        Processes of our own; with `executor`, how many workers it has: three blocks of each are
        under way.
    threads
        Threads of this process in place of processes. If none of the three is given, one for each
        core that this process may use, of a compiled task and a grid of 300,000 points or more.
    resume
        Whether blocks are kept in a hidden folder beside `path` until the file is written, so that
        the same call, after an interruption or a full disk, goes on where it stopped.
    overwrite
        Whether a file that exists is replaced.
    progress
        Wraps a loop, for a progress bar.
    **options
        Others of `workspace`: what is computed, from which start.

    Raises
    ------
    InputError, MechanismError, ClosureError, SingularityError, UnreachableError
        As `workspace`; also if the file exists, its folder does not, `threads` is given with
        `workers` or `executor`, or blocks of another computation are kept there, or of another
        process that goes on.
    BrokenExecutor
        If processes die again and again, or `executor` does not replace one that died.
    OSError
        If the disk has no room, or a write fails.
    """
    count = _count(task, grid, executor, workers, threads)
    if unknown := set(options) - _OPTIONS:
        raise TypeError(f"workspace_to_file has no option {min(unknown)!r}")
    job = Job(task, grid, settled=True, **options)
    compute = Compute(job, dtype)
    tally = _Tally(job)
    made = new_workspace_file(path, job, dtype=dtype, description=description, overwrite=overwrite)
    with ExitStack() as stack:
        kept = stack.enter_context(KeptBlocks(path, compute.description())) if resume else None
        file = stack.enter_context(made)
        folder = kept.folder if kept else stack.enter_context(scratch_folder(Path(path).parent))
        pool = None
        if executor is not None or count > 1 or workers is not None:
            own_threads = executor is None and workers is None
            pool = stack.enter_context(Workers(compute, count, executor, threads=own_threads))
        store = partial(OnDisk, folder, size=task.mechanism.model.nq)
        rounds = Rounds(job.division, store, job.first, job.q)
        bar, first = Bar(progress, grid.size), 0
        for blocks in rounds:
            numbers = range(first, first := first + len(blocks))
            given = _Numbered(rounds, blocks, numbers.start)
            found = results(numbers, given, compute, pool, kept)
            for block, arrays in zip(blocks, found, strict=True):
                at = arrays["at"]
                file.write(block, at, arrays)
                tally.add(block, at, arrays["reason"])
                rounds.take(block, at, seeds_of(arrays))
                bar.add(len(at))
        bar.close()
    return tally.counts()


class Compute:
    """Computes the blocks of a job as the file will hold them; pickled, in other processes too."""

    def __init__(self, job: Job, dtype: DType) -> None:
        self._job, self._dtype = job, dtype

    def __call__(self, work: Work) -> Arrays:
        """Return a block's arrays by name: of `Found`, in one level."""
        found: Found = self._job.compute(work)
        fields = found.fields._asdict()
        floats = {n: one.astype(self._dtype) for n, one in fields.items() if n != "reason"}
        return {
            "at": found.at,
            "reason": found.fields.reason,
            **floats,
            "beside_ends": np.cumsum([len(one.at) for one in found.beside]),
            "beside_at": np.concatenate([one.at for one in found.beside]),
            "beside_q": np.concatenate([one.q for one in found.beside]),
        }

    def description(self) -> dict[str, Any]:
        """Return what decides the numbers of the blocks."""
        job = self._job
        return {
            "version": version("rps-pin"),
            "task": _digest(job.task.interpreted()),
            "options": _digest(job.options),
            "min_conditioning": job.min_conditioning,
            "compiled": repr(job.task.compile_options) if job.task.compiled else "",
            "grid": [job.grid.over, *job.grid.axes, job.grid.at],
            "sides": job.division.sides,
            "start": [job.start, job.q],
            "dtype": self._dtype,
        }

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpacked, (self._packed, self._dtype)

    @cached_property
    def _packed(self) -> bytes:
        return pickle.dumps(self._job)


def _digest(part: object) -> str:
    """Return a digest of an object by its pickle, of a copy: what it shares is shared alike."""
    again = pickle.loads(pickle.dumps(part))  # it was pickled here
    return hashlib.sha256(pickle.dumps(again)).hexdigest()


@lru_cache(maxsize=2)
def _unpacked(packed: bytes, dtype: DType) -> Compute:
    """Return what computes a job's blocks in this process: code is loaded once."""
    return Compute(pickle.loads(packed), dtype)  # of the process that has the file


def seeds_of(arrays: Arrays) -> tuple[Seeds, ...]:
    """Return the points beyond each face from a block's arrays; see `Compute`."""
    cuts = arrays["beside_ends"][:-1]
    parts = (np.split(arrays[name], cuts) for name in ("beside_at", "beside_q"))
    return tuple(Seeds(at, q) for at, q in zip(*parts, strict=True))


class _Numbered:
    """What the blocks of a round are filled from, by running number."""

    def __init__(self, rounds: Rounds, blocks: Sequence[int], first: int) -> None:
        self._rounds, self._blocks, self._first = rounds, blocks, first

    def __call__(self, number: int) -> Work:
        return self._rounds.work(self._blocks[number - self._first])


class _Tally:
    """Counts of reasons and extents over blocks."""

    def __init__(self, job: Job) -> None:
        self._job, self._reached = job, 0
        self._inside = [np.zeros(n, dtype=bool) for n in job.grid.shape]
        self._counts = dict.fromkeys((INSIDE, *job.evaluation.reasons), 0)

    def add(self, block: int, at: Any, reason: Any) -> None:
        """Count points of a block."""
        self._reached += len(at)
        inside = reason == 0
        self._counts[INSIDE] += int(np.count_nonzero(inside))
        for k, name in enumerate(self._job.evaluation.reasons):
            self._counts[name] += int(np.count_nonzero(reason >> np.uint64(k) & np.uint64(1)))
        places = self._job.division.places(block, at[inside])
        for flags, place in zip(self._inside, places, strict=True):
            flags[place] = True

    def counts(self) -> TaskCounts:
        """Return the result."""
        size, extents = self._job.grid.size, {}
        self._counts[UNREACHABLE] = size - self._reached
        for name, axis, flags in zip(
            self._job.grid.over, self._job.grid.axes, self._inside, strict=True
        ):
            if flags.any():
                extents[name] = float(axis[flags][0]), float(axis[flags][-1])
        return TaskCounts(size, self._counts[INSIDE], self._counts, extents)


def _count(
    task: Task,
    grid: TaskGrid,
    executor: Executor | None,
    workers: int | None,
    threads: int | None,
) -> int:
    """Return how many workers there are."""
    if threads is not None:
        if workers is not None or executor is not None:
            raise InputError("give threads, or workers, or an executor; an executor with workers")
        return whole_number(threads, "threads")
    if workers is not None:
        return whole_number(workers, "workers")
    if executor is not None or (task.compiled and grid.size >= _WORTH_WORKERS):
        return cores()
    return 1

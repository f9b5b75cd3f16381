"""Workspaces of tasks in files: the same whoever computes them, also where workers die."""

from __future__ import annotations

import os
import resource
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from rps_pin.errors import InputError
from rps_pin.numerics import block_runs
from rps_pin.task.workspace import (
    TaskCounts,
    TaskGrid,
    load_workspace,
    task_grid,
    workspace,
    workspace_to_file,
)
from rps_pin.task.workspace.filling import division
from rps_pin.task.workspace.filling.job import Job
from tests.each import each
from tests.processes import wait_for_end
from tests.task.robots import compiled
from tests.task.test_workspace import FIVE_BAR

#: Steps of a progress bar.
STEPS = 1000


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(division, "LEAST_POINTS", 100)
    monkeypatch.setattr(division, "MOST_POINTS", 100)


def grid(skip: int = 2) -> TaskGrid:
    over = {name: values[::skip] for name, values in FIVE_BAR.items()}
    return task_grid(compiled("five_bar"), over)


def write(path: Path, **options: Any) -> TaskCounts:
    return workspace_to_file(compiled("five_bar"), path, grid(), **options)


@cache
def serial() -> dict[str, Any]:
    """Return the numbers of a file that this thread computed alone."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / "serial.h5")
        return numbers(Path(folder) / "serial.h5")


def numbers(path: Path) -> dict[str, Any]:
    with h5py.File(path) as file:
        assert file.attrs["complete"]
        return {name: data[...] for name, data in file.items()}


def same(path: Path) -> bool:
    """Return whether a file holds the same numbers, bit for bit, as the serial one."""
    found, wanted = numbers(path), serial()
    assert set(found) == set(wanted)
    return all(
        found[name].dtype == one.dtype and found[name].tobytes() == one.tobytes()
        for name, one in wanted.items()
    )


def at_step(step: int, do: Callable[[], None]) -> Callable[[Iterable[int]], Iterator[int]]:
    """Return a progress that does something at one of its steps."""

    def progress(steps: Iterable[int]) -> Iterator[int]:
        for k in steps:
            if k == step:
                do()
            yield k

    return progress


def stop(error: type[BaseException] = KeyboardInterrupt) -> Callable[[], None]:
    def do() -> None:
        raise error

    return do


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Blocks that were computed in this process."""
    compute, found = Job.compute, []

    def counting(job: Job, work: Any) -> Any:
        found.append(work.block)
        return compute(job, work)

    monkeypatch.setattr(Job, "compute", counting)
    return found


def test_a_file_holds_what_memory_would(tmp_path: Path) -> None:
    path, told = tmp_path / "space.h5", list[int]()
    counts = write(
        path, description="a five-bar", progress=lambda s: (told.append(k) or k for k in s)
    )
    wanted = workspace(compiled("five_bar"), grid())
    found = load_workspace(path)
    for name in wanted.fields._fields:
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    assert (found.mechanism, found.reasons) == (wanted.mechanism, wanted.reasons)
    assert counts == TaskCounts(
        wanted.grid.size, int(wanted.inside.sum()), wanted.counts(), wanted.extents()
    )
    with h5py.File(path) as file:
        assert file.attrs["description"] == "a five-bar"
        assert np.prod(file["reason"].chunks) <= 100
    assert told == list(range(STEPS))
    assert [one.name for one in tmp_path.iterdir()] == ["space.h5"]


def test_parts_of_a_file_are_those_of_the_whole(tmp_path: Path) -> None:
    write(tmp_path / "space.h5", holding=True, dtype="float32")
    whole = load_workspace(tmp_path / "space.h5")
    block = slice(3, 30), slice(1, None, 7)
    part = load_workspace(tmp_path / "space.h5", block)
    assert (
        part.grid.shape == whole.grid.axes[0][block[0]].shape + whole.grid.axes[1][block[1]].shape
    )
    for axis, of_whole, one in zip(part.grid.axes, whole.grid.axes, block, strict=True):
        assert np.array_equal(axis, of_whole[one])
    for name in whole.fields._fields:
        assert np.array_equal(getattr(part, name), getattr(whole, name)[block]), name
    assert part.holding.shape[-1] == 2
    exact = workspace(compiled("five_bar"), grid(), holding=True)
    assert np.array_equal(whole.holding, exact.holding.astype(np.float32))
    for wrong in ((slice(5, 5),), (slice(None),) * 3, (3,)):
        with pytest.raises(InputError, match=r"space\.h5"):
            load_workspace(tmp_path / "space.h5", wrong)  # type: ignore[arg-type]


def test_threads_and_executors_give_the_same_file(tmp_path: Path) -> None:
    path = tmp_path / "space.h5"
    write(path, threads=3)
    assert same(path)
    with ThreadPoolExecutor(2) as executor:
        write(path, executor=executor, workers=5, resume=True, overwrite=True)
        assert executor.submit(int, 3).result() == 3  # still at its owner's service
    assert same(path)
    with pytest.raises(InputError, match="give threads, or workers, or an executor"):
        write(path, threads=2, workers=2)
    with pytest.raises(InputError, match=r"space\.h5 exists"):
        write(path, resume=True)
    assert [one.name for one in tmp_path.iterdir()] == ["space.h5"]


@each("error", [KeyboardInterrupt, OSError])
def test_an_interrupted_run_goes_on(
    tmp_path: Path, counted: list[int], error: type[BaseException]
) -> None:
    path = tmp_path / f"{error.__name__}.h5"
    counted.clear()
    write(path)
    alone = list(counted)
    path.unlink()
    counted.clear()
    with pytest.raises(error):
        write(path, resume=True, progress=at_step(150, stop(error)))
    assert 5 < len(counted) < len(alone) - 5
    assert not path.exists()
    write(path, resume=True)
    assert counted == alone  # each once
    assert same(path)
    assert [one.name for one in tmp_path.iterdir() if error.__name__ in one.name] == [path.name]


def test_a_spoilt_block_is_computed_again(tmp_path: Path, counted: list[int]) -> None:
    path = tmp_path / "space.h5"
    with pytest.raises(KeyboardInterrupt):
        write(path, resume=True, progress=at_step(200, stop()))
    folder = tmp_path / ".space.h5.blocks"
    kept = len(list(folder.glob("*.npz")))
    (folder / "3.npz").write_bytes((folder / "3.npz").read_bytes()[:1000])
    (folder / "5.npz").write_bytes(b"")
    first = len(counted)
    write(path, resume=True, threads=2)
    assert len(counted) - first > 2
    assert kept == first
    assert same(path)


def test_blocks_of_another_computation_are_refused(tmp_path: Path) -> None:
    path, task = tmp_path / "space.h5", compiled("five_bar")
    with pytest.raises(KeyboardInterrupt):
        write(path, resume=True, progress=at_step(100, stop()))
    for other in (
        {"grid": grid(3)},
        {"min_conditioning": 0.01},
        {"dtype": "float32"},
        {"holding": True},
        {"start": task.home + 0.01},
        {"task": type(task)(task.mechanism, "left_tip", ["x", "z"], characteristic_length=2.0)},
    ):
        arguments: dict[str, Any] = {"task": task, "path": path, "grid": grid()} | other
        with pytest.raises(InputError, match="blocks of another computation"):
            workspace_to_file(**arguments, resume=True)
    assert not path.exists()
    write(path, resume=True)
    assert same(path)


def test_two_computations_of_one_file(tmp_path: Path) -> None:
    """The second is refused, with blocks that are kept and without."""
    path = tmp_path / "space.h5"

    def second() -> None:
        with pytest.raises(InputError, match="another process"):
            write(path, resume=True)

    write(path, resume=True, progress=at_step(300, second))
    assert same(path)

    def whole() -> None:
        with pytest.raises(InputError, match="another process is writing"):
            write(path, overwrite=True)

    write(path, overwrite=True, progress=at_step(300, whole))
    assert same(path)
    assert [one.name for one in tmp_path.iterdir()] == ["space.h5"]


@pytest.mark.skipif(sys.platform != "linux", reason="limits of file sizes are kept differently")
def test_a_full_disk_costs_the_blocks_under_way(tmp_path: Path, counted: list[int]) -> None:
    """The system refuses to let the file grow; when it may, the same call goes on."""
    path = tmp_path / "space.h5"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, before[1]))
        with pytest.raises(OSError, match="no part of it was kept"):
            write(path, resume=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not path.exists()
    done = len(counted)
    kept = len(list((tmp_path / ".space.h5.blocks").glob("*.npz")))
    assert done - 1 <= kept <= done
    assert done > 3
    write(path, resume=True)
    assert same(path)
    alone = len(counted) - done
    counted.clear()
    write(path, overwrite=True)
    assert alone + kept == len(counted)


# Workers that die ---------------------------------------------------------------------------------


def test_a_process_that_is_killed_costs_its_blocks_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pools: list[Any] = []

    class Pool(block_runs.ProcessPoolExecutor):  # type: ignore[misc]
        def __init__(self, *given: Any, **named: Any) -> None:
            super().__init__(*given, **named)
            pools.append(self)

    def kill() -> None:
        os.kill(next(iter(pools[-1]._processes)), signal.SIGKILL)

    monkeypatch.setattr(block_runs, "ProcessPoolExecutor", Pool)
    write(tmp_path / "space.h5", workers=2, progress=at_step(120, kill))
    assert len(pools) == 2
    assert same(tmp_path / "space.h5")


def test_a_dask_cluster_of_which_a_worker_is_killed(tmp_path: Path) -> None:
    from distributed import Client, LocalCluster

    cluster = LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    )
    with cluster, Client(cluster) as client:
        workers = list(client.run(os.getpid).values())

        def kill() -> None:
            os.kill(workers[0], signal.SIGKILL)

        options: Any = {"executor": client.get_executor(), "workers": 2, "resume": True}
        write(tmp_path / "space.h5", **options, progress=at_step(120, kill))
        wait_for_end([workers[0]])
    assert same(tmp_path / "space.h5")

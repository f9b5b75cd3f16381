"""Workspaces in files go on where they stopped, on any executor, also where workers die."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from rps_pin import RPSParameters
from rps_pin.errors import InputError
from rps_pin.numerics import block_runs
from rps_pin.rps.workspace import leg_grid, scale, workspace_to_file
from tests.processes import wait_for_end

MICRO = RPSParameters.from_preset("micro")
GRID = leg_grid(MICRO, 20)


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scale, "BLOCK", 400)  # 20 of them


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Blocks that were computed in this process."""
    compute, found = scale.GridJob.compute, []

    def counting(job: scale.GridJob, block: Any) -> Any:
        found.append(block)
        return compute(job, block)

    monkeypatch.setattr(scale.GridJob, "compute", counting)
    return found


def stopping(at: int, error: type[BaseException]) -> Callable[[Iterable[int]], Iterator[int]]:
    def progress(blocks: Iterable[int]) -> Iterator[int]:
        for i in blocks:
            if i == at:
                raise error
            yield i

    return progress


def same_file(one: Path, other: Path) -> bool:
    """Return whether two files hold the same numbers, bit for bit."""
    with h5py.File(one) as first, h5py.File(other) as second:
        assert set(first) == set(second)
        return all(np.array_equal(first[name][...], second[name][...]) for name in first)


def serial(folder: Path) -> Path:
    workspace_to_file(MICRO, folder / "serial.h5", GRID)
    return folder / "serial.h5"


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_an_interrupted_run_goes_on(
    tmp_path: Path, counted: list[Any], error: type[BaseException]
) -> None:
    right, path = serial(tmp_path), tmp_path / "space.h5"
    counted.clear()
    with pytest.raises(error):
        workspace_to_file(MICRO, path, GRID, resume=True, progress=stopping(13, error))
    assert len(counted) == 13
    assert not path.exists()
    found = workspace_to_file(MICRO, path, GRID, resume=True)
    assert len(counted) == 20
    assert found.points == 8000
    assert same_file(path, right)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["serial.h5", "space.h5"]


def test_blocks_of_another_computation_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "space.h5"
    with pytest.raises(KeyboardInterrupt):
        workspace_to_file(MICRO, path, GRID, resume=True, progress=stopping(2, KeyboardInterrupt))
    for other in (
        {"robot": MICRO.replace(base_radius=0.121)},
        {"grid": leg_grid(MICRO, 21)},
        {"min_conditioning": 0.01},
        {"dtype": "float64"},
        {"start": [0.22, 0.01, 0.0]},
        {"fields": ["length"]},
    ):
        arguments: dict[str, Any] = {"robot": MICRO, "path": path, "grid": GRID} | other
        with pytest.raises(InputError, match="blocks of another computation"):
            workspace_to_file(**arguments, resume=True)
    assert not path.exists()


def test_a_spoilt_block_is_computed_again(tmp_path: Path, counted: list[Any]) -> None:
    right, path = serial(tmp_path), tmp_path / "space.h5"
    with pytest.raises(KeyboardInterrupt):
        workspace_to_file(MICRO, path, GRID, resume=True, progress=stopping(9, KeyboardInterrupt))
    folder = tmp_path / ".space.h5.blocks"
    (folder / "3.npz").write_bytes((folder / "3.npz").read_bytes()[:1000])
    (folder / "5.npz").write_bytes(b"")
    counted.clear()
    workspace_to_file(MICRO, path, GRID, resume=True)
    assert len(counted) == 13
    assert same_file(path, right)


@pytest.mark.parametrize("kind", [ThreadPoolExecutor, ProcessPoolExecutor])
def test_any_executor_gives_the_same_file(tmp_path: Path, kind: type[Executor]) -> None:
    right, path = serial(tmp_path), tmp_path / "space.h5"
    with kind(2) as executor:  # type: ignore[call-arg]
        workspace_to_file(MICRO, path, GRID, executor=executor, resume=True)
        assert executor.submit(int, 3).result() == 3  # still at its owner's service
    assert same_file(path, right)


def test_as_many_blocks_are_under_way_as_the_workers_of_an_executor_need(tmp_path: Path) -> None:
    """A cluster may have more cores than this machine."""
    under_way, most = set(), []

    class Counting(ThreadPoolExecutor):
        def submit(self, *given: Any, **named: Any) -> Any:
            future = super().submit(*given, **named)
            under_way.add(future)
            most.append(len(under_way))
            return future

    def progress(blocks: Iterable[int]) -> Iterator[int]:
        for i in blocks:
            yield i
            under_way.difference_update([one for one in under_way if one.done()])

    with Counting(1) as executor:
        options: Any = {"executor": executor, "workers": 6}
        workspace_to_file(MICRO, tmp_path / "space.h5", GRID, **options)
    assert max(most) >= 18


def killing(pools: list[Any], at: set[int]) -> Callable[[Iterable[int]], Iterator[int]]:
    """Return a progress that kills the workers of the last pool before these blocks."""

    def progress(blocks: Iterable[int]) -> Iterator[int]:
        for i in blocks:
            if i in at:
                for worker in list(pools[-1]._processes):
                    os.kill(worker, signal.SIGKILL)
            yield i

    return progress


@pytest.fixture
def pools(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The pools of processes that are made."""
    found: list[Any] = []

    class Pool(block_runs.ProcessPoolExecutor):
        def __init__(self, *given: Any, **named: Any) -> None:
            super().__init__(*given, **named)
            found.append(self)

    monkeypatch.setattr(block_runs, "ProcessPoolExecutor", Pool)
    return found


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_its_blocks_only(tmp_path: Path, pools: list[Any]) -> None:
    right, path = serial(tmp_path), tmp_path / "space.h5"
    workspace_to_file(MICRO, path, GRID, workers=2, progress=killing(pools, {5}))
    assert same_file(path, right)
    assert len(pools) == 2


def test_workers_that_die_again_and_again_end_the_run_which_goes_on(
    tmp_path: Path, pools: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(block_runs, "_MOST_DEATHS", 0)
    right, path = serial(tmp_path), tmp_path / "space.h5"
    with pytest.raises(BrokenExecutor):
        workspace_to_file(MICRO, path, GRID, workers=2, resume=True, progress=killing(pools, {5}))
    assert not path.exists()
    workspace_to_file(MICRO, path, GRID, resume=True)
    assert same_file(path, right)


@pytest.mark.slow
def test_a_dask_cluster_of_which_a_worker_is_killed(tmp_path: Path) -> None:
    from distributed import Client, LocalCluster

    right, path = serial(tmp_path), tmp_path / "space.h5"
    cluster = LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    )
    with cluster, Client(cluster) as client:
        workers = list(client.run(os.getpid).values())

        def progress(blocks: Iterable[int]) -> Iterator[int]:
            for i in blocks:
                if i == 3:
                    os.kill(workers[0], signal.SIGKILL)
                yield i

        workspace_to_file(MICRO, path, GRID, executor=client.get_executor(), progress=progress)
        wait_for_end([workers[0]])
    assert same_file(path, right)

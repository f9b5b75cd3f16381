"""Workspaces in files: whole or absent, the same when read back, whatever interrupts."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from rps_pin import RPSParameters
from rps_pin.errors import InputError
from rps_pin.numerics import block_runs
from rps_pin.rps.workspace import (
    Grid,
    Reason,
    Workspace,
    leg_grid,
    load_workspace,
    pose_grid,
    save_workspace,
    scale,
    storage,
    workspace,
    workspace_to_file,
)
from tests.processes import lives, run, start, wait_for_end
from tests.quick import quick


@pytest.fixture(scope="module")
def micro() -> RPSParameters:
    return RPSParameters.from_preset("micro")


@pytest.fixture(scope="module")
def space(micro: RPSParameters) -> Workspace:
    """Some of its points are unreachable, some beyond limits, and an upper limit is infinite."""
    robot = micro.replace(leg_length_limits=(0.2, np.inf))
    return workspace(robot, leg_grid(robot, (5, 6, 7), limits=(0.05, 0.6)))


def same(a: Workspace, b: Workspace) -> bool:
    return (
        a.parameters == b.parameters
        and a.grid.kind == b.grid.kind
        and all(np.array_equal(x, y) for x, y in zip(a.grid.axes, b.grid.axes, strict=True))
        and np.array_equal(a.start, b.start)
        and a.min_conditioning == b.min_conditioning
        and all(np.array_equal(x, y) for x, y in zip(a.fields, b.fields, strict=True))
    )


def test_a_workspace_is_read_back_to_the_bit(space: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "space.h5"
    save_workspace(space, path)
    back = load_workspace(path)
    assert same(back, space)
    assert back.reason.dtype == np.uint16
    assert space.mask(Reason.UNREACHABLE).any() and space.inside.any()


def test_fields_left_out_are_computed_again(space: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "space.h5"
    save_workspace(space, path, fields=["conditioning"])
    with h5py.File(path) as file:
        assert set(file) == {"axis_1", "axis_2", "axis_3", "reason", "pose", "conditioning"}
    back = load_workspace(path)
    for name in space.fields._fields:
        found, expected = getattr(back, name), getattr(space, name)
        assert np.allclose(found, expected, rtol=1e-12, atol=1e-15), name


def test_a_block_is_read_alone(space: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "space.h5"
    save_workspace(space, path)
    part = load_workspace(path, (slice(1, 3), slice(2, 6)))
    assert part.grid.shape == (2, 4, 7)
    assert np.array_equal(part.position, space.position[1:3, 2:6])


def test_a_file_says_what_it_holds(space: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "space.h5"
    save_workspace(space, path)
    with h5py.File(path) as file:
        assert file["position"].attrs["unit"] == "m"
        assert all("unit" in file[name].attrs and "meaning" in file[name].attrs for name in file)
        assert json.loads(file.attrs["reason_bits"])["SINGULAR"] == int(Reason.SINGULAR)
        assert json.loads(file.attrs["parameters"])["platform_radius"] == 0.12
        assert file.attrs["complete"]


@pytest.mark.parametrize(
    ("kind", "workers"),
    quick(
        [(kind, workers) for kind in ("leg lengths", "poses") for workers in (1, 3)],
        [("leg lengths", 1), ("poses", 1), ("poses", 3)],
    ),
)
def test_a_file_holds_what_memory_would(
    micro: RPSParameters, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers: int, kind: str
) -> None:
    monkeypatch.setattr(scale, "BLOCK", 700)  # many blocks, some of a few rows
    axis = np.linspace(-0.3, 0.3, 30)
    grid = leg_grid(micro, (3, 29, 30)) if kind == "leg lengths" else pose_grid([0.2, 0.25], axis)
    path = tmp_path / "space.h5"
    fields = storage.ALL_FIELDS
    counts = workspace_to_file(micro, path, grid, fields=fields, dtype="float64", workers=workers)
    whole = workspace(micro, grid)
    # Sums of matrix products depend on their shape in the last bit.
    back = load_workspace(path)
    assert np.array_equal(back.reason, whole.reason)
    for name in fields:
        assert np.allclose(getattr(back, name), getattr(whole, name), rtol=0, atol=1e-11), name
    assert counts.points == grid.size
    assert counts.inside == whole.inside.sum()
    assert counts.counts == whole.counts()


def test_single_precision_is_what_it_says(micro: RPSParameters, tmp_path: Path) -> None:
    grid = leg_grid(micro, 12)
    workspace_to_file(micro, tmp_path / "space.h5", grid)
    back = load_workspace(tmp_path / "space.h5")
    assert np.allclose(back.pose, workspace(micro, grid).pose, rtol=6e-8, atol=1e-12)


def test_a_file_that_exists_is_left_alone(space: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "space.h5"
    path.write_text("precious")
    for write in (
        lambda: save_workspace(space, path),
        lambda: workspace_to_file(space.parameters, path, space.grid),
    ):
        with pytest.raises(InputError, match="exists; overwrite=True"):
            write()
    assert path.read_text() == "precious"
    save_workspace(space, path, overwrite=True)
    assert same(load_workspace(path), space)


def test_bad_requests_are_refused_before_anything_is_written(
    space: Workspace, tmp_path: Path
) -> None:
    path = tmp_path / "space.h5"
    for write, message in [
        (lambda: save_workspace(space, path, fields=["colour"]), "colour"),
        (lambda: save_workspace(space, path, dtype="int8"), "float32"),  # type: ignore[arg-type]
        (lambda: save_workspace(space, tmp_path / "no" / "space.h5"), "not a folder"),
        (lambda: workspace_to_file(space.parameters, path, space.grid, workers=0), "at least 1"),
    ]:
        with pytest.raises(InputError, match=message):
            write()
    assert list(tmp_path.iterdir()) == []


def test_files_that_are_no_workspace_are_refused(space: Workspace, tmp_path: Path) -> None:
    text, other, half = (tmp_path / name for name in ("text.h5", "other.h5", "half.h5"))
    text.write_text("no HDF5")
    with h5py.File(other, "w") as file:
        file["pose"] = np.zeros(3)
    save_workspace(space, half)
    with h5py.File(half, "a") as file:
        del file.attrs["complete"]
    for path in (text, other, half, tmp_path / "absent.h5"):
        with pytest.raises(InputError, match=path.name):
            load_workspace(path)


# Interruptions ------------------------------------------------------------------------------------


def interrupting(after: int, kind: type[BaseException]) -> Any:
    def progress(blocks: Iterable[int]) -> Iterator[int]:
        for i in blocks:
            if i == after:
                raise kind
            yield i

    return progress


@pytest.mark.parametrize("before", [None, "precious"])
def test_an_interrupted_run_leaves_what_was_there(
    micro: RPSParameters, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: str | None
) -> None:
    monkeypatch.setattr(scale, "BLOCK", 500)
    path = tmp_path / "space.h5"
    if before:
        path.write_text(before)
    with pytest.raises(KeyboardInterrupt):
        workspace_to_file(
            micro,
            path,
            leg_grid(micro, 20),
            overwrite=True,
            progress=interrupting(4, KeyboardInterrupt),
        )
    assert [entry.name for entry in tmp_path.iterdir()] == ([path.name] if before else [])
    assert not before or path.read_text() == before


def test_ctrl_c_in_a_real_process_leaves_no_file(tmp_path: Path) -> None:
    script = f"""
        import sys
        from rps_pin import RPSParameters
        from rps_pin.rps.workspace import leg_grid, workspace_to_file

        def progress(blocks):
            for i in blocks:
                if i == 3:
                    print("under way", flush=True)
                yield i

        micro = RPSParameters.from_preset("micro")
        grid = leg_grid(micro, 400)
        workspace_to_file(micro, {str(tmp_path / "space.h5")!r}, grid, progress=progress)
    """
    process = start([sys.executable, "-c", textwrap.dedent(script)])
    assert process.stdout is not None
    assert process.stdout.readline() == "under way\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=240)
    assert process.returncode != 0
    assert "KeyboardInterrupt" in errors
    assert list(tmp_path.iterdir()) == []


WITH_WORKERS = """
    from rps_pin import RPSParameters
    from rps_pin.numerics import block_runs
    from rps_pin.rps.workspace import leg_grid, workspace_to_file

    class Pool(block_runs.ProcessPoolExecutor):
        def __init__(self, *given, **named):
            super().__init__(*given, **named)
            pools.append(self)

    def progress(blocks):
        for i in blocks:
            if i == 3:
                print(*pools[0]._processes, flush=True)
            yield i

    pools, block_runs.ProcessPoolExecutor = [], Pool
    micro = RPSParameters.from_preset("micro")
    workspace_to_file(micro, "space.h5", leg_grid(micro, 400), workers=2, progress=progress)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_process_that_is_ended_takes_its_workers_with_it(
    space: Workspace, tmp_path: Path, number: signal.Signals
) -> None:
    with start([sys.executable, "-c", textwrap.dedent(WITH_WORKERS)], cwd=tmp_path) as process:
        try:
            assert process.stdout is not None
            workers = [int(word) for word in process.stdout.readline().split()]
            assert len(workers) == 2
            assert all(lives(one) for one in workers)
            process.send_signal(number)
            _, errors = process.communicate(timeout=240)
        finally:
            process.kill()
    wait_for_end(workers)
    if number == signal.SIGKILL:  # nobody could clear up: the next one who writes there does
        left, lock = sorted(tmp_path.iterdir(), key=lambda one: one.suffix)
        assert left.name.startswith(".space.rps_pin-")
        assert lock.name == ".space.h5.lock"
        save_workspace(space, tmp_path / "space.h5")
        assert [entry.name for entry in tmp_path.iterdir()] == ["space.h5"]
    else:
        assert process.returncode == 128 + number, errors
        assert errors == ""
        assert list(tmp_path.iterdir()) == []


def test_a_failing_write_is_clear_and_loses_nothing(
    space: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "space.h5"
    save_workspace(space, path)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "file write failed")

    monkeypatch.setattr(storage.WorkspaceFile, "write", full)
    for write in (
        lambda: save_workspace(space, path, overwrite=True),
        lambda: workspace_to_file(space.parameters, path, space.grid, overwrite=True),
    ):
        with pytest.raises(OSError, match="no part of it was kept: No space left") as caught:
            write()
        assert caught.value.errno == errno.ENOSPC
        assert caught.value.filename == str(path)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    monkeypatch.undo()
    assert same(load_workspace(path), space)


@pytest.mark.skipif(sys.platform != "linux", reason="limits of file sizes are kept differently")
def test_a_disk_that_fills_up_in_earnest(tmp_path: Path) -> None:
    """The system refuses to let a file grow: HDF5's write fails, inside the library."""
    script = f"""
        import resource, signal
        from rps_pin import RPSParameters
        from rps_pin.rps.workspace import leg_grid, workspace_to_file

        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, 500_000))
        micro = RPSParameters.from_preset("micro")
        try:
            workspace_to_file(micro, {str(tmp_path / "space.h5")!r}, leg_grid(micro, 60))
        except OSError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert "no part of it was kept" in done.stdout, done.stderr
    assert done.returncode == 0
    assert list(tmp_path.iterdir()) == []


def test_a_disk_known_to_be_too_small_is_refused_at_once(
    micro: RPSParameters, tmp_path: Path
) -> None:
    first, second, third = (np.linspace(0.2, 0.25, n) for n in (40_000, 40_000, 40_000))
    huge = Grid("leg lengths", (first, second, third))
    with pytest.raises(OSError, match="No space left") as caught:
        workspace_to_file(micro, tmp_path / "space.h5", huge)
    assert "GB are free" in str(caught.value.__cause__)
    assert list(tmp_path.iterdir()) == []


def test_memory_does_not_grow_with_the_grid(micro: RPSParameters, tmp_path: Path) -> None:
    """Few blocks are under way at a time: no more are computed than were written, and some."""
    computed = 0
    compute = scale.GridJob.compute

    def counted(job: scale.GridJob, block: Any) -> Any:
        nonlocal computed
        computed += 1
        return compute(job, block)

    ahead = []

    def progress(blocks: Iterable[int]) -> Iterator[int]:
        for i in blocks:
            ahead.append(computed - i)
            yield i

    class Threads(ThreadPoolExecutor):
        """In place of processes, whose calls could not be counted here."""

        def __init__(self, workers: int, **_: object) -> None:
            super().__init__(workers)

        def shutdown(self, *, kill_workers: bool) -> None:
            super().shutdown(cancel_futures=kill_workers)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(block_runs, "ProcessPoolExecutor", Threads)
        patch.setattr(scale, "BLOCK", 400)
        patch.setattr(scale.GridJob, "compute", counted)
        workspace_to_file(
            micro, tmp_path / "space.h5", leg_grid(micro, 20), workers=2, progress=progress
        )
    assert len(ahead) == 20
    assert max(ahead) <= 6  # three blocks a worker
    assert (tmp_path / "space.h5").stat().st_size < 22 * 8000 + 20_000


def _replaced(file: h5py.File, name: str, **options: Any) -> None:
    del file[name]
    file.create_dataset(name, **options)


SPOILT: dict[str, Any] = {
    "length of another shape": lambda f: _replaced(f, "length", data=np.ones((5, 6, 8, 3))),
    "length of one number": lambda f: _replaced(f, "length", data=1.0),
    "pose without vectors": lambda f: _replaced(f, "pose", data=np.ones((5, 6, 7))),
    "reason of a smaller grid": lambda f: _replaced(f, "reason", data=np.ones((5, 6, 6), "u2")),
    "longer axis": lambda f: _replaced(f, "axis_2", data=np.linspace(0.1, 0.2, 9)),
    "axis of two dimensions": lambda f: _replaced(f, "axis_1", data=np.ones((5, 5))),
    "axis of many numbers": lambda f: _replaced(f, "axis_3", shape=(10**12,), dtype="f8"),
    "axis of strings": lambda f: _replaced(f, "axis_1", data=[b"a", b"b"]),
    "NaN": lambda f: f["conditioning"].__setitem__((1, 2, 3), np.nan),
    "NaN in a pose": lambda f: f["pose"].__setitem__((1, 2, 3, 0), np.nan),
    "infinite": lambda f: f["determinant"].__setitem__((1, 2, 3), np.inf),
    "NaN in an axis": lambda f: f["axis_1"].__setitem__(2, np.nan),
    "reason of floats": lambda f: _replaced(f, "reason", data=np.ones((5, 6, 7))),
    "unknown reason": lambda f: f["reason"].__setitem__((0, 0, 0), 0x8000),
    "complex field": lambda f: _replaced(f, "determinant", data=np.ones((5, 6, 7)) * 1j),
    "a group": lambda f: (f.pop("angle"), f.create_group("angle")),
    "external link": lambda f: (
        f.pop("angle"),
        f.__setitem__("angle", h5py.ExternalLink("b", "/")),
    ),
    "soft link": lambda f: (f.pop("angle"), f.__setitem__("angle", h5py.SoftLink("/length"))),
    "start of NaN": lambda f: f.attrs.__setitem__("start", [np.nan, 0, 0]),
    "start of two": lambda f: f.attrs.__setitem__("start", [0.2, 0]),
    "start of text": lambda f: f.attrs.__setitem__("start", "here"),
    "conditioning NaN": lambda f: f.attrs.__setitem__("min_conditioning", np.nan),
    "conditioning of text": lambda f: f.attrs.__setitem__("min_conditioning", "small"),
    "parameters a list": lambda f: f.attrs.__setitem__("parameters", "[1, 2]"),
    "parameters a number": lambda f: f.attrs.__setitem__("parameters", 3),
    "format a list": lambda f: f.attrs.__setitem__("format", [1, 2]),
}


@pytest.mark.parametrize("how", SPOILT)
def test_spoilt_files_are_refused(space: Workspace, tmp_path: Path, how: str) -> None:
    path = tmp_path / "space.h5"
    save_workspace(space, path)
    with h5py.File(path, "r+") as file:
        SPOILT[how](file)
    for block in (None, (slice(0, 4), slice(0, 6))):
        with pytest.raises(InputError, match=r"space\.h5"):
            load_workspace(path, block)


def test_data_in_other_files_are_not_read(space: Workspace, tmp_path: Path) -> None:
    secret, path = tmp_path / "secret", tmp_path / "space.h5"
    secret.write_bytes(bytes(5 * 6 * 7 * 8))
    save_workspace(space, path)
    with h5py.File(path, "r+") as file:
        del file["conditioning"], file["determinant"]
        shape, external = (5, 6, 7), [(str(secret), 0, 5 * 6 * 7 * 8)]
        file.create_dataset("conditioning", shape, "f8", external=external)
    with pytest.raises(InputError, match="conditioning must be a dataset of the file itself"):
        load_workspace(path)
    with h5py.File(path, "r+") as file:
        del file["conditioning"]
        layout = h5py.VirtualLayout((5, 6, 7), "f8")
        layout[...] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", (5, 6, 7))
        file.create_virtual_dataset("conditioning", layout)
    with pytest.raises(InputError, match="conditioning must be a dataset of the file itself"):
        load_workspace(path)


def test_files_of_the_other_byte_order_are_read(space: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "space.h5"
    save_workspace(space, path)
    with h5py.File(path, "r+") as file:
        for name in ("axis_1", "pose", "reason", "conditioning"):
            data = file[name][...]
            _replaced(file, name, data=data.astype(data.dtype.newbyteorder(">")))
    assert same(load_workspace(path), space)


def test_what_is_no_regular_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.h5")
    for path in (tmp_path, tmp_path / "pipe.h5"):
        with pytest.raises(InputError, match="not a regular file"):
            load_workspace(path)


@pytest.mark.skipif(sys.platform != "linux", reason="limits of file sizes are kept differently")
@pytest.mark.parametrize("size", [0, 100, 3000, 20_000])
def test_a_process_goes_on_after_a_file_that_could_not_be_closed(size: int, tmp_path: Path) -> None:
    """HDF5 writes its tables when it closes a file, and crashes at the end if it could not."""
    script = f"""
        import resource
        from rps_pin import RPSParameters
        from rps_pin.rps.workspace import leg_grid, workspace_to_file

        micro = RPSParameters.from_preset("micro")
        path, grid = {str(tmp_path / "space.h5")!r}, leg_grid(micro, 9)
        for limit in ({size}, -1):
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, -1))
            try:
                workspace_to_file(micro, path, grid)
                print("written")
            except OSError as error:
                print(error.strerror)
    """
    done = run([sys.executable, "-c", textwrap.dedent(script)], timeout=240)
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert first.endswith("no part of it was kept: File too large")
    assert second == "written"
    assert [entry.name for entry in tmp_path.iterdir()] == ["space.h5"]

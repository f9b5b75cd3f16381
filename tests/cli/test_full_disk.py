"""A disk that is full: a command says so, and leaves no half of a file and what was there before.

Twice: with a limit on the size of files, which every user may set, and on a small disk in memory,
where this process may mount one.
"""

from __future__ import annotations

import contextlib
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.cli.commands import rps_pin
from tests.kills import BEFORE, COMMANDS, INPUTS, is_readable
from tests.processes import RPS_PIN, run

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits are kept differently")

#: Commands: bytes that there is room for, and files that they write, the first too large.
CASES = {
    "urdf": (8192, ["micro.urdf"]),
    "convert urdf": (4096, ["four_bar.urdf", "four_bar.yaml"]),
    "convert mjcf": (1024, ["four_bar.xml"]),
    "export c": (40_960, ["four_bar.c", "four_bar.h", "four_bar_test.c", "README.md"]),
    "new": (8192, ["mine.urdf", "mine.yaml", "path.yaml"]),
    "examples": (1024, ["robot.xml", "mine.yaml", "path.csv"]),
    "view html": (102_400, ["view.html"]),
    "simulate": (102_400, ["viewer.html", "simulation.csv", "simulation.png", "simulation.svg"]),
    "control": (8192, ["loop.csv", "report.md", "summary.json", "tracking.png", "viewer.html"]),
    "helix": (4096, ["helix.csv", "path.png", "viewer.html"]),
    "dynamics": (4096, ["dynamics.csv", "sizing.json", "forces_by_cause.svg", "viewer.html"]),
    "workspace": (4096, ["workspace.h5", "boundary.stl", "assembly_modes.png"]),
    "reproduce": (4096, ["reproduction/figure_1.png", "reproduction.md"]),
}
#: The browser of pictures needs files of any size: these are tried on a small disk alone.
PICTURES = {"view png": (8192, ["view.png"]), "view video": (8192, ["view.gif"])}


def words_of(name: str) -> tuple[str, ...]:
    """Return a command of `tests.kills` without the program."""
    return COMMANDS[name][len(RPS_PIN) :]


def prepared(folder: Path, names: list[str]) -> Path:
    """Write the inputs, and something where the results will be; return that folder."""
    for name, text in INPUTS.items():
        (folder / name).write_text(text)
    (folder / "out").mkdir(exist_ok=True)
    for name in names:
        (folder / "out" / name).parent.mkdir(exist_ok=True)
        (folder / "out" / name).write_bytes(BEFORE)
    return folder / "out"


def check(out: Path, names: list[str], errors: str, reason: str) -> None:
    """Check what a command said, and what is there afterwards."""
    assert errors.startswith(f"error: {out.name}/{names[0]}: ")
    assert errors.endswith(f"{reason}\n")
    assert errors.count("\n") == 1
    files = [path for path in out.rglob("*") if path.is_file()]
    assert (out / names[0]).read_bytes() == BEFORE
    for path in files:
        assert not path.name.startswith("."), path
        assert path.read_bytes() == BEFORE or is_readable(path) or path.suffix in (".h", ".txt")


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Refuse larger files in the block; Python ignores the signal, so that writing fails."""
    before, writes = resource.getrlimit(resource.RLIMIT_FSIZE), sys.dont_write_bytecode
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    # Python does not notice that what it compiled was cut off, and cannot import the module again.
    sys.dont_write_bytecode = True
    try:
        yield
    finally:
        sys.dont_write_bytecode = writes
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.filterwarnings("ignore:the cache folder:RuntimeWarning")
@pytest.mark.filterwarnings("ignore:TinyCC's slower code:RuntimeWarning")
@pytest.mark.parametrize("name", CASES)
def test_files_that_may_not_grow(name: str, tmp_path: Path) -> None:
    size, names = CASES[name]
    out = prepared(tmp_path, names)
    with largest_file(size):
        ended = rps_pin(*words_of(name), folder=tmp_path)
    assert ended.returncode == 1
    check(out, names, ended.stderr, "File too large")
    assert all(path.stat().st_size < size for path in out.rglob("*") if path.is_file())


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A folder on a disk of 200 kB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=200k", "none", str(disk)]
    try:
        subprocess.run(mount, check=True, capture_output=True, timeout=20)
    except (OSError, subprocess.SubprocessError) as error:
        pytest.skip(f"this process may not mount a disk: {error}")
    try:
        yield disk
    finally:
        # Processes of a browser that has just been closed may still be there, for a moment.
        for _ in range(100):
            if subprocess.run(["umount", str(disk)], timeout=20, check=False).returncode == 0:
                break
            time.sleep(0.1)
        assert not disk.is_mount()


@pytest.mark.parametrize("name", ["urdf", "convert urdf", "view html", "workspace", *PICTURES])
def test_a_disk_that_is_full(name: str, small_disk: Path) -> None:
    size, names = (CASES | PICTURES)[name]
    out = prepared(small_disk, names)
    with (small_disk / "filler").open("wb", buffering=0) as filler:
        with contextlib.suppress(OSError):
            while True:
                filler.write(bytes(4096))
        filler.truncate(filler.tell() - size)
    ended = rps_pin(*words_of(name), folder=small_disk)
    assert ended.returncode == 1, ended.stderr
    check(out, names, ended.stderr, "No space left on device")
    (small_disk / "filler").unlink()
    ended = rps_pin(*words_of("urdf"), folder=small_disk)
    assert ended.returncode == 0, ended.stderr


def test_an_output_that_is_full() -> None:
    for words in (["urdf"], ["--version"]):
        with Path("/dev/full").open("w") as full:
            ended = run([*RPS_PIN, *words], stdout=full)
        assert (ended.returncode, ended.stderr) == (1, "error: No space left on device\n")

"""Files appear whole or not at all."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from rps_pin import files, interruption
from rps_pin.errors import InputError
from rps_pin.files import opened, whole_file
from tests.each import each
from tests.processes import start


def test_finished_file_stands_at_its_path_and_nothing_else_remains(tmp_path: Path) -> None:
    with whole_file(tmp_path / "a.txt") as scratch:
        scratch.write_text("text")
    assert (tmp_path / "a.txt").read_text() == "text"
    assert os.listdir(tmp_path) == ["a.txt"]  # noqa: PTH208


def test_nothing_stands_at_the_path_before_the_end(tmp_path: Path) -> None:
    with whole_file(tmp_path / "a.txt") as scratch:
        scratch.write_text("half")
        assert not (tmp_path / "a.txt").exists()


def test_scratch_lies_beside_the_target_with_its_suffix(tmp_path: Path) -> None:
    """The same folder, so that the move is one step; the same suffix, for who goes by it."""
    with whole_file(tmp_path / "film.mp4") as scratch:
        assert scratch.parent == tmp_path
        assert scratch.suffix == ".mp4"


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_interrupted_file_leaves_what_stood_there(tmp_path: Path, error: type) -> None:
    (tmp_path / "a.txt").write_text("old")
    with pytest.raises(error), whole_file(tmp_path / "a.txt") as scratch:
        scratch.write_text("half")
        raise error
    assert (tmp_path / "a.txt").read_text() == "old"
    assert list(tmp_path.iterdir()) == [tmp_path / "a.txt"]


def test_existing_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("old, and longer")
    with whole_file(str(tmp_path / "a.txt")) as scratch:
        scratch.write_text("new")
    assert (tmp_path / "a.txt").read_text() == "new"


@pytest.mark.parametrize("mask", [0o022, 0o077])
def test_permissions_are_those_of_an_ordinary_new_file(tmp_path: Path, mask: int) -> None:
    before = os.umask(mask)
    try:
        with whole_file(tmp_path / "a.txt"):
            pass
        (tmp_path / "b.txt").touch()
    finally:
        os.umask(before)
    modes = [(tmp_path / name).stat().st_mode for name in ("a.txt", "b.txt")]
    assert modes[0] == modes[1]


def test_umask_stays_as_it_was(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        with whole_file(tmp_path / "a.txt"):
            pass
    finally:
        assert os.umask(before) == 0o027


def test_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), whole_file(tmp_path / "no" / "a.txt"):
        pass


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_bytes(b"\xff\xfe")
    reasons = {tmp_path / "no": "No such file", tmp_path: "directory", "a\0b": "null"}
    for path, why in reasons.items():
        words = f"cannot read the table .*: .*{why}"
        with pytest.raises(InputError, match=words), opened(path, "table"):
            pass
    words = r"cannot read the table .*a.txt: not a UTF-8 text"
    with pytest.raises(InputError, match=words), opened(tmp_path / "a.txt", "table") as file:
        file.read().decode()
    words = "a table is given by its path, not by 3"
    with pytest.raises(InputError, match=words), opened(3, "table"):
        pass


@each("kind", ["a FIFO", "a device", "a folder"])
def test_what_is_no_regular_file_is_not_read_nor_waited_for(kind: str, tmp_path: Path) -> None:
    path = {"a FIFO": tmp_path / "fifo", "a device": Path("/dev/zero")}.get(kind, tmp_path)
    if kind == "a FIFO":
        os.mkfifo(path)
    told = kind if kind != "a folder" else "Is a directory"
    why = f"cannot read the list {path}: .*{told}"
    with pytest.raises(InputError, match=why), opened(path, "list"):
        pytest.fail("it was opened")


def test_a_loop_of_links_is_told(tmp_path: Path) -> None:
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    why = "cannot read the list .*loop: Too many levels"
    with pytest.raises(InputError, match=why), opened(loop, "list"):
        pytest.fail("it was opened")


# Ended from outside -------------------------------------------------------------------------------

WRITER = """
import threading
from rps_pin.files import whole_file

with whole_file("a.txt") as scratch:
    scratch.write_text("half")
    print("under way", flush=True)
    threading.Event().wait()
"""


def ended(number: signal.Signals, folder: Path) -> tuple[int, str]:
    """Return exit status and errors of a process that a signal ended while it wrote a file."""
    with start([sys.executable, "-c", WRITER], cwd=folder) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "under way\n"
        process.send_signal(number)
        _, errors = process.communicate(timeout=60)
    return process.returncode, errors


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_leaves_no_file(tmp_path: Path, number: signal.Signals) -> None:
    assert ended(number, tmp_path) == (128 + number, "")
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_process_left_is_removed_by_the_next(tmp_path: Path) -> None:
    assert ended(signal.SIGKILL, tmp_path) == (-signal.SIGKILL, "")
    assert len(list(tmp_path.iterdir())) == 1
    with whole_file(tmp_path / "b.txt"):
        pass
    assert [one.name for one in tmp_path.iterdir()] == ["b.txt"]


def test_what_others_write_or_keep_is_left_alone(tmp_path: Path) -> None:
    old, young = time.time() - 1e6, time.time()
    elsewhere = ".a.rps_pin-{}-1-01234567.txt".format("f" * 8)
    one_of_theirs = f".a.rps_pin-{interruption._place()}-{os.getpid()}-01234567.txt"
    kept = (".a.txt", ".a-kx3_9v2q.txt", one_of_theirs, one_of_theirs[1:])
    for name in kept:
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (old, old))
    (tmp_path / ".a.rps_pin-00000000-1-01234567").mkdir()
    (tmp_path / elsewhere).touch()
    os.utime(tmp_path / elsewhere, (young, young))
    with whole_file(tmp_path / "b.txt"):
        pass
    assert len(list(tmp_path.iterdir())) == 7
    os.utime(tmp_path / elsewhere, (old, old))  # its process cannot be asked for: a day is enough
    with whole_file(tmp_path / "b.txt"):
        pass
    assert not (tmp_path / elsewhere).exists()
    assert len(list(tmp_path.iterdir())) == 6


def test_a_name_as_long_as_the_system_allows_can_be_written(tmp_path: Path) -> None:
    target = tmp_path / ("a" * 251 + ".txt")
    with whole_file(target) as scratch:
        scratch.write_text("text")
    assert target.read_text() == "text"


def test_handlers_of_signals_stay_as_they_were(tmp_path: Path) -> None:
    def mine(*_: object) -> None:
        pass

    for number in (signal.SIGTERM, signal.SIGHUP):
        for before in (signal.SIG_DFL, signal.SIG_IGN, mine):
            own = signal.signal(number, before)
            try:
                with whole_file(tmp_path / "a.txt"):
                    assert (signal.getsignal(number) == before) is (before != signal.SIG_DFL)
                assert signal.getsignal(number) == before
            finally:
                signal.signal(number, own)


def test_a_file_is_written_in_a_thread(tmp_path: Path) -> None:
    """Signals are the main thread's."""
    thread = threading.Thread(target=files.write_text, args=(tmp_path / "a.txt", "text"))
    thread.start()
    thread.join()
    assert (tmp_path / "a.txt").read_text() == "text"

"""Files appear whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rps_pin.errors import InputError
from rps_pin.files import opened, whole_file
from tests.each import each


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

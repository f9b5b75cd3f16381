"""The cache of compiled code: whole, or not used; where it cannot be used, nothing is lost."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
import pytest

from rps_pin.codegen.build import Source, build, cache, cache_folder, clear, compilers, source, tcc
from rps_pin.errors import CompileError
from tests.codegen.small_sources import FakeCompiler, Proof, called, sine

X = np.linspace(-2.0, 2.0, 37)


@pytest.fixture(autouse=True)
def alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RPS_PIN_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("RPS_PIN_CC", raising=False)
    monkeypatch.delenv("CC", raising=False)


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakeCompiler:
    """The only compiler on PATH."""
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    return FakeCompiler(tmp_path / "bin")


def entry(file: str = "library.so") -> Path:
    (found,) = cache_folder().glob(f"*/{file}")
    return found


def replaced(file: Path, content: bytes) -> None:
    """Write another file of this name: the first is loaded, and the process ends with it."""
    file.unlink()
    file.write_bytes(content)


def shortened(file: Path) -> None:
    replaced(file, file.read_bytes()[:-1])


def changed(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    replaced(file, content)


def emptied(file: Path) -> None:
    replaced(file, b"")


@pytest.mark.parametrize("file", ["library.so", "record.json"])
@pytest.mark.parametrize("damage", [shortened, changed, emptied, os.remove])
def test_what_is_damaged_is_made_again(
    fake: FakeCompiler, file: str, damage: Callable[[Path], None]
) -> None:
    build(sine(), Proof(), "gcc")
    damage(entry(file))
    proof = Proof()
    library = build(sine(), proof, "gcc")
    assert (fake.compiled, proof.calls) == (2, 1)
    np.testing.assert_array_equal(called(library, X), 2.0 * np.sin(X))
    build(sine(), proof)
    assert (fake.compiled, proof.calls) == (2, 1)


@pytest.mark.parametrize(
    "record", ["[]", "null", "3", '{"digest": 1}', '{"proof": {}}', "{", "\udcff"]
)
def test_a_library_without_its_record_is_not_used(fake: FakeCompiler, record: str) -> None:
    build(sine(), Proof(), "gcc")
    entry("record.json").write_text(record, "utf-8", "surrogateescape")
    build(sine(), Proof(), "gcc")
    assert fake.compiled == 2


def test_a_proof_cannot_be_written_by_hand(fake: FakeCompiler) -> None:
    build(sine(), Proof(), "gcc")
    record = json.loads(entry("record.json").read_text())
    entry("record.json").write_text(json.dumps(record | {"proof": {"samples": 10**6}}))
    assert build(sine(), Proof(), "gcc").proof == {"samples": 101}
    assert fake.compiled == 2


def test_what_a_killed_builder_left_is_removed(fake: FakeCompiler) -> None:
    build(sine(), Proof(), "gcc")
    left = entry().parent.with_name(f"{entry().parent.name}.part-abc")
    entry().parent.rename(left)
    build(sine(), Proof(), "gcc")
    assert fake.compiled == 2
    assert not left.exists()


def test_the_proof_is_as_json_gives_it(fake: FakeCompiler) -> None:
    """So that it is the same from a build and from the cache."""
    library = build(sine(), lambda _: {"shape": (1, 2), "worst": 1e-16}, "gcc")
    assert library.proof == {"shape": [1, 2], "worst": 1e-16}
    assert build(sine(), Proof(), "gcc").proof == library.proof
    with pytest.raises(TypeError):
        build(sine(3.0), lambda _: {"an array": X}, "gcc")


def test_texts_for_tcc_are_kept_with_their_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []

    def texts() -> tuple[str, ...]:
        made.append(1)
        return sine().units

    for _ in range(2):
        one = Source("sine", ("sine_many",), texts, determined_by="the same")
        proof = Proof()
        library = build(one, proof, "tcc")
        np.testing.assert_array_equal(called(library, X), 2.0 * np.sin(X))
    assert (made, proof.calls) == ([1], 0)
    shortened(entry("texts.json"))
    one = Source("sine", ("sine_many",), texts, determined_by="the same")
    build(one, proof, "tcc")
    assert (made, proof.calls) == ([1, 1], 1)


KEYS: list[tuple[Any, str, Any]] = [
    (source, "ABI", 10**6),
    (source, "__version__", "0.0.0"),
    (source, "processor", lambda: "another processor"),
    (source, "c_library", lambda: "glibc 1.0"),
]


@pytest.mark.parametrize(("module", "name", "value"), KEYS)
def test_the_key_depends_on_the_machine(
    module: Any, name: str, value: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = sine().key
    assert sine().key == before
    monkeypatch.setattr(module, name, value)
    assert sine().key != before


def test_the_key_depends_on_every_byte() -> None:
    base = Source("a", ("f",), ("text",))
    others = [
        Source("b", ("f",), ("text",)),
        Source("a", ("g",), ("text",)),
        Source("a", ("f",), ("texT",)),
        Source("a", ("f",), ("te", "xt")),
        Source("a", ("f",), ("text",), vectors=True),
        Source("a", ("f",), ("text",), flags=("-DA",)),
        Source("a", ("f",), ("text",), determined_by="x"),
        Source("a", ("f",), lambda: ("text",), determined_by="x"),
        Source("a", ("f",), lambda: ("text",), determined_by="y"),
    ]
    assert len({one.key for one in (base, *others)}) == 1 + len(others)
    assert Source("a", ("f",), lambda: ("text",)).key == base.key


def test_the_compiler_is_part_of_the_key(fake: FakeCompiler) -> None:
    for version in ("1.1", "1.2"):
        fake.path.write_text(fake.path.read_text().replace("version 1.0", f"version {version}"))
        os.utime(fake.path, ns=(0, int(float(version) * 1e9)))
        build(sine(), Proof(), "gcc")
        fake.path.write_text(fake.path.read_text().replace(version, "1.0"))
    assert fake.compiled == 2


def test_processors_differ_by_what_they_can_do() -> None:
    assert source.processor().splitlines()[0] == os.uname().machine
    assert len(source.processor().splitlines()) > 1
    assert "MHz" not in source.processor()  # that changes all the time


def useless(reason: str) -> Any:
    return pytest.warns(RuntimeWarning, match=f"cannot be used \\({reason}.*Set RPS_PIN_CACHE")


@pytest.mark.parametrize("compiler", ["gcc", "tcc"])
def test_a_file_in_place_of_the_folder(
    fake: FakeCompiler, compiler: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("here")
    monkeypatch.setenv("RPS_PIN_CACHE", str(tmp_path / "file" / "cache"))
    for _ in range(2):
        with useless("Not a directory"):
            library = build(sine(), Proof(), compiler)
        np.testing.assert_array_equal(called(library, X), 2.0 * np.sin(X))
    assert fake.compiled <= 1  # the second came from this process's own folder
    assert (tmp_path / "file").read_text() == "here"
    assert clear() == 0


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A new folder of this process."""

    class Folder:
        name = str(tmp_path / "own")

    monkeypatch.setattr(cache, "_own", Folder)


def refuse(number: int, place: Path) -> Callable[..., Any]:
    """A function of the system that fails in a folder."""
    real = os.mkdir

    def failing(path: Any, *rest: Any, **more: Any) -> Any:
        if str(path).startswith(str(place)):
            raise OSError(number, os.strerror(number), str(path))
        return real(path, *rest, **more)

    return failing


@pytest.mark.usefixtures("own")
@pytest.mark.parametrize(
    ("number", "words"),
    [(errno.EROFS, "Read-only"), (errno.ENOSPC, "No space"), (errno.EACCES, "Permission")],
)
def test_a_folder_that_cannot_be_written_to(
    fake: FakeCompiler, number: int, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    build(sine(3.0), Proof(3.0), "gcc")
    monkeypatch.setattr(os, "mkdir", refuse(number, cache_folder()))
    assert build(sine(3.0), Proof(), "gcc").proof  # what is in it serves
    with useless(words):
        library = build(sine(), Proof(), "gcc")
    np.testing.assert_array_equal(called(library, X), 2.0 * np.sin(X))
    assert fake.compiled == 2


@pytest.mark.usefixtures("own")
def test_a_full_disk_that_breaks_the_linker(
    fake: FakeCompiler, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It dies of a bus error."""

    class Usage:
        free = 0

    fake.path.write_text(fake.path.read_text().replace("PATH=", "exit 1; PATH="))
    real = compilers.shutil.disk_usage
    monkeypatch.setattr(
        compilers.shutil,
        "disk_usage",
        lambda folder: Usage if str(folder).startswith(str(cache_folder())) else real(folder),
    )
    with useless("No space left"), pytest.raises(CompileError, match="status 1"):
        build(sine(), Proof(), "gcc")


@pytest.mark.usefixtures("own")
def test_a_disk_that_is_full_for_the_compiler(fake: FakeCompiler) -> None:
    """It says so in its words; both folders are on that disk."""
    fake.path.write_text(
        fake.path.read_text().replace("PATH=", 'echo "ld: No space left on device"; exit 1; PATH=')
    )
    with (
        useless("No space left"),
        pytest.raises(CompileError, match=r"own cannot be used either \(No space left on device"),
    ):
        build(sine(), Proof(), "gcc")


@pytest.mark.usefixtures("own", "fake")
def test_a_disk_that_is_full_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was built and proven is used; the next process builds again."""

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "rename", full)
    proof = Proof()
    with useless("No space left"):
        library = build(sine(), proof, "gcc")
    np.testing.assert_array_equal(called(library, X), 2.0 * np.sin(X))
    assert proof.calls == 1
    assert [one for one in cache_folder().iterdir() if one.suffix != ".lock"] == []


@pytest.mark.usefixtures("own")
def test_a_folder_without_execution(fake: FakeCompiler, monkeypatch: pytest.MonkeyPatch) -> None:
    from rps_pin.codegen.build import builder

    real, place = builder.load, str(cache_folder())

    def load(path: Path, *rest: Any) -> Any:
        if str(path).startswith(place):
            raise OSError(f"{path}: failed to map segment from shared object")
        return real(path, *rest)

    monkeypatch.setattr(builder, "load", load)
    with useless("failed to map segment"):
        library = build(sine(), Proof(), "gcc")
    np.testing.assert_array_equal(called(library, X), 2.0 * np.sin(X))
    assert fake.compiled == 2


@pytest.mark.usefixtures("own", "fake")
def test_a_lock_that_is_never_free(monkeypatch: pytest.MonkeyPatch) -> None:
    one = sine()
    (gcc,) = compilers.find("gcc")
    with (
        cache.lock(cache_folder(), one, gcc.key(one), 1.0, lambda: None),
        useless("another process held .*lock for more than 2 s"),
    ):
        build(one, Proof(), "gcc", limit=2.0)


def test_an_error_of_the_proof_is_none_of_the_folder(fake: FakeCompiler) -> None:
    def prove(library: object) -> dict[str, int]:
        raise FileNotFoundError("a file of the proof")

    with pytest.raises(CompileError, match="the proof failed: a file of the proof"):
        build(sine(), prove, "gcc")
    assert fake.compiled == 1


def test_the_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RPS_PIN_CACHE", "here")
    assert cache_folder() == tmp_path / "here"
    monkeypatch.setenv("RPS_PIN_CACHE", "")
    assert cache_folder() == Path(platformdirs.user_cache_dir("rps-pin"))
    # Without a home, ~ stays what it is.
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda name: f"~/.cache/{name}")
    with useless("Not a directory"):
        build(sine(), Proof(), "tcc")
    assert list(tmp_path.glob("~")) == []


def test_the_oldest_go(fake: FakeCompiler, monkeypatch: pytest.MonkeyPatch) -> None:
    for factor in (1.0, 2.0, 3.0):
        build(sine(factor), Proof(factor), "gcc")
    size = sum(file.stat().st_size for file in entry_files())
    for age, record in enumerate(sorted(cache_folder().glob("*/record.json"), key=_age)):
        os.utime(record, (10**9 + age, 10**9 + age))
    build(sine(1.0), Proof(), "gcc")  # used last now
    monkeypatch.setattr(cache, "LARGEST", size + 1000)
    build(sine(4.0), Proof(4.0), "gcc")
    for factor in (3.0, 1.0, 4.0):
        build(sine(factor), Proof(factor), "gcc")
    assert fake.compiled == 4
    build(sine(2.0), Proof(2.0), "gcc")
    assert fake.compiled == 5


def entry_files() -> list[Path]:
    return [one for one in cache_folder().glob("*/*") if one.is_file()]


def _age(record: Path) -> int:
    return record.stat().st_mtime_ns


def test_old_remains_of_others_go(fake: FakeCompiler) -> None:
    cache_folder().mkdir()
    old, new = (cache_folder() / f"abc.part-{name}" for name in ("old", "new"))
    for part in (old, new):
        part.mkdir()
        (part / "0.c").write_text("")
    os.utime(old, (10**9, 10**9))
    build(sine(), Proof(), "gcc")
    assert (old.exists(), new.exists(), fake.compiled) == (False, True, 1)


def test_what_others_remove_meanwhile_is_no_error(
    fake: FakeCompiler, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the list of a folder and the look at what is in it, another process may remove it."""
    build(sine(1.0), Proof(1.0), "gcc")
    ghost = cache_folder() / "of-another.part-1"
    listed = Path.glob

    def glob(self: Path, pattern: str) -> list[Path]:
        return [*listed(self, pattern), ghost if "part" in pattern else self / "ghost"]

    monkeypatch.setattr(Path, "glob", glob)
    library = build(sine(3.0), Proof(3.0), "gcc")
    np.testing.assert_array_equal(called(library, X), 3.0 * np.sin(X))
    assert cache.usage()[0] == 2


def test_clearing(fake: FakeCompiler) -> None:
    library = build(sine(), Proof(), "gcc")
    build(sine(), Proof(), "tcc")
    assert cache.usage()[0] == 2
    assert clear() == 2
    assert list(cache_folder().iterdir()) == []
    assert cache.usage() == (0, 0)
    np.testing.assert_array_equal(called(library, X), 2.0 * np.sin(X))
    build(sine(), Proof(), "gcc")
    assert fake.compiled == 2


def test_tcc_is_known_by_its_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    before = tcc.key(sine())
    monkeypatch.setattr(tcc, "_fingerprint", lambda: "another")
    assert tcc.key(sine()) != before

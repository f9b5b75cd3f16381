"""Signals that end a process interrupt it as Ctrl-C does."""

from __future__ import annotations

import contextlib
import signal
import sys
import time

import pytest

from rps_pin.interruption import interruptions_wait, signals_as_ctrl_c


class Slow:
    """Its destructor is where a signal arrives: Python cannot pass on what is raised there."""

    def __init__(self, number: signal.Signals) -> None:
        self.number = number

    def __del__(self) -> None:
        signal.raise_signal(self.number)
        time.sleep(0.001)


def wait() -> None:
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        time.sleep(0.01)


def test_a_signal_interrupts_and_ends_with_the_status_of_a_shell() -> None:
    for number, status in ((signal.SIGTERM, 143), (signal.SIGHUP, 129)):
        cleared = []
        with pytest.raises(SystemExit) as caught, signals_as_ctrl_c():
            try:
                signal.raise_signal(number)
            except KeyboardInterrupt:
                cleared.append(number)
                raise
        assert caught.value.code == status
        assert cleared == [number]


def test_a_signal_that_arrives_in_a_destructor_is_not_lost() -> None:
    hook = sys.unraisablehook
    with pytest.raises(SystemExit) as caught, signals_as_ctrl_c():
        Slow(signal.SIGTERM)
        wait()
    assert caught.value.code == 143
    with pytest.raises(KeyboardInterrupt), signals_as_ctrl_c():
        Slow(signal.SIGINT)
        wait()
    assert sys.unraisablehook is hook


def test_an_inner_block_repeats_what_an_outer_one_received() -> None:
    hook = sys.unraisablehook
    with pytest.raises(SystemExit) as caught, signals_as_ctrl_c(), signals_as_ctrl_c():
        Slow(signal.SIGHUP)
        wait()
    assert caught.value.code == 129
    assert sys.unraisablehook is hook


def test_interruptions_wait_for_the_end_of_a_block() -> None:
    steps = []
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        with interruptions_wait():
            signal.raise_signal(signal.SIGINT)
            steps.append("the block")
        wait()
    assert signal.getsignal(signal.SIGINT) is before
    with pytest.raises(SystemExit) as caught, signals_as_ctrl_c():
        with interruptions_wait():
            signal.raise_signal(signal.SIGTERM)
            steps.append("another")
        wait()
    assert caught.value.code == 143
    assert steps == ["the block", "another"]


def test_interruptions_that_wait_do_not_hide_an_error() -> None:
    with pytest.raises(ValueError, match="of the block"), interruptions_wait():
        raise ValueError("of the block")


def test_a_block_that_takes_ctrl_c_as_its_end_ends_well() -> None:
    with signals_as_ctrl_c(), contextlib.suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
    with pytest.raises(SystemExit) as caught, signals_as_ctrl_c():
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt:
            sys.exit(0)
    assert caught.value.code == 0


def test_errors_and_ctrl_c_stay_what_they_are() -> None:
    for error in (ValueError, KeyboardInterrupt):
        with pytest.raises(error), signals_as_ctrl_c():
            raise error


def test_the_outermost_block_ends_the_process() -> None:
    """What is between the two clears up before it."""
    steps = []
    with pytest.raises(SystemExit) as caught, signals_as_ctrl_c():
        try:
            with signals_as_ctrl_c():
                signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt:
            steps.append("between")
            raise
    assert caught.value.code == 143
    assert steps == ["between"]

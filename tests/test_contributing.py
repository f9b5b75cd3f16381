"""Paths through the code in CONTRIBUTING.md are the calls that a program makes, in this order."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import rps_pin
from rps_pin import RPSRobot
from rps_pin.cli import main
from rps_pin.control import ComputedTorque, Gains
from rps_pin.trajectories import circle

ROOT = Path(__file__).resolve().parent.parent
SOURCE = Path(rps_pin.__file__).parent
Call = tuple[str, str]


def paths() -> dict[str, list[Call]]:
    """Return the files and functions of each path by its heading."""
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    section = text.partition("## Three paths through the code")[2].partition("\n## ")[0]
    return {
        part.partition("\n")[0]: re.findall(r"^\d+\. `([\w/.]+)`, `(\w+)`", part, re.MULTILINE)
        for part in section.split("\n### ")[1:]
    }


def first_calls(run: Callable[[], object], named: list[Call]) -> list[Call]:
    """Run a program; return the named functions in the order of their first calls."""
    wanted = {(str(SOURCE / file), function): (file, function) for file, function in named}
    found: list[Call] = []

    def profile(frame: FrameType, event: str, argument: Any) -> None:
        key = (frame.f_code.co_filename, frame.f_code.co_name)
        if event == "call" and key in wanted:
            found.append(wanted.pop(key))

    before = sys.getprofile()
    sys.setprofile(profile)
    try:
        run()
    finally:
        sys.setprofile(before)
    return found


def command(*words: str) -> Callable[[], None]:
    """Return a call of the command line in this process."""

    def run() -> None:
        with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as end:
            patch.setattr(sys, "argv", ["rps-pin", *words])
            main()
        assert not end.value.code

    return run


def a_tick() -> Callable[[], object]:
    """Return a call of a controller's tick."""
    robot = RPSRobot.from_preset("micro")
    path = circle(height=0.223, tilt=0.05, duration=1.0)
    start = path.sample(0.0).pose
    gains = Gains.placed(15.0, integral=0.2)
    controller = ComputedTorque(robot, start, gains, compiled=False)
    lengths = robot.inverse_kinematics(start).length
    return lambda: controller.tick(lengths, path.sample(1e-3))


def test_paths_are_the_calls_of_the_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    mechanism = str(ROOT / "urdf" / "four_bar.yaml")
    programs = {
        "From `rps-pin helix` to the force": command("helix", "--rate", "10"),
        "From an encoder reading to a force": a_tick(),
        "From a YAML file to `describe`": command("describe", mechanism),
    }
    named = paths()
    assert set(named) == set(programs)
    for heading, calls in named.items():
        files = [file for file, _ in calls]
        assert len(set(files)) == len(files) >= 9, heading
        assert first_calls(programs[heading], calls) == calls, heading


def test_a_wrong_order_is_found(capsys: pytest.CaptureFixture[str]) -> None:
    run = command("describe", str(ROOT / "urdf" / "four_bar.yaml"))
    calls = paths()["From a YAML file to `describe`"]
    assert first_calls(run, calls[::-1]) == calls
    assert first_calls(run, [("closed_loop/model.py", "simulate")]) == []

"""Numbers of every option and argument are decimal, as those of files."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, get_type_hints

import pytest

from rps_pin.cli.app import app
from rps_pin.cli.decimal_numbers import _pattern, decimal
from rps_pin.cli.lazy_group import _imported
from tests.cli.commands import rps_pin
from tests.each import each

COMMANDS = [one.name for one in app.registered_commands if one.name != "doctor"] + ["export c"]
#: What each command needs besides, so that nothing else is wrong with it.
NEEDED = {
    "dynamics": ["helix.yaml"],
    "control": ["scenario.yaml"],
    "describe": ["four_bar"],
    "assembly-modes": ["four_bar"],
    "simulate": ["four_bar"],
    "convert": ["four_bar"],
    "export c": ["four_bar"],
}


def numeric(command: str) -> Iterator[Any]:
    """The parameters of a command that are numbers."""
    made = _imported(command.replace("-", "_").replace(" ", "_"))
    kinds = get_type_hints(made.callback)
    for param in made.params:
        if _pattern(kinds[param.name]):
            yield param


@pytest.mark.parametrize("command", COMMANDS)
def test_numbers_of_python_alone_are_refused(command: str) -> None:
    for param in numeric(command):
        for text in ("1_000", "\u0663", "0x10", "1e5_0", "1.0f", ""):
            if str(param.opts[0]).startswith("-"):
                given = [*NEEDED.get(command, []), max(param.opts, key=len), *[text] * param.nargs]
            else:
                given = ["--", *[text] * max(param.nargs, 1)]
            told = rps_pin(*command.split(), *given)
            assert told.returncode == 2, (command, given, told.stderr)
            assert "number" in " ".join(told.stderr.split()), told.stderr


def test_there_are_numbers_in_the_commands() -> None:
    """Else the test above has tested nothing."""
    assert sum(1 for command in COMMANDS for _ in numeric(command)) > 20


@each("text", ["1", "-1.5", "+.5", "1.", "1e-3", "1E+3", " 2 ", "inf", "-Infinity", "NaN"])
def test_decimal_numbers(text: str) -> None:
    found, right = decimal(text), float(text)
    assert found == right or (math.isnan(found) and math.isnan(right))


@each("text", ["1_000", "1 000", "1,5", "\u0661", "\uff11", "\xa01", "0x1", "1e", "e1", "", "+-1"])
def test_others(text: str) -> None:
    with pytest.raises(ValueError, match="not a decimal number"):
        decimal(text)


def test_a_duration_is_refused_before_its_size_is_told() -> None:
    for duration, why in (("1e99", "duration = 1e+99"), ("1e9", "duration / step = 1e+12 steps")):
        told = rps_pin("simulate", "four_bar", "--duration", duration)
        assert told.returncode == 1
        assert why in " ".join(told.stderr.split())
        assert "MB" not in told.stderr


def test_more_points_than_memory_holds_are_refused() -> None:
    told = rps_pin("workspace", "--points", "999999999999")
    assert told.returncode == 1
    assert "999999999999 points of an axis: at most 1000000" in " ".join(told.stderr.split())

"""The commands that the README and the help show, as typed; `tools/look.py` runs all of them."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

from rps_pin.cli.app import app

ROOT = Path(__file__).parents[2]
NAMES = [*sorted({str(one.name) for one in app.registered_commands} - {"doctor"}), "export c"]


def commands_of_readme() -> list[str]:
    """Return those of the section on the command line."""
    text = (ROOT / "README.md").read_text("utf-8")
    block = text.partition("## Command line")[2].partition("`--help`")[0]
    return [line.partition("#")[0].strip() for line in re.findall(r"rps-pin .*", block)]


def commands_of_help(name: str) -> list[str]:
    """Return the examples of a command's help."""
    module = importlib.import_module(f"rps_pin.cli.{re.sub('[- ]', '_', name)}")
    command = getattr(module, f"{module.__name__.rpartition('.')[2]}_command")
    examples = re.split(r"\n    Examples?:", command.__doc__)[1:]
    return [line for text in examples for line in re.findall(r"`(rps-pin [^`]*)`", text)]


def all_commands() -> list[str]:
    """Return those of the README, then those of the help that it has not, each once."""
    of_help = [line for name in NAMES for line in commands_of_help(name)]
    return [*dict.fromkeys([*commands_of_readme(), *of_help])]


def commands_of_new(printed: str) -> list[str]:
    """Return what `rps-pin new` says to try."""
    return re.findall(r"^  (rps-pin .*)$", printed, re.MULTILINE)


def exit_status(line: str) -> int:
    """Return the exit status that a command is to have."""
    return int(line == "rps-pin check --radius 0.075 --pitch 0.05")  # it crosses two singularities

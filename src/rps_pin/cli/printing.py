"""What the commands print: names and paths of others are text there, whatever they hold."""

from __future__ import annotations

import os
import traceback
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.text import Text

from rps_pin.plain_text import plain

#: Exit status of a fault of this program.
FAULT = 70
_TRACEBACK = "RPS_PIN_TRACEBACK"


class PlainConsole(Console):
    """A console that prints every string as `plain` text, and takes markup only where asked."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"highlight": False, "markup": False} | options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a string as Rich's text."""
        return super().render_str(plain(text), **options)


def say(text: object, *, err: bool = False) -> None:
    """Print a line to standard output or standard error."""
    typer.echo(plain(text), err=err)


def tell_error(message: str) -> None:
    """Print an error as one line to standard error."""
    line = Text.assemble(("error:", "bold red"), f" {plain(' '.join(message.split()))}")
    PlainConsole(stderr=True, soft_wrap=True).print(line)


def tell_fault(error: BaseException) -> int:
    """Say what to report of an error that no command foresees; return the exit status, `FAULT`."""
    if os.environ.get(_TRACEBACK):
        say("".join(traceback.format_exception(error)), err=True)
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "rps_pin" in Path(frame.filename).parts] or frames
    where = f"{Path(own[-1].filename).name}, line {own[-1].lineno}" if own else "unknown place"
    words = str(error) or "no message"
    tell_error(
        f"a fault of rps-pin: {type(error).__name__}: {words[:500]} ({where}). Please report it "
        "with the command, its files and the output of rps-pin doctor (see SECURITY.md if it may "
        f"be a way in). {_TRACEBACK}=1 shows where it happened"
    )
    return FAULT

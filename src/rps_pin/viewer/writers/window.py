"""Meshcat's windows and commands: the one method that Meshcat asks of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable


class Command(Protocol):
    """Anything that can be written as one message of Meshcat's protocol."""

    def lower(self) -> Mapping[str, object]:
        """Return the message; its ``"type"`` is the kind of command."""


@runtime_checkable
class Window(Protocol):
    """A receiver of commands: a `Recorder`, a `LocalViewer.window`, or Meshcat's own window."""

    def send(self, command: Command) -> None:
        """Take one command."""


@dataclass(frozen=True)
class RawCommand:
    """A message that Meshcat's Python classes cannot express, given as a mapping."""

    message: Mapping[str, object]

    def lower(self) -> Mapping[str, object]:
        """Return the message."""
        return self.message

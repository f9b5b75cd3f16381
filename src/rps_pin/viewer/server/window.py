"""Where a scene's commands go: the one method that Meshcat asks of a window."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol


class Command(Protocol):
    """Anything that can be written as one message of Meshcat's protocol."""

    def lower(self) -> Mapping[str, object]:
        """Return the message; its ``"type"`` says what the viewer shall do."""


class Window(Protocol):
    """Takes commands in order: a recording, a server of ours, or Meshcat's own window."""

    def send(self, command: Command) -> None:
        """Take one command."""


@dataclass(frozen=True)
class RawCommand:
    """A message that Meshcat's Python classes cannot express, given as it is."""

    message: Mapping[str, object]

    def lower(self) -> Mapping[str, object]:
        """Return the message."""
        return self.message

"""Recording of a scene's commands, for pages."""

from __future__ import annotations

from collections.abc import Mapping

import umsgpack

from rps_pin.viewer.writers.window import Command


class Recorder:
    """A window for ``meshcat.Visualizer(window=...)`` that opens no socket and starts no process.

    Attributes
    ----------
    messages : list of mapping
        Every command's message, in the order sent.
    """

    def __init__(self) -> None:
        self.messages: list[Mapping[str, object]] = []

    def send(self, command: Command) -> None:
        """Append the command's message, as it stands now, to `messages`."""
        self.messages.append(command.lower())

    def packed(self) -> list[bytes]:
        """Return every message in Meshcat's wire format (MessagePack), in the order sent."""
        return [umsgpack.packb(message) for message in self.messages]

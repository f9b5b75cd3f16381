"""Store of the current scene, for browser tabs that open later."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping


class SceneStore:
    """The latest message of each kind for each path of the scene tree, oldest change first.

    Replaying these messages to an empty viewer gives the current scene. The store grows with the
    scene, not with time.
    """

    def __init__(self) -> None:
        self._messages: dict[tuple[str, str, str], bytes] = {}

    def apply(self, message: Mapping[str, object], packed: bytes) -> None:
        """Store a message; `packed` is the same in Meshcat's wire format."""
        kind, path = str(message["type"]), str(message.get("path", ""))
        if kind == "delete":
            self._forget(lambda other: f"{other}/".startswith(f"{path}/"))
            return
        if kind == "set_object":
            # The new object starts without what was set on the old one.
            self._forget(lambda other: other == f"{path}/<object>")
        key = (kind, path, str(message.get("property", "")))
        self._messages.pop(key, None)
        self._messages[key] = packed

    def __iter__(self) -> Iterator[bytes]:
        return iter(list(self._messages.values()))

    def __len__(self) -> int:
        return len(self._messages)

    def _forget(self, doomed: Callable[[str], bool]) -> None:
        self._messages = {key: kept for key, kept in self._messages.items() if not doomed(key[1])}

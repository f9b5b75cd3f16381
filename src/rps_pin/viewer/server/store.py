"""What a new browser tab has to be told: the scene as it stands now."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

_Key = tuple[str, str, str]


class SceneStore:
    """The latest message of each kind for each place in the scene tree, oldest change first.

    Replaying these messages to an empty viewer gives the scene that a viewer shows that was there
    from the start; the store grows with the scene, not with the time it has been shown.
    """

    def __init__(self) -> None:
        self._messages: dict[_Key, bytes] = {}

    def apply(self, message: Mapping[str, object], packed: bytes) -> None:
        """Take note of a message; `packed` is the same in Meshcat's wire format."""
        kind, path = str(message["type"]), str(message.get("path", ""))
        if kind == "delete":
            self._forget(lambda key: _within(key[1], path))
            return
        if kind == "set_object":
            # The new object starts without what was set on the old one.
            self._forget(lambda key: key[1] == f"{path}/<object>")
        key = (kind, path, str(message.get("property", "")))
        self._messages.pop(key, None)
        self._messages[key] = packed

    def __iter__(self) -> Iterator[bytes]:
        return iter(list(self._messages.values()))

    def __len__(self) -> int:
        return len(self._messages)

    def _forget(self, doomed: Callable[[_Key], bool]) -> None:
        self._messages = {key: kept for key, kept in self._messages.items() if not doomed(key)}


def _within(path: str, ancestor: str) -> bool:
    """Tell whether `path` is `ancestor` or lies below it."""
    return path == ancestor or path.startswith(f"{ancestor}/")

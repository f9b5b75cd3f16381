"""Copies of objects with a state: they go their own way, and share nothing that calls write to."""

from __future__ import annotations

from copy import deepcopy
from typing import TypeVar

_Self = TypeVar("_Self", bound="DeepCopied")


class DeepCopied:
    """Base of objects of which `copy.copy` is a deep copy too: half a copy would share memory."""

    def __copy__(self: _Self) -> _Self:
        """Return one with a state and scratch memory of its own."""
        return deepcopy(self)

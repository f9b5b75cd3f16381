"""Public names that have moved: the old name works, with a warning that gives the new one."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Mapping
from typing import Any


def moved_names(module: str, names: Mapping[str, str]) -> Callable[[str], Any]:
    """Return a module's ``__getattr__`` for names that are defined elsewhere now.

    Parameters
    ----------
    module
        The module with the old names, for messages.
    names
        The new module of each name.
    """

    def __getattr__(name: str) -> Any:  # noqa: N807
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        warnings.warn(
            f"{module}.{name} has moved to {names[name]}.{name}", DeprecationWarning, stacklevel=2
        )
        return getattr(importlib.import_module(names[name]), name)

    return __getattr__

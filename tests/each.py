"""One test for a whole table of cases, where an id for each case would only restate the table."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any

import pytest

ParameterSet = type(pytest.param())


def each(names: str | tuple[str, ...], cases: Iterable[Any], ids: Any = None) -> Any:
    """Run a test with each case in turn; as `pytest.mark.parametrize`, but one test.

    An error notes its case. Fixtures are made once for all cases.
    """
    keys = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    alone = len(keys) == 1
    table = [
        case.values if isinstance(case, ParameterSet) else (case,) if alone else case
        for case in cases
    ]
    assert table, "no cases"

    def decorate(test: Callable[..., object]) -> Callable[..., object]:
        @functools.wraps(test)
        def run(**fixtures: Any) -> None:
            for case in table:
                given = dict(zip(keys, case, strict=True))
                try:
                    test(**given, **fixtures)
                except BaseException as error:
                    error.add_note(f"with {given}")
                    raise

        signature = inspect.signature(test)
        kept = [one for name, one in signature.parameters.items() if name not in keys]
        run.__signature__ = signature.replace(parameters=kept)  # type: ignore[attr-defined]
        return run

    return decorate

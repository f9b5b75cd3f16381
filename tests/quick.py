"""Cases of a test of which some run in CI and the others with the slow tests."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def quick(cases: Iterable[Any], kept: Collection[Any]) -> list[Any]:
    """Return cases for `parametrize`; those that are not kept are slow."""
    cases = list(cases)
    assert set(kept) <= set(cases), "all that is kept must be a case"
    return [
        one if one in kept else pytest.param(*_values(one), marks=pytest.mark.slow) for one in cases
    ]


def _values(case: Any) -> tuple[Any, ...]:
    return case if isinstance(case, tuple) else (case,)

"""`worst` sees NaN wherever it stands, and does not call nothing a small error."""

from __future__ import annotations

import ast
import math
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from tests.worst import worst

ROOT = Path(__file__).parents[1]
#: Folders whose errors are folded, and compared.
FOLDERS = ("tests", "benchmarks", "docs")


def test_the_largest_of_numbers_and_arrays() -> None:
    assert worst(1.0, [[-3.0, 2.0]], np.float64(0.5)) == 3.0


@pytest.mark.parametrize(
    "errors", [(0.0, math.nan), (math.nan, 0.0), ([1.0, math.nan], 5.0), (), ([],)]
)
def test_nan_and_nothing_are_no_small_error(errors: tuple[ArrayLike, ...]) -> None:
    found = worst(*errors)
    assert math.isnan(found)
    assert not found < 1.0


def blind_folds(source: str) -> list[int]:
    """Return the lines of ``x = max(x, ...)`` and ``assert max(...) < bound``, which drop NaN."""
    if not re.search(r"(=|assert) max\(", source):
        return []
    lines = []
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Assign(targets=[target], value=ast.Call(func=ast.Name("max"), args=args)):
                names = {ast.unparse(arg) for arg in args}
                folded = ast.unparse(target) in names
            case ast.Assert(
                test=ast.Compare(
                    left=ast.Call(func=ast.Name("max")),
                    ops=[ast.Lt() | ast.LtE()],
                    comparators=[bound],
                )
            ):  # counts are compared with whole numbers
                folded = not (isinstance(bound, ast.Constant) and isinstance(bound.value, int))
            case _:
                folded = False
        if folded:
            lines.append(node.lineno)
    return lines


def test_such_folds_are_found() -> None:
    for source in ("x = max(x, e)", "x[0] = max(e, x[0])", "assert max(e, f) < 1e-9"):
        assert blind_folds(source) == [1]
    for source in ("y = max(x, 1.0)", "assert max(e) > 3.0", "assert max(n) <= 3"):
        assert blind_folds(source) == []


def test_no_error_is_folded_by_the_built_in_max() -> None:
    files = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
    found = {str(path.relative_to(ROOT)): blind_folds(path.read_text("utf-8")) for path in files}
    assert {path: lines for path, lines in found.items() if lines} == {}


def test_nan_on_both_sides_is_no_agreement() -> None:
    with pytest.raises(AssertionError):
        np.testing.assert_allclose([1.0, math.nan], [1.0, math.nan])
    np.testing.assert_allclose([1.0, math.nan], [1.0, math.nan], equal_nan=True)

"""Tables of cases in one test: every case is run, and a failing one is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.each import each

SEEN: list[tuple[int, int]] = []


@each("one", [1, 2])
@each(("other", "third"), [(3, 4), pytest.param(5, 6, id="five")])
def test_every_combination_is_run(one: int, other: int, third: int, tmp_path: Path) -> None:
    assert tmp_path.is_dir()
    assert third == other + 1
    SEEN.append((one, other))


def test_none_is_left_out() -> None:
    SEEN.clear()
    test_every_combination_is_run(tmp_path=Path())
    assert SEEN == [(1, 3), (1, 5), (2, 3), (2, 5)]


def test_cases_of_one_argument_are_what_is_listed() -> None:
    """Also those with an id, tuples, and mappings, whose `values` is a method."""
    seen: list[object] = []

    @each("one", [1, pytest.param(2, id="two"), (3, 4), {"five": 6}])
    def note(one: object) -> None:
        seen.append(one)

    note()
    assert seen == [1, 2, (3, 4), {"five": 6}]


def test_a_failing_case_is_named() -> None:
    @each("number", [1, 2, 3])
    def smaller(number: int) -> None:
        assert number < 2

    with pytest.raises(AssertionError) as caught:
        smaller()
    assert caught.value.__notes__ == ["with {'number': 2}"]

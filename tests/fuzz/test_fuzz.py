"""Hostile inputs load and give finite answers, or are refused in words: the short fixed run."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("mujoco")

from tests.fuzz.case import FINDING, LOADED, REFUSED, Case
from tests.fuzz.formats import FORMATS, case
from tests.fuzz.workers import outcomes

SEEDS = Path(__file__).parent / "seeds"
#: Mutants of each format.
CASES = {"URDF": 30, "MJCF": 30, "command": 12, "scenario": 40}
FIRST = 1_000_000
_USUAL = 60


@pytest.mark.parametrize("name", FORMATS)
def test_mutants_load_or_are_refused_in_words(name: str) -> None:
    numbers = range(FIRST, FIRST + CASES.get(name, _USUAL))
    found = {number: outcome for (_, number), outcome in outcomes([(name, n) for n in numbers])}
    assert {n: one for n, one in found.items() if one.kind == FINDING} == {}
    assert {one.kind for one in found.values()} >= {LOADED, REFUSED}


def test_what_was_found_once_stays_mended() -> None:
    seeds = {path.name: Case.from_json(path.read_text("utf-8")) for path in SEEDS.glob("*.json")}
    found = zip(seeds, outcomes(list(seeds.values())), strict=True)
    assert {name: one for name, (_, one) in found if one.kind == FINDING} == {}


def test_a_mutant_is_the_same_each_time() -> None:
    for name in FORMATS:
        if name != "workspace":  # HDF5 writes times
            assert case(name, 7) == case(name, 7), name

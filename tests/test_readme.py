"""The README's Python runs, and prints what the README shows."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def test_the_python_blocks_run_in_order_and_print_what_is_shown(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {}
    exec(BLOCKS[0], names)
    printed = capsys.readouterr().out
    assert "N" in printed
    for line in printed.splitlines():
        assert f"    {line}\n" in README
    for block in BLOCKS[1:]:
        exec(block, names)
    assert len(names["modes"].pose) >= 2
    four_bar, motion = names["four_bar"], names["motion"]
    assert four_bar.describe().mobility == 1
    assert np.isfinite(names["tau"]).all()
    assert motion.gap.max() <= 1e-12
    assert names["A"].shape == (6, 6)


def test_the_first_block_is_ten_lines() -> None:
    assert len(BLOCKS[0].strip().splitlines()) == 10


def test_it_opens_with_a_film_of_at_most_two_megabytes() -> None:
    first = re.search(r"!\[[^\]]*\]\(([^)]+)\)", README)
    assert first is not None and first.start() < README.index("```python")
    film = ROOT / first[1]
    assert film.stat().st_size <= 2_000_000
    with Image.open(film) as opened:
        assert opened.n_frames > 20


def test_the_files_it_names_exist() -> None:
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / target).is_file(), target


def test_it_goes_from_the_film_by_ten_lines_and_two_commands_to_who_should_use_it() -> None:
    pip, command, who = "\n    pip install", "\n    rps-pin ", "\n## Who should use it"
    parts = ["![", "```python", pip, command, who, "\n## Speed"]
    places = [README.index(part) for part in parts]
    assert places == sorted(places)


def test_speeds_are_those_of_the_benchmark(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs")
    monkeypatch.delitem(sys.modules, "update_readme", raising=False)
    update_readme = importlib.import_module("update_readme")
    table = update_readme.speeds()
    assert table in README
    inverse = update_readme.measured("inverse dynamics (us)")["3-RPS"]
    assert table.splitlines()[2].startswith(
        f"| inverse dynamics, generated code | {inverse['generated']} | "
    )

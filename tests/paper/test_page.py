"""The page: every table has its rows, every template field is filled, and the committed one."""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest

from rps_pin.paper import paper_data as paper
from rps_pin.paper import tables
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.figures import pictures
from rps_pin.paper.misprints import Misprint
from rps_pin.paper.page import closest_interpretation, equation_status, render, summary_lines
from rps_pin.paper.tables import between, error, markdown
from tests.paper.markdown_rows import rows, section

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reproduction.md"


@pytest.fixture(scope="module")
def page(found: Reproduction) -> str:
    return render(found)


def test_every_equation_has_its_line_and_none_fails(page: str, found: Reproduction) -> None:
    status = equation_status(found)
    assert list(status) == list(range(1, 30))
    assert {n for n, one in status.items() if one == "corrected"} == {5, 11, 12, 14, 16, 19, 29}
    assert not any("not" in one for one in status.values())
    lines = rows(section(page, "Equations"))[1:]
    assert [int(line[0]) for line in lines] == list(range(1, 30))
    for number, _, where, _, said in lines:
        assert said.startswith(status[int(number)])
        assert find_spec(f"rps_pin.{where.split()[0]}") is not None


def test_a_failing_equation_is_told(found: Reproduction) -> None:
    for bad in (1e-3, math.nan):
        broken = replace(found, checks=found.checks | {6: bad, "8 closed": bad})
        assert equation_status(broken)[6] == equation_status(broken)[8] == "**not reproduced**"
    unsure = replace(found, misprints={n: Misprint(1.0, 0.5) for n in found.misprints})
    assert equation_status(unsure)[5] == "**not corrected**"
    assert rows(section(render(unsure), "Misprints"))[1][-1] == "**not confirmed**"
    assert (
        summary_lines(unsure)[1][0],
        summary_lines(unsure)[1][1][:13],
    ) == ("misprints not confirmed", "Eq. 5, Eq. 11")


def test_tables_have_their_rows(page: str, found: Reproduction) -> None:
    assert [row[0] for row in rows(section(page, "Misprints"))[1:]] == [
        f"Eq. {n}" for n in found.misprints
    ]
    assert len(rows(section(page, "Table 1 and the helix"))) == 1 + 11
    assert len(rows(tables.reach(found))) == 1 + len(found.reach)
    assert len(rows(tables.helix_ranges(found))) == 1 + 6
    agreement = rows(section(page, "Three ways to the forces"))
    assert agreement[0] == ["largest", "500 random states", "helix, branch +", "helix, branch -"]
    assert len(agreement) == 1 + 7
    table_2 = rows(section(page, "Table 2"))
    assert table_2[0] == list(tables.FORCES)
    assert table_2[1][1:] == ["-329", "11", "-422", "509", "95", "426"]
    assert table_2[2][1:] == ["-305", "6", "-382", "438", "78", "369"]
    assert len(rows(section(page, "Interpretations of Table 1"))) == 1 + 9
    assert len(rows(tables.probes(found))) == 1 + len(found.probes)
    assert len(rows(tables.sampled(found))) == 1 + len(found.sampled)
    assert len(rows(tables.fits(found))) == 1 + 2 * 4
    assert len(rows(tables.moved(found))) == 1 + 1 + 4


def test_the_fates_of_paths_add_up(found: Reproduction) -> None:
    regular = 0
    for row in rows(tables.paths(found))[1:]:
        _, _, _, count, out, singular, *_ = row
        regular += int(count) - int(out) - int(singular)
    assert regular == sum(not path.refused for path in found.paths)


def test_differences_are_differences(found: Reproduction) -> None:
    best = closest_interpretation(found)
    _, interpretation, less_paper, less_sokolov = rows(tables.differences(best))
    assert interpretation[0] == "the interpretation"
    for row, table in ((less_paper, paper.THIS_STUDY), (less_sokolov, paper.SOKOLOV)):
        for text, ours, theirs in zip(
            row[1:7], best.relabelled.numbers(), table.numbers(), strict=True
        ):
            assert float(text) == pytest.approx(ours - theirs, abs=0.051)


def test_the_csv_has_every_reading(found: Reproduction) -> None:
    lines = list(csv.DictReader(io.StringIO(tables.interpretations_csv(found))))
    refused = [path for path in found.paths if path.refused]
    assert len(lines) == len(found.comparisons) + len(refused)
    choice = ("z_0", "r_h_p_h", "g_h", "branch", "eq_5", "eq_29", "bodies", "gravity", "eq_14")
    assert len({tuple(line[name] for name in choice) for line in lines}) == len(lines)
    distances = [float(line["distance"]) for line in lines if line["distance"]]
    assert distances == sorted(distances)
    for line in lines:
        assert None not in line
        assert bool(line["refused"]) is not bool(line["distance"])


def test_the_page_is_whole(page: str, found: Reproduction) -> None:
    assert not re.search(r"[${}]", page)
    for bad in ("nan", "None", "inf "):
        assert not re.search(rf"\b{bad}\b", page), bad
    shown = set(re.findall(r"\]\(reproduction/(\w+)\.png\)", page))
    assert shown == set(pictures(found))
    assert "This is a quick run" in page


def test_errors_are_bounds() -> None:
    for value in (0.0, 1e-16, 3e-13, 2e-9, 4e-7, 9e-4):
        bound = float(error(value).removeprefix("< "))
        assert value < bound <= max(1e-12, 31 * value)
    assert error(0.072) == "0.072"
    assert error(math.nan) == "nan"
    assert between([0.002, 0.001]) == "1.000 to 2.000"
    assert markdown(["a", "b"], [["1", "2"]]) == "| a | b |\n| --- | --- |\n| 1 | 2 |"


# The committed page -------------------------------------------------------------------------------


def prose(text: str) -> list[str]:
    """Return the lines that are no tables, without their numbers."""
    lines = [line for line in text.splitlines() if not line.startswith("|")]
    return [
        re.sub(r"[-+]?\d[\d,.]*(e-?\d+)?", "#", line) for line in lines if "quick run" not in line
    ]


def test_the_committed_page_is_this_template_s(page: str) -> None:
    committed = PAGE.read_text("utf-8")
    assert "quick run" not in committed
    assert [x for x in prose(committed) if x] == [x for x in prose(page) if x]


def bounds(text: str) -> tuple[str, list[int]]:
    """Return a text without its bounds of rounding errors, and their exponents."""
    pattern = r"< 1e-(\d+)"
    return re.sub(pattern, "<", text), [int(power) for power in re.findall(pattern, text)]


def test_cheap_numbers_of_the_committed_page_are_today_s(page: str) -> None:
    """Bounds of rounding errors within a power of ten, which is what machines differ by."""
    committed = PAGE.read_text("utf-8")
    cheap = ("Misprints", "Table 1 and the helix", "Table 2", "Interpretations of Table 1")
    for heading in cheap:
        today, rounding = bounds(section(page, heading))
        then, rounding_then = bounds(section(committed, heading))
        assert today == then
        assert all(abs(a - b) <= 1 for a, b in zip(rounding, rounding_then, strict=True))
    for line in section(page, "What the paper states").splitlines():
        if "random legs" not in line and "volume" not in line:
            assert line in committed


def test_the_committed_pictures_and_readings_are_there_and_small() -> None:
    folder = PAGE.with_suffix("")
    shown = re.findall(r"\]\((reproduction/\w+\.\w+)\)", PAGE.read_text("utf-8"))
    assert {path.name for path in folder.iterdir()} == {Path(name).name for name in shown}
    assert sum(path.stat().st_size for path in folder.glob("*.png")) < 1_300_000  # of 200 dpi
    with (folder / "interpretations.csv").open() as file:
        lines = list(csv.DictReader(file))
    refused = sum(bool(line["refused"]) for line in lines)
    assert len(lines) == 24 * (384 - refused) + refused

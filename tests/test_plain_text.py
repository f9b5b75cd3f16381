"""Names of others have no effect where they are printed or drawn."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

from rps_pin.plain_text import for_figure, plain


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("leg_1 (rad)", "leg_1 (rad)"),
        ("Kurbel äöü 腕", "Kurbel äöü 腕"),
        ("two\nlines\tand a tab", "two\nlines\tand a tab"),
        ("\x1b]0;title\x07\x1b[31mred", "\\x1b]0;title\\x07\\x1b[31mred"),
        ("\x9b31m", "\\x9b31m"),  # the same in one character
        ("over\rwritten\x08", "over\\rwritten\\x08"),
        ("\u202egpj.exe", "\\u202egpj.exe"),  # shown as exe.jpg
        ("\ud800", "\\ud800"),
        ("\u2028", "\\u2028"),
        ("\U000e0041", "\\U000e0041"),
    ],
)
def test_control_characters_are_written_as_escapes(name: str, shown: str) -> None:
    assert plain(name) == shown
    plain(name).encode()
    assert plain(plain(name)) == shown


@pytest.mark.parametrize("name", ["cost $x_$", "$", "$a$", "a_$\\frac$b", "\x1b[31m$x$"])
def test_a_figure_shows_names_letter_by_letter(name: str) -> None:
    figure = Figure()
    text = figure.text(0.5, 0.5, for_figure(name))
    figure.savefig("/dev/null", format="svg")  # a formula that is none would fail
    drawn, is_formula = text._preprocess_math(text.get_text())  # type: ignore[attr-defined]
    assert not is_formula
    assert drawn == plain(name)

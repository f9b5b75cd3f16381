"""Tables in files: the usual dialects are read, every other one is refused with its line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from numpy.testing import assert_array_equal

from rps_pin import InputError
from rps_pin.trajectories import csv_file
from rps_pin.trajectories.csv_file import read_csv
from tests.each import each
from tests.trajectories.csv_files import HEADER, SI, good_lines, read, refuse


@each(
    "change",
    [
        lambda text: "\ufeff" + text,
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace(",", ";"),
        lambda text: text.replace(",", "\t"),
        lambda text: text.replace(",", " , "),
        lambda text: text.rstrip("\n"),
        lambda text: "# by hand\n\n" + text.replace("\n", "\n\n  # between\n") + "\n\n",
        lambda text: text.replace(HEADER, '"time_s","z_m","tilt_x_rad","tilt_y_rad"'),
        lambda text: "\n".join(
            ",".join(f'"{cell}"' for cell in line.split(",")) for line in text.split("\n") if line
        ),
    ],
    ids=["mark", "crlf", "semicolons", "tabs", "spaces", "no newline", "comments", "names", "all"],
)
def test_the_usual_dialects_are_read(tmp_path: Path, change: Any) -> None:
    text = "\n".join(good_lines()) + "\n"
    expected, found = read(tmp_path, text), read(tmp_path, change(text))
    assert_array_equal(found.times, expected.times)
    assert_array_equal(found.poses, expected.poses)


@each(
    ("line", "words"),
    [
        ("0.5,,0.1,0.1", "z_m is empty"),
        ("0.5,0.1,0.1,", "tilt_y_rad is empty"),
        ("0.5,0.1,0.1,   ", "tilt_y_rad is empty"),
        ("0.5,0.1,0.1", "3 cells, where the header names 4 columns"),
        ("0.5,0.1,0.1,0.1,0.1", "5 cells, where the header names 4 columns"),
        ("0.5,0.1,0.1,0.1,", "5 cells, where the header names 4 columns$"),
        ("0,5,0,1,0,1,0,1", "8 cells.*written with a point"),
        ('0.5,"0,1",0.1,0.1', "z_m = '0,1': it must be a number.*with a point"),
        ('0.5,"0.1,0.1,0.1', "unexpected end of data"),
        ("0.5,0.1,high,0.1", "tilt_x_rad = 'high': it must be a number"),
        ("0.5,0.1,1_0,0.1", "tilt_x_rad = '1_0': it must be a number"),
        ("0.5,0.1,0x1p-3,0.1", "tilt_x_rad = '0x1p-3': it must be a number"),
        ("0.5,0.1,0.1 # note,0.1", "tilt_x_rad = '0.1 # note': it must be a number"),
        ("0.5;0.1;0.1;0.1", "1 cell, where"),
        (HEADER, "time_s = 'time_s': it must be a number"),
        ("0.5,nan,0.1,0.1", "z_m = nan: it must be finite"),
        ("0.5,0.1,-inf,0.1", "tilt_x_rad = -inf: it must be finite"),
        ("0.5,0.1,1e999,0.1", "tilt_x_rad = inf: it must be finite"),
        ("0.4,0.1,0.1,0.1", "time_s = 0.4 after 0.4: times must increase"),
        ("0.3,0.1,0.1,0.1", "time_s = 0.3 after 0.4: times must increase"),
        ("0.5,0.1,6.5,0.1", "tilt_x_rad = 6.5: .* 6.283 rad; is it in degrees.* tilt_x_deg"),
        ("0.5,0.1,0.1,-57", "tilt_y_rad = -57: .* 6.283 rad; is it in degrees.* tilt_y_deg"),
        ("0.5,223,0.1,0.1", "z_m = 223: .* 100 m; is it in millimetres.* z_mm"),
    ],
)
@each("comments", [False, True])
def test_a_bad_row_is_told_with_its_line(
    tmp_path: Path, line: str, words: str, comments: bool
) -> None:
    lines = good_lines()
    lines[6] = line
    number = 7
    if comments:
        lines[3:3] = ["", "# by hand", "   "]
        number = 10
    refuse(tmp_path, "\n".join(lines), number, words)


@each(
    ("content", "line", "words"),
    [
        ("", None, "is empty"),
        ("# nothing\n\n", None, "is empty"),
        (HEADER + "\n", 1, "ends after no samples; 2 or more"),
        ("\n" + HEADER + "\n\n# none\n", 2, "ends after no samples; 2 or more"),
        ("\n".join(good_lines(1)), 2, "ends after 1 sample; 2 or more"),
        (",".join(["time_s", *SI]) + "\n0" + 9 * ",0", 2, "ends after 1 sample; 2 or more"),
        ("\n".join(good_lines()).encode("utf-16"), 1, "not a UTF-8 text .byte 0xff"),
        (
            "\n".join([*good_lines(), "# 5\xb0"]).encode("latin-1"),
            14,
            "not a UTF-8 text .byte 0xb0",
        ),
        (b"\x00" * 1000, 1, "is not known"),
    ],
)
def test_a_file_that_is_no_table_is_refused(
    tmp_path: Path, content: str | bytes, line: int | None, words: str
) -> None:
    refuse(tmp_path, content, line, words)


def test_free_ends_need_six_samples(tmp_path: Path) -> None:
    text = "\n".join(good_lines(5))
    refuse(tmp_path, text, 6, "ends after 5 samples; 6 or more", ends="free")
    assert len(read(tmp_path, text).times) == 5


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read the .*none.csv: No such file"):
        read_csv(tmp_path / "none.csv")
    with pytest.raises(InputError, match=r"cannot read the .*: Is a directory"):
        read_csv(tmp_path)
    with pytest.raises(InputError, match=r"cannot read the .*: embedded null"):
        read_csv("a\0b.csv")
    with pytest.raises(InputError, match="given by its path, not by 3"):
        read_csv(3)  # type: ignore[arg-type]


def test_huge_files_are_refused_before_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(csv_file, "MOST_LINES", 10)
    refuse(tmp_path, "\n".join(good_lines()), None, "has more than 10 lines")
    refuse(tmp_path, 11 * "#\n", None, "has more than 10 lines")
    assert len(read(tmp_path, "\n".join(good_lines(9))).times) == 9
    with pytest.raises(InputError, match="it is a device, not a regular file"):
        read_csv("/dev/zero")
    refuse(tmp_path, good_lines()[0] + "\n0.0," + 100_000 * " ", 2, "more than 100000 bytes")

"""YAML files are data: read safely, bounded, with lines for messages."""

from __future__ import annotations

import math
import time
from pathlib import Path

import pytest
from pydantic import Field

from rps_pin.bounds import YAML
from rps_pin.config import (
    Entry,
    Faults,
    Finite,
    Positive,
    Text,
    Three,
    read_config,
    read_yaml,
)
from rps_pin.errors import InputError, MechanismError
from tests.each import each


def held(folder: Path, content: str | bytes) -> Path:
    file = folder / "given.yaml"
    if isinstance(content, bytes):
        file.write_bytes(content)
    else:
        file.write_text(content, "utf-8")
    return file


def test_values_and_their_lines(tmp_path: Path) -> None:
    file = read_yaml(
        held(tmp_path, "a: 1\nb:\n  - x: 2\n    y: [1, 2]\n  - {x: 3}\nc: &v [4]\nd: *v\n"), "file"
    )
    assert file.values == {"a": 1, "b": [{"x": 2, "y": [1, 2]}, {"x": 3}], "c": [4], "d": [4]}
    lines = {
        ("a",): 1,
        ("b",): 2,
        ("b", 0): 3,
        ("b", 0, "y"): 4,
        ("b", 0, "y", 1): 4,
        ("b", 1, "x"): 5,
        ("b", 1, "none"): 5,  # what is not there is told by what is around
        ("b", 7): 2,
        ("c",): 6,
        ("d",): 7,
    }
    for path, line in lines.items():
        assert file.place(path) == f"{tmp_path / 'given.yaml'}, line {line}"
    assert file.place(()) == str(tmp_path / "given.yaml")


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    assert read_yaml(held(tmp_path, "\ufeffa: 1\n"), "file").values == {"a": 1}


def test_numbers_of_yaml(tmp_path: Path) -> None:
    text = "a: [1, -2, +3, 017, 0o17, 0x1F, 1e3, 1.E-3, .5, -.5e+1, .inf, -.Inf]"
    given = [1, -2, 3, 17, 15, 31, 1e3, 1e-3, 0.5, -5.0, math.inf, -math.inf]
    assert read_yaml(held(tmp_path, text), "file").values["a"] == given


@each(
    ("content", "why"),
    [
        ("", "must hold 'key: value' lines; it holds nothing"),
        ("# only a comment\n", "it holds nothing"),
        ("- a\n- b\n", "it holds a list"),
        ("word\n", "it holds a str"),
        ("a: 1\nb: [1\n", "line 3: not valid YAML"),
        ("a: 1\nb: 2\na: 3\n", "line 3: not valid YAML: .*found duplicate key"),
        ("a: 1\n2: 3\n", "line 2: the key '2' must be text"),
        ("a: 1\n? [1, 2]\n: 3\n", "line 2: a key must be text"),
        ("a:\n  [[[]]]: 1\n", "line 2: a key must be text"),
        (
            "a: 1\nb: !!python/object/apply:os.getcwd []\n",
            "line 2: not valid YAML: the tag .* is not read",
        ),
        ("a: !!python/name:os.system\n", "line 1: not valid YAML"),
        ("a: *nowhere\n", "line 1: not valid YAML: found undefined alias"),
        ("a: 1\n---\nb: 2\n", "line 2: not valid YAML: .*but found another document"),
        ("a: \x07\n", "not valid YAML"),
        (b"\xff\xfe\x00\x01", "cannot read the file .*: not a UTF-8 text"),
        (b"\x7fELF\x02\x01\x01\x00\x00", "is not a file but a program or library"),
        ("a: !!float word\n", "line 1: not valid YAML: 'word' is not a number of YAML"),
        ("!!omap\n- a: 1\n", "line 1: not valid YAML: the tag !!omap is not read"),
        ("a: 1\nb: !!bool 'x'\n", "line 2: not valid YAML: 'x' is neither true nor false"),
        ("a: !!map [1]\n", "line 1: not valid YAML: this is no map"),
        ("a: !!seq {b: 1}\n", "line 1: not valid YAML: this is no seq"),
        ("a: !!int [1]\n", "line 1: not valid YAML: this is no int"),
        ("a: !!seq b\n", "line 1: not valid YAML: this is no seq"),
        ("a: 1\nb: 0x" + "f" * 5000, "line 2: not valid YAML: a number of 5002 digits is too long"),
        ("a: " + "9" * 5000, "line 1: not valid YAML: a number of 5000 digits is too long"),
        ('a: 1\nb: "k\\ud800"\n', "line 2: not valid YAML: .* has half a character"),
        ('a: 1\n"k\\udfff": 1\n', "line 2: not valid YAML: .* has half a character"),
        ("a: 1_000\n", "line 1: not valid YAML: '1_000' is not a number of YAML"),
        ("a: [1, 1_0.5]\n", "line 1: not valid YAML: '1_0.5' is not a number of YAML"),
        ("a: 0x1_0\n", "line 1: not valid YAML: '0x1_0' is not a number of YAML"),
        ("a: 0b11\n", "line 1: not valid YAML: '0b11' is not a number of YAML"),
        ("a: !!timestamp 2020-99-99\n", "not valid YAML"),
    ],
)
def test_what_is_no_mapping_is_refused(content: str | bytes, why: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=why) as caught:
        read_yaml(held(tmp_path, content), "file")
    assert "\n" not in str(caught.value)
    assert "given.yaml" in str(caught.value)


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read the file .*none\.yaml: No such file"):
        read_yaml(tmp_path / "none.yaml", "file")
    with pytest.raises(InputError, match=r"cannot read the file .*directory"):
        read_yaml(tmp_path, "file")
    with pytest.raises(InputError, match="given by its path, not by 3"):
        read_yaml(3, "file")
    with pytest.raises(InputError, match="cannot read"):
        read_yaml("a\0b", "file")


def bomb(levels: int) -> str:
    """Ten of ten of ten ...: each list names the one before ten times."""
    lines = ["a0: &a0 [ha, ha, ha, ha, ha, ha, ha, ha, ha, ha]"]
    for level in range(1, levels):
        lines.append(f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * 10)}]")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (bomb(40), "would expand to more than"),
        ("a: &a [*a]\n", "would expand to more than"),
        ("a: &a\n  b: *a\n", "would expand to more than"),
        ("a: " + "[" * 50_000, "nested too deeply"),
        ("a: " + "{b: " * 20_000, "nested too deeply"),
        ("a: " + "- " * 50_000, "not valid YAML"),
        ("x" * (YAML + 1), f"more than {YAML} bytes.*RPS_PIN_BOUNDS=10"),
    ],
    ids=["bomb", "list in itself", "mapping in itself", "lists", "mappings", "dashes", "long"],
)
def test_huge_things_are_refused_at_once(content: str, why: str, tmp_path: Path) -> None:
    start = time.perf_counter()
    with pytest.raises(InputError, match=why):
        read_yaml(held(tmp_path, content), "file")
    assert time.perf_counter() - start < 60


def test_a_file_without_an_end_is_refused() -> None:
    if not Path("/dev/zero").exists():
        pytest.skip("this system has no endless file")
    with pytest.raises(InputError, match="it is a device, not a regular file"):
        read_yaml("/dev/zero", "file")


def test_modest_aliases_and_merges_are_read(tmp_path: Path) -> None:
    text = "base: &b {x: 1}\nmore: {<<: *b, y: 2}\n" + bomb(3)
    assert read_yaml(held(tmp_path, text), "file").values["more"] == {"x": 1, "y": 2}


class Inner(Entry):
    """A mapping in a list."""

    kind: Text
    size: Positive = 1.0


class Whole(Entry):
    """A schema of every way to nest."""

    name: Text
    parts: list[Inner] = Field(default_factory=list)
    best: Inner | None = None
    home: dict[str, Finite | Three] = Field(default_factory=dict)


WRONG = {
    "name: a\nnme: b\n": "line 2: unknown key 'nme' (did you mean name?); the keys of a test are: "
    "name, parts, best, home",
    "name: a\nparts:\n- kind: b\n  sze: 1\n": "line 4: unknown key 'sze' (did you mean size?); the "
    "keys of parts[0] are: kind, size",
    "name: a\nbest: {kind: b, colour: 1}\n": "line 2: unknown key 'colour'; the keys of best are: "
    "kind, size",
    "parts: []\n": "a test needs name",
    "name: a\nparts:\n- kind: b\n- {}\n": "line 4: parts[1] needs kind",
    "nam: a\n": "line 1: unknown key 'nam' (did you mean name?)",
    "name: a\nbest:\n  kind: b\n  size: -1\n": "line 4: best.size = -1: must be greater",
    "name: a\nbest:\n  kind: b\n  size: '1'\n": "line 4: best.size = '1': must be a valid",
    "name: a\nhome:\n  crank: .nan\n": "line 3: home.crank = nan: must be a finite number",
    "name: a\nhome:\n  ball: [0, 0]\n": "line 3: home.ball = [0, 0]: ",
    "name: ''\n": "line 1: name = '': ",
    "name: 3\n": "line 1: name = 3: must be a valid string",
}


@each("text", WRONG)
def test_every_schema_is_read_with_the_same_messages(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError) as caught:
        read_config(held(tmp_path, text), "test", Whole)
    assert str(caught.value).startswith(f"{tmp_path / 'given.yaml'}")
    assert WRONG[text] in str(caught.value)


def test_a_schema_s_values_are_as_given_with_their_lines(tmp_path: Path) -> None:
    text = "name: a\nparts: [{kind: b}]\nbest:\n  kind: c\n  size: 2\n"
    file, whole = read_config(held(tmp_path, text), "test", Whole)
    assert whole.parts[0].kind == "b"
    best = file.part("best")
    assert best.validated(Inner, "the best") == whole.best == Inner(kind="c", size=2.0)
    assert best.place(()) == f"{tmp_path / 'given.yaml'}, line 3"
    with pytest.raises(KeyError):
        file.part("worst")


def test_errors_are_told_with_their_place(tmp_path: Path) -> None:
    file = read_yaml(held(tmp_path, "a: 1\nb: [1, 2]\n"), "file")
    for kind in (InputError, MechanismError):
        with pytest.raises(kind, match=r"given.yaml, line 2: so"), file.at("b", 1):
            raise kind("so")
    with pytest.raises(ZeroDivisionError), file.at("b"):
        raise ZeroDivisionError


def test_all_that_is_wrong_is_told_at_once_each_value_once(tmp_path: Path) -> None:
    text = "nam: a\nparts:\n- {}\n- kind: 3\n  sze: 1\nbest: {kind: b, size: -1}\nhome:\n  b: [0]\n"
    with pytest.raises(InputError) as caught:
        read_config(held(tmp_path, text), "test", Whole)
    words = str(caught.value).split("; ")
    told = [one for one in words if not one.startswith("the keys of")]
    assert len(told) == 6, told
    assert told[0].startswith(f"{tmp_path / 'given.yaml'}, line 5: unknown key 'sze'")
    for line in (
        "line 1: unknown key 'nam' (did you mean name?)",  # and not that it lacks a name
        "line 3: parts[0] needs kind",
        "line 4: parts[1].kind = 3: ",
        "line 6: best.size = -1: ",
        "line 8: home.b = [0]: ",
    ):
        assert sum(one.startswith(line) for one in told) == 1, (line, told)


def test_errors_are_kept_to_be_told_at_once(tmp_path: Path) -> None:
    file = read_yaml(held(tmp_path, "a: 1\nb: [1, 2]\n"), "file")
    faults = Faults(file.origin)
    faults.tell()
    for place, kind in ((("b", 1), MechanismError), (("a",), InputError)):
        with faults, file.at(*place):
            raise kind("so")
    with pytest.raises(MechanismError, match=r"given.yaml, line 2: so; line 1: so$"):
        faults.tell()
    with pytest.raises(ZeroDivisionError), faults:
        raise ZeroDivisionError

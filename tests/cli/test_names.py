"""Names and paths of others are text: no codes for a terminal, no markup of Rich or Matplotlib."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rps_pin import ClosedLoopModel
from tests.cli.commands import rps_pin

MODELS = Path(__file__).parents[2] / "urdf"
NAMES = ["x[/]", "[bold]x[/bold]", "cost $x_$", "\x1b]0;title\x07\x1b[31mred", "\u202egpj", "a\\"]


def shown(name: str) -> str:
    return "".join(one if one.isprintable() else ascii(one)[1:-1] for one in name)


@pytest.mark.parametrize("name", NAMES)
def test_a_mechanism_s_name(tmp_path: Path, name: str) -> None:
    text = (MODELS / "four_bar.yaml").read_text("utf-8").splitlines()
    text = [f"name: {json.dumps(name)}" if one.startswith("name:") else one for one in text]
    (tmp_path / "m.yaml").write_text("\n".join(text), "utf-8")
    (tmp_path / "four_bar.urdf").write_bytes((MODELS / "four_bar.urdf").read_bytes())
    text = str(ClosedLoopModel.load(tmp_path / "m.yaml").describe())  # from Python, too
    assert text.startswith(f"{shown(name)}: ")
    for words in (("describe", "m.yaml"), ("simulate", "m.yaml", "--duration", "0.002")):
        ended = rps_pin(*words, folder=tmp_path)
        assert ended.returncode == 0, ended.stderr
        assert shown(name) in ended.stdout
        assert not {"\x1b", "\x07", "\u202e"} & {*ended.stdout, *ended.stderr}
    page = (tmp_path / "m-simulation" / "viewer.html").read_text("utf-8")
    assert "\x1b" not in page[: page.index("<script")]


@pytest.mark.parametrize("name", NAMES)
def test_a_folder_s_name(tmp_path: Path, name: str) -> None:
    folder = name.replace("/", "")
    for words in (("helix", "-r", "micro", "--rate", "5"), ("convert", "four_bar", "--to", "urdf")):
        ended = rps_pin(*words, "-o", folder, folder=tmp_path)
        assert ended.returncode == 0, ended.stderr
        assert shown(folder) in ended.stdout
        assert not {"\x1b", "\x07", "\u202e"} & {*ended.stdout, *ended.stderr}


def test_a_path_in_an_error(tmp_path: Path) -> None:
    ended = rps_pin("describe", "no\x1b[31m[/].yaml", folder=tmp_path)
    assert ended.returncode == 1
    assert "no\\x1b[31m[/].yaml" in ended.stderr
    assert "\x1b" not in ended.stderr

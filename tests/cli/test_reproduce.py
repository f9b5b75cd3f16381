"""``rps-pin reproduce``: it writes everything, the same each time, and nothing by halves."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

from rps_pin.cli.reproduce import reproduce_command
from rps_pin.paper import compute, write
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.figures import pictures
from rps_pin.paper.page import render
from rps_pin.paper.tables import interpretations_csv

app = typer.Typer()
app.command()(reproduce_command)


def test_a_quick_run_writes_everything_and_the_same_twice(
    tmp_path: Path, found: Reproduction
) -> None:
    run = CliRunner().invoke(app, ["--quick", "-o", str(tmp_path / "new" / "one")])
    assert run.exit_code == 0, run.output
    folder = tmp_path / "new" / "one"
    names = {f"{name}.png" for name in pictures(found)}
    assert {path.name for path in folder.iterdir()} == {"reproduction.md", "reproduction"}
    beside = folder / "reproduction"
    assert {path.name for path in beside.iterdir()} == names | {"interpretations.csv"}
    for name in names:
        with Image.open(beside / name) as picture:
            assert picture.format == "PNG"
            assert min(picture.size) > 200
            assert len(picture.convert("RGB").resize((64, 64)).getcolors(4096) or []) > 4
    for words in ("reproduction.md", "interpretations.csv", "figure_9.png", "closest to Table 2"):
        assert words in run.output

    assert (folder / "reproduction.md").read_text("utf-8") == render(found)
    assert (beside / "interpretations.csv").read_text("utf-8") == interpretations_csv(found)


def test_an_interrupted_computation_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(**_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(compute, "compute", interrupted)
    run = CliRunner().invoke(app, ["--quick", "-o", str(tmp_path / "out")])
    assert run.exit_code != 0
    assert not (tmp_path / "out").exists()


def test_an_interrupted_writing_leaves_no_half_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> str:
        raise KeyboardInterrupt

    (tmp_path / "reproduction.md").write_text("what stood there")
    monkeypatch.setattr(compute, "compute", lambda **_: None)
    monkeypatch.setattr(write, "write_figures", lambda *_: [])
    monkeypatch.setattr(write, "interpretations_csv", lambda _: "whole\n")
    monkeypatch.setattr(write, "render", interrupted)
    run = CliRunner().invoke(app, ["--quick", "--overwrite", "-o", str(tmp_path)])
    assert run.exit_code != 0
    assert (tmp_path / "reproduction.md").read_text() == "what stood there"
    left = {path.name for path in (tmp_path / "reproduction").iterdir()}
    assert left <= {"interpretations.csv"}

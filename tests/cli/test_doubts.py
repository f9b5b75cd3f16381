"""Notes of the commands on input that may be meant in another unit, and on large files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import RPSRobot, helix
from rps_pin.cli import console
from rps_pin.rps.dynamics.motion_csv import COLUMNS, motion_columns, write_csv
from rps_pin.rps.dynamics.motion_run import run_motion
from tests.cli.commands import rps_pin


@pytest.mark.parametrize(
    ("tilt", "doubted"), [(("63", "0"), True), (("0", "-3.2"), True), (("0.1", "0.5"), False)]
)
def test_tilts_beyond_half_a_turn_are_doubted(tilt: tuple[str, str], doubted: bool) -> None:
    said = rps_pin("ik", "--pose", "0.4", *tilt)
    assert ("more than half a turn" in said.stderr) == doubted
    if doubted:
        degrees = " ".join(f"{value:g}" for value in np.radians([float(one) for one in tilt]))
        assert f"degrees would be {degrees}" in said.stderr


@pytest.mark.parametrize(
    ("command", "doubted"),
    [
        (["ik", "--pose", "400", "0.1", "0"], "--pose: a height of 400 m? Lengths are in metres; "),
        (["ik", "--pose", "0.4", "0.1", "0"], ""),
        (["fk", "--lengths", "460", "460.5", "460"], "460 460.5 460 mm would be 0.46 0.4605 0.46"),
        (["fk", "--lengths", "0.46", "0.46", "0.46"], ""),
    ],
)
def test_lengths_in_millimetres_are_doubted(command: list[str], doubted: str) -> None:
    said = rps_pin(*command).stderr
    assert doubted in said
    assert ("Lengths are in metres" in said) == bool(doubted)


def test_the_size_of_a_table_is_told_in_advance(
    tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = RPSRobot.from_preset("sokolov")
    run = run_motion(robot, helix(robot, radius=0.02, pitch=0.01, height=0.4), 100.0)
    assert len(motion_columns(run)) == COLUMNS
    file = tmp_path_factory.mktemp("size") / "motion.csv"
    write_csv(file, run)
    per_number = file.stat().st_size / (run.time.size * COLUMNS)
    assert 0.7 * console.BYTES < per_number < 1.3 * console.BYTES
    console.tell_size("motion.csv", 1e5, COLUMNS)
    assert capsys.readouterr().err == ""
    console.tell_size("motion.csv", 1e7, COLUMNS)
    assert "motion.csv will have 1e+07 rows of 24 columns, about 4.8e+03 MB" in (
        capsys.readouterr().err
    )


def test_a_simulation_tells_the_size_of_its_table(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    said = rps_pin("simulate", "four_bar", "--duration", "0.1", folder=tmp_path)
    assert "simulation.csv will have" not in said.stderr
    monkeypatch.setattr(console, "LARGE", 1e3)
    said = rps_pin("simulate", "four_bar", "--duration", "0.1", folder=tmp_path)
    with next(tmp_path.rglob("simulation.csv")).open(encoding="utf-8") as file:
        columns = len(file.readline().split(","))
    assert f"simulation.csv will have 100 rows of {columns} columns" in said.stderr

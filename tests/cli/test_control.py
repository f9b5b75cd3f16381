"""``rps-pin control``: a scenario file in, a folder of results out, whatever happens between."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rps_pin import SingularityError
from rps_pin.cli import console
from rps_pin.cli.control import control_command
from rps_pin.control import Plant
from tests.cli.commands import rps_pin

SCENARIO = """robot: micro
trajectory: {kind: circle, height: 0.223, tilt: 0.05, duration: 0.4}
settle: 0.1
controller: {bandwidth: 15.0, integral: 0.2}
plant: {masses: 1.1, delay: 1, encoder_resolution: 5.0e-8}
faults: [{kind: nan, start: 0.3, duration: 0.0015, leg: 2}]
"""
FILES = {
    *("report.md", "loop.csv", "summary.json", "viewer.html"),
    *("tracking.png", "tracking.svg", "forces.png", "forces.svg"),
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("control")
    (folder / "weekday.yaml").write_text(SCENARIO)
    run = rps_pin("control", "weekday.yaml", "--json", folder=folder)
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    return folder / "weekday-control", run.stdout


def test_it_writes_everything(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    assert {path.name for path in folder.iterdir()} == FILES
    told = {Path(name).name for name in json.loads(printed)["files"]}
    assert told == FILES


def test_the_size_of_the_table_is_told_in_advance(
    finished: tuple[Path, str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with (finished[0] / "loop.csv").open(encoding="utf-8") as file:
        columns = len(file.readline().split(","))
    monkeypatch.setattr(console, "LARGE", 1e3)
    (tmp_path / "day.yaml").write_text(SCENARIO)
    said = rps_pin("control", "day.yaml", folder=tmp_path).stderr
    assert f"loop.csv will have 500 rows of {columns} columns, about 0.24 MB" in said


def test_the_table_holds_what_the_summary_says(finished: tuple[Path, str]) -> None:
    """Recomputed from the CSV alone."""
    folder, printed = finished
    table = np.genfromtxt(folder / "loop.csv", delimiter=",", names=True)
    assert table.size == 500
    np.testing.assert_allclose(np.diff(table["time_s"]), 1e-3, rtol=1e-9)
    summary = json.loads(printed)
    assert summary | {"scenario": 0, "files": 0} == {
        **json.loads((folder / "summary.json").read_text()),
        **{"scenario": 0, "files": 0},
    }
    here = table["time_s"] >= 0.1 - 1e-9
    force = np.stack([table[f"applied_{leg}_N"] for leg in (1, 2, 3)], axis=-1)[here]
    assert summary["ticks"] == here.sum()
    assert summary["force_peak"] == pytest.approx(np.abs(force).max(), rel=1e-9)
    rms = np.sqrt((force**2).mean(axis=0)).max()
    assert summary["force_rms"] == pytest.approx(rms, rel=1e-9)
    assert summary["minimum_type_ii"] == pytest.approx(table["type_ii"][here].min(), rel=1e-9)
    assert (
        summary["statuses"] == {"bad input": int((table["status"] == 1).sum())} == {"bad input": 2}
    )
    # The centre: h (1 - cos of the tilt) sideways, by the two tilts; Eq. 5, corrected.
    centre = {}
    for name in ("target", "pose"):
        z, x, y = (table[f"{name}_{one}"] for one in ("z_m", "tilt_x_rad", "tilt_y_rad"))
        size = np.hypot(x, y)
        bend = 0.12 / 2 * (1 - np.cos(size)) / size**2
        centre[name] = np.stack([bend * (x * x - y * y), -2 * bend * x * y, z], axis=-1)
    error = 1e6 * np.linalg.norm(centre["pose"] - centre["target"], axis=1)[here]
    assert summary["centre_rms"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-4)
    assert summary["centre_max"] == pytest.approx(error.max(), rel=1e-4)


def test_the_report_says_what_ran_and_what_came_of_it(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    text = (folder / "report.md").read_text()
    summary = json.loads(printed)
    for words in (
        *("# 3-RPS micro, weekday.yaml", "500 ticks of 1 ms", "masses 1.1", "bandwidth 15"),
        *("proportional: ", "gain", "phase", "nan of leg 2 from t = 0.3 s", "bad input"),
        f"| error of the centre | {summary['centre_rms']:.4g} |",
    ):
        assert words in text
    for picture in re.findall(r"\]\((\S+\.png)\)", text):
        assert (folder / picture).stat().st_size > 10_000


def test_mistakes_are_told_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text(SCENARIO.replace("bandwidth", "bandwith"))
    for name, words in (("bad.yaml", "unknown key 'bandwith'"), ("none.yaml", "cannot read")):
        run = rps_pin("control", name, folder=tmp_path)
        assert run.returncode == 1
        assert words in " ".join(run.stderr.split())
        assert "Traceback" not in run.stderr
    assert not list(tmp_path.glob("*-control"))


@pytest.mark.parametrize("error", [KeyboardInterrupt, SingularityError])
def test_what_was_run_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: type[BaseException]
) -> None:
    """Of Ctrl-C, and of a plant that cannot go on."""
    step = Plant.step

    def broken_later(self: Plant, forces: Any) -> None:
        if self.time > 0.2:
            raise error("enough", 1.0, 1.0) if error is SingularityError else error()
        step(self, forces)

    monkeypatch.setattr(Plant, "step", broken_later)
    (tmp_path / "long.yaml").write_text(SCENARIO)
    with pytest.raises(error):
        control_command(tmp_path / "long.yaml", tmp_path / "kept")
    assert {path.name for path in (tmp_path / "kept").iterdir()} == FILES
    table = np.genfromtxt(tmp_path / "kept" / "loop.csv", delimiter=",", names=True)
    assert table["time_s"][-1] == pytest.approx(0.2, abs=2e-3)


def test_nothing_is_written_where_nothing_was_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(self: Plant, forces: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Plant, "step", broken)
    (tmp_path / "long.yaml").write_text(SCENARIO)
    with pytest.raises(KeyboardInterrupt):
        control_command(tmp_path / "long.yaml", tmp_path / "kept")
    assert not (tmp_path / "kept").exists()

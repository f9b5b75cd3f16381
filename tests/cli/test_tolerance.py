"""``rps-pin tolerance``: files, what is printed, and what is refused."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from rps_pin import ClosedLoopModel
from rps_pin.task.tolerances import tolerance
from tests.cli.commands import rps_pin
from tests.worst import worst

SAMPLES = Path(__file__).parents[2] / "src" / "rps_pin" / "cli" / "samples"
DRAWING = SAMPLES / "drawing.yaml"


@pytest.fixture(autouse=True)
def _quick_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Figure, "savefig", lambda _, path, **options: path.write_text("<svg/>"))


def test_errors_over_a_grid(tmp_path: Path) -> None:
    words = ("tolerance", str(DRAWING), "-m", "five_bar", "--machines", "50", "--sobol", "8")
    grid = ("--over", "x=0.1:0.3:3", "--over", "z=0.5:0.6:3")
    ended = rps_pin(*words, *grid, "--json", folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    told = json.loads(ended.stdout)
    out = tmp_path / "tolerances"
    names = ["map.png", "map.svg", "poses.csv", "shares.png", "shares.svg", "sobol.csv"]
    assert sorted(one.name for one in out.iterdir()) == [*names, "tolerances.csv"]
    poses = np.genfromtxt(out / "poses.csv", delimiter=",", names=True)
    x = np.stack([poses["x_m"], poses["z_m"]], axis=-1)
    assert len(x) == told["poses"] == 9
    found = tolerance(ClosedLoopModel.load("urdf/five_bar.yaml"), DRAWING, x)
    assert worst(poses["z_three_sigma_m"] - 3 * found.deviations[:, 1]) < 1e-9 * 1e-3
    part = told["parts"]["position"]
    assert abs(part["three_sigma"] - 3 * found.rms("position")) < 1e-12
    assert abs(part["machines_over_first_order"] - 1) < 0.2
    with (out / "tolerances.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["number"] for row in rows} == set(found.labels)
    shares = {row["number"]: float(row["position_share_percent"]) for row in rows}
    assert worst([shares[name] - 100 * one for name, one in part["shares"].items()]) < 1e-6
    again = rps_pin(*words, *grid, folder=tmp_path)
    assert again.returncode == 1
    assert "exist; --overwrite replaces them" in again.stderr


def test_what_is_printed_and_refused(tmp_path: Path) -> None:
    words = ("tolerance", "drawing.yaml", "-m", "five_bar", "--machines", "50")
    drawing = tmp_path / "drawing.yaml"
    drawing.write_text(DRAWING.read_text().replace("[xz]", "?"))
    ended = rps_pin(*words, folder=tmp_path)
    assert ended.returncode == 1
    assert "placement:left_joint.y, " in ended.stderr
    assert "--leave-out" in ended.stderr
    ended = rps_pin(*words, "--leave-out", folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert "three sigma" in ended.stdout
    assert "closure:tips.b.x" in ended.stdout
    assert "they were left out" in ended.stdout
    assert "50 machines at random, position: " in ended.stdout
    drawing.write_text(DRAWING.read_text().replace("0.05 mm", "0.05 mn"))
    ended = rps_pin(*words, "--overwrite", folder=tmp_path)
    assert "error: drawing.yaml, line 5: " in ended.stderr
    for more, reason in (
        (("--path", "x.csv", "--over", "x=0:1:2"), "give either --path or --over"),
        (("--held", "x=0"), "--held is of a grid"),
    ):
        assert reason in rps_pin(*words, *more, folder=tmp_path).stderr

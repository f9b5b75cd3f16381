"""``rps-pin workspace --mechanism``: files, figures, numbers, and what it refuses."""

from __future__ import annotations

import csv
import json
import math
from contextvars import copy_context
from pathlib import Path

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from rps_pin import ClosedLoopModel
from rps_pin.cli import task_workspace
from rps_pin.cli.app import app
from rps_pin.cli.degrees import words_in_degrees
from rps_pin.task import Cone, Payload, certify
from rps_pin.task.design import RoundPart
from rps_pin.task.workspace import load_workspace, volume, workspace
from tests.cli.commands import rps_pin

FIVE_BAR = ("workspace", "-m", "five_bar", "--over", "x=-0.8:0.9:25", "--over", "z=-0.8:0.9:22")
STEWART = ("workspace", "-m", "stewart", "--degrees", "--over", "z=0.5:0.8:5")


def test_two_axes_make_a_file_and_a_map(tmp_path: Path) -> None:
    run = rps_pin(*FIVE_BAR, "--json", "-o", str(tmp_path))
    assert run.returncode == 0, run.stderr
    told = json.loads(run.stdout)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "map.png",
        "map.svg",
        "workspace.h5",
    ]
    found = load_workspace(tmp_path / "workspace.h5")
    assert told["inside"] == np.count_nonzero(found.inside) > 0
    assert told["volume"] == pytest.approx(volume(found).value)
    assert told["out"] == {k: n for k, n in found.counts().items() if n and k != "inside"}
    assert found.grid.over == ("x", "z")
    again = rps_pin(*FIVE_BAR, "-o", str(tmp_path))
    assert (again.returncode, "exist" in again.stderr) == (1, True)
    cone = ("--cone", "universe,left_arm_joint=1.0:x:x")
    text = rps_pin(*FIVE_BAR, *cone, "--overwrite", "-o", str(tmp_path)).stdout
    assert "of which inside" in text
    assert "universe, left_arm_joint cone above 1 rad" in " ".join(text.replace("│", " ").split())
    assert "beyond the end of the assembly mode" in text


def test_a_grid_in_blocks_gives_the_same_and_is_drawn_in_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = rps_pin(*FIVE_BAR, "--json", "-o", str(tmp_path / "whole"))
    run = rps_pin(*FIVE_BAR, "--resume", "--json", "-o", str(tmp_path / "blocks"))
    assert run.returncode == 0, run.stderr
    told, wanted = json.loads(run.stdout), json.loads(whole.stdout)
    assert told.pop("drawn_every") == 1
    assert [Path(one).name for one in told.pop("files")] == [
        Path(one).name for one in wanted.pop("files")
    ]
    least = "least_conditioning"  # by code for batches, or not yet
    assert told.pop(least) == pytest.approx(wanted.pop(least), rel=1e-12)
    assert told == wanted
    monkeypatch.setattr(task_workspace, "_LARGE", 500)
    monkeypatch.setattr(task_workspace, "_DRAWN", 100)
    run = rps_pin(*FIVE_BAR, "--json", "-o", str(tmp_path / "part"))
    told = json.loads(run.stdout)
    assert told["drawn_every"] == 3  # sqrt(550 / 100), rounded up
    assert {name: told[name] for name in ("points", "inside", "extents", "out")} == {
        name: wanted[name] for name in ("points", "inside", "extents", "out")
    }
    found = load_workspace(tmp_path / "part" / "workspace.h5")
    assert np.array_equal(found.reason, load_workspace(tmp_path / "whole" / "workspace.h5").reason)
    part = load_workspace(tmp_path / "part" / "workspace.h5", [slice(None, None, 3)] * 2)
    assert told["volume"] == pytest.approx(volume(part).value)
    text = rps_pin(*FIVE_BAR, "--overwrite", "-o", str(tmp_path / "part")).stdout
    assert "of one point in 3 along each axis" in text


def test_three_axes_in_degrees_make_slices_and_a_mesh(tmp_path: Path) -> None:
    more = ("--over", "rx=-30:30:6", "--over", "ry=-30:30:7", "--held", "rz=10", "--holding")
    run = rps_pin(*STEWART, *more, "--json", "-o", str(tmp_path))
    assert run.returncode == 0, run.stderr
    told, found = json.loads(run.stdout), load_workspace(tmp_path / "workspace.h5")
    assert told["volume_unit"] == "m deg^2"
    assert told["volume"] == pytest.approx(volume(found).value * math.degrees(1.0) ** 2)
    assert told["held"]["rz"] == pytest.approx(10.0)
    assert found.grid.held["rz"] == pytest.approx(math.radians(10.0))
    assert found.holding.shape == (5, 6, 7, 6)
    mesh = trimesh.load(tmp_path / "boundary.stl", force="mesh")
    assert mesh.volume == pytest.approx(volume(found).least, rel=1e-5)
    assert (tmp_path / "slices.png").exists()
    box = told["largest_box"]
    assert box["rx"][1] - box["rx"][0] <= 60.0


def test_loads_and_speeds_put_points_out_by_name(tmp_path: Path) -> None:
    load = ("--payload", "200", "--wrench", "900", "0", "0", "0", "0", "0", "--force", "900")
    more = (*load, "--over", "rx=-30:30:6", "--speed", "0.6", "--turning-speed", "60")
    run = rps_pin(*STEWART, *more, "--json", "-o", str(tmp_path))
    assert run.returncode == 0, run.stderr
    told, found = json.loads(run.stdout), load_workspace(tmp_path / "workspace.h5")
    assert told["out"]["leg_1_rod_joint force beyond 2000 N"] > 0
    assert told["least_speed_left"] == found.speed_left[found.inside].min() > 0
    assert told["least_force_left"] == found.force_left[found.inside].min() >= 0
    task = ClosedLoopModel.load("urdf/stewart.yaml").task
    same = workspace(
        task,
        found.grid,
        payload=Payload(200.0),
        wrench=[900, 0, 0, 0, 0, 0],
        force=900,
        speed=0.6,
        turning_speed=math.radians(60),
    )
    assert np.array_equal(same.reason, found.reason)
    words = rps_pin(*STEWART, *more, "--overwrite", "-o", str(tmp_path)).stdout
    assert "speed left inside" in words


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("workspace", "-m", "five_bar", "--over", "x=0:1:5"), "2 to 6"),
        (("workspace", "-m", "five_bar", "--over", "x=0:1"), "NAME=FROM:TO:POINTS"),
        (("workspace", "-m", "five_bar", "--over", "x=1:0:5"), "FROM must be below TO"),
        (("workspace", "-m", "five_bar", "--over", "x=0:nan:5"), "both finite"),
        (("workspace", "-m", "five_bar", "--over", "x=0:1:99999999"), "at most 1000000"),
        (("workspace", "-m", "five_bar", "--over", "x=0:1:5", "--over", "x=0:1:5"), "twice"),
        (("workspace", "-m", "five_bar", "--over", "x=0:1:5", "--over", "w=0:1:5"), "'w'"),
        (("workspace", "-m", "five_bar", "--points", "5"), "does not go with a mechanism"),
        (("workspace", "--payload", "1"), "needs a --mechanism"),
        (("workspace", "-m", "rps", "--payload-centre", "1", "0", "0"), "give its mass"),
        (("workspace", "--over", "x=0:1:5"), "needs a --mechanism"),
        (("workspace", "-m", "rps", "--over", "z=0:1:5", "--over", "w=0:1:5"), "'w'"),
    ],
)
def test_what_is_no_grid_is_refused(words, told: str, tmp_path: Path) -> None:
    run = rps_pin(*words, "-o", str(tmp_path / "out"), folder=tmp_path)
    assert run.returncode in (1, 2)
    assert told in " ".join(run.stderr.replace("│", " ").split())
    assert not (tmp_path / "out").exists()


def test_a_3_rps_keeps_its_own_and_nothing_inside_is_an_error(tmp_path: Path) -> None:
    assert rps_pin("new", "3rps", "-o", str(tmp_path)).returncode == 0
    (robot,) = [path for path in tmp_path.glob("*.yaml") if path.name != "path.yaml"]
    over = ("--over", "z=0.2:0.25:3", "--over", "rx=-0.1:0.1:3")
    run = rps_pin("workspace", "-m", str(robot), *over, folder=tmp_path)
    assert "a workspace of its own: --robot" in run.stderr
    most = ("--min-conditioning", "1")
    run = rps_pin(*FIVE_BAR, *most, "-o", str(tmp_path / "none"))
    assert "no point of the grid is inside the workspace" in run.stderr
    assert "singular" in run.stderr


def test_certified_boxes_of_a_mechanism_and_of_a_3_rps(tmp_path: Path) -> None:
    over = ("--over", "x=0.1:0.3:2", "--over", "z=0.2:0.6:2")
    words = ("workspace", "-m", "five_bar", "--certify", *over, "--most-boxes", "2000", "--json")
    run = rps_pin(*words, "-o", str(tmp_path / "one"))
    assert run.returncode == 0, run.stderr
    told = json.loads(run.stdout)
    found = certify(
        ClosedLoopModel.load("urdf/five_bar.yaml").task, (0.1, 0.2), (0.3, 0.6), most_boxes=2000
    )
    assert told["verdict"] == found.verdict
    assert list(told["shares"].values()) == [v / sum(found.volumes) for v in found.volumes]
    assert told["out"] == found.reason_shares()
    rows = list(csv.DictReader((tmp_path / "one" / "boxes.csv").read_text().splitlines()))
    for verdict in ("inside", "outside", "undecided"):
        boxes = [row for row in rows if row["verdict"] == verdict]
        assert told["boxes"][verdict] == len(boxes) == len(getattr(found, verdict))
        assert all((row["reasons"] != "") == (verdict == "outside") for row in boxes)
    sizes = [
        math.prod(float(r[f"{one}_most_m"]) - float(r[f"{one}_least_m"]) for one in "xz")
        for r in rows
    ]
    assert math.isclose(sum(sizes), 0.2 * 0.4, rel_tol=1e-9)
    tilts = ("--over", "rx=-6:6:2", "--over", "ry=-6:6:2", "--degrees")
    run = rps_pin(
        "workspace", "--certify", "--over", "z=0.22:0.23:2", *tilts, "-o", str(tmp_path / "rps")
    )
    assert run.returncode == 0, run.stderr
    assert "-6 to 6 deg" in run.stdout
    rows = list(csv.DictReader((tmp_path / "rps" / "boxes.csv").read_text().splitlines()))
    assert min(float(row["rx_least_deg"]) for row in rows) == pytest.approx(-6)
    assert "the whole box" in run.stdout


def test_cones_and_discs_of_certified_boxes(tmp_path: Path) -> None:
    """A tilt of at most 8 degrees in a disc of 10, which is the cone's own disc."""
    tilts = ("--over", "rx=-10:10:2", "--over", "ry=-10:10:2", "--degrees", "--most-boxes", "100")
    cut = ("--cone", "universe,platform=8:z:0,0,2", "--round", "rx,ry=10:0:0")
    words = ("workspace", "-m", "stewart", "--certify", *tilts, "--json")
    run = rps_pin(*words, *cut, "-o", str(tmp_path / "one"))
    assert run.returncode == 0, run.stderr
    told = json.loads(run.stdout)
    task = ClosedLoopModel.load("urdf/stewart.yaml").task
    low, high = task.home.copy(), task.home.copy()
    low[3:5], high[3:5] = -math.radians(10), math.radians(10)
    found = certify(
        task,
        low,
        high,
        cones=[Cone("universe", "platform", math.radians(8))],
        round=[RoundPart(["rx", "ry"], [0, 0], math.radians(10))],
        most_boxes=100,
    )
    assert told["out"] == {"universe, platform cone above 8 deg": 1.0}
    for verdict in ("inside", "outside", "undecided"):
        assert told["boxes"][verdict] == len(getattr(found, verdict))
    size, _, undecided = found.volumes
    assert size <= math.pi * math.radians(8) ** 2 <= size + undecided


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--cone", "universe,platform"), "must be FRAME,FRAME=ANGLE[:AXIS:AXIS]"),
        (("--cone", "universe,platform=8:u:z"), "must be FRAME,FRAME=ANGLE[:AXIS:AXIS]"),
        (("--cone", "universe,platform=8:z:0,1"), "must be FRAME,FRAME=ANGLE[:AXIS:AXIS]"),
        (("--cone", "universe,rain=8"), "no frame 'rain'"),
        (("--cone", "universe,platform=180"), "must be below pi"),
        (("--round", "rx=8"), "must be NAME,NAME[,NAME]=RADIUS"),
        (("--round", "rx,ry=8:0"), "must be NAME,NAME[,NAME]=RADIUS"),
        (("--round", "rx,ry=-8"), "the radius must be positive"),
        (("--round", "rx,rain=8"), "no coordinate 'rain'"),
        (("--round", "rx,z=8"), "lengths and angles have no common radius"),
        (("--round", "rx,ry=8:90:0"), "the centre (90, 0) deg of a round part is not in the box"),
    ],
)
def test_cones_and_discs_that_are_none(words: tuple[str, str], told: str, tmp_path: Path) -> None:
    """In this process: eleven starts of Python would be dear."""
    tilts = ["--over", "rx=-10:10:2", "--over", "ry=-10:10:2", "--degrees", "-o", str(tmp_path)]
    asked = ["workspace", "-m", "stewart", "--certify", *tilts, *words]
    run = copy_context().run(CliRunner().invoke, app, asked)
    assert run.exit_code != 0
    assert told in words_in_degrees(f"{run.output} {run.exception}")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--certify", "--points", "5"), "does not go with --certify"),
        (("--certify", "--cone", "a,b=1"), "needs a --mechanism"),
        (("-m", "five_bar", "--round", "x,z=1"), "needs --certify"),
        (("--certify", "-m", "five_bar", "--holding"), "does not go with --certify"),
        (("--certify", "--over", "z=0.2:0.3:2", "--over", "rx=0:0.1:2"), "--over of each"),
        (("--undecided", "0.1"), "needs --certify"),
        (("-m", "five_bar", "--most-boxes", "10"), "needs --certify"),
    ],
)
def test_what_does_not_go_with_certified_boxes(words, told: str, tmp_path: Path) -> None:
    run = rps_pin("workspace", *words, "-o", str(tmp_path / "out"), folder=tmp_path)
    assert run.returncode in (1, 2)
    assert told in " ".join(run.stderr.replace("│", " ").split())

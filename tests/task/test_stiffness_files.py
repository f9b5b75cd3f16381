"""Compliances from files, and maps of stiffness."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from rps_pin import ClosedLoopModel, ClosureError, InputError, Task
from rps_pin.cli.app import app
from rps_pin.plots import plot_stiffness_map
from rps_pin.task.stiffness import (
    Beam,
    Compliances,
    Material,
    Section,
    StiffnessMap,
    StiffnessModel,
    load_compliances,
    stiffness_map,
    write_map,
)

ROOT = Path(__file__).parents[2]
FILE = """
materials:
  steel: {young_modulus_Pa: 210.0e9, shear_modulus_Pa: 81.0e9}
sections:
  bar: {shape: rectangle, width_m: 0.03, height_m: 0.02}
  pipe: {shape: tube, outer_diameter_m: 0.03, inner_diameter_m: 0.026}
  own: {area_m2: 1.0e-4, second_moment_y_m4: 2.0e-8, second_moment_z_m4: 3.0e-8,
        torsion_constant_m4: 4.0e-8}
actuators:
  crank_joint: {stiffness_Nm_per_rad: 2.0e4}
joints:
  coupler_joint: {z_N_per_m: 1.0e8, x_N_per_m: 2.0e8, rx_Nm_per_rad: 1.0e5}
closures:
  knee: {y_N_per_m: 1.0e8}
beams:
  crank: {link: crank, start: crank_joint, end: coupler_joint, section: bar, material: steel,
          up: [0, 1, 0], segments: 2}
  coupler: {link: coupler, start: coupler_joint, end: knee, section: own, material: steel,
            up: [0, 1, 0]}
  rocker: {link: rocker, start: rocker_joint, end: knee, section: pipe, material: steel}
"""


@cache
def four_bar() -> Task:
    return ClosedLoopModel.load("urdf/four_bar.yaml").task


def written(folder: Path, text: str) -> Path:
    path = folder / "compliances.yaml"
    path.write_text(text, "utf-8")
    return path


def test_a_file_says_what_the_objects_say(tmp_path: Path) -> None:
    steel, up = Material(210e9, 81e9), [0, 1, 0]
    own = Section(1e-4, 2e-8, 3e-8, 4e-8)
    crank, pipe = Section.rectangle(0.03, 0.02), Section.tube(0.03, 0.026)
    expected = Compliances(
        {"crank_joint": 2e4},
        {"coupler_joint": {"x": 2e8, "z": 1e8, "rx": 1e5}},
        {"knee": {"y": 1e8}},
        {
            "crank": Beam("crank", "crank_joint", "coupler_joint", crank, steel, up, 2),
            "coupler": Beam("coupler", "coupler_joint", "knee", own, steel, up),
            "rocker": Beam("rocker", "rocker_joint", "knee", pipe, steel),
        },
    )
    q = four_bar().mechanism.home
    found = load_compliances(written(tmp_path, FILE), four_bar().mechanism)
    by_file, by_hand = (
        StiffnessModel(four_bar(), one, frame="coupler_tip") for one in (found, expected)
    )
    assert by_file.springs == by_hand.springs
    assert np.array_equal(by_file.stiffness, by_hand.stiffness)
    assert np.array_equal(by_file.deflection(q).compliance, by_hand.deflection(q).compliance)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("section: bar", "section: barr", r"line 16: no section 'barr'.*mean bar"),
        ("crank_joint: {stiffness_Nm_per_rad", "crank_joint: {stiffness_N_per_m", "turns: give"),
        ("width_m: 0.03, ", "", r"line 5: a section of shape rectangle needs width_m"),
        ("height_m: 0.02", "height_m: 0.02, area_m2: 1.0", r"line 5.* has no area_m2; it takes"),
        ("x_N_per_m: 2.0e8", "x_Nm_per_rad: 1", "unknown key 'x_Nm_per_rad'"),
        ("knee: {y_N_per_m: 1.0e8}", "knee: {}", "line 14: give the stiffness of at least one"),
        ("inner_diameter_m: 0.026", "inner_diameter_m: 0.04", "line 6: inner_diameter = 0.04"),
        ("section: own", "section: bar", "line 7: no beam has the section 'own'"),
        ("{link: coupler,", "{link: coupler, segments: 0,", "line 1[78]: segments"),
        ("rad: 2.0e4}", "rad: 2,0e4}", r"line 10: .*key 0.0 is no name; .* with a point, 0.5 and"),
        ("crank_joint: {stiff", "crank: {stiff", "line 10: no actuator 'crank'"),
    ],
)
def test_what_a_file_cannot_say_is_told_with_its_line(
    tmp_path: Path, old: str, new: str, match: str
) -> None:
    assert FILE.count(old) == 1
    path = written(tmp_path, FILE.replace(old, new))
    with pytest.raises(InputError, match=match):
        load_compliances(path, four_bar().mechanism)


def test_sections_have_the_constants_of_the_tables() -> None:
    """J / (a b^3) of rectangles in Timoshenko and Goodier's table; a tube by its integrals."""
    for ratio, share in ((1, 0.1406), (1.5, 0.196), (2, 0.229), (4, 0.281), (10, 0.312)):
        assert Section.rectangle(ratio, 1.0).torsion_constant / ratio == pytest.approx(
            share, abs=6e-4
        )
    tube = Section.tube(0.4, 0.2)
    r = np.linspace(0.1, 0.2, 200_001)
    assert tube.area == pytest.approx(np.trapezoid(2 * np.pi * r, r), rel=1e-9)
    assert tube.torsion_constant == pytest.approx(np.trapezoid(2 * np.pi * r**3, r), rel=1e-9)
    assert tube.second_moment_y == pytest.approx(tube.torsion_constant / 2)


def test_a_map_has_what_each_pose_has() -> None:
    """And NaN where the mechanism does not come."""
    task = ClosedLoopModel.load("urdf/five_bar.yaml").task
    drives = Compliances(actuators=dict.fromkeys(task.mechanism.actuated, 1e4))
    model = StiffnessModel(task, drives)
    x = task.home + np.array([[[0.0, 0.0], [0.02, 0.01]], [[-0.03, 0.01], [9.0, 0.0]]])
    load, seen = [0.0, 0.0, -5.0, 0.0, 0.0, 0.0], []

    def progress(poses: Iterable[int]) -> Iterable[int]:
        for pose in poses:
            seen.append(pose)
            yield pose

    found = stiffness_map(model, x, load, frequencies=2, progress=progress)
    assert seen == [0, 1, 2, 3]
    assert found.reached.tolist() == [[True, True], [True, False]]
    one = model.at(x[1, 0], load)
    assert np.array_equal(found.compliance[1, 0], one.compliance)
    assert np.array_equal(found.frequencies[1, 0], one.frequencies[:2])
    assert found.softest[1, 0] == pytest.approx(1 / np.linalg.eigvalsh(one.compliance[:3, :3])[-1])
    assert np.isnan(found.softest[1, 1])
    assert "3 of 4 poses" in found.summary()
    with pytest.raises(ClosureError):
        stiffness_map(model, x, load, errors="raise")


def test_the_command_prints_what_the_model_has(tmp_path: Path) -> None:
    path = written(tmp_path, FILE)
    load = ["0", "50", "-100", "0", "0", "1"]
    words = ["stiffness", str(path), "-m", "four_bar", "--frame", "coupler_tip", "--wrench", *load]
    run = CliRunner().invoke(app, [*words, "--json"])
    assert run.exit_code == 0, run.output
    told = json.loads(run.stdout)
    model = StiffnessModel(
        four_bar(), load_compliances(path, four_bar().mechanism), frame="coupler_tip"
    )
    found = model.deflection(four_bar().mechanism.home, [float(one) for one in load])
    assert told["displacement"] == pytest.approx(found.displacement.tolist())
    assert np.allclose(told["compliance"], found.compliance, rtol=1e-9, atol=0.0)
    knee = told["closures"]["knee"]
    assert list(knee.values()) == pytest.approx(found.closure_wrenches["knee"].tolist())
    finite = found.frequencies[np.isfinite(found.frequencies)]
    assert told["frequencies_Hz"] == pytest.approx(finite.tolist())
    table = CliRunner().invoke(app, words).stdout
    for name in (*found.output, "crank_joint", "knee", "Frequencies"):
        assert name in table


def test_the_command_writes_maps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A row for each pose, with what the model has there; empty where there is none."""
    monkeypatch.setattr(Figure, "savefig", lambda _, path, **options: path.write_text("<svg/>"))
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path, "actuators: {left_joint: {stiffness_Nm_per_rad: 2.0e3}}\n")
    words = ["stiffness", str(path), "-m", "five_bar", "--over", "z=0.5:0.9:3"]
    words += ["--over", "x=0.1:0.2:2", "--wrench", "1", "0", "2", "0", "0", "0"]
    run = CliRunner().invoke(app, [*words, "--json"])
    assert run.exit_code == 0, run.output
    told = json.loads(run.stdout)
    written_files = sorted(file.name for file in (tmp_path / "stiffness").iterdir())
    assert written_files == sorted(
        ["map.csv", "stiffness.png", "stiffness.svg", "frequency.png", "frequency.svg"]
    )
    assert sorted(Path(one).name for one in told["files"]) == written_files
    with (tmp_path / "stiffness" / "map.csv").open() as file:
        rows = list(csv.DictReader(file))
    task = ClosedLoopModel.load(ROOT / "urdf" / "five_bar.yaml").task
    model = StiffnessModel(task, load_compliances(path, task.mechanism))
    assert (told["points"], told["reached"]) == (6, 2)
    assert [(float(row["z_m"]), float(row["x_m"])) for row in rows] == [
        (z, x) for z in (0.5, 0.7, 0.9) for x in (0.1, 0.2)
    ]
    for row in rows:
        if float(row["z_m"]) > 0.65:
            assert row["least_stiffness_N_per_m"] == row["frequency_1_Hz"] == ""
            continue
        one = model.at([float(row["x_m"]), float(row["z_m"])], [1, 0, 2, 0, 0, 0])
        assert float(row["displacement_z_m"]) == pytest.approx(one.displacement[2], rel=1e-8)
        assert float(row["compliance_x_m_per_N"]) == pytest.approx(one.compliance[0, 0], rel=1e-8)
        assert float(row["frequency_1_Hz"]) == pytest.approx(one.frequencies[0], rel=1e-8)
        least = 1 / np.linalg.eigvalsh(one.compliance[:3, :3])[-1]
        assert float(row["least_stiffness_N_per_m"]) == pytest.approx(least, rel=1e-8)
    least = min(float(row["frequency_1_Hz"]) for row in rows if row["frequency_1_Hz"])
    assert told["lowest_frequency"]["least"] == pytest.approx(least, rel=1e-8)
    run = CliRunner().invoke(app, [*words, "--at", "x=0.1"])
    assert run.exit_code == 2
    run = CliRunner().invoke(app, [*words[:4], "--held", "x=0.1"])
    assert run.exit_code == 2


def test_the_command_says_that_nothing_vibrates(tmp_path: Path) -> None:
    path = written(tmp_path, "closures: {tips: {y_N_per_m: 1.0e5}}\n")
    run = CliRunner().invoke(app, ["stiffness", str(path), "-m", "five_bar"])
    assert run.exit_code == 0, run.output
    assert "Frequencies: none, nothing that has a mass moves" in run.stdout


def test_a_map_of_a_task_of_joints_has_units_of_turns() -> None:
    task = ClosedLoopModel.load("urdf/ankle.yaml").task
    assert task.frame is None
    drives = Compliances(actuators=dict.fromkeys(task.mechanism.actuated, 1e5))
    model = StiffnessModel(task, drives)
    x = task.home + np.array([[[0.0, 0.0], [0.0, 0.02]], [[0.05, 0.0], [0.05, 0.02]]])
    found = stiffness_map(model, x)
    assert found.unit == "N m/rad"
    figure = plot_stiffness_map(found)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert "least stiffness (N m/rad)" in labels
    assert [figure.axes[0].get_xlabel(), labels[0]] == [f"{one} (°)" for one in task.coordinates]


@pytest.mark.parametrize(
    ("turns", "column"),
    [
        ((False, False), "least_stiffness_N_per_m"),
        ((True, True), "least_stiffness_Nm_per_rad"),
        ((False, True), "least_stiffness_mixed_units"),
    ],
)
def test_columns_of_a_map_name_their_unit(
    turns: tuple[bool, bool], column: str, tmp_path: Path
) -> None:
    """Of a task of joints: slides, hinges, or both."""
    joints = ("left", "right")
    place, C = np.array([[0.1, 0.2]]), 1e-5 * np.eye(2)[None]
    found = StiffnessMap(joints, place, joints, C, place, np.ones((1, 1)), turns, turns)
    write_map(found, tmp_path / "map.csv")
    with (tmp_path / "map.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert float(row[column]) == pytest.approx(1e5, rel=1e-8)

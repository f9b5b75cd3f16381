"""URDFs of other people on the command line: limits, meshes, what is told."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rps_pin import cli
from tests.cli.commands import rps_pin
from tests.closed_loop.io.urdf.test_packages import stl
from tests.closed_loop.io.urdf.texts import joint, link, robot
from tests.closed_loop.test_rounded_files import FIVE_BAR

EFFORT = 'effort="1" velocity="20"'
FOUR_BAR = robot(
    link("ground"),
    link("pivot"),
    link("crank", 0.2, "0.05 0 0"),
    link("coupler", 0.3, "0.15 0 0"),
    link("rocker", 0.2, "0.1 0 0"),
    link("coupler_end"),
    link("rocker_end"),
    joint("motor", "revolute", "ground", "crank", limit=EFFORT),
    joint("elbow", "revolute", "crank", "coupler", xyz="0.1 0 0", limit=EFFORT),
    joint("far", "fixed", "ground", "pivot", xyz="0.3 0 0"),
    joint("swing", "revolute", "pivot", "rocker", limit=EFFORT),
    joint("end_a", "fixed", "coupler", "coupler_end", xyz="0.3 0 0"),
    joint("end_b", "fixed", "rocker", "rocker_end", xyz="0.2 0 0"),
)
CLOSURE = (
    "closures:\n  - {name: pin, frame_a: coupler_end, frame_b: rocker_end, kind: revolute, "
    "axis: [0, 1, 0]}\nactuated: [motor]\nhome: {motor: -1.0, elbow: 0.6, swing: -1.6}\n"
)
BOUNDED = FOUR_BAR.replace(EFFORT, f'lower="-0.1" upper="0.1" {EFFORT}')
ARM = robot(link("base"), link("arm", 1.0, "0.1 0 0"), joint("hinge", "continuous", "base", "arm"))


def described(folder: Path, *more: str) -> dict:
    run = rps_pin("describe", "m.yaml", "--json", *more, folder=folder)
    assert (run.returncode, run.stderr) == (0, ""), run.stderr
    return json.loads(run.stdout)


def write(folder: Path, urdf: str, yaml: str) -> None:
    (folder / "r.urdf").write_text(urdf)
    (folder / "m.yaml").write_text(f"urdf: r.urdf\n{yaml}")


def test_limits_without_numbers_bound_nothing(tmp_path: Path) -> None:
    """As Onshape exports them, and Gepetto's robots have them."""
    write(tmp_path, FOUR_BAR, CLOSURE)
    found = described(tmp_path)
    assert found["mobility"] == 1
    assert [one["lower"] for one in found["joints"]] == [[None]] * 3
    assert "'motor' (line 1), 'elbow' (line 1), 'swing' (line 1)" in found["notes"][0]


@pytest.mark.filterwarnings("default::rps_pin.errors.AccuracyWarning")
def test_accuracy_of_the_file_can_be_set(tmp_path: Path) -> None:
    (tmp_path / "m.xml").write_text(FIVE_BAR.format(turn="1.5708"))
    run = rps_pin("describe", "m.xml", "--json", folder=tmp_path)
    assert json.loads(run.stdout)["mobility"] == 2
    assert run.stderr.startswith("note: five_bar: the file's numbers are rounded, closure 'foot' (")
    assert "Warning" not in run.stderr
    run = rps_pin("describe", "m.xml", "--json", "--accuracy", "0", folder=tmp_path)
    assert json.loads(run.stdout)["mobility"] == 1
    (tmp_path / "m.yaml").write_text("mjcf: m.xml\naccuracy: 0\n")
    run = rps_pin("describe", "m.yaml", "--json", folder=tmp_path)
    assert json.loads(run.stdout)["mobility"] == 1
    run = rps_pin("describe", "m.yaml", "--json", "--accuracy", "1e-4", folder=tmp_path)
    assert json.loads(run.stdout)["mobility"] == 2
    assert rps_pin("describe", "m.yaml", "--accuracy", "-1", folder=tmp_path).returncode == 2


def test_limits_can_be_ignored(tmp_path: Path) -> None:
    write(tmp_path, BOUNDED, CLOSURE)
    run = rps_pin("describe", "m.yaml", folder=tmp_path)
    assert run.returncode == 1
    assert "at its limit" in run.stderr
    for name in ("motor", "elbow", "swing"):
        assert run.stderr.count(name) <= 1
    assert described(tmp_path, "--ignore-limits")["mobility"] == 1
    write(tmp_path, BOUNDED, CLOSURE + "within_limits: false\n")
    found = described(tmp_path)
    assert found["mobility"] == 1
    assert "position limits are ignored, as was asked" in found["notes"]


@pytest.mark.parametrize(
    "command",
    [
        "describe m.yaml",
        "simulate m.yaml --duration 0.01 -o out",
        "assembly-modes m.yaml --at motor=-1 --starts 40",
        "convert m.yaml --to urdf -o out",
        "convert m.yaml --to mjcf -o out",
        "export c m.yaml -o out",
    ],
)
def test_every_command_can_ignore_limits(tmp_path: Path, command: str) -> None:
    """By its option, and by the file's own word."""
    if command.startswith("export"):
        pytest.importorskip("casadi")
    words = command.split()
    write(tmp_path, BOUNDED, CLOSURE)
    run = rps_pin(*words, folder=tmp_path)
    assert run.returncode == 1
    assert "limit" in run.stderr
    run = rps_pin(*words, "--ignore-limits", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    write(tmp_path, BOUNDED, CLOSURE + "within_limits: false\n")
    again = ["--overwrite"] * (words[0] in ("convert", "export"))
    run = rps_pin(*words, *again, folder=tmp_path)
    assert run.returncode == 0, run.stderr


def test_no_command_that_loads_a_mechanism_lacks_the_option() -> None:
    commands = [*Path(cli.__file__).parent.glob("*.py")]
    loading = [path for path in commands if "load_mechanism(" in path.read_text("utf-8")]
    assert len(loading) >= 7
    for path in loading:
        assert "ignore_limits, accuracy" in path.read_text("utf-8").replace("\n", " ") or (
            path.name == "mechanism_options.py"
        ), path


@pytest.mark.parametrize("home", ["0.3", "[0.955336489125606, 0.29552020666133955]"])
def test_a_continuous_joint_starts_at_an_angle(tmp_path: Path, home: str) -> None:
    """Also given as cosine and sine, as Pinocchio has them."""
    write(tmp_path, ARM, f"actuated: [hinge]\nhome: {{hinge: {home}}}\n")
    found = described(tmp_path)
    assert found["configuration"] == pytest.approx([0.3])
    write(tmp_path, ARM, "actuated: [hinge]\nhome: {hinge: [0.3, 0.4]}\n")
    run = rps_pin("describe", "m.yaml", folder=tmp_path)
    assert (run.returncode, "m.yaml, line 3: home of 'hinge'" in run.stderr) == (1, True)


def simulated(folder: Path, *more: str, json_: bool = True):
    args = ["simulate", "m.yaml", "--duration", "0.02", "-o", "out", *(["--json"] * json_), *more]
    run = rps_pin(*args, folder=folder)
    assert run.returncode == 0, run.stderr
    assert (folder / "out" / "viewer.html").is_file()
    return json.loads(run.stdout) if json_ else run.stdout


def test_a_robot_without_shapes_is_simulated(tmp_path: Path) -> None:
    write(tmp_path, ARM, "actuated: [hinge]\n")
    assert simulated(tmp_path, "--start", "hinge=0.4")["notes"] == []


def test_a_mesh_that_is_not_there_costs_a_note(tmp_path: Path) -> None:
    mesh = '<visual><geometry><mesh filename="package://else/a.stl"/></geometry></visual>'
    write(tmp_path, ARM.replace("<inertial>", f"{mesh}<inertial>"), "actuated: [hinge]\n")
    (note,) = simulated(tmp_path)["notes"]
    assert "not drawn: 'package://else/a.stl': no package 'else'" in note
    told = " ".join(simulated(tmp_path, json_=False).split())
    assert "note: " in told
    assert "largest loop gap" in told
    stl(tmp_path / "ws" / "else" / "a.stl")
    assert simulated(tmp_path, "--package-path", "ws")["notes"] == []


def test_placeholder_links_are_merged(tmp_path: Path) -> None:
    parts = [link("base"), link("x", 1e-9, inertia=1e-9), link("y", 1e-9, inertia=1e-9)]
    parts += [link("bob", 0.5, "0 0 -0.2")]
    for name, axis, parent, child in (
        ("bx", "1 0 0", "base", "x"),
        ("by", "0 1 0", "x", "y"),
        ("bz", "0 0 1", "y", "bob"),
    ):
        parts.append(joint(name, "revolute", parent, child, axis=axis))
    merge = "merge:\n  - {joints: [bx, by, bz], into: spherical, name: ball}\nactuated: [ball]\n"
    write(tmp_path, robot(*parts), merge)
    found = described(tmp_path)
    assert (found["nv"], found["mobility"]) == (3, 3)
    assert "2e-09 kg of the links between" in found["notes"][0]
    write(tmp_path, robot(*parts).replace("1e-09", "1e-3"), merge)
    run = rps_pin("describe", "m.yaml", folder=tmp_path)
    assert run.returncode == 1
    assert "only links can be left out that are massless, or have at most 1e-05" in run.stderr


def test_a_urdf_alone_is_described_and_simulated(tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(ARM)
    run = rps_pin("describe", "r.urdf", folder=tmp_path)
    assert run.returncode == 0
    assert "note: a URDF names no actuated joints" in run.stdout
    run = rps_pin("simulate", "r.urdf", "--duration", "0.01", "-o", "out", folder=tmp_path)
    assert run.returncode == 0, run.stderr

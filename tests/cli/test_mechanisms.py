"""The commands for any mechanism, as a person types them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel
from tests.cli.commands import rps_pin

Array = NDArray[np.float64]

URDF = Path(__file__).resolve().parents[2] / "urdf"

MJCF = """<mujoco model="swing"><worldbody>
<body name="left" pos="0 0 1"><joint name="left_hinge" axis="0 1 0"/>
  <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.5"/>
  <body name="seat" pos="0 0 -0.5"><joint name="seat_hinge" axis="0 1 0"/>
    <geom type="capsule" size="0.02" fromto="0 0 0 0.6 0 0"/></body></body>
<body name="right" pos="0.6 0 1"><joint name="right_hinge" axis="0 1 0"/>
  <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.5"/></body>
</worldbody>
<equality><connect body1="seat" body2="right" anchor="0.6 0 0"/></equality>
<actuator><motor joint="left_hinge"/></actuator></mujoco>"""


def test_describe_prints_a_table() -> None:
    run = rps_pin("describe", str(URDF / "four_bar.yaml"))
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("four-bar: mobility 1, actuation sufficient: 1 actuator\n")
    for words in ("crank_joint", "revolute", "actuated", "rank 2, redundant rows 3"):
        assert words in run.stdout


def test_describe_as_json_is_what_the_library_says() -> None:
    file = URDF / "stewart.yaml"
    run = rps_pin("describe", str(file), "--json")
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout) == ClosedLoopModel.load(file).describe().as_dict()


def test_mechanisms_of_the_package_go_by_their_names(tmp_path: Path) -> None:
    run = rps_pin("describe", "delta", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stdout == f"{ClosedLoopModel.load(URDF / 'delta.yaml').describe()}\n"
    run = rps_pin("describe", "dleta", folder=tmp_path)
    assert run.returncode == 1
    assert "those are: ankle, cassie_biped, cassie_leg, cassie_leg_free, delta" in run.stderr


def test_describe_reads_mujoco_files(tmp_path: Path) -> None:
    file = tmp_path / "swing.xml"
    file.write_text(MJCF)
    run = rps_pin("describe", str(file), "--json")
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    assert (found["name"], found["mobility"], found["redundant_rows"]) == ("swing", 1, 1)
    assert found["actuated"] == ["left_hinge"]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("missing.yaml", None, "missing.yaml"),
        ("robot.urdf", "<robot/>", "<robot> has no link"),
        ("robot.txt", "", "ends in .yaml"),
        ("robot.yaml", "urdf: missing.urdf", "missing.urdf"),
        ("robot.yaml", "urdf: [", "line 1"),
        ("robot.xml", MJCF.replace('axis="0 1 0"', 'axis="0 b 0"', 1), "line 2"),
        ("robot.xml", "<!DOCTYPE x [<!ENTITY a 'b'>]><mujoco>&a;</mujoco>", "document type"),
    ],
)
@pytest.mark.parametrize("command", ["describe", "simulate"])
def test_bad_files_are_told_in_one_line(
    tmp_path: Path, command: str, name: str, text: str | None, words: str
) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    run = rps_pin(command, name, folder=tmp_path)
    assert run.returncode == 1
    assert run.stdout == ""
    assert run.stderr.startswith("error: ")
    assert run.stderr.count("\n") == 1
    assert words in run.stderr


def test_a_loop_that_cannot_close_says_which_and_by_how_much(tmp_path: Path) -> None:
    """The slider-crank's guide raised to 2 m: its bars reach much less high."""
    shutil.copy(URDF / "slider_crank.urdf", tmp_path)
    text = (URDF / "slider_crank.yaml").read_text()
    file = tmp_path / "slider_crank.yaml"
    file.write_text(text)
    urdf = tmp_path / "slider_crank.urdf"
    raised = urdf.read_text()
    mechanism = ClosedLoopModel.load(file)
    frame = mechanism.model.frames[mechanism.model.getFrameId("guide")]
    x, _, z = frame.placement.translation
    old, new = f'xyz="{x:g} 0 {z:g}"', f'xyz="{x:g} 0 2"'
    assert old in raised
    urdf.write_text(raised.replace(old, new))
    run = rps_pin("describe", str(file))
    assert run.returncode == 1
    assert "closure 'slide' stays open by" in run.stderr


def test_simulate_writes_table_figures_and_page(tmp_path: Path) -> None:
    file = URDF / "four_bar.yaml"
    run = rps_pin("simulate", str(file), "--duration", "0.2", "--step", "0.002", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    folder = tmp_path / "four_bar-simulation"
    names = {"simulation.csv", "simulation.png", "simulation.svg", "viewer.html"}
    assert {path.name for path in folder.iterdir()} == names
    table = np.genfromtxt(folder / "simulation.csv", delimiter=",", names=True)
    assert len(table) == 101
    np.testing.assert_allclose(np.diff(table["time"]), 0.002, rtol=0, atol=1e-12)
    assert table["gap"].max() <= 1e-12
    energy = table["kinetic"] + table["potential"]
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-8 * table["kinetic"].max())


def test_held_mechanism_stays_where_it_is(tmp_path: Path) -> None:
    run = rps_pin(
        *("simulate", str(URDF / "delta.yaml"), "--hold", "--duration", "0.1", "--json"),
        *("--start", "arm_1_joint=0.5", "--output", str(tmp_path / "out")),
    )
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)
    assert summary["kinetic_peak"] < 1e-20
    assert summary["largest_gap"] <= 1e-12
    table = np.genfromtxt(tmp_path / "out" / "simulation.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["q_arm_1_joint"], 0.5, rtol=0, atol=1e-9)


_FLOATING = """<mujoco model="floating"><worldbody>
<body name="hull" pos="0 0 1"><freejoint name="root"/><geom type="box" size=".1 .1 .05" mass="3"/>
<body name="tail" pos=".1 0 0"><joint name="hip" axis="0 1 0"/>
<geom type="capsule" size=".01" fromto="0 0 0 .2 0 0" mass=".3"/></body></body>
</worldbody><actuator><motor joint="hip"/></actuator></mujoco>"""


_WRONG_VALUES = [
    (["nowhere=1"], "no joint 'nowhere' to give a value; there are: crank_joint, coupler_joint"),
    (["crank_joint=abc"], "'crank_joint=abc': it must be JOINT=NUMBER"),
    (["crank_joint=1_0"], "'crank_joint=1_0': it must be JOINT=NUMBER"),
    (["crank_joint=٣"], "'crank_joint=٣': it must be JOINT=NUMBER"),
    (["crank_joint"], "'crank_joint': it must be JOINT=NUMBER"),
    (["crank_joint=nan"], "the value of joint 'crank_joint' is not finite"),
    (["crank_joint=1", "crank_joint=2"], "joint 'crank_joint' is named twice"),
    (["crank_joint=99"], "outside their limits: 'crank_joint' at 99 rad (-6.28319 to 6.28319 rad)"),
    (["rocker_joint=3.1"], "closure 'knee' stays open by 0.246978 m"),
    (["crank_joint=1", "rocker_joint=1"], "closure 'knee' stays open by 0.0828846 m"),
]


@pytest.mark.parametrize("command", ["assembly-modes", "simulate"])
@pytest.mark.parametrize(("values", "said"), _WRONG_VALUES)
def test_joint_values_that_cannot_be_are_refused(
    command: str, values: list[str], said: str, tmp_path: Path
) -> None:
    """Smallest gaps: see `test_the_gaps_are_the_smallest`."""
    option = {"assembly-modes": "--at", "simulate": "--start"}[command]
    pairs = [text for value in values for text in (option, value)]
    run = rps_pin(command, "four_bar", *pairs, folder=tmp_path)
    assert run.returncode == 1
    assert said in run.stderr
    assert "Traceback" not in run.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("cranks", "rocker", "gap"),
    [(np.linspace(-np.pi, np.pi, 100_001), 3.1, 0.246978), (np.array([1.0]), 1.0, 0.0828846)],
)
def test_the_gaps_are_the_smallest(cranks: Array, rocker: float, gap: float) -> None:
    """Bars of 0.2, 0.5, 0.4 and 0.45 m: the coupler's end comes no nearer to the rocker's."""
    apart = 0.45 + 0.4 * np.exp(1j * rocker) - 0.2 * np.exp(1j * cranks)
    assert np.abs(np.abs(apart) - 0.5).min() == pytest.approx(gap, abs=1e-6)


def test_a_start_may_leave_the_assembly_mode(tmp_path: Path) -> None:
    """The mirror image of home: the rocker comes there through its dead point only."""
    start = ("simulate", "four_bar", "--start", "rocker_joint=-1.3", "--duration", "0.01")
    run = rps_pin(*start, folder=tmp_path)
    assert run.returncode == 1
    assert "a singularity is met" in run.stderr
    assert rps_pin(*start, "--jump", folder=tmp_path).returncode == 0


def test_assembly_modes_are_printed_as_wide_as_they_fit(tmp_path: Path) -> None:
    run = rps_pin("assembly-modes", "rps", "--ignore-limits", folder=tmp_path, COLUMNS="80")
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert max(map(len, lines[:-1])) <= 80
    assert "…" not in run.stdout
    assert "more: --json prints all; --frame NAME" in run.stdout


def test_what_cannot_be_held_is_told(tmp_path: Path) -> None:
    """3.3 kg float: their weight, and 0.3 kg at 0.2 m less the hip, are nobody's."""
    pytest.importorskip("mujoco")
    file = tmp_path / "floating.xml"
    file.write_text(_FLOATING)
    command = ("simulate", str(file), "--hold", "--duration", "0.05")
    run = rps_pin(*command, "--json", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    (missing,) = json.loads(run.stdout)["not_held"]
    assert missing["joint"] == "root"
    assert missing["force"] == pytest.approx(3.3 * 9.81, rel=1e-12)
    assert missing["moment"] == pytest.approx(0.3 * 9.81 * 0.2, rel=1e-12)
    assert "not held are 32.373 N and 0.5886 N m at joint 'root'" in run.stderr
    run = rps_pin(*command, folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert "not held by the actuators" in run.stdout
    run = rps_pin("simulate", "delta", "--hold", "--duration", "0.01", "--json", folder=tmp_path)
    assert json.loads(run.stdout)["not_held"] == []
    assert "not held" not in run.stderr


def test_speeds_and_forces_are_those_asked_for(tmp_path: Path) -> None:
    run = rps_pin(
        *("simulate", str(URDF / "five_bar.yaml"), "--duration", "0.01", "--method", "adaptive"),
        *("--speed", "left_joint=0.3", "--tau", "right_joint=-2.5", "-o", str(tmp_path / "out")),
    )
    assert run.returncode == 0, run.stderr
    table = np.genfromtxt(tmp_path / "out" / "simulation.csv", delimiter=",", names=True)
    assert table["v_left_joint"][0] == pytest.approx(0.3, abs=1e-15)
    assert table["v_right_joint"][0] == pytest.approx(0.0, abs=1e-15)
    assert (table["tau_right_joint"] == -2.5).all()
    assert (table["tau_left_joint"] == 0.0).all()


def test_the_work_of_an_actuator_is_no_error_of_the_energy(tmp_path: Path) -> None:
    """The largest change of the energy used to be reported, which holds the actuators' work."""
    command = ("simulate", str(URDF / "five_bar.yaml"), "--duration", "0.1", "--tau")
    run = rps_pin(*command, "left_joint=2.0", "--json", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)
    table = np.genfromtxt(
        tmp_path / "five_bar-simulation" / "simulation.csv", delimiter=",", names=True
    )
    energy = table["kinetic"] + table["potential"]
    # A constant torque's work is its angle's change times it.
    work = 2.0 * (table["q_left_joint"][-1] - table["q_left_joint"][0])
    assert abs(work) > 1e-3
    assert summary["work"] == pytest.approx(work, rel=1e-6)
    assert summary["energy_change"] == pytest.approx(energy[-1] - energy[0], rel=1e-9)
    assert summary["energy_balance"] < 1e-6
    printed = " ".join(rps_pin(*command, "left_joint=2.0", folder=tmp_path).stdout.split())
    assert f"{summary['work']:.6g} J" in printed
    assert f"{summary['energy_balance']:.2g} of the energy" in printed


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (("--tau", "knee=1"), "no actuated joint 'knee'; there are: crank_joint"),
        (("--speed", "crank_joint"), "must be JOINT=NUMBER"),
        (("--start", "crank_joint=fast"), "must be JOINT=NUMBER"),
        (("--start", "nothing=1"), "no joint 'nothing'"),
        (("--tau", "crank_joint=1", "--tau", "crank_joint=2"), "named twice"),
        (("--tau", "crank_joint=nan"), "finite"),
        (("--step", "0"), "step = 0"),
        (("--duration", "inf"), "duration = inf"),
    ],
)
def test_bad_options_are_told_in_one_line(
    tmp_path: Path, option: tuple[str, ...], words: str
) -> None:
    run = rps_pin("simulate", str(URDF / "four_bar.yaml"), *option, folder=tmp_path)
    assert run.returncode == 1
    assert words in run.stderr
    assert run.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_folder_of_example_parallel_robots(tmp_path: Path) -> None:
    folder = tmp_path / "linkage"
    folder.mkdir()
    shutil.copy(URDF / "five_bar.urdf", folder / "robot.urdf")
    (folder / "robot.yaml").write_text(
        "closed_loop: [[left_tip, right_tip]]\ntype: [3d]\nname_mot: [left_joint, right_joint]\n"
    )
    run = rps_pin("describe", "linkage", "--json", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    assert (found["name"], found["mobility"]) == ("linkage", 2)
    run = rps_pin("convert", "linkage", "--to", "urdf", "-o", "out", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stdout == "wrote out/linkage.urdf and out/linkage.yaml\n"


def test_convert_writes_what_describe_reads(tmp_path: Path) -> None:
    run = rps_pin("convert", "stewart", "--to", "urdf", "-o", "out", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stdout == "wrote out/stewart.urdf and out/stewart.yaml\n"
    run = rps_pin("convert", "out/stewart.yaml", "--to", "mjcf", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stdout == "wrote stewart.xml\n"
    one, other = (
        json.loads(rps_pin("describe", name, "--json", folder=tmp_path).stdout)
        for name in ("stewart", "stewart.xml")
    )
    assert one["mobility"] == other["mobility"] == 6
    assert one["actuated"] == other["actuated"]


def test_convert_replaces_files_only_if_asked(tmp_path: Path) -> None:
    (tmp_path / "delta.yaml").write_text("mine")
    run = rps_pin("convert", "delta", "--to", "urdf", folder=tmp_path)
    assert run.returncode == 1
    assert "delta.yaml exists; --overwrite replaces it" in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["delta.yaml"]
    run = rps_pin("convert", "delta", "--to", "urdf", "--overwrite", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "delta.yaml").read_text() != "mine"


def test_convert_keeps_meshes_and_tells_what_is_lost(tmp_path: Path) -> None:
    """Meshes by whole paths, so that they are found from the new folder; others are told."""
    source = tmp_path / "source"
    source.mkdir()
    shapes = "".join(
        f'<visual><geometry><mesh filename="{name}.stl"/></geometry></visual>'
        for name in ("mesh", "gone")
    )
    inertial = (
        '<inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    (source / "arm.urdf").write_text(
        f'<robot name="arm"><link name="base"/><link name="arm">{inertial}{shapes}</link>'
        '<joint name="j" type="continuous"><parent link="base"/><child link="arm"/></joint></robot>'
    )
    corners = ("0 0 0", "1 0 0", "0 1 0")
    facet = "".join(f"vertex {corner}\n" for corner in corners)
    (source / "mesh.stl").write_text(
        f"solid a\nfacet normal 0 0 1\nouter loop\n{facet}endloop\nendfacet\nendsolid a\n"
    )
    run = rps_pin("convert", "source/arm.urdf", "--to", "urdf", "-o", "out", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert f'filename="{source / "mesh.stl"}"' in (tmp_path / "out" / "arm.urdf").read_text()
    assert "gone.stl" in run.stderr
    assert "a URDF names no actuated joints" in run.stderr


def test_convert_names_the_link_that_mujoco_does_not_move(tmp_path: Path) -> None:
    run = rps_pin("convert", "rps", "--to", "mjcf", folder=tmp_path)
    assert run.returncode == 1
    assert "'leg_1_rod' has a mass of 0 kg" in run.stderr
    mend = ("--least-mass", "1e-9", "--least-inertia", "1e-9", "--mend-inertia")
    run = rps_pin("convert", "rps", "--to", "mjcf", *mend, folder=tmp_path)
    assert run.returncode == 0, run.stderr


def test_assembly_modes_are_printed_and_each_can_be_a_home() -> None:
    run = rps_pin("assembly-modes", "four_bar", "--at", "crank_joint=1.2")
    assert run.returncode == 0, run.stderr
    assert "2 found in 128 random starts" in run.stdout
    run = rps_pin("assembly-modes", "four_bar", "--at", "crank_joint=1.2", "--json")
    found = json.loads(run.stdout)
    mechanism = ClosedLoopModel.load(URDF / "four_bar.yaml")
    assert found["stopped"] == "settled"
    assert len(found["modes"]) == 2
    for mode in found["modes"]:
        assert mode["home"]["crank_joint"] == 1.2
        assert (
            mechanism.loop_gap([mode["home"][name] for name in list(mechanism.model.names)[1:]])
            < 1e-12
        )
    run = rps_pin("assembly-modes", "four_bar", "--at", "crank_joint=1.2", "--all", "--json")
    every = json.loads(run.stdout)
    assert every["complex_count"] == every["paths"] == 2
    assert [mode["certified"] for mode in every["modes"]] == [True, True]
    run = rps_pin("assembly-modes", "four_bar", "--at", "crank_joint=1.2", "--all")
    assert "2 found on 2 paths; 2 certified. Complex solutions: 2" in run.stdout
    run = rps_pin("assembly-modes", "four_bar", "--at", "crank=1.2")
    assert run.returncode == 1
    assert "crank_joint" in run.stderr


BALL = """<mujoco model="ball"><option gravity="0 0 0"/><worldbody>
<body><joint name="ball" type="ball"/><inertial pos="0 0 0" mass="1" diaginertia="0.02 0.03 0.04"/>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize("actuated", ["[ball]", "[ball.y]"])
def test_velocities_of_a_driven_ball_are_named_one_by_one(actuated: str, tmp_path: Path) -> None:
    """About a principal axis: 0.06 N m on 0.03 kg m^2, from 0.5 rad/s, for 0.2 s."""
    (tmp_path / "ball.xml").write_text(BALL)
    (tmp_path / "ball.yaml").write_text(f"mjcf: ball.xml\nactuated: {actuated}\n")
    words = ["simulate", "ball.yaml", "--duration", "0.2", "--output", "out"]
    run = rps_pin(*words, folder=tmp_path)
    assert run.returncode == 0, run.stderr
    run = rps_pin(*words, "--tau", "ball.y=0.06", "--speed", "ball.y=0.5", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    table = np.genfromtxt(tmp_path / "out" / "simulation.csv", delimiter=",", names=True)
    assert table["v_ball_1"][-1] == pytest.approx(0.5 + 0.2 * 2.0, rel=1e-9)
    run = rps_pin(*words, "--tau", "ball.w=1", folder=tmp_path)
    assert run.returncode == 1
    assert "no actuated joint 'ball.w'; there are: ball" in run.stderr

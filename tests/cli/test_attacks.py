"""Inputs that got through once, as they were tried: each ends in one line, or works.

What they are kinds of is tested beside the code: arrays in `closed_loop.test_array_arguments`,
copies in `control.test_copies`, floats in `control.test_every_float`, origins and hosts in
`panel.test_guarded_server`, outputs in `test_outputs`, names in `test_names`.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from rps_pin import ClosedLoopModel
from rps_pin.errors import RPSPinError
from tests.cli.commands import rps_pin
from tests.each import each

ROOT = Path(__file__).parents[2]
FOUR_BAR = (ROOT / "urdf" / "four_bar.urdf").read_text("utf-8")
PRESETS = ROOT / "src" / "rps_pin" / "rps" / "presets"
CIRCLE = str(ROOT / "docs" / "trajectories" / "circle.yaml")


def refused(*words: str, folder: Path) -> str:
    """Return the one line that a command ends with."""
    ended = rps_pin(*words, folder=folder)
    assert ended.returncode == 1, (words, ended)
    assert ended.stdout == ""
    lines = ended.stderr.splitlines()
    assert len(lines) == 1, ended.stderr
    assert lines[0].startswith("error: ")
    return lines[0]


def changed(pattern: str, new: str) -> str:
    """Return the four-bar's URDF with the first place of a pattern replaced."""
    text, count = re.subn(pattern, new.replace("\\", r"\\"), FOUR_BAR, count=1)
    assert count == 1, pattern
    return text


def with_end(more: str) -> str:
    return FOUR_BAR.replace("</robot>", f"{more}</robot>")


MASS, INERTIA = r'<mass value="[^"]*"\s*/>', r"<inertia [^>]*/>"
LIMITED = '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'


@each(
    ("text", "why"),
    [
        (changed(MASS, '<mass value="1_5"/>'), "line 19: mass value = '1_5'"),
        (changed(MASS, '<mass value="\u0661"/>'), "line 19: mass value = '\u0661'"),
        (changed(MASS, '<mass value="2\u00a0"/>'), "line 19: mass value = '2"),
        (FOUR_BAR.replace("inertial>", "inertail>", 2), "line 17: <link> has a <inertail>"),
        (changed("<axis", "<axsi"), "<joint> has a <axsi>; did you mean <axis>"),
        (changed("axis xyz", "axis yxz"), "<axis> has no attribute 'yxz'"),
        (changed(r'axis xyz="[^"]*"', 'axis xyz="0 0 0"'), "is no direction"),
        (
            changed(INERTIA, '<inertia ixx="2" ixy="0" ixz="0" iyy="2" iyz="0" izz="20"/>'),
            "line 20: link 'crank': its principal moments",
        ),
        (
            changed(INERTIA, '<inertia ixx="0.1" ixy="3" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'),
            "line 20: link 'crank': its principal moments",
        ),
        (
            with_end(
                '<joint name="again" type="fixed"><parent link="crank"/><child link="rocker"/>'
                "</joint>"
            ),
            "link 'rocker' is the child of two joints",
        ),
        (
            with_end(
                '<link name="x"/><link name="y"/>'
                '<joint name="xy" type="fixed"><parent link="x"/><child link="y"/></joint>'
                '<joint name="yx" type="fixed"><parent link="y"/><child link="x"/></joint>'
            ),
            "these joints form a cycle",
        ),
        (
            with_end(
                '<link name="x"/><joint name="m" type="revolute"><parent link="crank"/>'
                f'<child link="x"/>{LIMITED}<mimic joint="none"/></joint>'
            ),
            "joint 'm': mimic: no joint 'none'",
        ),
        (
            changed("<limit [^>]*>", '<limit lower="2" upper="1" effort="1" velocity="1"/>'),
            "lower = 2 is above upper = 1",
        ),
        (
            changed(MASS, '<mass value="-2"/>').replace("<robot ", '<robot xmlns="u:v" ', 1),
            "line 19: link 'crank': mass = -2 kg is negative",
        ),
        (
            with_end(
                '<link name="universe"/><joint name="u" type="fixed"><parent link="crank"/>'
                '<child link="universe"/></joint>'
            ),
            "a link cannot be called 'universe'",
        ),
        (changed("<mass ", '<mass value="50"/><mass '), "line 19: <inertial> has a second <mass>"),
        (changed('<link name="crank"', '<link nmae="crank"'), "<link> has no attribute 'nmae'"),
    ],
)
def test_urdfs_that_are_wrong(text: str, why: str, tmp_path: Path) -> None:
    (tmp_path / "four_bar.urdf").write_text(text, "utf-8")
    shutil.copy(ROOT / "urdf" / "four_bar.yaml", tmp_path)
    assert why in refused("describe", "four_bar.yaml", folder=tmp_path)


def test_a_mimicking_joint_is_a_coupling() -> None:
    text = with_end(
        '<link name="x"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"'
        ' izz="1"/></inertial></link><joint name="m" type="revolute"><parent link="coupler"/>'
        f'<child link="x"/>{LIMITED}<mimic joint="crank_joint" multiplier="3"/></joint>'
    )
    mechanism = ClosedLoopModel.from_urdf(
        text, [], ["crank_joint", "coupler_joint", "rocker_joint"]
    )
    assert mechanism.model.nv == 4
    v = mechanism.velocity(mechanism.home, [0.5, 0.25, -0.125])
    joints = {mechanism.model.names[i]: mechanism.model.joints[i].idx_v for i in range(1, 5)}
    assert v[joints["m"]] == pytest.approx(3.0 * 0.5)


@each("links", [1500, 3000, 5000, 20_000])
def test_links_in_a_row_end_no_process(links: int) -> None:
    parts = ["<link name='l0'/>"]
    parts += [
        f"<link name='l{i}'/><joint name='j{i}' type='fixed'><parent link='l{i - 1}'/>"
        f"<child link='l{i}'/></joint>"
        for i in range(1, links + 1)
    ]
    with pytest.raises(RPSPinError, match=r"link.*at most (1000|20000) are taken"):
        ClosedLoopModel.from_urdf(f"<robot name='c'>{''.join(parts)}</robot>", [], [])


MJCF = (
    "<mujoco>{top}<worldbody><body name='b'><joint name='j' {joint}/>"
    "<inertial pos='0.2 0 0' mass='{mass}' diaginertia='0.03 0.04 0.05'/></body>"
    "<body name='c'><joint name='k'/><geom size='0.1'/></body></worldbody></mujoco>"
)


@each(
    ("change", "why"),
    [
        ({"joint": "axsi='0 1 0'"}, "unrecognized attribute: 'axsi'"),
        ({"joint": "stifness='4'"}, "unrecognized attribute: 'stifness'"),
        ({"top": "<equaltiy/>"}, "unrecognized element Element 'equaltiy'"),
        ({"top": "<compiler angel='degree'/>"}, "unrecognized attribute: 'angel'"),
        ({"mass": "1_2"}, "bad format in attribute 'mass'"),
        ({"mass": "٢"}, "bad format in attribute 'mass'"),
        ({"joint": "armature='-2'"}, "negative armature"),
    ],
)
def test_mjcfs_that_are_misspelt(change: dict[str, str], why: str, tmp_path: Path) -> None:
    text = MJCF.format(**{"top": "", "joint": "", "mass": "1.2"} | change)
    (tmp_path / "m.xml").write_text(text, "utf-8")
    line = refused("describe", "m.xml", folder=tmp_path)
    assert why in line
    assert "m.xml" in line


def of_preset(name: str, pattern: str, new: str) -> str:
    text = (PRESETS / f"{name}.yaml").read_text("utf-8")
    return re.sub(pattern, new, text, flags=re.MULTILINE) if pattern else f"{text}{new}\n"


IK = ("ik", "--pose", "0.223", "0", "0", "-r")


@each(
    ("text", "words", "why"),
    [
        (of_preset("micro", "", "self: 2"), IK, "self = 2: unknown field"),
        (
            of_preset("micro", "^base_radius: .*", f"base_radius: 0x{'a' * 6000}"),
            IK,
            "a number of 6002 digits is too long",
        ),
        ("!!omap\n- b: 2\n", ("describe",), "line 1: not valid YAML: the tag !!omap"),
        ("b: !!bool 'y!'\n", ("describe",), "line 1: not valid YAML: 'y!' is neither"),
        (of_preset("sokolov", "^base_radius: .*", "base_radius: 1e200"), ("urdf", "-r"), "1e+200"),
        (
            of_preset("sokolov", "^base_radius: .*", "base_radius: 1e200"),
            ("fk", "--lengths", "0.2", "0.2", "0.2", "-r"),
            "1e+200",
        ),
        (
            (ROOT / "urdf" / "four_bar.yaml").read_text("utf-8").replace("knee", r'"n\udc00"'),
            ("describe",),
            "has half a character (a surrogate)",
        ),
        (
            (ROOT / "urdf" / "four_bar.yaml").read_text("utf-8") + "characteristic_length: 1e-307",
            ("describe",),
            "characteristic_length = 1e-307",
        ),
    ],
)
def test_yamls_that_ended_in_tracebacks(
    text: str, words: tuple[str, ...], why: str, tmp_path: Path
) -> None:
    (tmp_path / "x.yaml").write_text(text, "utf-8")
    shutil.copy(ROOT / "urdf" / "four_bar.urdf", tmp_path)
    assert why in refused(*words, "x.yaml", folder=tmp_path)


SCENARIO = """robot: micro
trajectory: {{kind: helix, radius: 0.5e-3, pitch: 0.33e-3, height: 0.223, duration: 0.05}}
settle: 0.02
controller: {{law: computed_torque, bandwidth: {bandwidth}, integral: 0.2}}
plant: {{{plant}}}
period: {period}
duration: {duration}
"""
USUAL = {"bandwidth": "15.0", "plant": "delay: 1", "period": "1.0e-3", "duration": "0.05"}


@each(
    ("change", "why"),
    [
        ({"plant": "delay: 2000000000000"}, "at most 100000 are taken"),
        ({"plant": "delay: 99999999999999999999999"}, "at most 100000 are taken"),
        ({"period": "1.0e-12"}, "duration / period = 5e+10 ticks: at most 2000000"),
        ({"period": "1.0e-300"}, "period = 1e-300"),
        ({"duration": "1.0e+12"}, "duration / period = 1e+15 ticks: at most 2000000"),
        ({"bandwidth": "1.0e+300"}, "controller.bandwidth = 1e+300"),
        ({"plant": "payload: 1.0e+300"}, "plant.payload = 1e+300"),
        ({"plant": "substeps: 2000000000"}, "at most 1000 are taken"),
    ],
)
def test_scenarios_without_end(change: dict[str, str], why: str, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(SCENARIO.format(**USUAL | change))
    assert why in refused("control", "s.yaml", "--json", "-o", "o", folder=tmp_path)
    assert not (tmp_path / "o").exists()


@each(
    ("words", "why"),
    [
        (("simulate", "four_bar", "--duration", "1e308"), "duration = 1e+308"),
        (("simulate", "four_bar", "--duration", "0.01", "--step", "5e-324"), "step = 5e-324"),
        (("simulate", "four_bar", "--duration", "0.01", "--step", "1e-30"), "at most 10000000"),
        (("simulate", "four_bar", "--duration", "1e9", "--step", "1e-3"), "at most 10000000"),
        (("dynamics", CIRCLE, "--payload", "1e200"), "payload mass = 1e+200"),
        (("dynamics", CIRCLE, "--gravity", "1e308", "0", "0"), "1e+308"),
    ],
)
def test_options_without_end(words: tuple[str, ...], why: str, tmp_path: Path) -> None:
    assert why in refused(*words, "-o", "o", folder=tmp_path)
    assert not (tmp_path / "o").exists()


@each("visual", ["", '<visual><geometry><mesh filename="loop.stl"/></geometry></visual>'])
def test_a_urdf_without_shapes_is_simulated(visual: str, tmp_path: Path) -> None:
    """Or with a mesh that is a link to itself."""
    (tmp_path / "loop.stl").unlink(missing_ok=True)
    (tmp_path / "loop.stl").symlink_to("loop.stl")
    (tmp_path / "r.urdf").write_text(
        '<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="2"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
        f'{visual}</link><joint name="turn" type="continuous"><parent link="base"/>'
        '<child link="arm"/><axis xyz="0 1 0"/></joint></robot>'
    )
    (tmp_path / "m.yaml").write_text("urdf: r.urdf\nactuated: [turn]\n")
    ended = rps_pin(
        *("simulate", "m.yaml", "--duration", "0.005", "-o", "o", "--overwrite"), folder=tmp_path
    )
    assert ended.returncode == 0, ended.stderr
    assert "r, simulated" in ended.stdout
    assert ("no file loop.stl" in ended.stdout) == bool(visual)
    written = {path.name for path in (tmp_path / "o").iterdir()}
    assert written == {"simulation.csv", "simulation.png", "simulation.svg", "viewer.html"}

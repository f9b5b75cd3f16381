"""The benchmark of robot files tells them by content, compares with MuJoCo, and counts causes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("mujoco")

from benchmarks.robot_files.beside_mujoco import compiled, differences
from benchmarks.robot_files.find import RobotFile, kind_of, robot_files
from benchmarks.robot_files.trial import loaded, tried
from benchmarks.zoo import main

HINGES = """<mujoco><worldbody>
  <body name="one"><joint name="a" axis="0 1 0" damping="0.3" armature="0.1"/>
    <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/>
    <body name="two" pos="0.3 0 0"><joint name="b" axis="0 1 0.2" stiffness="2" springref="20"/>
      <geom type="box" size="0.1 0.02 0.02" pos="0.1 0 0"/></body></body>
  <body name="loose" pos="0 0 1"><freejoint/><geom type="ellipsoid" size="0.1 0.2 0.3"/></body>
</worldbody><actuator><motor joint="a"/></actuator></mujoco>"""
ARM = """<?xml version="1.0"?><!-- one joint --><robot name="arm">
  <link name="base"/><link name="tip"><inertial><mass value="1"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="tip"/>
  <origin xyz="0.5 0 0" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/></joint></robot>"""


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (HINGES, "MJCF"),
        (ARM, "URDF"),
        (ARM.replace('"1.0"', '"0.0"', 1), "URDF"),
        ("\ufeff" + ARM, "URDF"),
        (ARM.replace('type="continuous"', 'type="fixed"'), "URDF without joints"),
        (
            ARM.replace("<link", '<xacro:x xmlns:xacro="http://www.ros.org/wiki/xacro"/><link', 1),
            "xacro",
        ),
        (ARM.replace('xyz="0.5', 'xyz="${far}'), "xacro"),
        ("<mujocoinclude/>", "part of an MJCF"),
        ("<sdf version='1.6'/>", "SDF"),
        ("<mujoco><worldbody></mujoco>", "broken XML"),
        ("<robot><group name='arm'/></robot>", None),
        ("<html/>", None),
        ("# a mechanism\nurdf: arm.urdf\nactuated: [turn]\n", "YAML"),
        ("other: 1\n", None),
    ],
)
def test_files_are_told_by_content(content: str, kind: str | None) -> None:
    assert kind_of(content.encode()) == kind


def test_a_folder_is_tried(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robots = tmp_path / "robots"
    robots.mkdir()
    texts = {
        "hinges.xml": HINGES,
        "arm": ARM,
        "arm.yaml": "urdf: arm\nactuated: [turn]\n",
        "prism.urdf": ARM.replace('type="continuous"', 'type="prism"'),
        "no_parent.urdf": ARM.replace('parent link="base"', 'parent link="bass"'),
        "no_mass.xml": HINGES.replace("<geom", "<site"),
        "still.xml": "<mujoco><worldbody><geom size='1'/></worldbody></mujoco>",
        "scene.sdf": "<sdf/>",
    }
    for name, text in texts.items():
        (robots / name).write_text(text, encoding="utf-8")
    results = tmp_path / "results.json"
    assert main([str(robots), "--json", str(results)]) == 0
    written = json.loads(results.read_text("utf-8"))
    assert written["apart"] == {"SDF": 1}
    outcomes = {one["file"]: (one["outcome"], one["agrees"]) for one in written["files"]}
    assert outcomes == {
        "hinges.xml": ("loads", True),
        "arm": ("loads", True),
        "arm.yaml": ("loads", None),
        "no_mass.xml": ("apart", None),
        "no_parent.urdf": ("apart", None),
        "prism.urdf": ("apart", None),
        "still.xml": ("apart", None),
    }
    printed = capsys.readouterr().out
    assert "| files tried | 1 | 1 | 1 |" in printed
    assert "1 counted apart: SDF" in printed
    assert "apart: MJCF: no joints (such as still.xml)" in printed


def test_another_mass_is_seen(tmp_path: Path) -> None:
    right, wrong = tmp_path / "right.xml", tmp_path / "wrong.xml"
    right.write_text(HINGES, encoding="utf-8")
    wrong.write_text(HINGES.replace('damping="0.3"', 'damping="0.300001"'), encoding="utf-8")
    model, _ = compiled(wrong, "MJCF")
    found = differences(loaded(right, "MJCF"), model)
    assert found["forces"] > 1e-9 > found["mass matrix"]


def test_parts_and_limits_of_time(tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text(
        '<mujoco><actuator><motor joint="a"/></actuator></mujoco>', encoding="utf-8"
    )
    (tmp_path / "whole.xml").write_text(
        HINGES.replace("<worldbody>", '<include file="part.xml"/><worldbody>', 1), encoding="utf-8"
    )
    part, whole = robot_files([tmp_path])
    assert part.included and not whole.included
    assert tried(part).message == "part of an MJCF"
    assert isinstance(whole, RobotFile)

"""The benchmark of robot files tells them by content, compares with MuJoCo, and counts causes."""

from __future__ import annotations

import io
import json
import tarfile
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("mujoco")

from benchmarks.robot_files.beside_mujoco import compiled, differences
from benchmarks.robot_files.find import RobotFile, kind_of, robot_files
from benchmarks.robot_files.packages import packages
from benchmarks.robot_files.trial import loaded, tried
from benchmarks.zoo import main
from benchmarks.zoo_fetch import main as fetch
from benchmarks.zoo_fetch import unpacked
from tests.worst import worst

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


def test_an_inertia_without_mass_is_compared(tmp_path: Path) -> None:
    """MuJoCo leaves it out, so it is given some dust; the same for a link that moves."""
    for kind in ("fixed", "continuous"):
        more = (
            '<link name="flag"><inertial><mass value="0.0"/><inertia ixx="0.1" iyy="0.2" '
            f'izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="f" type="{kind}">'
            '<parent link="tip"/><child link="flag"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>'
            "</joint></robot>"
        )
        path = tmp_path / f"{kind}.urdf"
        path.write_text(ARM.replace("</robot>", more), encoding="utf-8")
        model, why = compiled(path, "URDF")
        assert model is not None, why
        assert worst(*differences(loaded(path, "URDF"), model).values()) < 1e-12


def test_packages_have_versions_and_licences() -> None:
    found = packages()
    assert len(found) > 40
    assert [one.name for one in found] == sorted(one.name for one in found)
    assert all(one.version[0].isdigit() and one.licence for one in found)


@pytest.mark.parametrize("form", ["whl", "tar.gz"])
def test_archives_are_unpacked_without_code(form: str, tmp_path: Path) -> None:
    archive, target = tmp_path / f"robots-1.0.{form}", (tmp_path / "robots").resolve()
    members = {"robots/a.urdf": ARM, "robots/run.py": "1 / 0", "../outside.urdf": ARM}
    if form == "whl":
        with zipfile.ZipFile(archive, "w") as wheel:
            for name, text in members.items():
                wheel.writestr(name, text)
    else:
        with tarfile.open(archive, "w:gz") as source:
            for name, text in members.items():
                entry = tarfile.TarInfo(name)
                entry.size = len(text.encode())
                source.addfile(entry, io.BytesIO(text.encode()))
    assert unpacked(archive, target) == 1
    assert [path.name for path in tmp_path.rglob("*.*") if path != archive] == ["a.urdf"]


def test_robots_are_not_fetched_into_the_repository(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        fetch([str(Path(__file__).parent / "robots")])
    assert "is in the repository" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        fetch(["/tmp/robots", "no-such-package"])
    assert "no package 'no-such-package'" in capsys.readouterr().err

"""Where meshes are found: the rules of ROS, plain paths, and what is said where there is none."""

from __future__ import annotations

import os
import struct
import warnings
from pathlib import Path

import pytest

from rps_pin import ClosedLoopModel, InputError
from rps_pin.closed_loop.io.urdf import model_from_urdf
from rps_pin.closed_loop.io.urdf.packages import file_of
from rps_pin.closed_loop.visuals import visual_model
from tests.closed_loop.io.urdf.texts import joint, link, robot
from tests.each import each


@pytest.fixture(autouse=True)
def no_workspace(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)


def stl(path: Path, first: float = 0.0) -> Path:
    """One triangle."""
    path.parent.mkdir(parents=True, exist_ok=True)
    numbers = struct.pack("<12f", 0, 0, 1, first, 0, 0, 1, 0, 0, 0, 1, 0)
    path.write_bytes(b"\0" * 80 + struct.pack("<I", 1) + numbers + b"\0\0")
    return path


URI = "package://pkg/meshes/a.stl"


@each(
    ("mesh", "urdf"),
    [
        ("ws/pkg/meshes/a.stl", "ws/pkg/urdf/r.urdf"),  # a folder above has the package's name
        ("ws/pkg/meshes/a.stl", "ws/other/urdf/r.urdf"),  # beside the URDF's own package
        ("ws/src/pkg/meshes/a.stl", "ws/src/other/r.urdf"),
        ("ws/meshes/a.stl", "ws/r.urdf"),  # the URDF's own folder
    ],
)
def test_packages_around_the_urdf(tmp_path_factory, mesh: str, urdf: str) -> None:
    folder = tmp_path_factory.mktemp("packages")
    stl(folder / mesh)
    assert file_of(URI, folder / urdf) == folder / mesh


def test_a_folder_above_whose_manifest_has_the_name(tmp_path: Path) -> None:
    found = stl(tmp_path / "checkout" / "meshes" / "a.stl")
    manifest = tmp_path / "checkout" / "package.xml"
    manifest.write_text('<?xml version="1.0"?><package format="3">\n<name> pkg </name></package>')
    assert file_of(URI, tmp_path / "checkout" / "urdf" / "r.urdf") == found


@each(
    ("variable", "entry", "mesh"),
    [
        ("ROS_PACKAGE_PATH", "ws", "ws/pkg/meshes/a.stl"),
        ("ROS_PACKAGE_PATH", "ws/pkg", "ws/pkg/meshes/a.stl"),
        ("ROS_PACKAGE_PATH", "ws", "ws/src/pkg/meshes/a.stl"),
        ("ROS_PACKAGE_PATH", "ws", "ws/stack/pkg/meshes/a.stl"),
        ("AMENT_PREFIX_PATH", "install", "install/share/pkg/meshes/a.stl"),
        ("CMAKE_PREFIX_PATH", "install", "install/share/pkg/meshes/a.stl"),
        (None, "ws", "ws/pkg/meshes/a.stl"),
        (None, "ws/pkg", "ws/pkg/meshes/a.stl"),
    ],
)
def test_packages_of_a_workspace(tmp_path_factory, variable, entry: str, mesh: str) -> None:
    folder = tmp_path_factory.mktemp("workspace")
    found, urdf = stl(folder / mesh), folder / "elsewhere" / "r.urdf"
    with pytest.raises(InputError, match=r"no package 'pkg'"):
        file_of(URI, urdf)
    with pytest.MonkeyPatch.context() as patch:
        if variable:
            patch.setenv(variable, f"/nowhere:{folder / entry}")
        given = () if variable else (folder / entry,)
        assert file_of(URI, urdf, given) == found


def test_given_folders_come_first(tmp_path: Path) -> None:
    stl(tmp_path / "a" / "pkg" / "meshes" / "a.stl")
    second = stl(tmp_path / "b" / "pkg" / "meshes" / "a.stl")
    urdf = tmp_path / "a" / "pkg" / "r.urdf"
    assert file_of(URI, urdf, [tmp_path / "b"]) == second


def test_plain_paths_are_relative_to_the_urdf(tmp_path: Path) -> None:
    found, urdf = stl(tmp_path / "my meshes" / "a.stl"), tmp_path / "urdf" / "r.urdf"
    urdf.parent.mkdir()
    assert file_of("../my meshes/a.stl", urdf).samefile(found)
    assert file_of(str(found), urdf) == found
    assert file_of(f"file://{str(found).replace(' ', '%20')}", urdf) == found


@each(
    ("name", "why"),
    [
        ("http://x/a.stl", "http:// is not read"),
        ("package://pkg/../../../../etc/none", "no package 'pkg'"),
        ("none.stl", "no file"),
        ("a\0b.stl", "no file"),
        ("x" * 5000, "no file"),
    ],
)
def test_what_cannot_be_found_is_told(tmp_path_factory, name: str, why: str) -> None:
    with pytest.raises(InputError, match=why):
        file_of(name, tmp_path_factory.mktemp("none") / "r.urdf")


# Shapes -------------------------------------------------------------------------------------------


def mesh(name: str) -> str:
    return f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'


BALL = '<visual><geometry><sphere radius="0.1"/></geometry></visual>'


def shapes(folder: Path, *visuals: str, **options):
    """The shapes of an arm with these visuals, and the warnings."""
    text = robot(link("base"), link("arm", 1.0), joint("j", "continuous", "base", "arm"))
    text = text.replace("</inertial>", "</inertial>" + "".join(visuals))
    (folder / "r.urdf").write_text(text)
    (folder / "r.yaml").write_text("urdf: r.urdf\nactuated: [j]\n")
    mechanism = ClosedLoopModel.load(folder / "r.yaml")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = visual_model(folder / "r.yaml", mechanism.model, **options)
    return found, " ".join(str(one.message) for one in told)


def test_bad_meshes_cost_themselves_alone(tmp_path: Path) -> None:
    stl(tmp_path / "good.stl")
    stl(tmp_path / "nan.stl", float("nan"))
    (tmp_path / "text.stl").write_text("nothing")
    (tmp_path / "loop.stl").symlink_to("loop.stl")
    names = ("good", "nan", "text", "loop", "none")
    found, told = shapes(tmp_path, BALL, *(mesh(f"{name}.stl") for name in names))
    assert [type(item.geometry).__name__ for item in found.geometryObjects] == [
        "Sphere",
        "BVHModelOBBRSS",
    ]
    for name in names[1:]:
        assert f"'{name}.stl'" in told
    assert "good" not in told


@each("visual", ["", mesh("none.stl"), "<visual/>", "<visual><geometry/></visual>"])
def test_where_nothing_can_be_drawn_there_are_no_shapes(tmp_path_factory, visual: str) -> None:
    found, told = shapes(tmp_path_factory.mktemp("bare"), visual)
    assert found is None
    assert bool(told) == bool(visual)


def test_a_mesh_that_was_not_fetched_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d\n")
    visual = '<visual><geometry><mesh filename="a.stl"/></geometry></visual>'
    urdf = tmp_path / "r.urdf"
    urdf.write_text(robot(f'<link name="base">{visual}</link>'))
    with pytest.warns(UserWarning, match="as a mesh: it is a pointer of Git LFS"):
        assert visual_model(urdf, model_from_urdf(urdf)) is None


@each(
    "visual",
    [
        BALL.replace('"0.1"', '"x"'),
        BALL.replace("radius", "size"),
        BALL.replace("sphere", "dodecahedron"),
        BALL.replace("<geometry>", '<origin xyz="0 0"/><geometry>'),
    ],
)
def test_wrong_shapes_cost_themselves_alone(tmp_path_factory, visual: str) -> None:
    found, told = shapes(tmp_path_factory.mktemp("wrong"), BALL, visual)
    assert found.ngeoms == 1
    assert "line 1" in told


def test_materials_are_forgiven(tmp_path: Path) -> None:
    materials = ('<material><color rgba="1 0 0 1"/></material>', '<material name="a"/>')
    visuals = [BALL.replace("</visual>", f"{one}</visual>") for one in materials]
    found, told = shapes(tmp_path, *visuals)
    assert (found.ngeoms, told) == (2, "")
    assert found.geometryObjects[0].meshColor.tolist() == [1, 0, 0, 1]


def test_capsules_are_drawn(tmp_path: Path) -> None:
    capsule = '<visual><origin xyz="0 0 1"/><geometry><capsule radius="0.1" length="0.5"/>'
    found, told = shapes(tmp_path, capsule + "</geometry></visual>")
    heights = sorted(item.placement.translation[2] for item in found.geometryObjects)
    assert heights == pytest.approx([0.75, 1.0, 1.25])
    assert told == ""


def test_folders_of_packages_can_be_given(tmp_path: Path) -> None:
    stl(tmp_path / "ws" / "pkg" / "meshes" / "a.stl")
    (tmp_path / "robot").mkdir()
    assert "no package 'pkg'" in shapes(tmp_path / "robot", mesh(URI))[1]
    found, told = shapes(tmp_path / "robot", mesh(URI), package_path=[tmp_path / "ws"])
    assert (found.ngeoms, told) == (1, "")


def test_a_mesh_that_is_a_fifo_is_not_waited_for(tmp_path: Path) -> None:
    urdf = tmp_path / "r.urdf"
    shape = '<visual><geometry><mesh filename="f.stl"/></geometry></visual>'
    urdf.write_text(f'<robot name="r"><link name="a">{shape}</link></robot>')
    os.mkfifo(tmp_path / "f.stl")
    with pytest.warns(UserWarning, match=r"not drawn: 'f.stl': no file"):
        assert visual_model(urdf, model_from_urdf(urdf)) is None

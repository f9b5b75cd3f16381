"""Meshes of a URDF are drawn wherever a mechanism of it is, from Python too, in their colours."""

from __future__ import annotations

import copy
import dataclasses
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from PIL import Image

from rps_pin import ClosedLoopModel, LoopClosure
from rps_pin.closed_loop.visuals import own_shapes
from rps_pin.viewer import Ghosts, save_html
from rps_pin.viewer.scene.shapes import Cylinder, TriangleMesh
from tests.viewer.test_layers import URDF, bars, shown

#: A right-angled corner, its triangles in two colours of the MTL.
OBJ = """mtllib corner.mtl
v 0 0 0
v 1 0 0
v 0 2 0
v 0 0 3
usemtl red
f 1 2 3
usemtl green
f 1 2 4
f 1 3 4
"""
MTL = "newmtl red\nKd 1 0 0\nnewmtl green\nKd 0 0.5 0\n"
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="t"><lambert><diffuse>
<color>0 0 1 1</color></diffuse></lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 1 0 0 0 2 0 0 0 3</float_array>
<technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="3" material="m"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 1 2 0 1 3 0 2 3</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g">
<bind_material><technique_common><instance_material symbol="m" target="#m"/></technique_common>
</bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""
STL = "solid s\n" + 3 * (
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 2 3\nendloop\nendfacet\n"
) + "endsolid s\n"  # fmt: skip


def urdf_of(mesh: str, material: str = "", scale: str = "0.1 0.1 0.1") -> str:
    return f"""<robot name="r"><link name="base"/><link name="arm">
      <inertial><mass value="1"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
      <visual><geometry><mesh filename="{mesh}" scale="{scale}"/></geometry>{material}</visual>
      </link><joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/>
      <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A ROS package with meshes of each kind."""
    meshes = tmp_path / "arms" / "meshes"
    meshes.mkdir(parents=True)
    (tmp_path / "arms" / "package.xml").write_text("<package><name>arms</name></package>")
    for name, text in (
        ("corner.obj", OBJ), ("corner.mtl", MTL), ("corner.dae", DAE), ("corner.stl", STL)
    ):  # fmt: skip
        (meshes / name).write_text(text)
    (tmp_path / "arms" / "urdf").mkdir()
    return tmp_path / "arms"


def arm(folder: Path, *of_urdf: str) -> ClosedLoopModel:
    file = folder / "urdf" / "arm.urdf"
    file.write_text(urdf_of(*of_urdf))
    return ClosedLoopModel.from_urdf(file, [], ["hinge"])


def surfaces(mechanism: ClosedLoopModel) -> list[tuple[np.ndarray, int, np.ndarray | None]]:
    """Return vertices, colour and colours of vertices of each mesh that is drawn."""
    view, _ = shown(mechanism)
    parts = [part for link in view.scene._links for part in link.parts()]
    return [
        (part.shape.vertices, part.material.colour, part.shape.colours)
        for part in parts
        if isinstance(part.shape, TriangleMesh)
    ]


@pytest.mark.parametrize("place", ["package://arms/meshes/{}", "../meshes/{}", "file://{}"])
@pytest.mark.parametrize(
    ("name", "colours"),
    [("corner.obj", {0xFF0000, 0x008000}), ("corner.dae", {0x0000FF}), ("corner.stl", {0xE6E6E6})],
)
def test_meshes_are_drawn_in_their_colours(folder, name, colours, place):
    file = folder / "meshes" / name
    found = surfaces(arm(folder, place.format(file if "file" in place else name)))
    assert {colour for _, colour, _ in found} == colours
    vertices = np.concatenate([vertices for vertices, _, _ in found])
    np.testing.assert_allclose(np.ptp(vertices, axis=0), [0.1, 0.2, 0.3], rtol=1e-6)


@pytest.mark.parametrize("name", ["corner.obj", "corner.dae"])
def test_a_material_of_the_urdf_is_before_those_of_the_mesh(folder, name):
    red = '<material name="paint"><color rgba="1 0 1 1"/></material>'
    [(_, colour, _)] = surfaces(arm(folder, f"../meshes/{name}", red))
    assert colour == 0xFF00FF


def test_scales_may_differ_and_mirror(folder):
    found = surfaces(arm(folder, "../meshes/corner.obj", "", "1 -0.5 0.1"))
    vertices = np.concatenate([vertices for vertices, _, _ in found])
    np.testing.assert_allclose(vertices.min(axis=0), [0.0, -1.0, 0.0], atol=1e-7)
    np.testing.assert_allclose(vertices.max(axis=0), [1.0, 0.0, 0.3], atol=1e-7)


def test_a_texture_colours_the_vertices(folder):
    picture = np.zeros((2, 2, 3), np.uint8)
    picture[:, 0], picture[:, 1] = [255, 0, 0], [0, 0, 255]  # left red, right blue
    Image.fromarray(picture).resize((64, 64), Image.Resampling.NEAREST).save(
        folder / "meshes" / "skin.png"
    )
    (folder / "meshes" / "corner.mtl").write_text("newmtl skin\nmap_Kd skin.png\n")
    text = OBJ.split("usemtl", maxsplit=1)[0] + "vt 0.1 0.5\nvt 0.9 0.5\nusemtl skin\n"
    (folder / "meshes" / "corner.obj").write_text(text + "f 1/1 2/2 3/1\nf 1/1 2/2 4/1\n")
    [(vertices, _, colours)] = surfaces(arm(folder, "../meshes/corner.obj"))
    assert colours is not None
    for vertex, colour in zip(vertices, colours, strict=True):
        expected = [0.0, 0.0, 1.0] if vertex[0] > 0.05 else [1.0, 0.0, 0.0]
        np.testing.assert_allclose(colour, expected, atol=0.02)


def test_a_mesh_that_is_missing_is_named_with_where_it_was_looked_for(folder, tmp_path):
    lost = arm(folder, "package://arms/meshes/lost.stl")
    with pytest.warns(UserWarning, match=r"not drawn: 'package://arms/meshes/lost.stl'") as told:
        save_html(tmp_path / "page.html", lost)
    assert str(folder) in str(told[0].message)
    assert "lost.stl" in str(told[0].message) and told[0].filename == __file__
    assert (tmp_path / "page.html").exists()  # a skeleton
    nowhere = arm(folder, "package://nowhere/a.stl")
    with pytest.warns(UserWarning, match="no package 'nowhere': neither in the folders"):
        assert own_shapes(nowhere) is None


def test_an_edited_or_copied_mechanism_keeps_its_shapes(folder):
    one = arm(folder, "../meshes/corner.obj")
    undriven = one.with_actuated([])
    rod = LoopClosure("arm", "universe", "distance", name="rod", distance=0.5)
    offset = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
    held = undriven.with_closures([dataclasses.replace(rod, placement_b=offset)])
    ball = undriven.with_joints({"hinge": "spherical"})
    for other in (undriven, held, ball, one.without_effects(), copy.deepcopy(one)):
        assert len(surfaces(other)) == 2


def test_the_shapes_of_a_text_are_drawn():
    text = (URDF / "four_bar.urdf").read_text()
    closures = ClosedLoopModel.load(URDF / "four_bar.yaml").closures
    of_text = ClosedLoopModel.from_urdf(text, closures, ["crank_joint"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn = own_shapes(of_text)
    own = own_shapes(ClosedLoopModel.load(URDF / "four_bar.yaml"))
    assert [one.name for one in drawn.geometryObjects] == [one.name for one in own.geometryObjects]


def test_ghosts_have_the_rods_of_distance_closures():
    delta = ClosedLoopModel.load(URDF / "delta.yaml")
    there = delta.task.configuration(delta.task.home + np.array([0.05, 0.0, 0.02]))
    _, recorder = shown(delta, there)
    expected = bars(recorder)
    ghosts = shown(delta, layers=[Ghosts(at=there)])[0].drawings["ghosts"].parts
    names = {f"bar_{closure.name}" for closure in delta.closures}
    rods = {part.name.removeprefix("bar_"): part for part in ghosts if part.name in names}
    assert set(rods) == set(expected) and len(rods) == 6
    for name, part in rods.items():
        assert isinstance(part.shape, Cylinder)
        half = part.shape.length / 2.0
        ends = part.placement @ np.array([[0, 0, -half, 1.0], [0, 0, half, 1.0]]).T
        np.testing.assert_allclose(ends[:3].T, expected[name], atol=1e-9)
        turn = part.placement[:3, :3]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)

"""Collision shapes of files: read as they are, or refused with the file and the reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, InputError
from tests.closed_loop.interference import shaped
from tests.closed_loop.interference.shaped import floating, joint, link, place, robot, shape
from tests.worst import worst

BALL = '<sphere radius="1"/>'
RNG = np.random.default_rng(5)


def kinds(mechanism: ClosedLoopModel) -> dict[str, str]:
    items = mechanism.collision_model.geometryObjects
    return {item.name: type(item.geometry).__name__ for item in items}


def moved(x: float, y: float = 0.0, z: float = 0.0) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def depth(mechanism: ClosedLoopModel, a: pin.SE3, b: pin.SE3) -> float:
    nearest = mechanism.interference(place(a, b)).nearest
    assert nearest is not None
    return nearest.distance


# URDF ---------------------------------------------------------------------------------------------


def test_shapes_of_a_urdf_stand_where_it_says() -> None:
    """Against Pinocchio's own reader, which has no capsules."""
    forms = ('<box size="0.1 0.2 0.3"/>', '<cylinder radius="0.1" length="0.3"/>')
    one = shape(forms[0], "0.1 0.2 0.3", "0.4 0.5 0.6") + shape(forms[1], "-0.1 0 0", "1 0 0")
    text = robot(
        link("base", shape('<sphere radius="0.2"/>')),
        link("a", one),
        link("b", one),
        joint("ab", "base", "a", xyz="0.5 0.1 0"),
        joint("bc", "a", "b", "fixed", xyz="0.7 0 0"),
    )
    mechanism = ClosedLoopModel.from_urdf(text, [], [])
    ours = mechanism.collision_model
    theirs = pin.buildGeomFromUrdfString(mechanism.model, text, pin.GeometryType.COLLISION)
    assert ours.ngeoms == theirs.ngeoms == 5
    for item in ours.geometryObjects:
        other = theirs.geometryObjects[theirs.getGeometryId(item.name)]
        assert (item.parentJoint, item.parentFrame) == (other.parentJoint, other.parentFrame)
        assert worst(item.placement.homogeneous - other.placement.homogeneous) < 1e-12
        assert item.geometry == other.geometry
    assert {shape.where for shape in mechanism.collision_shapes.shapes if shape.link == "base"} == {
        "the URDF text, line 1: link 'base'"
    }


def test_kinds_of_shapes() -> None:
    forms = {
        "box": '<box size="1 1 1"/>',
        "sphere": '<sphere radius="1"/>',
        "cylinder": '<cylinder radius="1" length="1"/>',
        "capsule": '<capsule radius="1" length="1"/>',
        "drakes": '<drake:capsule radius="1" length="1"/>',
        "ellipsoid": '<drake:ellipsoid a="1" b="2" c="3"/>',
    }
    links = [link(name, shape(form)) for name, form in forms.items()]
    joints = [joint(f"j_{name}", "box", name) for name in list(forms)[1:]]
    one = ClosedLoopModel.from_urdf(robot(*links, *joints), [], [])
    assert kinds(one) == {
        "box_0": "Box", "sphere_0": "Sphere", "cylinder_0": "Cylinder", "capsule_0": "Capsule",
        "drakes_0": "Capsule", "ellipsoid_0": "Ellipsoid",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("form", "words"),
    [
        ('<sphere radius="-1"/>', "radius = -1 m must be positive"),
        ('<sphere radius="wide"/>', "radius = 'wide'"),
        ("<sphere/>", "no radius"),
        ('<box size="1 1"/>', "size = '1 1'"),
        ('<box size="1 0 1"/>', "width = 0 m must be positive"),
        ('<cone radius="1" length="1"/>', "<cone> is not a shape; there are: box"),
        ('<sphere radius="1"/><sphere radius="2"/>', "no geometry, or several"),
        ("", "no geometry, or several"),
        ('<mesh filename="none.stl"/>', "no file .*none.stl"),
        ('<mesh filename="package://none/a.stl"/>', "no package 'none'"),
        ('<mesh filename="http://none/a.stl"/>', "http:// is not read"),
        ('<mesh scale="1 1 1"/>', "no filename"),
        ('<mesh filename="chain.urdf" scale="1 1"/>', "scale = '1 1'"),
        ('<mesh filename="chain.urdf"/>', "cannot be read as a mesh"),
    ],
)
def test_what_cannot_be_read_is_refused_when_it_is_asked_for(
    form: str, words: str, tmp_path: Path
) -> None:
    text = robot(link("a", "\n" + shape(form)), link("b"), joint("ab", "a", "b"))
    (tmp_path / "chain.urdf").write_text(text)
    one = ClosedLoopModel.from_urdf(tmp_path / "chain.urdf", [], ["ab"])
    one.inverse_dynamics([0.1], [0], [0])
    for ask in (lambda: one.collision_model, one.link_distances, lambda: one.interference([0.0])):
        with pytest.raises(InputError, match=rf"chain.urdf, line 2: link 'a'.*{words}"):
            ask()


def test_a_link_that_is_merged_away_is_told(tmp_path: Path) -> None:
    text = robot(
        link("a"), f'<link name="b">{shape(BALL)}</link>', link("c"),
        joint("ab", "a", "b", axis="1 0 0"), joint("bc", "b", "c", axis="0 1 0"),
    )  # fmt: skip
    (tmp_path / "chain.urdf").write_text(text)
    merge = "merge: [{joints: [ab, bc], into: universal, name: cross}]\n"
    (tmp_path / "chain.yaml").write_text(f"urdf: chain.urdf\n{merge}actuated: []\n")
    one = ClosedLoopModel.load(tmp_path / "chain.yaml")
    with pytest.raises(InputError, match="link 'b' is not in the model any more"):
        one.interference(one.home)


def test_packages_are_several_folders() -> None:
    ball = floating('<sphere radius="1"/>', '<sphere radius="1"/>').collision_shapes
    assert ball.in_packages([Path("b"), "c"]).in_packages(["a"]).package_path == ("a", "b", "c")
    for wrong in ("folder", Path("folder")):
        with pytest.raises(InputError, match="it must be several paths"):
            ball.in_packages(wrong)  # type: ignore[arg-type]


# Meshes -------------------------------------------------------------------------------------------


def meshed(tmp_path: Path, mesh: tuple[np.ndarray, np.ndarray], other: str) -> ClosedLoopModel:
    shaped.write_mesh(tmp_path / "part.stl", *mesh)
    return floating(f'<mesh filename="{tmp_path / "part.stl"}" scale="2 1 1"/>', other)


def test_a_mesh_of_a_box_is_the_box(tmp_path: Path) -> None:
    ball = '<sphere radius="0.1"/>'
    of_mesh = meshed(tmp_path, shaped.box((0.4, 0.5, 0.6)), ball)
    of_box = floating('<box size="0.8 0.5 0.6"/>', ball)
    assert kinds(of_mesh)["a_0"] == "Convex"
    errors = []
    for _ in range(40):
        at = pin.SE3(pin.exp3(RNG.uniform(-1, 1, 3)), RNG.uniform(-0.6, 0.6, 3))
        errors.append(depth(of_mesh, at, moved(0)) - depth(of_box, at, moved(0)))
    assert worst(errors) < 1e-7  # Assimp's numbers have 24 bits


@pytest.mark.parametrize("forms", ["ball", "mesh"])
def test_a_mesh_that_is_not_convex_is_hollow_where_it_is(forms: str, tmp_path: Path) -> None:
    """A U: a ball, or a cube as another hollow mesh, between its walls is free."""
    vertices, triangles = shaped.channel()
    shaped.write_mesh(tmp_path / "u.stl", vertices, triangles)
    u = f'<mesh filename="{tmp_path / "u.stl"}"/>'
    if forms == "ball":
        other, reach = '<sphere radius="0.1"/>', 0.1
    else:  # two cubes of 0.2 m, of which the second is far up: together they are not convex
        cube, same = shaped.box((0.2, 0.2, 0.2))
        shaped.write_mesh(
            tmp_path / "two.stl",
            np.concatenate([cube, cube + np.array([0, 0, 9.0])]),
            np.concatenate([same, same + 8]),
        )
        other, reach = f'<mesh filename="{tmp_path / "two.stl"}"/>', 0.1
    two = floating(u, other)
    assert kinds(two)["a_0"].startswith("BVHModel")
    free = depth(two, moved(0), moved(0, 0, 0.3))
    assert free == pytest.approx(0.3 - 0.1 - reach, abs=2e-8)
    assert depth(two, moved(0), moved(0.25, 0, 0.35)) == pytest.approx(0.4 - 0.25 - reach, abs=2e-8)
    for x in (0.31, 0.35, 0.45):  # into the wall
        assert depth(two, moved(0), moved(x, 0, 0.35)) < 0


def test_a_shape_inside_a_hollow_mesh_is_in_interference(tmp_path: Path) -> None:
    """Wholly inside the material: the surfaces do not cut."""
    shaped.write_mesh(tmp_path / "u.stl", *shaped.channel())
    u = f'<mesh filename="{tmp_path / "u.stl"}"/>'
    one, other = floating(u, '<sphere radius="0.01"/>'), floating('<sphere radius="0.01"/>', u)
    for x, z in ((0.45, 0.3), (0.0, 0.05), (-0.2, 0.05)):
        assert depth(one, moved(0), moved(x, 0, z)) == pytest.approx(-0.04, abs=2e-8)
        assert depth(other, moved(x, 0, z), moved(0)) == pytest.approx(-0.04, abs=2e-8)
    assert depth(one, moved(0), moved(0, 0, 0.2)) == pytest.approx(0.09, abs=2e-8)

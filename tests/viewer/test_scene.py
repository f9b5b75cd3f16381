"""What a scene tells its window, checked against Pinocchio and by hand."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from rps_pin.errors import InputError
from rps_pin.viewer import Recorder, Scene
from rps_pin.viewer.scene.stage import grid_spacing
from tests.viewer.robots import Sample, build, sample_robot

ROBOT = "/world/robot"


def matrix(message) -> np.ndarray:
    return np.reshape(message["matrix"], (4, 4)).T


def transforms(recorder: Recorder) -> dict[str, np.ndarray]:
    """Return the last transform sent to each path."""
    return {m["path"]: matrix(m) for m in recorder.messages if m["type"] == "set_transform"}


def objects(recorder: Recorder) -> dict[str, dict]:
    return {m["path"]: m["object"] for m in recorder.messages if m["type"] == "set_object"}


def properties(recorder: Recorder) -> dict[tuple[str, str], object]:
    return {
        (m["path"], m["property"]): m["value"]
        for m in recorder.messages
        if m["type"] == "set_property"
    }


def shown(sample: Sample, q=None) -> tuple[Scene, Recorder]:
    recorder = Recorder()
    first = sample.configurations[0] if q is None else q
    return Scene(sample.model, sample.visual, recorder, first), recorder


def test_links_have_readable_unique_paths(sample):
    scene, recorder = shown(sample)
    assert scene.paths == {
        "base": f"{ROBOT}/base",
        "cylinder.1": f"{ROBOT}/cylinder.1",
        "rod": f"{ROBOT}/rod",
        "platform": f"{ROBOT}/platform",
    }
    robot = [path for path in objects(recorder) if path.startswith(ROBOT)]
    assert robot == [
        f"{ROBOT}/base/base_0",
        f"{ROBOT}/platform/platform_0",
        f"{ROBOT}/cylinder.1/cylinder.1_0",
        f"{ROBOT}/cylinder.1/cylinder.1_1",
        f"{ROBOT}/rod/rod_0",
        f"{ROBOT}/rod/rod_1",
    ]


def test_names_that_differ_only_in_a_slash_stay_apart():
    urdf = """<robot name="r">
      <link name="a/b"><visual><geometry><sphere radius="1"/></geometry></visual></link>
      <link name="a.b"><visual><geometry><sphere radius="1"/></geometry></visual></link>
      <joint name="j" type="continuous"><parent link="a/b"/><child link="a.b"/></joint>
    </robot>"""
    model, visual = build(urdf)
    scene = Scene(model, visual, Recorder(), pin.neutral(model))
    assert scene.paths == {"a.b": f"{ROBOT}/a.b", "a.b_2": f"{ROBOT}/a.b_2"}


@pytest.mark.parametrize("time_index", [0, 700, 1500])
def test_every_geometry_stands_where_pinocchio_puts_it(sample, time_index):
    scene, recorder = shown(sample)
    q = sample.configurations[time_index]
    scene.display(q)
    data, placed = sample.model.createData(), sample.visual.createData()
    pin.updateGeometryPlacements(sample.model, data, sample.visual, placed, q)
    told = transforms(recorder)
    drawn_axis_to_z = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    for index, item in enumerate(sample.visual.geometryObjects):
        link = sample.model.frames[item.parentFrame].name.replace("/", ".")
        path = f"{ROBOT}/{link}/{item.name.replace('/', '.')}"
        expected = placed.oMg[index].homogeneous.copy()
        if isinstance(item.geometry, coal.Cylinder):
            expected[:3, :3] = expected[:3, :3] @ drawn_axis_to_z
        found = told[f"{ROBOT}/{link}"] @ told[path]
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_display_moves_only_what_can_move(sample):
    scene, recorder = shown(sample)
    before = len(recorder.messages)
    scene.display(sample.configurations[100])
    sent = recorder.messages[before:]
    assert [m["path"] for m in sent] == [
        f"{ROBOT}/platform",
        f"{ROBOT}/cylinder.1",
        f"{ROBOT}/rod",
    ]


def test_shapes_have_the_urdf_sizes_and_colours(sample):
    _, recorder = shown(sample)
    found = objects(recorder)
    box = found[f"{ROBOT}/platform/platform_0"]
    assert box["geometries"][0]["type"] == "BoxGeometry"
    size = [box["geometries"][0][side] for side in ("width", "height", "depth")]
    np.testing.assert_allclose(size, [0.16, 0.16, 0.015], rtol=1e-12)
    assert box["materials"][0]["color"] == 0xC74033  # 0.78, 0.25, 0.20
    assert box["materials"][0]["transparent"] is False
    cylinder = found[f"{ROBOT}/cylinder.1/cylinder.1_0"]["geometries"][0]
    assert cylinder["radiusTop"] == cylinder["radiusBottom"] == 0.02
    assert cylinder["height"] == pytest.approx(0.2)
    assert found[f"{ROBOT}/rod/rod_1"]["geometries"][0]["radius"] == 0.022


def floating(shape) -> tuple[pin.Model, pin.GeometryModel, np.ndarray]:
    """A robot that is one shape on a free-flyer."""
    model, visual = pin.Model(), pin.GeometryModel()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "float")
    visual.addGeometryObject(pin.GeometryObject("thing", joint, pin.SE3.Identity(), shape))
    return model, visual, pin.neutral(model)


def test_a_geometry_without_a_link_is_named_after_its_joint():
    model, visual, q = floating(coal.Box(1.0, 1.0, 1.0))
    scene = Scene(model, visual, Recorder(), q)
    assert scene.paths == {"float": f"{ROBOT}/float"}


def test_transparent_colours_stay_transparent():
    model, visual, q = floating(coal.Sphere(1.0))
    visual.geometryObjects[0].meshColor = np.array([1.0, 0.0, 0.0, 0.25])
    recorder = Recorder()
    Scene(model, visual, recorder, q)
    material = objects(recorder)[f"{ROBOT}/float/thing"]["materials"][0]
    assert (material["opacity"], material["transparent"]) == (0.25, True)


def test_a_cone_points_up_and_a_capsule_is_a_rod_with_round_ends():
    recorder = Recorder()
    model, visual, q = floating(coal.Cone(0.5, 2.0))
    Scene(model, visual, recorder, q)
    cone = objects(recorder)[f"{ROBOT}/float/thing"]["geometries"][0]
    assert (cone["radiusTop"], cone["radiusBottom"], cone["height"]) == (0.0, 0.5, 2.0)
    top = transforms(recorder)[f"{ROBOT}/float/thing"] @ [0.0, 1.0, 0.0, 1.0]
    np.testing.assert_allclose(top, [0.0, 0.0, 1.0, 1.0], atol=1e-15)

    recorder = Recorder()
    model, visual, q = floating(coal.Capsule(0.5, 2.0))
    Scene(model, visual, recorder, q)
    kinds = {
        path: found["geometries"][0]["type"]
        for path, found in objects(recorder).items()
        if path.startswith(ROBOT)
    }
    assert kinds == {
        f"{ROBOT}/float/thing": "CylinderGeometry",
        f"{ROBOT}/float/thing_2": "SphereGeometry",
        f"{ROBOT}/float/thing_3": "SphereGeometry",
    }
    ends = [transforms(recorder)[f"{ROBOT}/float/thing_{k}"][2, 3] for k in (2, 3)]
    assert ends == [-1.0, 1.0]


def test_an_ellipsoid_has_its_radii():
    recorder = Recorder()
    model, visual, q = floating(coal.Ellipsoid(1.0, 2.0, 3.0))
    Scene(model, visual, recorder, q)
    thing = objects(recorder)[f"{ROBOT}/float/thing"]["object"]
    np.testing.assert_allclose(np.diag(np.reshape(thing["matrix"], (4, 4))), [1, 2, 3, 1])


def test_a_mesh_keeps_its_vertices_at_the_urdf_scale(tmp_path):
    (tmp_path / "part.stl").write_text(
        "solid part\nfacet normal 0 0 1\nouter loop\n"
        "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
        "facet normal 1 0 0\nouter loop\n"
        "vertex 0 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\nendsolid part\n"
    )
    urdf = f"""<robot name="r"><link name="base"/><link name="a"><visual><geometry>
      <mesh filename="{tmp_path / "part.stl"}" scale="2 3 4"/></geometry></visual></link>
      <joint name="j" type="floating"><parent link="base"/><child link="a"/></joint></robot>"""
    model, visual = build(urdf)
    recorder = Recorder()
    Scene(model, visual, recorder, pin.neutral(model))
    data = objects(recorder)[f"{ROBOT}/a/a_0"]["geometries"][0]["data"]
    vertices = np.frombuffer(data["attributes"]["position"]["array"].data, dtype="<f4")
    corners = np.frombuffer(data["index"]["array"].data, dtype="<u4")
    triangles = vertices.reshape(-1, 3)[corners].reshape(-1, 3, 3)
    np.testing.assert_allclose(triangles.max(axis=(0, 1)), [2.0, 3.0, 4.0])
    assert len(triangles) == 2


def test_a_shape_that_cannot_be_drawn_is_refused_by_name():
    model, visual, q = floating(coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0))
    with pytest.raises(InputError, match=r"'thing' is a Halfspace"):
        Scene(model, visual, Recorder(), q)


def test_nothing_to_draw_is_refused(sample):
    with pytest.raises(InputError, match="nothing to show"):
        Scene(sample.model, pin.GeometryModel(), Recorder(), sample.configurations[0])


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda q: q[:-1], "nq = 9"),
        (lambda q: np.where(np.arange(9) == 3, np.nan, q), "not finite"),
        (lambda q: 2.0 * q, "unit length"),
        (lambda q: np.array([q, q]), "2 were given"),
    ],
)
def test_display_refuses_what_is_not_a_configuration(sample, spoil, complaint):
    scene, recorder = shown(sample)
    before = len(recorder.messages)
    with pytest.raises(InputError, match=complaint):
        scene.display(spoil(sample.configurations[0]))
    assert len(recorder.messages) == before


@pytest.mark.parametrize("scale", [0.05, 1.0, 10.0])
def test_a_robot_of_any_size_fills_the_same_picture(scale):
    """The world node brings any robot to radius one about the origin; the rest stays the same."""
    reference, of_one = shown(sample_robot(1.0))
    scene, recorder = shown(sample_robot(scale))
    assert properties(recorder) == properties(of_one)
    world, world_of_one = transforms(recorder)["/world"], transforms(of_one)["/world"]
    np.testing.assert_allclose(world[:3, :3] * scale, world_of_one[:3, :3], rtol=1e-9)
    np.testing.assert_allclose(world[:3, 3], world_of_one[:3, 3], rtol=1e-9, atol=1e-12)
    assert 0.4 * scale < scene.grid_spacing / reference.grid_spacing < 2.6 * scale


def test_the_world_node_centres_a_box_of_known_size():
    model, visual, q = floating(coal.Box(2.0, 4.0, 4.0))  # half diagonal 3
    q[:3] = [10.0, 20.0, 30.0]
    recorder = Recorder()
    Scene(model, visual, recorder, q)
    world = transforms(recorder)["/world"]
    np.testing.assert_allclose(world @ [10.0, 20.0, 30.0, 1.0], [0, 0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(world[:3, :3], np.eye(3) / 3.0, rtol=1e-12)


def test_a_link_fixed_to_another_has_its_own_frame_and_box():
    urdf = """<robot name="r"><link name="base"/><link name="a"/><link name="b"><visual>
      <origin xyz="0.5 0 0"/><geometry><box size="2 2 2"/></geometry></visual></link>
      <joint name="f" type="floating"><parent link="base"/><child link="a"/></joint>
      <joint name="g" type="fixed"><parent link="a"/><child link="b"/>
        <origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/></joint></robot>"""
    model, visual = build(urdf)
    recorder = Recorder()
    Scene(model, visual, recorder, pin.neutral(model))
    told = transforms(recorder)
    # The fixed joint turns the link's x axis onto y.
    turn = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(told[f"{ROBOT}/b"], turn, atol=1e-12)
    np.testing.assert_allclose(told[f"{ROBOT}/b/b_0"][:3, 3], [0.5, 0.0, 0.0], atol=1e-12)
    world = told["/world"]
    np.testing.assert_allclose(world @ [1.0, 2.5, 3.0, 1.0], [0, 0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(world[:3, :3], np.eye(3) / np.sqrt(3.0), rtol=1e-12)


def test_the_frame_holds_the_whole_motion(sample):
    recorder = Recorder()
    Scene(sample.model, sample.visual, recorder, sample.configurations)
    world = transforms(recorder)["/world"]
    start = sample.model.joints[sample.model.getJointId("float")].idx_q
    centres = sample.configurations[:, start : start + 3]
    scene_centres = centres @ world[:3, :3].T + world[:3, 3]
    assert np.linalg.norm(scene_centres, axis=1).max() < 1.0


@pytest.mark.parametrize(
    ("radius", "spacing"), [(0.4, 0.1), (0.3, 0.05), (1.0, 0.2), (0.0399, 0.005), (4.0, 1.0)]
)
def test_the_grid_has_round_spacing(radius, spacing):
    assert grid_spacing(radius) == pytest.approx(spacing, rel=1e-12)

"""viser's scene against Meshcat's: the same parts in the same places, sizes and colours."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
import viser

from rps_pin import ClosedLoopModel, RPSPinError, RPSRobot
from rps_pin.viewer import Recorder, Scene, View, fitting_layers
from rps_pin.viewer.writers.viser_writer import ViserWriter

URDF = Path(__file__).parents[2] / "urdf"
pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),  # of websockets
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    running = viser.ViserServer(host="127.0.0.1", port=8080, verbose=False)
    yield running
    running.stop()


def in_viser(server: viser.ViserServer, path: str) -> np.ndarray:
    """Return the placement of a part in the world, scale included."""
    whole, names = np.eye(4), path.strip("/").split("/")
    for k in range(1, len(names) + 1):
        handle = server.scene.get_handle_by_name("/" + "/".join(names[:k]))
        assert handle is not None, path
        w, x, y, z = handle.wxyz
        placement = np.eye(4)
        placement[:3, :3] = pin.Quaternion(w, x, y, z).matrix() * np.asarray(handle.scale)
        placement[:3, 3] = handle.position
        whole = whole @ placement
    return whole


def in_meshcat(recorder: Recorder, path: str) -> np.ndarray:
    """Return the placement of a part in the world, below the node that scales the scene."""
    told = {
        m["path"]: np.reshape(m["matrix"], (4, 4)).T
        for m in recorder.messages
        if m["type"] == "set_transform"
    }
    whole, names = np.eye(4), path.strip("/").split("/")
    for k in range(2, len(names) + 1):
        whole = whole @ told.get("/" + "/".join(names[:k]), np.eye(4))
    return whole


def size_in_meshcat(geometry: dict[str, Any]) -> np.ndarray:
    """Return the lengths of a shape along its own axes; Meshcat's cylinders stand along y."""
    if geometry["type"] == "BoxGeometry":
        return np.array([geometry[side] for side in ("width", "height", "depth")])
    if geometry["type"] == "SphereGeometry":
        return np.full(3, 2.0 * geometry["radius"])
    width = 2.0 * max(geometry["radiusTop"], geometry["radiusBottom"])
    return np.array([width, geometry["height"], width])


@pytest.mark.parametrize("name", ["micro", "delta", "slider_crank"])
def test_every_part_is_where_meshcat_has_it(server: viser.ViserServer, name: str) -> None:
    what: Any
    if name == "micro":
        what, start = RPSRobot.from_preset("micro"), [0.22, 0.0, 0.0]
        q = what.state([0.23, 0.05, -0.08], np.zeros(3), np.zeros(3))[0]
        layers = ["frames", "forces", "reactions", "limits", "singularity", "closures", "ghosts"]
    else:
        what, start = ClosedLoopModel.load(URDF / f"{name}.yaml"), None
        q, layers = what.home, fitting_layers(what)
    recorder = Recorder()
    for window in (recorder, ViserWriter(server)):
        View(window, what, start, layers=layers).display(q)
    objects = {m["path"]: m["object"] for m in recorder.messages if m["type"] == "set_object"}
    colours = {
        m["path"].removesuffix("/<object>"): m["value"]
        for m in recorder.messages
        if m.get("property") == "color"
    }
    checked = 0
    for path, drawn in objects.items():
        geometry = drawn["geometries"][0]
        if path in ("/world/floor", "/world/grid", "/world/axes"):
            continue
        handle = server.scene.get_handle_by_name(path)
        placement, expected = in_viser(server, path), in_meshcat(recorder, path)
        np.testing.assert_allclose(placement[:3, 3], expected[:3, 3], atol=1e-12)
        if geometry["type"] != "BufferGeometry":
            size = np.ptp(handle.vertices, axis=0)
            lengths = np.linalg.norm(placement[:3, :3] * size, axis=0)
            wanted = np.linalg.norm(expected[:3, :3] * size_in_meshcat(geometry), axis=0)
            if geometry["type"] == "CylinderGeometry":
                wanted = wanted[[0, 2, 1]]
                axis, upright = placement[:3, 2], expected[:3, 1]
                np.testing.assert_allclose(
                    axis / np.linalg.norm(axis), upright / np.linalg.norm(upright), atol=1e-9
                )
            np.testing.assert_allclose(lengths, wanted, rtol=5e-3)
        if path in colours:
            shown = [round(255 * share) for share in colours[path][:3]]
        else:
            colour = drawn["materials"][0]["color"]
            shown = [(colour >> shift) & 0xFF for shift in (16, 8, 0)]
        assert list(handle.color) == shown
        checked += 1
    assert checked > 20


def test_a_cone_points_up_and_a_capsule_has_its_ends(server: viser.ViserServer) -> None:
    model, visual = pin.Model(), pin.GeometryModel()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "float")
    for name, shape in (("cone", coal.Cone(0.5, 2.0)), ("rod", coal.Capsule(0.1, 1.0))):
        visual.addGeometryObject(pin.GeometryObject(name, joint, pin.SE3.Identity(), shape))
    Scene(model, visual, ViserWriter(server), pin.neutral(model))
    cone = server.scene.get_handle_by_name("/world/robot/float/cone").vertices
    np.testing.assert_allclose(cone[np.argmax(cone[:, 2])], [0.0, 0.0, 1.0], atol=1e-6)
    ends = [
        server.scene.get_handle_by_name(f"/world/robot/float/rod_{k}").position[2] for k in (2, 3)
    ]
    assert ends == [-0.5, 0.5]


def test_layers_are_switched_by_name(server: viser.ViserServer) -> None:
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    view = View(ViserWriter(server), four_bar, layers=["frames"], hidden=["closures"])
    assert not server.scene.get_handle_by_name("/world/layers/closures").visible
    view.set_visible("closures", True)
    assert server.scene.get_handle_by_name("/world/layers/closures").visible
    assert server.scene.get_handle_by_name("/world/layers/frames").visible


def test_a_motion_is_not_dropped_in_silence(server: viser.ViserServer) -> None:
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    run = four_bar.simulate(four_bar.home, duration=0.05)
    with pytest.raises(RPSPinError, match=r"use View\.play"):
        View(ViserWriter(server), four_bar, run).animate()


def test_the_workspace_keeps_its_colours(server: viser.ViserServer) -> None:
    micro = RPSRobot.from_preset("micro")
    View(ViserWriter(server), micro, [0.225, 0.0, 0.0], layers=["workspace"])
    handle = server.scene.get_handle_by_name("/world/layers/workspace/surface/boundary")
    [mesh] = trimesh.load(trimesh.util.wrap_as_stream(handle.glb_data), "glb").geometry.values()
    colours = np.asarray(mesh.visual.vertex_colors)
    assert len(np.unique(colours, axis=0)) > 50
    assert set(colours[:, 3]) == {140}  # an opacity of 0.55

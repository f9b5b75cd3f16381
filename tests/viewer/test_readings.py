"""Numbers beside the scene, scales of the arrows, what the picture holds, and what is not offered.

Without a browser: what is recorded for the page.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, RPSRobot, helix
from rps_pin.errors import InputError
from rps_pin.rps.leg_frames import LEGS
from rps_pin.viewer import Forces, Ghosts, Motion, Recorder, Trail, View, fitting_layers, save_html
from rps_pin.viewer.layers.colours import BLACK, BLUE, GOLD, GREEN, VERMILLION
from rps_pin.viewer.scene.bounds import bounding_box
from rps_pin.viewer.scene.links import links_of
from rps_pin.viewer.scene.stage import stage_around
from tests.viewer.test_layers import URDF, arrow, legend, page_scales, placed, shown, user_data

#: Machado, Oliveira and Fernandes (2009): linear red, green and blue as seen without one kind of
#: cones; and as seen by others.
VISIONS = {
    "all cones": np.eye(3),
    "no long": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                [-0.003882, -0.048116, 1.051998]],
    "no middle": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                  [-0.011820, 0.042940, 0.968881]],
    "no short": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                 [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


@pytest.fixture(scope="module")
def robot() -> RPSRobot:
    return RPSRobot.from_preset("sokolov")


@pytest.fixture(scope="module")
def path(robot):
    return helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)


def lab(colour: int, vision) -> np.ndarray:
    """Return CIE L*a*b* of a colour as seen in one way."""
    shares = np.array([(colour >> shift) & 0xFF for shift in (16, 8, 0)]) / 255
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.asarray(vision) @ linear, 0.0, 1.0)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    xyz = np.array(to_xyz) @ seen / [0.9505, 1.0, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("vision", VISIONS)
def test_arrows_are_told_from_legs_and_from_each_other(robot, vision):
    painted = {
        int(np.round(255 * item.meshColor[:3]) @ [1 << 16, 1 << 8, 1])
        for item in robot.visual_model().geometryObjects
    }
    assert {BLUE, VERMILLION, GREEN} <= painted
    pairs = [(one, leg) for one in (GOLD, BLACK) for leg in (BLUE, VERMILLION, GREEN)]
    for one, other in [*pairs, (GOLD, BLACK)]:
        distance = np.linalg.norm(lab(one, VISIONS[vision]) - lab(other, VISIONS[vision]))
        assert distance > 25.0, (hex(one), hex(other))  # 2.3 is just noticeable


def test_forces_and_reactions_are_in_one_scale(robot):
    """Reactions larger than the forces: both are drawn in the scale of the larger ones."""
    q, still = robot.state([0.4, 0.1, -0.05], np.zeros(3), np.zeros(3))[0], np.zeros((1, 12))
    reactions = np.zeros((1, robot.mechanism.constraint_size))
    reactions[0, :3] = [0.0, 30.0, 40.0]
    motion = Motion(
        robot.mechanism.model, [0.0], q[None], still, still,
        forces=[[1.0, 2.0, 3.0]], constraint_forces=reactions,
    )  # fmt: skip
    _, recorder = shown(robot, motion, layers=["forces"], hidden=["reactions"])
    lengths = {name: np.linalg.norm(arrow(place)) for name, place in placed(recorder).items()}
    forces = [lengths[f"forces/leg_{leg}_prismatic"] for leg in LEGS]
    longest = lengths["reactions/leg_1"]
    np.testing.assert_allclose(np.array(forces) / [1.0, 2.0, 3.0], longest / 50.0, rtol=1e-9)
    texts = [one["text"].partition(": ")[2].partition(";")[0] for one in legend(recorder)]
    assert texts[0] == texts[1]
    _, own = shown(robot, motion, layers=[Forces(newtons_per_metre=4.0), "reactions"])
    texts = [one["text"].partition(": ")[2].partition(";")[0] for one in legend(own)]
    assert texts[0] != texts[1]


def test_the_number_of_the_ring_follows_the_motion(robot, path):
    view, recorder = shown(robot, path, layers=["singularity"])
    for time in (0.0, 2.6):
        view.show_moment(time)
        told = user_data(recorder, "/readings")
        q = view.motion.state_at(time).q
        assert told["time"] == time
        measure = 1.0 / robot.mechanism.condition(q)
        assert told["readings"]["singularity"] == f"1 / cond(J_p) = {measure:.2g}"
    [ring] = legend(recorder)
    points = view.drawings["singularity"].parts[0].shape.vertices
    reach = np.linalg.norm(points, axis=1).max()
    beside = np.array(ring["at"]) - [*view.scene.box.centre[:2], view.scene.box.lower[2]]
    assert np.linalg.norm(beside) == pytest.approx(reach, rel=1e-9)
    view.animate(frame_rate=10.0)
    every = user_data(recorder, "/readings")["every"]["singularity"]
    times = np.linspace(0.0, view.motion.duration, len(every))
    measures = [1.0 / robot.mechanism.condition(view.motion.at(time)) for time in times]
    assert every == [f"1 / cond(J_p) = {measure:.2g}" for measure in measures]


def test_the_use_of_the_limits_is_told_as_a_number():
    micro = RPSRobot.from_preset("micro")
    view, recorder = shown(micro, [0.225, 0.0, 0.0], layers=["limits"])
    view.display([0.2375, 0.0, 0.0])  # the stroke goes from 0.2 to 0.25 m
    told = user_data(recorder, "/readings")
    assert told["time"] is None
    assert told["readings"]["limits"].startswith("most: 50 % (leg_")


@pytest.mark.parametrize("name", ["rps", "delta", "stewart", "four_bar"])
def test_the_picture_holds_the_motion_and_all_arrows(name):
    """Every point within the sphere of the frame, and within the outline that the page fits."""
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    tau = np.full(mechanism.actuated_indices.size, 0.3)
    run = mechanism.simulate(mechanism.home, duration=0.2, forces=True, tau=tau)
    view, recorder = shown(mechanism, run, layers=["forces"], hidden=["reactions"])
    centre, radius = view.scene.frame.centre, view.scene.frame.radius
    stage = stage_around(view.scene.frame, 0.0)
    half, low, high = user_data(recorder, "/Cameras")["outline"]
    assert (half, low, high) == stage.outline
    camera = np.array(stage.camera_position)
    forward = -camera / np.linalg.norm(camera)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    tops = 0
    for time in np.linspace(0.0, 0.2, 41):
        view.show_moment(time)
        for node, place in placed(recorder).items():
            if node.count("/") == 1 and np.linalg.norm(arrow(place)) > 1e-4 * radius:
                tip = (place[:3, 3] + arrow(place) - centre) / radius
                assert np.linalg.norm(tip) < 1.001
                seen = tip - camera
                picture = np.array([seen @ right, seen @ up]) / (seen @ forward)
                x, y = picture / np.tan(np.radians(stage.field_of_view / 2))
                assert abs(x) < half + 0.01 and low - 0.01 < y < high + 0.01
                tops += 1
    assert tops >= 41


def test_long_arrows_widen_the_picture_not_the_robot(robot):
    _, plain = shown(robot, [0.4, 0.1, 0.0])
    view, _ = shown(robot, [0.4, 0.1, 0.0], layers=[Forces(newtons_per_metre=0.1)])
    own = links_of(view.subject.model, view.subject.visual)
    box = bounding_box(view.subject.model, own, view.motion.configurations)
    np.testing.assert_allclose(view.scene.box.upper, box.upper)
    assert view.scene.frame.radius > 3.0 * box.radius
    assert plain.messages


@pytest.mark.parametrize(
    ("name", "layer", "missing"),
    [
        ("stewart", "trail", "the robot is at rest: a path needs a motion"),
        ("stewart", "workspace", "only a 3-RPS has one"),
        ("stewart", "ghosts", r"give the configurations, Ghosts\(at=configurations\)"),
        ("four_bar", "limits", "no joint has position limits"),
        ("open", "closures", "the mechanism has no closures"),
        ("open", "reactions", "the mechanism has no loop closures"),
        ("open", "singularity", "the mechanism has no closures"),
        ("open", "trail", "the robot is at rest: a path needs a motion"),
        ("undriven", "singularity", "the conditioning needs an actuator for each motion: 0 of 1"),
        ("undriven", "forces", "no joint is actuated"),
        ("weightless", "forces", "no link has a mass"),
        ("weightless", "reactions", "no link has a mass"),
    ],
)
def test_a_layer_without_contents_is_refused_or_not_offered(name, layer, missing):
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    open_chain = four_bar.without_closures([one.name for one in four_bar.closures])
    light = pin.Model(four_bar.model)
    for joint in range(light.njoints):
        light.inertias[joint] = pin.Inertia.Zero()
    others = {
        "four_bar": four_bar,
        "open": open_chain,
        "undriven": four_bar.with_actuated([]),
        "weightless": four_bar.with_model(light),
    }
    mechanism = others.get(name) or ClosedLoopModel.load(URDF / f"{name}.yaml")
    with pytest.raises(InputError, match=f"layer '{layer}' has nothing to show: {missing}"):
        shown(mechanism, layers=[layer])
    view, _ = shown(mechanism, layers=["frames"], hidden=[layer])
    assert list(view.drawings) == ["frames"]
    assert layer not in fitting_layers(mechanism)


def test_a_trail_is_offered_for_what_moves_alone(robot, path):
    assert "trail" in fitting_layers(robot, path)
    assert "trail" not in fitting_layers(robot, [0.4, 0.0, 0.0])
    assert "trail" not in fitting_layers(robot)
    with pytest.raises(InputError, match="the origin of 'base' does not move"):
        shown(robot, path, layers=[Trail(frame="base")])
    arm = ClosedLoopModel.load(URDF / "four_bar.yaml").without_closures(["knee"])
    with pytest.raises(InputError, match=r"it needs a frame: Trail\(frame=...\)"):
        shown(arm, Motion(arm.model, [0.0, 1.0], [arm.home, arm.home]), layers=["trail"])
    at = robot.state([0.4, 0.0, 0.0], np.zeros(3), np.zeros(3))[0]
    view = View(Recorder(), robot, path, layers=[Ghosts(at=at)])
    assert list(view.drawings) == ["ghosts"]


def test_a_page_has_its_readings(robot, path, tmp_path):
    save_html(tmp_path / "a.html", robot, path, layers=["singularity", "forces"], frame_rate=5.0)
    text = (tmp_path / "a.html").read_text("utf-8")
    assert len(page_scales(text)["forces/leg_1_prismatic"]) == 27
    assert 'id="clock"' in text and 'id="playback"' in text

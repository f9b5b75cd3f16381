"""The layers, without a browser: where their parts stand, in what scale, and what is refused."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
import umsgpack

from rps_pin import ClosedLoopModel, JointCoupling, LoopClosure, RPSRobot, helix
from rps_pin.closed_loop.visuals import skeleton, visual_model
from rps_pin.errors import ClosureError, InputError
from rps_pin.rps import joint_reactions
from rps_pin.rps.dynamics.motion_run import run_motion
from rps_pin.trajectories import point_to_point
from rps_pin.viewer import (
    LAYERS,
    Forces,
    Ghosts,
    Limits,
    Motion,
    Reactions,
    Recorder,
    Singularity,
    Trail,
    View,
    WorkspaceSurface,
    fitting_layers,
    save_html,
)
from rps_pin.viewer.layers.parts import between, pointing, tube
from rps_pin.viewer.motion import MotionState
from rps_pin.viewer.scene.stage import round_number
from tests.reference import stewart

URDF = Path(__file__).parents[2] / "urdf"
POSE = [0.4, 0.1, -0.05]
LEGS = (1, 2, 3)


@pytest.fixture(scope="module")
def robot() -> RPSRobot:
    return RPSRobot.from_preset("sokolov")


@pytest.fixture(scope="module")
def path(robot):
    return helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)


def shown(what, motion=None, **options) -> tuple[View, Recorder]:
    recorder = Recorder()
    return View(recorder, what, motion, **options), recorder


def placed(recorder: Recorder) -> dict[str, np.ndarray]:
    """Return the last transform sent to each path below the layers."""
    start = "/world/layers/"
    return {
        m["path"].removeprefix(start): np.reshape(m["matrix"], (4, 4)).T
        for m in recorder.messages
        if m["type"] == "set_transform" and m["path"].startswith(start)
    }


def legend(recorder: Recorder) -> list[dict]:
    return user_data(recorder, "/world")["layers"]


def user_data(recorder: Recorder, path: str) -> dict:
    """Return what was sent last to the page's own scripts under a path."""
    sent = [m for m in recorder.messages if m.get("property") == "userData" and m["path"] == path]
    return sent[-1]["value"]


def page_scales(text: str) -> dict[str, np.ndarray]:
    """Return the scales (n, 3) that a page's keyframes give to each node below the layers."""
    packed = json.loads(re.search(r'id="commands">\n(.*?)\n</script>', text, re.DOTALL)[1])
    [animation] = [
        m
        for m in (umsgpack.unpackb(base64.b64decode(item)) for item in packed)
        if m["type"] == "set_animation"
    ]
    return {
        clip["path"].removeprefix("/world/layers/"): np.frombuffer(
            track["values"].data, dtype="<f4"
        ).reshape(-1, 3)[:, 2:]
        for clip in animation["animations"]
        for track in clip["clip"]["tracks"]
        if track["name"] == ".scale"
    }


def arrow(place: np.ndarray) -> np.ndarray:
    """Return what an arrow's placement shows: its direction times its length."""
    return place[:3, 2]


def test_every_arrow_of_the_forces_is_the_force_in_one_scale(robot, path):
    x, dx, ddx = path.sample(1.0)
    view, recorder = shown(robot, path, layers=[Forces(newtons_per_metre=4.0), Reactions(8.0)])
    q, v, a = robot.state(x, dx, ddx)
    view.display(q, v, a)
    found = placed(recorder)
    expected = joint_reactions(robot, x, dx, ddx)  # in closed form, without constraint models
    position, turn = robot.platform_placement(x)
    for leg in LEGS:
        force = found[f"forces/leg_{leg}_prismatic"]
        along = expected.leg_axes[leg - 1][:, 0]
        np.testing.assert_allclose(
            arrow(force), expected.actuator[leg - 1] * along / 4.0, atol=1e-12
        )
        way = 2 * np.pi / 3 * (leg - 1)
        tip = position + turn @ (0.230 * np.array([np.cos(way), np.sin(way), 0.0]))
        np.testing.assert_allclose(force[:3, 3], tip, atol=1e-12)
        reaction = found[f"reactions/leg_{leg}"]
        np.testing.assert_allclose(arrow(reaction), expected.spherical[leg - 1] / 8.0, atol=1e-12)
        np.testing.assert_allclose(reaction[:3, 3], tip, atol=1e-12)


def test_the_scale_on_screen_is_the_arrows_own(robot, path):
    _, recorder = shown(robot, path, layers=["forces"])
    text = legend(recorder)[0]["text"]
    assert text.startswith("actuators' forces: 200 mm for 1 N; at most 0.93")
    q, v, a = robot.state(*path.sample(0.0))
    force = robot.inverse_dynamics(q, v, a).tau[0]
    length = np.linalg.norm(arrow(placed(recorder)["forces/leg_1_prismatic"]))
    assert length == pytest.approx(0.2 * abs(force), rel=1e-9)


def test_outside_wrenches_and_known_forces_are_shown(robot):
    q, still = robot.state(POSE, np.zeros(3), np.zeros(3))[0], np.zeros((1, 12))
    push = [0.0, 0.0, -7.0, 0.0, 0.0, 0.0]
    motion = Motion(robot.mechanism.model, [0.0], q[None], wrenches={"platform": push})
    _, recorder = shown(robot, motion, layers=[Forces(newtons_per_metre=1.0)])
    expected = robot.inverse_dynamics(q, still[0], still[0], wrench=push).tau
    known = Motion(robot.mechanism.model, [0.0], q[None], still, still, forces=[[1.0, 2.0, 3.0]])
    _, other = shown(robot, known, layers=[Forces(newtons_per_metre=1.0)])
    for leg in LEGS:
        node = f"forces/leg_{leg}_prismatic"
        length = np.linalg.norm(arrow(placed(recorder)[node]))
        assert length == pytest.approx(abs(expected[leg - 1]), rel=1e-9)
        assert np.linalg.norm(arrow(placed(other)[node])) == pytest.approx(leg)


@pytest.mark.parametrize("writes", ["view", "page"])
def test_arrows_of_a_motion_run_are_its_own_forces_with_its_wrench(robot, path, tmp_path, writes):
    """The run knows its wrench only through its forces: they must not be computed again."""
    push = [3.0, -2.0, -7.0, 0.1, 0.2, 0.0]
    run = run_motion(robot, path, 100.0, wrench=push)
    layers = [Forces(newtons_per_metre=4.0), Reactions(8.0)]
    if writes == "view":
        view, recorder = shown(robot, run, layers=layers)
        times = run.time[[0, 77, 200, -1]]
        arrows = []
        for time in times:
            view.show_moment(time)
            arrows.append({node: arrow(place) for node, place in placed(recorder).items()})
    else:
        save_html(tmp_path / "page.html", robot, run, layers=layers)
        scales = page_scales((tmp_path / "page.html").read_text("utf-8"))
        count = len(scales["forces/leg_1_prismatic"])
        times = np.linspace(0.0, run.time[-1], count)
        arrows = [{node: scale[k] for node, scale in scales.items()} for k in range(count)]

    def at(rows: np.ndarray, time: float) -> np.ndarray:
        flat = rows.reshape(len(rows), -1).T
        return np.array([np.interp(time, run.time, row) for row in flat]).reshape(rows.shape[1:])

    free = run_motion(robot, path, 100.0)
    assert np.abs(run.force - free.force).min() > 0.1
    for time, found in zip(times, arrows, strict=True):
        for leg in LEGS:
            force = np.linalg.norm(found[f"forces/leg_{leg}_prismatic"])
            assert force == pytest.approx(abs(at(run.force, time)[leg - 1]) / 4.0, rel=1e-6)
            reaction = np.linalg.norm(found[f"reactions/leg_{leg}"])
            expected = np.linalg.norm(at(run.reaction, time)[leg - 1])
            assert reaction == pytest.approx(expected / 8.0, rel=1e-6)


def test_forces_of_rest_are_said_to_be_and_known_ones_are_not(robot):
    q = robot.state(POSE, np.zeros(3), np.zeros(3))[0][None]
    for known, forces in ((False, None), (True, [[1.0, 2.0, 3.0]])):
        motion = Motion(robot.mechanism.model, [0.0], q, forces=forces)
        _, recorder = shown(robot, motion, layers=["forces", "reactions"])
        own, of_closures = (entry["text"] for entry in legend(recorder))
        assert (", at rest:" in own) is not known
        assert ", at rest:" in of_closures


def test_forces_that_are_all_zero_are_nothing_to_show():
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    run = four_bar.simulate(four_bar.home, duration=0.05, forces=True)
    assert "forces" not in fitting_layers(four_bar, run)
    with pytest.raises(InputError, match="the actuators exert no force in this motion"):
        shown(four_bar, run, layers=["forces"])


def test_reactions_of_a_simulation_are_its_own_with_its_wrench():
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    push = {"coupler": [3.0, 0.0, -5.0, 0.0, 0.0, 0.0]}
    run = four_bar.simulate(four_bar.home, duration=0.05, wrenches=push, forces=True)
    view, recorder = shown(four_bar, run, layers=[Reactions(8.0)])
    view.show_moment(run.time[-1])
    wrench = four_bar.closure_wrenches(run.q[-1], run.constraint_forces[-1])["knee"]
    np.testing.assert_allclose(
        arrow(placed(recorder)["reactions/knee"]), wrench[:3] / 8.0, rtol=1e-9, atol=1e-12
    )


def test_arrows_between_coarse_samples_are_those_of_the_closed_state():
    """Interpolation opens the loops by more than inverse dynamics accepts."""
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    cranks = four_bar.home[0] + np.array([0.0, 0.15])
    ends = [four_bar.complete({"crank_joint": crank}, four_bar.home) for crank in cranks]
    motion = Motion(four_bar.model, [0.0, 1.0], ends)
    middle = motion.at(0.5)
    assert four_bar.loop_gap(middle) > 1e-4
    with pytest.raises(ClosureError):
        four_bar.inverse_dynamics(middle, np.zeros(3), np.zeros(3))
    layers = [Forces(newton_metres_per_metre=2.0), Reactions(8.0)]
    view, recorder = shown(four_bar, motion, layers=layers)
    view.show_moment(0.5)
    found, closed = placed(recorder), four_bar.close(middle)
    expected = four_bar.inverse_dynamics(closed, np.zeros(3), np.zeros(3))
    length = np.linalg.norm(arrow(found["forces/crank_joint"]))
    assert length == pytest.approx(abs(expected.tau[0]) / 2.0, rel=1e-9)
    wrench = four_bar.closure_wrenches(closed, expected.constraint_forces)["knee"]
    reaction = np.linalg.norm(arrow(found["reactions/knee"]))
    assert reaction == pytest.approx(np.linalg.norm(wrench[:3]) / 8.0, rel=1e-2)


def test_arrows_beyond_the_joint_limits_are_those_of_the_state_itself():
    micro = RPSRobot.from_preset("micro")
    free = RPSRobot(micro.parameters.without_limits())
    view, recorder = shown(micro, [0.225, 0.0, 0.0], layers=[Forces(newtons_per_metre=4.0)])
    still, beyond = np.zeros(3), [0.225, np.radians(40.0), 0.0]
    view.display(free.state(beyond, still, still)[0])
    force = free.actuator_forces(beyond, still, still)
    for leg in LEGS:
        length = np.linalg.norm(arrow(placed(recorder)[f"forces/leg_{leg}_prismatic"]))
        assert length == pytest.approx(abs(force[leg - 1]) / 4.0, rel=1e-9)


def test_a_visibly_open_mechanism_has_no_arrows():
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    view, recorder = shown(four_bar, layers=["forces", "reactions"])
    assert np.linalg.norm(arrow(placed(recorder)["forces/crank_joint"])) > 0.01
    view.display(four_bar.home + np.array([0.3, 0.0, 0.0]))
    found = placed(recorder)
    for node in ("forces/crank_joint", "reactions/knee"):
        assert np.linalg.norm(arrow(found[node])) < 1e-5


def test_torques_have_two_heads_and_lie_along_the_axis():
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    _, recorder = shown(four_bar, layers=[Forces(newton_metres_per_metre=2.0)])
    still = np.zeros(four_bar.model.nv)
    tau = four_bar.inverse_dynamics(four_bar.home, still, still).tau[0]
    found = placed(recorder)
    assert "forces/crank_joint/second_head" in found
    [joint] = ElementTree.parse(URDF / "four_bar.urdf").findall("joint[@name='crank_joint']")
    axis = np.array(joint.find("axis").get("xyz").split(), float)
    np.testing.assert_allclose(arrow(found["forces/crank_joint"]), axis * tau / 2, atol=1e-12)


def test_the_trail_is_magnified_as_it_says(robot, path):
    view, recorder = shown(robot, path, layers=[Trail(factor=200)])
    assert "magnified 200 times" in legend(recorder)[0]["text"]
    x = path.sample(1.5)[0]
    start, now = robot.platform_placement(path.sample(0.0)[0])[0], robot.platform_placement(x)[0]
    view.display(x)
    np.testing.assert_allclose(
        placed(recorder)["trail/point"][:3, 3], start + 200 * (now - start), atol=1e-9
    )


def test_ghosts_are_all_the_other_modes(robot):
    view, recorder = shown(robot, POSE, layers=["ghosts"])
    modes = robot.assembly_modes(robot.inverse_kinematics(POSE).length)
    assert legend(recorder)[0]["text"].startswith(f"{len(modes.angle) - 1} other assembly modes")
    ghosts = view.drawings["ghosts"].parts
    balls = {  # of the platforms, told by their link's name and the shape's radius
        int(part.node): part.placement[:3, 3]
        for part in ghosts
        if part.name.startswith("platform_") and type(part.shape).__name__ == "Sphere"
    }
    position, _ = robot.platform_placement(POSE)
    others = [p for p in modes.position if np.linalg.norm(p - position) > 1e-6]
    assert sorted(balls) == list(range(1, len(others) + 1))
    distances = [np.linalg.norm(others[number - 1] - ball) for number, ball in balls.items()]
    np.testing.assert_allclose(distances, 0.230, atol=1e-9)  # a ball is h from a mode's centre


def test_limits_turn_to_vermillion_at_the_limit():
    micro = RPSRobot.from_preset("micro")
    context_free = Limits()
    view, _ = shown(micro, [0.225, 0.0, 0.0], layers=[context_free])
    update = view.drawings["limits"].update
    assert update is not None
    still = np.zeros(12)

    def colour(z: float) -> tuple[float, float, float]:
        q = micro.state([z, 0.0, 0.0], np.zeros(3), np.zeros(3))[0]
        return update(MotionState(q, still, still))["leg_2_prismatic"].colour

    vermillion, blue = (0xD5 / 255, 0x5E / 255, 0.0), (0.0, 0x72 / 255, 0xB2 / 255)
    np.testing.assert_allclose(colour(0.25 - 1e-9), vermillion, atol=0.01)
    np.testing.assert_allclose(colour(0.225), blue, atol=0.02)


def test_the_singularity_ring_is_the_condition_number(robot):
    view, _ = shown(robot, POSE, layers=[Singularity(worst=1e-2)])
    update = view.drawings["singularity"].update
    assert update is not None
    still = np.zeros(12)
    near = robot.state([0.004, 0.0, 0.0], np.zeros(3), np.zeros(3))[0]
    assert 1 / robot.mechanism.condition(near) < 1e-2
    red, _, blue = update(MotionState(near, still, still))["ring"].colour
    assert red > 0.8 and blue < 0.05


def test_the_workspace_surface_spans_the_workspace():
    micro = RPSRobot.from_preset("micro")
    view, recorder = shown(micro, [0.225, 0.0, 0.0], layers=[WorkspaceSurface(factor=10)])
    points = view.drawings["workspace"].parts[0].shape.vertices
    assert points[:, 2].min() == pytest.approx(0.200, abs=2e-3)
    assert points[:, 2].max() == pytest.approx(0.250, abs=1e-6)
    bar = legend(recorder)[0]
    assert float(bar["low"]) < float(bar["high"]) <= 1.0
    assert len(bar["colours"]) == 7
    # x = h/2 b (wx^2 - wy^2) stays below 2.5 mm: the paper's stroke
    assert 0.010 < np.abs(points[:, 0]).max() < 0.025


@pytest.mark.parametrize(
    "name",
    [
        *("four_bar", "delta", "stewart", "slider_crank", "five_bar"),
        *("rotary_stewart", "linear_delta", "planar_rrr"),
    ],
)
def test_any_mechanism_shows_with_all_that_fits_and_nothing_but_its_model(name):
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    fitting = fitting_layers(mechanism)
    view, recorder = shown(mechanism, layers=fitting)
    assert list(view.drawings) == fitting
    found, data = placed(recorder), mechanism.model.createData()
    pin.framesForwardKinematics(mechanism.model, data, mechanism.home)
    for closure in mechanism.closures:
        a, b = closure.frame_ids(mechanism.model)
        for side, frame in (("a", a), ("b", b)):
            mark = found[f"closures/{closure.name}_{side}"][:3, 3]
            np.testing.assert_allclose(mark, data.oMf[frame].translation, atol=1e-12)


def test_offsets_of_closures_are_drawn_where_they_stand():
    """By hand: the frame's placement times the offset; at a pose in the world, that pose."""
    tree = ClosedLoopModel.load(URDF / "four_bar.yaml").without_closures(["knee"])
    at = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), np.array([0.1, 0.02, -0.03]))
    pose = np.array([0.4, 0.0, 0.2])
    closures = [
        LoopClosure("coupler", "rocker", "planar", placement_a=at, placement_b=at, name="grip"),
        LoopClosure(
            "crank",
            "universe",
            "distance",
            name="tie",
            distance=0.5,
            placement_b=pin.SE3(np.eye(3), pose),
        ),
    ]
    held = ClosedLoopModel(tree.model, closures, [])
    q = tree.home + np.array([0.2, -0.3, 0.1])
    _, recorder = shown(held, q, layers=["closures"])
    found, data = placed(recorder), held.model.createData()
    pin.framesForwardKinematics(held.model, data, q)
    for side, name in (("a", "coupler"), ("b", "rocker")):
        mark = found[f"closures/grip_{side}"][:3, 3]
        frame = data.oMf[held.model.getFrameId(name)]
        np.testing.assert_allclose(mark, frame.act(at.translation), atol=1e-12)
    np.testing.assert_allclose(found["closures/tie_b"][:3, 3], pose, atol=1e-12)


def test_an_open_closure_shows_its_gap():
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    view, recorder = shown(four_bar, layers=["closures"])
    q = four_bar.home + np.array([0.1, 0.0, 0.0])
    view.display(q)
    length = np.linalg.norm(placed(recorder)["closures/knee_line"][:3, 2])
    assert length == pytest.approx(four_bar.loop_gap(q), rel=1e-9)
    assert length > 0.01


def test_a_coupling_is_drawn_between_its_joints():
    tree = ClosedLoopModel.load(URDF / "four_bar.yaml").model
    geared = ClosedLoopModel(
        tree, [JointCoupling("rocker_joint", "crank_joint", -1.0, name="gear")], ["crank_joint"]
    )
    assert "closures" in fitting_layers(geared)
    _, recorder = shown(geared, layers=["closures"])
    found, data = placed(recorder), geared.model.createData()
    pin.forwardKinematics(geared.model, data, geared.home)
    for side, joint in (("a", "rocker_joint"), ("b", "crank_joint")):
        place = data.oMi[geared.model.getJointId(joint)].translation
        np.testing.assert_allclose(found[f"closures/gear_{side}"][:3, 3], place, atol=1e-12)
    (row,) = (one for one in legend(recorder) if "couplings" in one["text"])
    assert "closures" in row["text"]


def test_a_coupling_of_several_joints_is_drawn_to_each():
    tree = ClosedLoopModel.load(URDF / "four_bar.yaml").model
    others = {"crank_joint": 1.0, "coupler_joint": -2.0}
    tied = [JointCoupling("rocker_joint", others, name="tie")]
    geared = ClosedLoopModel(tree, tied, ["crank_joint", "coupler_joint"])
    _, recorder = shown(geared, layers=["closures"])
    found, data = placed(recorder), geared.model.createData()
    pin.forwardKinematics(geared.model, data, geared.home)
    for name, other in zip(("tie", "tie_1"), others, strict=True):
        for side, joint in (("a", "rocker_joint"), ("b", other)):
            place = data.oMi[geared.model.getJointId(joint)].translation
            np.testing.assert_allclose(found[f"closures/{name}_{side}"][:3, 3], place, atol=1e-12)


def test_a_skeleton_reaches_every_closed_frame():
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    bars = [one for one in skeleton(four_bar).geometryObjects if one.name.startswith("bar")]
    lengths = sorted(2 * float(bar.geometry.halfLength) for bar in bars)
    np.testing.assert_allclose(lengths, [0.2, 0.4, 0.45, 0.5], rtol=1e-12)


def bars(recorder: Recorder) -> dict[str, np.ndarray]:
    """Return begin and end, (2, 3), of each bar that is no link, as sent last."""
    start = "/world/robot/bars/"
    found = {}
    for m in recorder.messages:
        name = m.get("path", "").removeprefix(start)
        if m["type"] == "set_transform" and m["path"].startswith(start) and "/" not in name:
            place = np.reshape(m["matrix"], (4, 4)).T
            ends = place @ np.array([[0, 0, 0, 1.0], [0, 0, 1, 1.0]]).T
            found[name] = ends[:3].T
    return found


@pytest.mark.parametrize("name", ["delta", "linear_delta"])
@pytest.mark.parametrize("with_shapes", [True, False])
def test_rods_of_distance_closures_are_drawn(name, with_shapes):
    """From frame to frame, as long as they are, in every pose and in the animation."""
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    shapes = visual_model(URDF / f"{name}.yaml", mechanism.model)
    if not with_shapes:
        shapes = mechanism.file = None
    path = point_to_point(mechanism.task.home, mechanism.task.home + 0.02, duration=1.0)
    view, recorder = shown(mechanism, path, visual=shapes)
    for share in (0.0, 0.6, 1.0):
        view.show_moment(share)
        q, found = view.motion.state_at(share).q, bars(recorder)
        sliding = name == "linear_delta" and not with_shapes
        assert len(found) == len(mechanism.closures) + (3 if sliding else 0)
        for closure in mechanism.closures:
            begin, end = found[closure.name]
            for frame, place in ((closure.frame_a, begin), (closure.frame_b, end)):
                where = mechanism.frame_placement(q, frame)[:3, 3]
                np.testing.assert_allclose(place, where, atol=1e-9)
            assert np.linalg.norm(end - begin) == pytest.approx(closure.distance, rel=1e-9)
    view.animate()
    animated = {clip["path"] for clip in recorder.messages[-1]["animations"]}
    assert {f"/world/robot/bars/{closure.name}" for closure in mechanism.closures} <= animated


def test_a_skeleton_has_legs_as_long_as_their_joints_say():
    """Those of a Stewart platform, by the closed form; with its own shapes they are not drawn."""
    mechanism = ClosedLoopModel.load(URDF / "stewart.yaml")
    pose = mechanism.task.home + np.array([0.03, -0.02, 0.05, 0.1, 0.2, -0.1])
    shapes = visual_model(URDF / "stewart.yaml", mechanism.model)
    assert not bars(shown(mechanism, visual=shapes)[1])
    assert not bars(shown(mechanism)[1])  # those of its file
    mechanism.file = None
    view, recorder = shown(mechanism)
    view.display(mechanism.task.configuration(pose))
    turn, found = pin.exp3(pose[3:]), bars(recorder)
    assert len(found) == 6
    for i, (anchor, ball) in enumerate(zip(stewart.ANCHORS, stewart.BALLS, strict=True), 1):
        begin, end = found[f"leg_{i}_rod_joint"]
        np.testing.assert_allclose(begin, anchor, atol=1e-9)
        np.testing.assert_allclose(end, pose[:3] + turn @ ball, atol=1e-9)


def test_layers_are_switched_by_name(robot):
    view, recorder = shown(robot, POSE, layers=["frames"], hidden=["closures"])
    assert [(one["name"], one["visible"]) for one in legend(recorder)] == [
        ("frames", True),
        ("closures", False),
    ]
    view.set_visible("closures", True)
    last = [m for m in recorder.messages if m.get("property") == "visible"][-1]
    assert (last["path"], last["value"]) == ("/world/layers/closures", True)
    assert legend(recorder)[1]["visible"] is True
    with pytest.raises(InputError, match="no layer 'trail' in this view; there are: frames, clos"):
        view.set_visible("trail", True)


@pytest.mark.parametrize(
    ("layers", "complaint"),
    [
        (["tail"], "no layer 'tail'; there are: frames, trail"),
        ([Trail], "is not a layer"),
        ([Trail(factor=0.5)], "factor = 0.5"),
        ([Trail(frame="nose")], "no frame 'nose'; there are: universe"),
        ([Forces(newtons_per_metre=-1.0)], "must be positive"),
    ],
)
def test_what_is_no_layer_is_refused(robot, layers, complaint):
    with pytest.raises(InputError, match=complaint):
        shown(robot, POSE, layers=layers)


@pytest.mark.parametrize("layer", ["ghosts", "workspace"])
def test_layers_of_the_3_rps_say_so_of_others(layer):
    four_bar = ClosedLoopModel.load(URDF / "four_bar.yaml")
    with pytest.raises(InputError, match=f"layer '{layer}'"):
        shown(four_bar, layers=[layer])
    if layer == "ghosts":
        view, _ = shown(four_bar, layers=[Ghosts(at=four_bar.home)])
        assert "1 other poses" in view.drawings["ghosts"].legend.text


@pytest.mark.parametrize(
    ("what", "motion", "complaint"),
    [
        ("robot", None, "at a pose"),
        ("robot", [1.0, 2.0], r"must be \(13,\)"),
        ("robot", "nonsense", "not a motion"),
        ("nothing", None, "cannot be shown"),
    ],
)
def test_what_cannot_be_shown_is_refused(robot, what, motion, complaint):
    with pytest.raises(InputError, match=complaint):
        shown(robot if what == "robot" else 3.0, motion)


def test_all_layers_have_the_names_they_go_by(robot):
    micro = RPSRobot.from_preset("micro")
    path = point_to_point([0.225, 0.1, 0.0], [0.23, 0.1, 0.0], duration=1.0)
    view, _ = shown(micro, path, layers=list(LAYERS))
    assert list(view.drawings) == list(LAYERS)


def test_arrows_and_bars_point_every_way():
    for vector in ([0, 0, 2.0], [0, 0, -2.0], [1.0, 0, 0], [0.3, -0.4, 1.2]):
        start = np.array([0.1, 0.2, 0.3])
        place = pointing(start, np.array(vector))
        np.testing.assert_allclose(place @ [0, 0, 1, 1], [*(start + vector), 1], atol=1e-12)
        assert np.linalg.det(place[:3, :3]) == pytest.approx(np.linalg.norm(vector) ** 3)
        bar = between(start, start + np.array(vector))
        np.testing.assert_allclose(bar @ [0, 0, 1, 1], [*(start + vector), 1], atol=1e-12)
    assert np.linalg.norm(pointing(np.zeros(3), np.zeros(3))[:3, 2]) < 1e-5


def test_a_tube_keeps_its_radius():
    turn = np.linspace(0, 6, 60)
    line = np.stack([np.cos(turn), np.sin(turn), 0.1 * turn], axis=1)
    made = tube(line, 0.02)
    rings = made.vertices.reshape(60, 6, 3)
    np.testing.assert_allclose(np.linalg.norm(rings - line[:, None], axis=2), 0.02, rtol=1e-4)
    assert made.faces.max() == 359


@pytest.mark.parametrize(("wanted", "number"), [(7.0, 5.0), (1.0, 1.0), (0.049, 0.02)])
def test_round_numbers(wanted, number):
    assert round_number(wanted) == pytest.approx(number)

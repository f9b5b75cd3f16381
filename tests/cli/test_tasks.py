"""`rps-pin ik` and `fk` of any mechanism with a task."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.task import Payload, load_task_trajectory, size_trajectory
from tests.cli.commands import rps_pin
from tests.worst import worst

URDF = Path(__file__).parents[2] / "urdf"


def answer(*words: str) -> dict:
    return json.loads(rps_pin(*words, "--json").stdout)


def test_positions_go_there_and_back() -> None:
    there = answer("ik", "--mechanism", "stewart", "--at", "z=0.64", "--at", "rx=0.1")
    task = ClosedLoopModel.load("urdf/stewart.yaml").task
    x = task.home
    x[[2, 3]] = 0.64, 0.1
    assert worst(np.array(list(there["actuators"].values())) - task.to_actuators(x)) < 1e-12
    given = [f"--at={name}={value!r}" for name, value in there["actuators"].items()]
    back = answer("fk", "--mechanism", "stewart", *given)
    assert list(back["task"]) == ["x", "y", "z", "rx", "ry", "rz"]
    assert worst(np.array(list(back["task"].values())) - x) < 1e-11
    assert back["units"] == {"length": "m", "angle": "rad"}


def test_degrees_are_those_of_angles_alone() -> None:
    there = answer("ik", "-m", "stewart", "--at", "rx=10", "--at", "x=0.01", "--degrees")
    same = answer("ik", "-m", "stewart", "--at", f"rx={math.radians(10)!r}", "--at", "x=0.01")
    assert (
        worst([there["actuators"]["leg_1_rod_joint"] - same["actuators"]["leg_1_rod_joint"]])
        < 1e-12
    )
    assert there["task"]["rx"] == pytest.approx(10)
    assert there["task"]["x"] == pytest.approx(0.01)
    of_arms = answer("fk", "-m", "delta", "--at", "arm_1_joint=20", "--degrees")
    assert of_arms["actuators"]["arm_1_joint"] == pytest.approx(20)
    assert of_arms["units"]["angle"] == "deg"


def test_tables_name_units_and_limits() -> None:
    told = rps_pin("ik", "-m", "stewart", "--degrees").stdout
    for word in ("leg_1_rod_joint", "0.45 to 0.95", "deg", "type_ii"):
        assert word in told


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (("ik", "-m", "delta", "--at", "z=-0.1"), 1, "'coordinates of platform' stays open by"),
        (("ik", "-m", "delta", "--at", "rx=0.1"), 1, "--at: no 'rx'; there are: x, y, z"),
        (("ik", "-m", "delta", "--at", "z"), 1, "it must be JOINT=NUMBER"),
        (("ik", "-m", "delta", "--at", "z=nan"), 1, ""),
        (("fk", "-m", "delta", "--at", "elbow=1"), 1, "no 'elbow'; there are: arm_1_joint"),
        (
            ("fk", "-m", "delta", "--at", "arm_1_joint=2"),
            1,
            "'arm_1_joint' at 2 rad (-1.2 to",
        ),
        (("ik", "-m", "gripper"), 1, "gripper has no task"),
        (("ik", "-m", "delta", "-r", "micro"), 2, "it does not go with a mechanism"),
        (("fk", "-m", "delta", "-r", "micro"), 2, "it does not go with a mechanism"),
        (("ik", "-m", "nothing"), 1, "is not a file or a mechanism of the package"),
        (("ik",), 2, "give a pose, or a --mechanism"),
        (("fk",), 2, "give leg lengths, or a --mechanism"),
        (("ik", "--at", "z=1"), 2, "these options need a"),
        (("ik", "-m", "delta", "--pose", "1", "0", "0"), 2, "are given by --at"),
        (("fk", "-m", "delta", "--near", "1", "0", "0"), 2, "are given by --at"),
    ],
)
def test_what_does_not_fit_is_refused(words, status, message) -> None:
    done = rps_pin(*words)
    assert done.returncode == status
    told = (done.stdout + done.stderr).replace("│", " ")
    assert message in " ".join(told.split())
    assert "Traceback" not in done.stderr


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "path.yaml"
    file.write_text("kind: point_to_point\nend: {z: 0.66, rx: 0.1}\nduration: 1\n")
    return file


def test_a_path_of_a_task_is_checked(path) -> None:
    clear = rps_pin("check", str(path), "--mechanism", "stewart", "--json")
    assert clear.returncode == 0
    assert json.loads(clear.stdout)["ok"] is True
    path.write_text("kind: point_to_point\nend: {rz: 1.8}\nduration: 2\n")
    crossing = json.loads(rps_pin("check", str(path), "-m", "stewart", "--json").stdout)
    assert not crossing["ok"]
    met = [one for one in crossing["singularities"] if one["singularity"] == "type II"]
    assert [one["kind"] for one in met] == ["crosses"]
    assert met[0]["pose"][5] == pytest.approx(np.pi / 2, abs=1e-6)  # as its geometry says


def test_a_trajectory_file_of_the_3rps_is_checked(path) -> None:
    path.write_text("kind: circle\nheight: 0.223\ntilt: 0.1\nduration: 1\n")
    assert rps_pin("check", str(path), "--robot", "micro").returncode == 0


def test_any_mechanism_and_trajectory_is_shown(path, tmp_path) -> None:
    page = tmp_path / "page.html"
    done = rps_pin("view", str(path), "-m", "stewart", "--html", str(page))
    assert done.returncode == 0, done.stderr
    assert page.stat().st_size > 10_000
    home = tmp_path / "home.html"
    assert rps_pin("view", "-m", "delta", "--html", str(home)).returncode == 0
    assert home.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("check", "-m", "stewart"), "a mechanism has no helix: give a trajectory"),
        (("view", "-m", "delta", "--pose", "1", "0", "0"), "it does not go with a mechanism"),
        (("view", "p.csv", "--pose", "1", "0", "0"), "it does not go with a trajectory"),
        (("view", "-r", "micro", "--poses", "p.yaml"), "it is of the panel: see --interactive"),
        (("view", "-i", "--fastest"), "there is no trajectory"),
        (("view", "-m", "delta", "-r", "micro"), "it does not go with a mechanism"),
        (("view", "p.csv", "--radius", "0.001"), "it does not go with a trajectory"),
        (("view", "--pose", "0.4", "0", "0", "--pitch", "0"), "does not go with --pose"),
        (("view", "--time", "1"), "it is the time of a picture"),
        (("view", "--html", "a.html", "--size", "9x9"), "it is of a picture or film"),
        (("view", "--html", "a.html", "--port", "80"), "and no server started"),
        (("view", "--overwrite"), "no file is written"),
        (("view", "--ignore-limits"), "it is an option of a mechanism"),
        (("view", "-i", "--png", "a.png"), "it does not go with --interactive"),
        (("view", "micro", "-r", "sokolov"), "micro is a robot already"),
        (("view", "delta", "-m", "stewart"), "delta is a robot already"),
        (("check", "p.csv", "--radius", "0.001"), "it does not go with a trajectory"),
        (("check", "p.csv", "-m", "delta", "-r", "micro"), "it does not go with a mechanism"),
        (("dynamics", "p.csv", "-m", "delta", "-r", "micro"), "does not go with a mechanism"),
        (("dynamics", "p.csv", "--ignore-limits"), "it is an option of a mechanism"),
    ],
)
def test_options_that_do_not_go_together_are_refused(words, message) -> None:
    done = rps_pin(*words)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.replace("│", " ").split())


def test_forces_of_a_path_are_written_and_can_be_read_as_a_path(tmp_path) -> None:
    file = tmp_path / "d.yaml"
    file.write_text("kind: point_to_point\nend: {x: 0.1, z: -0.48}\nduration: 0.5\n")
    given = ("dynamics", str(file), "-m", "delta", "--rate", "100", "--payload", "0.2")
    done = rps_pin(*given, "-o", str(tmp_path / "out"), "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert [one["name"] for one in told["sizing"]["actuators"]] == [
        f"arm_{leg}_joint" for leg in (1, 2, 3)
    ]
    for name in ("dynamics.csv", "sizing.json", "viewer.html", "force_over_speed.png"):
        assert (tmp_path / "out" / name).stat().st_size > 100
    task = ClosedLoopModel.load("urdf/delta.yaml").task
    again = load_task_trajectory(tmp_path / "out" / "dynamics.csv", task)
    path = load_task_trajectory(file, task)
    for t in (0.0, 0.1, 0.25, 0.5):
        assert worst(again.sample(t).pose - path.sample(t).pose) < 1e-9
    table = np.genfromtxt(tmp_path / "out" / "dynamics.csv", delimiter=",", names=True)
    sized = size_trajectory(task, path, 100.0, payload=Payload(0.2))
    peaks = [one.force_peak for one in sized.actuators]
    for leg, peak in enumerate(peaks, start=1):
        assert worst(table[f"arm_{leg}_joint_force_Nm"]) == pytest.approx(peak, rel=1e-12)


def test_forces_of_one_pose_are_those_of_inverse_dynamics() -> None:
    found = answer("ik", "-m", "stewart", "--at", "z=0.65", "--at", "rx=0.1", "--forces")
    mechanism = ClosedLoopModel.load(URDF / "stewart.yaml")
    legs = np.array(list(found["forces"].values()))
    # Virtual work: the legs' forces do the work against all weights.
    task, q = mechanism.task, np.array(found["configuration"])
    slope, data = np.empty(6), mechanism.model.createData()
    for i in range(6):
        heights = []
        for step in (-1e-5, 1e-5):
            x = task.at(q) + step * np.eye(6)[i]
            moved = task.configuration(x, q)
            heights.append(pin.computePotentialEnergy(mechanism.model, data, moved))
        slope[i] = (heights[1] - heights[0]) / 2e-5
    np.testing.assert_allclose(task.jacobian(q).T @ legs, slope, rtol=1e-6, atol=1e-6)
    told = rps_pin("ik", "-m", "stewart", "--forces").stdout
    assert "force" in told and "singular (" not in told
    told = rps_pin("ik", "-m", "delta", "--forces").stdout
    assert "N m" in told


def test_a_mechanism_without_masses_has_no_forces(tmp_path: Path) -> None:
    text = (URDF / "five_bar.urdf").read_text()
    bare = re.sub(r"<inertial>.*?</inertial>", "", text, flags=re.DOTALL)
    (tmp_path / "five_bar.urdf").write_text(bare)
    shutil.copy(URDF / "five_bar.yaml", tmp_path / "bare.yaml")
    assert rps_pin("ik", "-m", "bare.yaml", folder=tmp_path).returncode == 0
    (tmp_path / "path.yaml").write_text("kind: point_to_point\nend: {x: 0.25}\nduration: 0.5\n")
    bare_one = ("-m", "bare.yaml")
    for words in (("ik", *bare_one, "--forces"), ("dynamics", "path.yaml", *bare_one)):
        ended = rps_pin(*words, folder=tmp_path)
        assert ended.returncode == 1
        assert "no link of five-bar has a mass: forces need the <inertial>" in ended.stderr


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A 3-RPS of one's own, and trajectories of it: a circle, as a task, and as a table."""
    folder = tmp_path_factory.mktemp("own")
    assert rps_pin("new", "3rps", "-o", ".", folder=folder).returncode == 0
    (folder / "there.yaml").write_text(
        "kind: point_to_point\nend: {z: 0.23, rx: 0.05}\nduration: 0.2\n"
    )
    (folder / "table.csv").write_text(
        "time_s,z_m,tilt_x_deg,tilt_y_deg\n0,0.22,0,0\n0.1,0.22,1,0\n"
    )
    return folder


def test_a_3_rps_as_a_mechanism_is_as_a_robot(own: Path) -> None:
    given = ("dynamics", "path.yaml", "--rate", "50", "--json")
    options = (("--robot", "mine.yaml", "-o", "a"), ("-m", "mine.yaml", "-o", "b"))
    first, second = (json.loads(rps_pin(*given, *more, folder=own).stdout) for more in options)
    for one, other in zip(first["sizing"]["actuators"], second["sizing"]["actuators"], strict=True):
        for name in ("force_peak", "force_rms", "speed_peak", "stroke"):
            assert one[name] == pytest.approx(other[name], rel=1e-9)
    for path in ("path.yaml", "there.yaml", "table.csv"):
        for words in (("check", path), ("view", path, "--html", "a.html", "--overwrite")):
            done = rps_pin(*words, "-m", "mine.yaml", folder=own)
            assert done.returncode == 0, done.stderr
    assert rps_pin("view", "-m", "mine.yaml", "--html", "home.html", folder=own).returncode == 0
    (own / "loop.yaml").write_text(
        "mechanism: mine.yaml\ntrajectory: {kind: circle, tilt: 0.1}\ncontroller: {law: pd}\n"
    )
    told = rps_pin("control", "loop.yaml", folder=own)
    assert "line 1: mine.yaml holds the parameters of a 3-RPS: write robot: mine" in told.stderr


def test_gravity_and_power_of_a_mechanism(path: Path, tmp_path: Path) -> None:
    words = ("dynamics", str(path), "-m", "stewart", "--rate", "20", "--json", "--overwrite")
    words = (*words, "-o", str(tmp_path / "out"))
    loads = []
    for gravity in ((0.0, 0.0, -9.81), (0.0, 0.0, 0.0), (0.0, 0.0, 9.81)):
        given = ("--gravity", *map(str, gravity), "--power", "0.01")
        sizing = json.loads(rps_pin(*words, *given).stdout)["sizing"]
        broken = [m for one in sizing["actuators"] for m in one["margins"] if not m["kept"]]
        assert {(one["quantity"], one["limit"]) for one in broken} == {("power", 0.01)}
        table = np.genfromtxt(tmp_path / "out" / "dynamics.csv", delimiter=",", names=True)
        loads.append([table[f"leg_{leg}_rod_joint_force_N"] for leg in range(1, 7)])
    weight, motion, lifted = np.array(loads)
    np.testing.assert_allclose(weight + lifted, 2 * motion, atol=1e-9)  # linear in gravity
    assert np.abs(weight - motion).min() > 1.0


def test_a_payload_of_a_3_rps_is_checked(own: Path) -> None:
    given = ("check", "there.yaml", "-m", "mine.yaml", "--json")
    given_robot = ("check", "table.csv", "-r", "mine.yaml", "--json")
    for words in (given, given_robot):
        assert json.loads(rps_pin(*words, "--payload", "1", folder=own).stdout)["ok"]
        heavy = json.loads(rps_pin(*words, "--payload", "60", folder=own).stdout)
        assert {one["quantity"] for one in heavy["limits"]} == {"force"}


def test_a_singular_pose_is_told() -> None:
    # A Stewart platform that is turned by 90 degrees (Fichter).
    told = rps_pin("ik", "-m", "stewart", "--at", "rz=90", "--at", "z=0.62", "--degrees")
    assert "singular (type_ii" in told.stdout, told


def test_forces_singularity_and_degrees_of_a_3rps() -> None:
    pose = ("ik", "-r", "micro", "--pose", "0.22")
    robot = RPSRobot.from_preset("micro")
    x, still = np.array([0.22, math.radians(5), math.radians(-3)]), np.zeros(3)
    found = answer(*pose, "5", "-3", "--degrees", "--forces")
    forces = robot.inverse_dynamics(*robot.state(x, still, still)).tau
    np.testing.assert_allclose(found["force"], forces, rtol=1e-12)
    np.testing.assert_allclose(found["pose"], [0.22, 5, -3], rtol=1e-14)
    radians = answer(*pose, *map(str, x[1:].tolist()))
    assert "force" not in radians and radians["units"]["angle"] == "rad"
    np.testing.assert_allclose(np.radians(found["angle"]), radians["angle"], rtol=1e-14)
    assert "singular (" not in rps_pin(*pose, "0", "0").stdout
    flat = rps_pin("ik", "--pose", "0", "0", "0")
    assert "singular (type_ii 0; " in flat.stdout
    refused = rps_pin("ik", "--pose", "0", "0", "0", "--forces")
    assert refused.returncode == 1 and "is singular" in refused.stderr


@pytest.mark.parametrize("lengths", [(0.22, 0.23, 0.22), (0.24, 0.205, 0.21)])
def test_fk_marks_the_modes_within_limits(lengths: tuple[float, ...]) -> None:
    words = ("fk", "-r", "micro", "--lengths", *map(str, lengths))
    modes = answer(*words)["modes"]
    robot = RPSRobot.from_preset("micro")
    for mode in modes:
        if mode["pose"] is not None:
            reached = robot.inverse_kinematics(mode["pose"], errors="mask").reachable
            assert mode["within_limits"] == reached
    marked = sum(mode["within_limits"] for mode in modes)
    assert 0 < marked < len(modes)
    assert f"{marked} within the robot's limits" in rps_pin(*words).stdout.replace("\n", " ")
    in_degrees = answer(*words, "--degrees")
    assert in_degrees["units"]["angle"] == "deg"
    for mode, other in zip(modes, in_degrees["modes"], strict=True):
        np.testing.assert_allclose(np.degrees(mode["angle"]), other["angle"], atol=1e-9)
    near = ("--near", "0.22", "0", "0", "--degrees")
    pose = answer(*words, *near)["pose"]
    radians = [pose[0], *np.radians(pose[1:])]
    np.testing.assert_allclose(robot.inverse_kinematics(radians).length, lengths, rtol=1e-9)

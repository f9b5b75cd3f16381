"""Joints of URDF's type `continuous`: an angle everywhere, of any number of turns, unlimited.

A four-bar with bars 1.0, 0.5, 1.2 and 0.8 (a crank-rocker), all joints continuous, against the
intersection of circles; and a wheel against closed forms.
"""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, JointCoupling, LoopClosure
from tests.cli.commands import rps_pin
from tests.closed_loop.io.urdf.texts import joint, link, robot
from tests.worst import worst

Array = NDArray[np.float64]
GROUND, CRANK, COUPLER, ROCKER = 1.0, 0.5, 1.2, 0.8
TURN = 2 * np.pi


def pin_joint(name: str, parent: str, child: str, x: float = 0.0) -> str:
    return joint(name, "continuous", parent, child, xyz=f"{x} 0 0", axis="0 0 1")


URDF = robot(
    link("ground"),
    link("crank", 0.3, "0.25 0 0", 2e-3),
    link("coupler", 0.5, "0.6 0 0", 6e-3),
    link("rocker", 0.4, "0.4 0 0", 4e-3),
    link("coupler_end"),
    link("rocker_end"),
    pin_joint("motor", "ground", "crank"),
    pin_joint("elbow", "crank", "coupler", CRANK),
    pin_joint("swing", "ground", "rocker", GROUND),
    joint("end_a", "fixed", "coupler", "coupler_end", xyz=f"{COUPLER} 0 0"),
    joint("end_b", "fixed", "rocker", "rocker_end", xyz=f"{ROCKER} 0 0"),
)
YAML = """urdf: r.urdf
gravity: [0, -9.81, 0]
closures:
  - {name: pin, frame_a: coupler_end, frame_b: rocker_end, kind: revolute, axis: [0, 0, 1]}
actuated: [motor]
"""
CLOSURE = LoopClosure("coupler_end", "rocker_end", "revolute", axis=(0, 0, 1), name="pin")


def exact(angle: float, side: int = 1) -> Array:
    """Motor, elbow and swing by the intersection of two circles."""
    tip, pivot = CRANK * np.array([np.cos(angle), np.sin(angle)]), np.array([GROUND, 0.0])
    length = np.hypot(*(pivot - tip))
    along = (COUPLER**2 - ROCKER**2 + length**2) / (2 * length)
    e = (pivot - tip) / length
    knee = tip + along * e + side * np.sqrt(COUPLER**2 - along**2) * np.array([-e[1], e[0]])
    return np.array(
        [
            angle,
            np.arctan2(*(knee - tip)[::-1]) - angle,
            np.arctan2(*(knee - pivot)[::-1]),
        ]
    )


def off(q: Array, right: Array) -> float:
    """Largest difference of the angles, but for whole turns of those that follow."""
    found = (q - right + np.pi) % TURN - np.pi
    return max(worst(np.abs(found)), abs(q[0] - right[0]))


@pytest.fixture(scope="module")
def four_bar() -> ClosedLoopModel:
    return ClosedLoopModel.from_urdf(
        URDF, [CLOSURE], ["motor"], home=exact(0.6), gravity=(0, -9.81, 0)
    )


def test_an_angle_of_any_number_of_turns_is_completed(four_bar: ClosedLoopModel) -> None:
    assert four_bar.model.nq == four_bar.model.nv == 3
    assert np.isinf(four_bar.model.upperPositionLimit).all()
    for angle in np.linspace(-2 * TURN, 2 * TURN, 33):
        assert off(four_bar.complete({"motor": angle}), exact(angle)) < 1e-9
        q = four_bar.close(np.add(exact(angle), (0.0, 1e-3, -1e-3)))
        assert off(q, exact(q[0])) < 1e-9


def test_both_modes_are_found(four_bar: ClosedLoopModel) -> None:
    found = four_bar.assembly_modes({"motor": 0.6 + TURN}, starts=50)
    assert len(found.q) == 2
    for side in (1, -1):
        right = exact(0.6 + TURN, side)
        assert min(off(q, right) for q in found.q) < 1e-9


def test_the_generated_engine_has_the_same_coordinates(four_bar: ClosedLoopModel) -> None:
    compiled = four_bar.compile()
    q = four_bar.complete({"motor": 2.0 + TURN})
    v = four_bar.velocity(q, [0.7])
    a = four_bar.acceleration(q, v, [-0.3])
    ours = four_bar.inverse_dynamics(q, v, a).tau
    assert compiled.inverse_dynamics(q, v, a).tau == pytest.approx(ours, rel=1e-10)


def test_written_files_turn_without_limits(four_bar: ClosedLoopModel, tmp_path: Path) -> None:
    four_bar.to_urdf(tmp_path / "w.urdf")
    assert (tmp_path / "w.urdf").read_text().count('type="continuous"') == 3
    again = ClosedLoopModel.load(tmp_path / "w.yaml")
    angle = 1.0 - 3 * TURN
    assert off(again.complete({"motor": angle}), exact(angle)) < 1e-9
    four_bar.to_mjcf(tmp_path / "w.xml")
    assert not mujoco.MjModel.from_xml_path(str(tmp_path / "w.xml")).jnt_limited.any()


# In descriptions and on the command line ----------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "r.urdf").write_text(URDF)
    return tmp_path


def test_a_home_is_an_angle_or_cosine_and_sine(folder: Path) -> None:
    right = exact(0.6)
    angles = [f"{value:.17g}" for value in right]
    pairs = [f"[{np.cos(value):.17g}, {np.sin(value):.17g}]" for value in right]
    for values in (angles, pairs):
        motor, elbow, swing = values
        home = f"home: {{motor: {motor}, elbow: {elbow}, swing: {swing}}}\n"
        (folder / "m.yaml").write_text(YAML + home)
        assert off(ClosedLoopModel.load(folder / "m.yaml").home, right) < 1e-9


def test_springs_count_turns(folder: Path) -> None:
    """k (q - rest) = 2 (5 pi - 0.5) beside the same mechanism without it."""
    home = "home: {motor: 0.6, elbow: 0.62, swing: 1.74}\n"
    effects = "stiffness: {motor: 2.0}\nrest: {motor: 0.5}\n"
    taus = []
    for more in ("", effects):
        (folder / "m.yaml").write_text(YAML + home + more)
        mechanism = ClosedLoopModel.load(folder / "m.yaml")
        q = mechanism.complete({"motor": 5 * np.pi})
        taus.append(mechanism.inverse_dynamics(q, np.zeros(3), np.zeros(3)).tau[0])
    assert taus[1] - taus[0] == pytest.approx(2.0 * (5 * np.pi - 0.5), rel=1e-9)


def test_a_start_beyond_a_turn_is_in_the_table(folder: Path) -> None:
    (folder / "m.yaml").write_text(YAML + "home: {motor: 0.6, elbow: 0.62, swing: 1.74}\n")
    command = ("simulate", "m.yaml", "--start", "motor=7", "--duration", "0.01", "-o", "out")
    run = rps_pin(*command, "--json", folder=folder)
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["limits_passed"] == []
    with (folder / "out" / "simulation.csv").open() as file:
        table = np.genfromtxt(
            (line for line in file if not line.startswith("#")), delimiter=",", names=True
        )
    motor = next(name for name in table.dtype.names if "motor" in name)
    assert table[motor][0] == pytest.approx(7.0, abs=1e-12)
    run = rps_pin("assembly-modes", "m.yaml", "--at", "motor=7", "--json", folder=folder)
    assert run.returncode == 0, run.stderr
    modes = json.loads(run.stdout)["modes"]
    assert sorted(round(mode["home"]["motor"], 12) for mode in modes) == [7.0, 7.0]


def test_a_folder_of_example_parallel_robots(folder: Path) -> None:
    (folder / "robot.urdf").write_text(URDF)
    (folder / "r.urdf").unlink()
    words = 'closed_loop: [[coupler_end, rocker_end]]\ntype: ["3d"]\nname_mot: [motor]\n'
    (folder / "robot.yaml").write_text(words)
    mechanism = ClosedLoopModel.load(folder)
    assert mechanism.describe().mobility == 1
    q = mechanism.complete({"motor": 4.0 + TURN}, np.add(exact(4.0 + TURN), (0.0, 1e-2, 1e-2)))
    assert off(q, exact(4.0 + TURN)) < 1e-9


# Gears, balls -------------------------------------------------------------------------------------


def test_a_coupling_turns_as_often_as_asked() -> None:
    gears = robot(
        link("base"),
        link("pinion", 1.0, inertia=2e-3),
        link("wheel", 1.0, inertia=4e-3),
        pin_joint("fast", "base", "pinion"),
        pin_joint("slow", "base", "wheel", 0.1),
    )
    mechanism = ClosedLoopModel.from_urdf(gears, [JointCoupling("slow", "fast", -0.25)], ["fast"])
    np.testing.assert_allclose(
        mechanism.complete({"fast": 40 * TURN}), [40 * TURN, -10 * TURN], rtol=1e-14
    )
    v = mechanism.velocity(mechanism.home, [100.0])
    motion = mechanism.simulate(mechanism.home, v, duration=0.2, step=0.01)
    assert motion.q[-1] == pytest.approx([100.0 * motion.time[-1], -25.0 * motion.time[-1]])


def test_three_continuous_joints_are_one_ball_and_one_a_hook(tmp_path: Path) -> None:
    parts = [link("base"), link("x"), link("y"), link("bob", 0.5, "0 0 -0.2")]
    for name, axis, parent, child in (
        ("bx", "1 0 0", "base", "x"),
        ("by", "0 1 0", "x", "y"),
        ("bz", "0 0 1", "y", "bob"),
    ):
        parts.append(joint(name, "continuous", parent, child, axis=axis))
    (tmp_path / "r.urdf").write_text(robot(*parts))
    merge = "merge:\n  - {joints: [bx, by, bz], into: spherical, name: ball}\n"
    (tmp_path / "m.yaml").write_text(f"urdf: r.urdf\nactuated: [ball]\n{merge}")
    ball = ClosedLoopModel.load(tmp_path / "m.yaml")
    assert (ball.model.nv, ball.describe().mobility) == (3, 3)
    tree = ClosedLoopModel.from_urdf(tmp_path / "r.urdf", [], ["bx", "by"])
    replaced = tree.with_joints({"bz": "spherical"})
    assert replaced.model.nv == 5

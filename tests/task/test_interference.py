"""Links that interfere along a path: when, in closed form."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq, minimize_scalar

from rps_pin import ClosedLoopModel, InputError, LoopClosure
from rps_pin.closed_loop import Part, compose, composed_shapes
from rps_pin.errors import MechanismError
from rps_pin.task import PathCheck, Task, check_path
from rps_pin.trajectories.path import PathSample
from tests.closed_loop.interference import shaped
from tests.closed_loop.interference.shaped import joint, link, robot, rod, shape
from tests.quick import quick
from tests.reference import five_bar
from tests.task.paths import swinging, uniform
from tests.task.test_path_check import ARMS, LEFT, elbow
from tests.worst import worst

R, OTHER, OFFSET = 0.05, 0.03, 0.04


def as_it_is(task: Task) -> Task:
    return task


BOTH = pytest.mark.parametrize("engine", [as_it_is, Task.compile], ids=["pinocchio", "generated"])


def slides(a: str, b: str, extra: str = "", second: str = "") -> ClosedLoopModel:
    """Two links on slides along x, the second OFFSET beside the first; its shape may be given."""
    parts = [
        link("root"),
        link("a", a),
        link("b", b),
        joint("xa", "root", "a", "prismatic", axis="1 0 0"),
        joint("xb", "root", "b", "prismatic", f"0 {OFFSET} 0", "1 0 0").replace(
            "<limit", f"{second}<limit"
        ),
    ]
    return ClosedLoopModel.from_urdf(robot(*parts, extra), [], ["xa"] if second else ["xa", "xb"])


BALL_A, BALL_B = shape(f'<sphere radius="{R}"/>'), shape(f'<sphere radius="{OTHER}"/>')
#: Where the balls touch, and where they do with a clearance of 0.01 m.
AT = float(np.sqrt((R + OTHER) ** 2 - OFFSET**2))
NEAR = float(np.sqrt((R + OTHER + 0.01) ** 2 - OFFSET**2))


@cache
def balls() -> Task:
    return Task(slides(BALL_A, BALL_B), joints=["xa", "xb"], characteristic_length=1.0)


def check(one: Task, path: Any, **options: Any) -> PathCheck:
    """The check of a path, of fewer samples."""
    return check_path(one, path, **{"least_steps": 80, "actuators": False} | options)


def events(found: PathCheck) -> list[tuple[str, str, str]]:
    return [(e.kind, *sorted((e.link_a, e.link_b))) for e in found.touching]


def times(found: PathCheck) -> list[float]:
    return [event.time for event in found.touching]


# Balls on slides ----------------------------------------------------------------------------------


@BOTH
def test_balls_that_pass_each_other_touch_at_known_times(engine: Any) -> None:
    one = engine(balls())
    path = uniform([-0.3, 0.1], [0.3, -0.1], 2.0)  # they approach by 0.4 m/s, from 0.4 m
    found = check(one, path)
    assert events(found) == [("begins", "a", "b"), ("ends", "a", "b")]
    assert worst(np.array(times(found)) - [(0.4 - AT) / 0.4, (0.4 + AT) / 0.4]) < 1e-9
    assert all(event.width <= 2e-10 for event in found.touching)
    assert not found.ok
    links = found.interference
    assert links is not None
    assert (links.pairs, links.skipped) == (1, "")
    assert links.minimum_distance == pytest.approx(OFFSET - R - OTHER, abs=1e-12)
    assert links.minimum_time == pytest.approx(1.0, abs=1e-6)
    text = str(found)
    assert "1 pair of links interferes" in text
    assert "interference: 1 pair of links, least distance -0.04 m (a and b) at t = 1" in text
    assert re.search(r"a and b begin to interfere \(\+- \de-11 s\); xa = ", text)
    assert "a and b come apart" in text


@BOTH
def test_a_clearance_is_as_if_the_links_were_larger(engine: Any) -> None:
    one = engine(balls())
    path = uniform([-0.3, 0.1], [0.3, -0.1], 2.0)
    found = check(one, path, clearance=0.01)
    assert worst(np.array(times(found)) - [(0.4 - NEAR) / 0.4, (0.4 + NEAR) / 0.4]) < 1e-9
    assert "a and b come nearer than 0.01 m" in str(found)
    assert {event.clearance for event in found.touching} == {0.01}


def test_the_order_of_the_links_does_not_matter() -> None:
    path = uniform([-0.3, 0.1], [0.3, -0.1], 2.0)
    turned = uniform([0.3, -0.1], [-0.3, 0.1], 2.0)
    one = check(balls(), path)
    other = check(
        Task(slides(BALL_B, BALL_A), joints=["xa", "xb"], characteristic_length=1.0), turned
    )
    assert worst(np.array(times(one)) - times(other)) < 1e-9


@pytest.mark.parametrize("miss", [1e-6, -1e-6])
def test_a_contact_between_two_samples_is_found(miss: float) -> None:
    """Balls that turn back where they would touch: 1e-6 m too late, or before."""
    turn = -(AT + miss)
    path = swinging([turn - 0.2, 0], [0.2, 0], 1.0, np.pi)
    found = check(balls(), path, least_steps=7, max_step=0.3)
    assert found.samples < 20
    if miss > 0:
        assert found.ok
        assert found.interference is not None
        nearest = float(np.hypot(turn, OFFSET)) - R - OTHER
        assert found.interference.minimum_distance == pytest.approx(nearest, abs=1e-11)
        assert found.interference.minimum_time == pytest.approx(np.pi / 2, abs=1e-5)
    else:
        inside = np.arcsin((-AT - turn + 0.2) / 0.2)
        assert events(found) == [("begins", "a", "b"), ("ends", "a", "b")]
        assert worst(np.array(times(found)) - [inside, np.pi - inside]) < 1e-7


def test_what_is_said_of_hidden_contacts_holds() -> None:
    """Sampled at the period of a swing, a contact is missed; it is no deeper than is said."""
    w, period = 2 * np.pi, 1.0
    path = swinging([-0.4, 0.0], [0.35, 0.0], w, 4 * period)
    coarse = {"least_steps": 4, "max_step": 1e3}
    missed = check(balls(), path, **coarse)
    assert missed.samples == 5
    assert not missed.touching
    deepest = R + OTHER - float(np.hypot(0.05, OFFSET))
    assert missed.interference is not None
    assert 0 < deepest < missed.interference.hidden
    fine = check(balls(), path)
    assert len(fine.touching) == 8
    assert fine.interference is not None
    assert fine.interference.hidden < 0.05
    assert check(balls(), uniform([-0.5, 0], [-0.4, 0])).interference.hidden == 0  # type: ignore[union-attr]


def test_links_that_overlap_all_the_way_are_told_once() -> None:
    still = uniform([0.0, 0.01], [0.01, 0.0])
    found = check(balls(), still)
    assert events(found) == [("throughout", "a", "b")]
    assert "a and b interfere on the whole path" in str(found)
    assert check(balls(), still, ignore=[("b", "a")]).ok
    leaving = check(balls(), uniform([0.0, 0.0], [0.3, 0.0]))
    assert events(leaving) == [("starts inside", "a", "b"), ("ends", "a", "b")]
    assert times(leaving) == [0.0, pytest.approx(AT / 0.3, abs=1e-9)]
    arriving = check(balls(), uniform([0.3, 0.0], [0.0, 0.0]))
    assert events(arriving) == [("begins", "a", "b")]


@BOTH
def test_a_joint_that_follows_another_carries_its_link(engine: Any) -> None:
    """xb = -2 xa: they approach three times as fast as the first moves."""
    mimic = '<mimic joint="xa" multiplier="-2"/>'
    one = engine(
        Task(slides(BALL_A, BALL_B, second=mimic), joints=["xa"], characteristic_length=1.0)
    )
    found = check(one, uniform([-0.2], [0.2], 1.0))
    assert worst(np.array(times(found)) - [0.5 - AT / 1.2, 0.5 + AT / 1.2]) < 1e-9


# Rods ---------------------------------------------------------------------------------------------


@BOTH
def test_a_rod_that_swings_over_another_meets_it_at_a_known_angle(engine: Any) -> None:
    """Its round end comes within 2 r of the other's axis, one plane above."""
    r, above, length, below = 0.02, 0.03, 0.6, 0.5
    parts = [
        link("base"),
        link("a", rod(r, 1.0, "capsule")),
        link("b", rod(r, length, "capsule")),
        joint("ja", "base", "a"),
        joint("jb", "base", "b", xyz=f"0.5 {-below} {above}"),
    ]
    model = ClosedLoopModel.from_urdf(robot(*parts), [], ["ja", "jb"])
    path = uniform([0.0, 0.0], [0.0, np.pi / 2], np.pi / 2)
    reach = np.sqrt(4 * r**2 - above**2)
    found = check(engine(Task(model, joints=["ja", "jb"])), path)
    assert events(found) == [("begins", "a", "b")]
    assert found.touching[0].time == pytest.approx(np.arcsin((below - reach) / length), abs=1e-8)
    assert worst(found.touching[0].pose - [0, found.touching[0].time]) < 1e-9


def five_bar_with_an_obstacle(folder: Path, at: Any) -> ClosedLoopModel:
    """Rods of the five-bar as capsules, and a ball on the base."""
    text = Path("urdf/five_bar.urdf").read_text("utf-8")
    lengths = {
        "left": five_bar.LEFT.length,
        "left_arm": five_bar.LEFT_ARM.length,
        "right": five_bar.RIGHT.length,
        "right_arm": five_bar.RIGHT_ARM.length,
    }
    ball = shape('<sphere radius="0.02"/>', f"{at[0]} 0 {at[1]}")
    shapes = {"base": ball} | {name: rod(0.01, size, "capsule") for name, size in lengths.items()}
    for name, one in shapes.items():
        text = text.replace(f'<link name="{name}">', f'<link name="{name}">{one}')
    (folder / "five_bar.urdf").write_text(text, "utf-8")
    (folder / "five_bar.yaml").write_text(Path("urdf/five_bar.yaml").read_text("utf-8"))
    return ClosedLoopModel.load(folder / "five_bar.yaml")


@BOTH
def test_a_rod_of_a_five_bar_meets_a_ball_at_a_known_time(engine: Any, tmp_path: Path) -> None:
    """The left arm: from where two circles meet to the tip."""
    at = np.array([0.05, 0.5])
    model = five_bar_with_an_obstacle(tmp_path, at)
    names = {frozenset(pair) for pair in model.link_distances().pairs}
    not_joined = ("left", "right"), ("left", "right_arm"), ("right", "left_arm")
    arms = ("base", "left_arm"), ("base", "right_arm")
    assert names == {frozenset(pair) for pair in (*not_joined, *arms)}
    one = engine(model.task)
    path = uniform(one.home, one.home + np.array([-0.1, 0.1]), 1.0)

    def gap(t: float) -> float:
        tip = path.sample(t).pose
        knee = elbow(LEFT, tip, ARMS, 1.0)
        along = (at - knee) @ (tip - knee) / float((tip - knee) @ (tip - knee))
        return float(np.linalg.norm(knee + np.clip(along, 0, 1) * (tip - knee) - at)) - 0.03

    values = [gap(t) for t in np.linspace(0, 1, 101)]
    assert min(values) < 0 < values[0]
    first = int(np.argmax(np.array(values) < 0))
    wanted = brentq(gap, (first - 1) / 100, first / 100, xtol=1e-14)
    found = check(one, path)
    assert events(found)[0] == ("begins", "base", "left_arm")
    assert found.touching[0].time == pytest.approx(wanted, abs=1e-8)
    lowest = minimize_scalar(gap, bounds=(0, 1), method="bounded", options={"xatol": 1e-10})
    least = min(float(lowest.fun), *values)
    assert found.interference is not None
    assert found.interference.minimum_distance <= least + 1e-6


# Meshes -------------------------------------------------------------------------------------------


@BOTH
def test_a_ball_through_the_wall_of_a_hollow_mesh(engine: Any, tmp_path: Path) -> None:
    """Inside the wall it cuts no surface: one interference from face to face, for each wall."""
    shaped.write_mesh(tmp_path / "u.stl", *shaped.channel())
    small = shape('<sphere radius="0.01"/>', "0 0 0.3")
    u = shape(f'<mesh filename="{tmp_path / "u.stl"}"/>')
    one = engine(Task(slides(small, u), joints=["xa", "xb"], characteristic_length=1.0))
    found = check(one, uniform([-0.7, 0.0], [0.7, 0.0], 1.4))
    assert events(found) == 2 * [("begins", "a", "b"), ("ends", "a", "b")]
    walls = np.array([-0.51, -0.39, 0.39, 0.51]) + 0.7
    assert worst(np.array(times(found)) - walls) < 1e-7


# Against many samples -----------------------------------------------------------------------------

FORMS = (
    '<sphere radius="0.2"/>', '<box size="0.3 0.5 0.2"/>', '<cylinder radius="0.1" length="0.6"/>',
    '<capsule radius="0.1" length="0.5"/>', '<ellipsoid a="0.1" b="0.2" c="0.3"/>',
    '<mesh filename="{u}"/>',
)  # fmt: skip


class Swings:
    """Coordinates that swing, each by its own sine."""

    duration = 2.0

    def __init__(self, rng: np.random.Generator, size: int) -> None:
        self.middle, self.reach = rng.uniform(-0.5, 0.5, size), rng.uniform(0.2, 1.2, size)
        self.w, self.phase = rng.uniform(1, 5, size), rng.uniform(0, 6, size)

    def sample(self, t: Any) -> PathSample:
        angle = self.w * np.asarray(t, float)[..., None] + self.phase
        across = self.reach * np.sin(angle)
        return PathSample(
            self.middle + across, self.reach * self.w * np.cos(angle), -(self.w**2) * across
        )


@pytest.mark.parametrize("seed", quick(range(8), range(4)))
def test_events_are_the_changes_of_sign_of_many_samples(seed: int, tmp_path: Path) -> None:
    """Two shapes that slide and turn at random."""
    shaped.write_mesh(tmp_path / "u.stl", *shaped.channel())
    rng = np.random.default_rng(seed)
    forms = [FORMS[k].format(u=tmp_path / "u.stl") for k in rng.integers(0, len(FORMS), 2)]
    axes = [" ".join(map(str, axis)) for axis in rng.normal(size=(2, 3))]
    parts = [
        link("root"), link("ca"), link("cb"),
        link("a", shape(forms[0], "0.1 0 0.05", "0.3 0.2 0.1")),
        link("b", shape(forms[1], "0 0.1 0", "0.1 1 2")),
        joint("xa", "root", "ca", "prismatic", axis="1 0 0"),
        joint("ra", "ca", "a", xyz="0 0 0.05", axis=axes[0]),
        joint("xb", "root", "cb", "prismatic", "0 0.5 0.2", "0 1 0"),
        joint("rb", "cb", "b", xyz="0.05 0 0", axis=axes[1]),
    ]  # fmt: skip
    names = ["xa", "ra", "xb", "rb"]
    model = ClosedLoopModel.from_urdf(robot(*parts), [], names)
    path = Swings(rng, 4)
    found = check(Task(model, joints=names, characteristic_length=1.0), path)
    distances = model.link_distances()
    assert distances.pairs == [("a", "b")]
    times_of = np.linspace(0, path.duration, 2001)
    values = np.empty(times_of.size)
    for k, q in enumerate(path.sample(times_of).pose):
        distances.set_state(q)
        values[k] = distances.distance(0).distance
    cuts = np.flatnonzero((values[1:] < 0) != (values[:-1] < 0))
    told = [e.time for e in found.touching if e.kind in ("begins", "ends")]
    assert len(told) == len(cuts)
    for time, cut in zip(told, cuts, strict=True):
        assert times_of[cut] <= time <= times_of[cut + 1]
    assert (values[0] < 0) == any(e.kind in ("starts inside", "throughout") for e in found.touching)
    assert found.interference is not None
    assert values.min() - 1e-3 < found.interference.minimum_distance < values.min() + 1e-3


def test_a_floor_of_mujoco_is_met_at_a_known_time() -> None:
    """A ball that sinks: the half space is endless, and the nearest pair nevertheless."""
    pytest.importorskip("mujoco")
    text = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1" pos="0 0 -1"/>
      <body name="a"><joint name="down" type="slide" axis="0 0 -1"/>
        <geom size="0.1" contype="0" conaffinity="0"/>
        <body name="b"><joint name="side" type="slide" axis="1 0 0"/><geom size="0.1"/></body>
      </body></worldbody></mujoco>"""
    model = ClosedLoopModel.from_mjcf(text, actuated=["down", "side"])
    one = Task(model, joints=["down", "side"], characteristic_length=1.0)
    found = check(one, uniform([0.0, 0.0], [1.8, 3.0], 1.0))
    assert events(found) == [("begins", "b", "world")]
    assert found.touching[0].time == pytest.approx(0.5, abs=1e-9)


# Several files ------------------------------------------------------------------------------------


def test_arms_of_several_files_that_hold_one_tip() -> None:
    """Two arms of one file, composed and closed at their tips: names have their part's name."""
    forearm = link("forearm", rod(0.02, 0.4, "capsule"))
    text = robot(
        link("base"), link("arm", rod(0.02, 0.4, "capsule")), forearm, link("tip"),
        joint("shoulder", "base", "arm", axis="0 -1 0"),
        joint("elbow", "arm", "forearm", xyz="0.4 0 0", axis="0 -1 0"),
        joint("end", "forearm", "tip", "fixed", xyz="0.4 0 0"),
    )  # fmt: skip
    arm = ClosedLoopModel.from_urdf(text, [], [])
    beside = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
    whole = compose({"left": Part(arm.model), "right": Part(arm.model, beside)})
    shapes = composed_shapes(dict.fromkeys(("left", "right"), arm.collision_shapes))
    tips = LoopClosure("left/tip", "right/tip", "spherical")
    home = [2.2, -1.6, 0.9, 1.6]
    model = ClosedLoopModel(
        whole, [tips], ["left/shoulder", "right/shoulder"], home=home, collision=shapes
    )
    task = Task(model, "left/tip", ["x", "z"])
    start = task.home
    path = uniform(start, [0.15, 0.2], 1.0)
    found = check(task, path)
    names = {frozenset(pair) for pair in model.link_distances().pairs}
    assert frozenset(("left/arm", "right/arm")) in names
    assert frozenset(("left/forearm", "right/forearm")) not in names
    assert found.interference is not None
    assert found.interference.pairs == 3
    assert all(name.startswith(("left/", "right/")) for name in found.interference.minimum_links)


# Where there is nothing to check, and bad input ---------------------------------------------------


def test_without_shapes_it_is_said_in_a_line() -> None:
    bare = Task(slides("", ""), joints=["xa", "xb"], characteristic_length=1.0)
    path = uniform([-0.3, 0.1], [0.3, -0.1])
    found = check(bare, path)
    assert "\ninterference: no collision shapes" in str(found)
    assert found.ok
    with pytest.raises(InputError, match="shaped has no collision shapes"):
        check(bare, path, interference=True)
    alone = Task(slides(BALL_A, ""), joints=["xa", "xb"], characteristic_length=1.0)
    assert "interference: no pair of links to check" in str(check(alone, path))
    off = check(balls(), path, interference=False)
    assert off.interference is None
    assert "interference" not in str(off)


def test_shapes_that_cannot_be_read_are_refused_where_they_are_asked_for() -> None:
    broken = Task(
        slides(BALL_A, shape('<mesh filename="none.stl"/>')),
        joints=["xa", "xb"],
        characteristic_length=1.0,
    )
    path = uniform([-0.3, 0.1], [0.3, -0.1])
    words = r"collision shapes that cannot be used: .*link 'b': 'none.stl': no file"
    with pytest.raises(InputError, match=words):
        check(broken, path, interference=True)
    found = check(broken, path)
    assert found.interference is not None
    assert re.search(words, str(found))


def test_bad_input_is_refused() -> None:
    path = uniform([-0.3, 0.1], [0.3, -0.1])
    with pytest.raises(MechanismError, match=r"ignore: no link 'c'; there are: root, a, b"):
        check(balls(), path, ignore=[("a", "c")])
    with pytest.raises(InputError, match="ignore"):
        check(balls(), path, ignore=["ab"])  # type: ignore[list-item]
    for clearance in (-1e-3, np.nan, np.inf):
        with pytest.raises(InputError, match="clearance"):
            check(balls(), path, clearance=clearance)
    for asked in ("yes", 1, []):
        with pytest.raises(InputError, match=r"interference = .*: it must be True, False or None"):
            check(balls(), path, interference=asked)


def test_where_the_assembly_mode_ends_the_rest_is_not_checked(tmp_path: Path) -> None:
    model = five_bar_with_an_obstacle(tmp_path, np.array([5.0, 5.0]))
    one = model.task
    found = check(one, uniform(one.home, one.home + np.array([0.35, 0.25]), 1.0))
    assert found.singularities[-1].kind == "ends"
    assert found.interference is not None
    assert found.interference.minimum_time <= found.singularities[-1].time

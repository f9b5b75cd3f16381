"""Designs: against closed forms on a fine grid, and against the robots that are written."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, InputError, Task
from rps_pin.arrays import Array
from rps_pin.task import certify
from rps_pin.task.design import (
    DesignSpace,
    Dimension,
    Objective,
    Region,
    Requirements,
    RoundPart,
    design,
    load_design,
)
from rps_pin.task.design.measures import Measuring
from rps_pin.task.design.search import best_of
from rps_pin.task.design.violations import violations
from rps_pin.task.workspace.evaluate import gains_of
from rps_pin.trajectories.point_to_point import point_to_point
from tests.task.workspaces import conditioning, delta_arms

LEGS, SIDES = (1, 2, 3), ("left", "right")
ELBOWS = [[f"rod_{leg}_{side}.a" for side in SIDES] for leg in LEGS]
RODS = [f"rod_{leg}_{side}" for leg in LEGS for side in SIDES]
LIMITS = -1.2, 1.5
CYLINDER = Region(box={"z": (-0.55, -0.45)}, round=[RoundPart(["x", "y"], [0, 0], 0.15)])
#: The side of home on the type II singularities, of the closed form.
HOME_SIDE = conditioning(delta_arms(np.array([[0, 0, -0.5]])).gain, 1.0)[1][0]


def task(name: str) -> Task:
    return ClosedLoopModel.load(f"urdf/{name}.yaml").task


@cache
def delta() -> DesignSpace:
    dimensions = [
        Dimension("arm", 0.1, 0.5, length=ELBOWS),
        Dimension("rod", 0.25, 1.0, distance=RODS),
    ]
    return DesignSpace(task("delta"), dimensions)


@cache
def measuring() -> Measuring:
    return Measuring(delta(), Requirements(CYLINDER))


def closed_form(arm: float, rod: float, points: Array) -> tuple[bool, float, float, float]:
    """Whether a Delta does all of a region, its conditioning, its room to limits, its distance.

    The last is from where points stop being reached.
    """
    found = delta_arms(points, arm, rod)
    if not found.exists.all():
        return False, np.nan, np.nan, float(found.margin.min())
    worst, side = conditioning(found.gain, delta().task.mechanism.characteristic_length)
    if (side != HOME_SIDE).any():
        return False, np.nan, np.nan, float(worst.min())
    room = min((found.actuators - LIMITS[0]).min(), (LIMITS[1] - found.actuators).min())
    return True, float(worst.min()), float(room), float(found.margin.min())


def test_measures_are_those_of_the_closed_form() -> None:
    rng = np.random.default_rng(0)
    values = rng.uniform([0.1, 0.25], [0.5, 1.0], (300, 2))
    found, points = measuring()(values), measuring().points
    met = 0
    for k, (arm, rod) in enumerate(values):
        whole, worst, room, far = closed_form(arm, rod, points)
        if far < 1e-3:
            continue
        reached = found.unreached[k] == 0 and found.beyond[k] == 0
        assert reached == whole, (arm, rod)
        if whole:
            met += 1
            np.testing.assert_allclose(found.conditioning[k], worst, rtol=1e-8)
            np.testing.assert_allclose(found.room[k] * (LIMITS[1] - LIMITS[0]), room, atol=1e-8)
    assert 60 < met < 240


@pytest.mark.slow
def test_the_smallest_delta_is_that_of_a_fine_grid() -> None:
    """Arm and rod of the least sum whose workspace holds a cylinder, and the front."""
    result = design(
        delta(),
        Requirements(CYLINDER, min_conditioning=0.25),
        [Objective({"arm": 1.0, "rod": 1.0}), "conditioning"],
        candidates=1500,
        seed=3,
    )
    points = measuring().points
    arms, rods = np.linspace(0.1, 0.5, 41), np.linspace(0.25, 1.0, 76)
    grid = []
    for arm in arms:
        for rod in rods:
            whole, worst, room, _ = closed_form(arm, rod, points)
            if whole and worst >= 0.25 and room >= 0:
                grid.append((arm + rod, worst))
    truth = np.array(grid)
    step = (arms[1] - arms[0]) + (rods[1] - rods[0])
    found = result.scores[result.front]
    least = truth[:, 0].min()
    assert least - step < found[:, 0].min() < least + step
    best = truth[best_of(truth * [1, -1])]
    for total, worst in best[:: len(best) // 20]:  # no point of the grid is better by more
        near = found[found[:, 0] <= total + step]
        assert near[:, 1].max() > worst - 0.01, (total, worst)
    for total, worst in found[:: len(found) // 20]:  # nor does the front promise more
        assert best[best[:, 0] <= total + step][:, 1].max() > worst - 0.02


# Parameters against robots that are built anew ----------------------------------------------------

BALLS = [f"ball_{k}" for k in range(1, 7)]


def stewart_space() -> DesignSpace:
    pairs = [[f"ball_{a}.a", f"ball_{b}.a"] for a, b in ((1, 2), (3, 4), (5, 6))]
    return DesignSpace(
        task("stewart"),
        [
            Dimension("platform_radius", 0.15, 0.25, radius=[f"{ball}.a" for ball in BALLS]),
            Dimension("half", 0.2, 0.9, spread=pairs),
            Dimension("down", -0.02, 0.02, height=[f"{ball}.a" for ball in BALLS]),
            Dimension("stroke", 0.5, 0.6, stroke=[f"leg_{k}_rod_joint" for k in range(1, 7)]),
            Dimension("scale", 0.8, 1.2, scale=True),
        ],
    )


def five_bar_space() -> DesignSpace:
    return DesignSpace(
        task("five_bar"),
        [
            Dimension("arm", 0.25, 0.35, length=["left_arm_joint", "right_arm_joint"]),
            Dimension("fore", 0.38, 0.5, length=["tips.a", "tips.b", "task"]),
            Dimension(
                "apart", 0.3, 0.5, length=["right_joint"],
                stretch={"left_joint": [1.0, 0, 0], "right_joint": [[1.0, 0, 0], [0, 0, 1.0]]},
            ),
            Dimension("turned", -0.1, 0.1, turn=["right_joint"], axis=(0, 1, 0)),
        ],
    )  # fmt: skip


def delta_space() -> DesignSpace:
    return DesignSpace(
        task("delta"),
        [
            Dimension("arm", 0.2, 0.35, length=ELBOWS, stretch={"arm_1_joint": [1.0, 0, 0]}),
            Dimension("rod", 0.5, 0.7, distance=RODS),
            Dimension("base", 0.15, 0.25, radius=[f"arm_{leg}_joint" for leg in LEGS]),
            Dimension(
                "platform", 0.04, 0.1,
                radius=[[f"rod_{leg}_{side}.b" for side in SIDES] for leg in LEGS],
            ),
        ],
    )  # fmt: skip


CASES = {
    "stewart": (stewart_space, Region(box={"z": (0.58, 0.62), "rx": (-0.1, 0.1)}, points=3)),
    "five_bar": (five_bar_space, Region(box={"x": (0.15, 0.25), "z": (0.45, 0.55)}, points=3)),
    "delta": (delta_space, Region(box={"x": (-0.1, 0.1), "z": (-0.5, -0.45)}, points=3)),
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow if name != "five_bar" else ()) for name in CASES],
)
def test_numbers_are_those_of_the_robot_that_is_written(name: str, tmp_path: Path) -> None:
    """Conditioning, strokes, limits, forces, stiffness, mass: by the Pinocchio engine, to 1e-9."""
    make, region = CASES[name]
    space = make()
    start = region.grid(space.task)
    path = point_to_point(start[1], start[-1], duration=0.4)
    stiffness = 1e5 * np.arange(1.0, 1 + space.task.of_actuators.size)
    requirements = Requirements(
        region, motions={"path": path}, samples=7, stiffness=stiffness, min_stiffness=1.0
    )
    one = Measuring(space, requirements, "tcc")
    low, high = np.array([[d.lower, d.upper] for d in space.dimensions]).T
    values = np.random.default_rng(1).uniform(low, high, (3, low.size))
    found, q = one(values), one.middles(values)
    np.testing.assert_array_equal(found.unreached, 0)
    np.testing.assert_array_equal(found.off, 0)
    for k in range(len(values)):
        (file, _) = space.write(values[k], q[k], tmp_path, f"robot_{k}")
        built = ClosedLoopModel.load(file, within_limits=False).task
        np.testing.assert_allclose(built.mechanism.home, q[k], atol=1e-9)
        of_points = built.configuration(one.points, within_limits=False)
        K = built.jacobian(of_points, x=one.points)
        gains = gains_of(built, K)
        np.testing.assert_allclose(found.conditioning[k], gains.conditioning.min(), rtol=1e-9)
        actuators = of_points[:, built.of_actuators]
        np.testing.assert_allclose(found.stroke[k], np.ptp(actuators, axis=0).max(), rtol=1e-9)
        scaled = K / built.scale
        stiff = np.swapaxes(scaled, -1, -2) @ (stiffness[:, None] * scaled)
        np.testing.assert_allclose(
            found.stiffness[k], np.linalg.eigvalsh(stiff)[:, 0].min(), rtol=1e-8
        )
        sample = path.sample(np.linspace(0, path.duration, 7))
        state = built.state(sample.pose, sample.rate, sample.acceleration, within_limits=False)
        forces = np.abs(built.actuator_forces(*state))
        np.testing.assert_allclose(found.force[k], forces.max(), rtol=1e-9)
        speeds = np.abs(state.v[:, built.mechanism.actuated_indices])
        np.testing.assert_allclose(found.speed[k], speeds.max(), rtol=1e-9)
        model = built.mechanism.model
        np.testing.assert_allclose(found.mass[k], sum(b.mass for b in list(model.inertias)[1:]))
        at, way = built.position_limits(), []
        rooms, _ = at.rooms(of_points, np.zeros((len(K), model.nv)), one.points, 0 * one.points)
        names = [f"{s.joint} {s.side}" for s in at.signals]
        for room, limit in zip(rooms.T, names, strict=True):
            joint = model.joints[model.getJointId(limit.split()[0])]
            ends = (m[joint.idx_q] for m in (model.lowerPositionLimit, model.upperPositionLimit))
            way.append(float(room.min() / abs(np.subtract(*ends))))
        if way:
            np.testing.assert_allclose(found.room[k], min(way), atol=1e-9)
            assert one.limits[int(found.limit[k])] == names[int(np.argmin(way))]


def test_a_stretched_bar_is_a_longer_bar() -> None:
    """A thin rod and a plate: m l^2 / 3 about the end, and m (a^2 + b^2) / 12."""
    from rps_pin.task.design.geometry.bodies import projector, stretched

    rod = np.array([[2.0, 0.5, 0, 0, 0, 0, 2.0 * 0.25 / 3, 0, 0, 2.0 * 0.25 / 3]])
    longer = stretched(rod, *projector([1.0, 0, 0]), np.array([3.0]))[0]
    np.testing.assert_allclose(longer[:4], [6.0, 6.0 * 0.75, 0, 0])
    np.testing.assert_allclose(longer[[4, 6, 9]], [0, 6 * 1.5**2 / 3, 6 * 1.5**2 / 3], atol=1e-12)
    plate = np.array([[1.0, 0, 0, 0, 1 / 12, 0, 1 / 12, 0, 0, 1 / 6]])
    wider = stretched(plate, *projector([[1.0, 0, 0], [0, 1.0, 0]]), np.array([2.0]))[0]
    np.testing.assert_allclose(wider[0], 4.0)
    np.testing.assert_allclose(wider[[4, 6, 9]], [4 * 4 / 12, 4 * 4 / 12, 4 * 8 / 12])


# Runs ---------------------------------------------------------------------------------------------


def run(**options: object):
    return design(
        delta(), Requirements(CYLINDER, min_conditioning=0.2), ["size", "conditioning"],
        **{"candidates": 240, "population": 40, "seed": 5, **options},
    )  # fmt: skip


@cache
def once():
    return run()


def assert_same(one, other) -> None:
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_array_equal(one.front, other.front)
    for a, b in zip(one.measures, other.measures, strict=True):
        assert a.tobytes() == b.tobytes()


def test_the_same_seed_gives_the_same_front() -> None:
    first = once()
    assert_same(first, run())
    assert not np.array_equal(first.values, run(seed=6).values)
    assert (np.diff(first.scores[first.front, 0]) > 0).all()
    assert (np.diff(first.scores[first.front, 1]) > 0).all()


def test_two_processes_give_the_same_front() -> None:
    small = {"candidates": 80, "compiler": "tcc"}
    assert_same(run(**small), run(workers=2, **small))


def test_an_interrupted_run_goes_on(tmp_path: Path) -> None:
    """After Ctrl-C in the fourth generation; and with more candidates later."""
    store, asked = tmp_path / "candidates", []

    def stopped(loop):
        for k in loop:
            if k == 3:
                raise KeyboardInterrupt
            yield k

    with pytest.raises(KeyboardInterrupt):
        run(store=store, progress=stopped)
    kept = len(list((tmp_path / ".candidates.blocks").glob("*.npz")))
    whole = once()
    original = Measuring.__call__

    def counted(self, values):
        asked.append(len(values))
        return original(self, values)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Measuring, "__call__", counted)
        assert_same(run(store=store), whole)
    assert sum(asked) == 240 - 3 * 40
    assert kept == 3
    assert not list(tmp_path.iterdir())


def test_an_interrupted_run_goes_on_with_more_candidates(tmp_path: Path) -> None:
    store = tmp_path / "candidates"

    def stopped(loop):
        yield from list(loop)[:3]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(store=store, progress=stopped)
    with pytest.raises(InputError, match="another computation"):
        run(store=store, seed=6)
    assert_same(run(store=store, candidates=280), run(candidates=280))


def test_steps_and_dimensions_that_are_held() -> None:
    space = DesignSpace(
        task("delta"),
        [
            Dimension("arm", 0.1, 0.5, step=0.05, length=ELBOWS),
            Dimension("rod", 0.25, 1.0, distance=RODS),
            Dimension("base", 0.18, 0.18, radius=[f"arm_{leg}_joint" for leg in LEGS]),
        ],
    )
    found = design(
        space, Requirements(CYLINDER), "rod", candidates=80, population=40, compiler="tcc"
    )
    np.testing.assert_allclose(found.values[:, 0] / 0.05, np.round(found.values[:, 0] / 0.05))
    np.testing.assert_array_equal(found.values[:, 2], 0.18)
    assert len(found.front) == 1


def test_what_is_impossible_says_by_how_much() -> None:
    near = Region(box={"z": (-0.5, -0.49)}, round=[RoundPart(["x", "y"], [0, 0], 1.5)], points=3)
    with pytest.raises(InputError, match=r"none meets .*reach \(by 0\.\d+ at least\)"):
        design(delta(), Requirements(near), "size", candidates=80, population=40)
    away = Region(box={"z": (-5.1, -5.0)})
    with pytest.raises(InputError, match=r"closes at the middle of the region: .* the best gets"):
        design(delta(), Requirements(away), "size", candidates=80, population=40)
    asked = Requirements(CYLINDER, min_conditioning=0.95)
    with pytest.raises(InputError, match=r"the best fails .*conditioning by 0\.\d+"):
        design(delta(), asked, "size", candidates=80, population=40)


def test_two_requirements_that_contradict_each_other_are_named() -> None:
    """Small arms keep the limits' margin away from their ends, long ones the conditioning."""
    space = DesignSpace(task("delta"), [Dimension("rod", 0.55, 0.95, distance=RODS)])
    one = Measuring(space, Requirements(CYLINDER), "tcc")
    measures = one(np.linspace(0.55, 0.95, 41)[:, None])
    good = np.isfinite(measures.conditioning) & (measures.unreached == 0)
    worst, room = measures.conditioning[good], measures.room[good]
    # Bounds that only the best of one keep.
    asked = Requirements(CYLINDER, float(worst.max() - 1e-3), float(room.max() - 1e-3))
    assert np.argmax(worst) != np.argmax(room)
    with pytest.raises(InputError, match="some meet limits and some conditioning, but none both"):
        design(space, asked, "rod", candidates=200, population=40, seed=1, compiler="tcc")


def test_violations_fall_as_candidates_come_nearer() -> None:
    rods = np.linspace(0.3, 0.5, 21)
    found = measuring()(np.stack([np.full(21, 0.1), rods], axis=-1))
    assert (np.diff(violations(found, Requirements(CYLINDER), 1.0)["reach"]) <= 1e-12).all()
    assert found.unreached[0] > 1 > found.unreached[-1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"length": ["rod_1.a"]}, "no point 'rod_1.a' .did you mean rod_1_left.a"),
        ({"distance": ["rod_1"]}, "no rod 'rod_1'"),
        ({"stroke": ["arm"]}, "arm"),
        ({}, "moves nothing"),
        ({"length": [["arm_1_joint", "rod_1_left.a"]]}, "different links"),
        ({"scale": True, "turn": ["arm_1_joint"]}, "an angle and a length"),
        ({"distance": RODS, "lower": 2.0}, "is empty"),
        ({"distance": RODS, "step": 2.0}, "larger than its range"),
        ({"distance": RODS, "stretch": {"arm_1_joint": [0, 0, 0]}}, "direction is zero"),
    ],
)
def test_bad_dimensions(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        DesignSpace(delta().task, [Dimension("one", **{"lower": 0.1, "upper": 0.5, **options})])


# Files --------------------------------------------------------------------------------------------

SAMPLE = Path("src/rps_pin/cli/samples/design.yaml")


def test_the_sample_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "path.yaml").write_text(SAMPLE.with_name("path.yaml").read_text())
    (tmp_path / "design.yaml").write_text(SAMPLE.read_text())
    found = load_design(tmp_path / "design.yaml")
    np.testing.assert_allclose(found.space.nominal, [0.25, 0.6, 0.2], rtol=1e-12)
    assert [one.name for one in found.objectives] == ["size", "conditioning"]
    assert (found.candidates, found.population, found.seed) == (10000, 100, 1)
    grid = found.requirements.region.grid(found.space.task)
    assert len(grid) == 5 * (1 + 8 + 16)
    np.testing.assert_allclose(grid[0], [0, 0, -0.5], atol=1e-15)
    np.testing.assert_allclose(np.hypot(grid[:, 0], grid[:, 1]).max(), 0.15)


FAULTS = """robot: delta
dimensions:
  arm: {range: [0.4, 0.1], length: [rod_1_left.a]}
  rod: {range: [0.3, 0.9], distance: [rod_7]}
  hand: {range: [0.3, 0.9], length: [elbow.a]}
  base: {value: 0.2, range: [0.1, 0.2], radius: [arm_1_joint]}
requirements:
  region: {box: {w: [0, 1]}}
  motions: [nowhere.yaml]
  stiffness: {arm_1_joint: 10}
objectives: [size, stifness]
"""


def test_all_faults_of_a_file_are_told_with_their_lines(tmp_path: Path) -> None:
    file = tmp_path / "design.yaml"
    file.write_text(FAULTS)
    with pytest.raises(InputError) as told:
        load_design(file)
    words = str(told.value)
    for line, word in (
        (3, "range 0.4 to 0.1 is empty"),
        (4, "no rod 'rod_7'"),
        (5, "no point 'elbow.a'"),
        (6, "either a range or a value"),
        (8, "no coordinate 'w'"),
        (9, "nowhere.yaml"),
        (10, "stiffness of arm_2_joint, arm_3_joint is missing"),
    ):
        assert f"line {line}" in words and word in words, (line, words)
    misspelt = FAULTS.replace("hand: ", "length: ").replace("length: [elbow.a]", "lenth: [elbow.a]")
    file.write_text(misspelt)
    with pytest.raises(InputError, match=r"line 5: unknown key 'lenth' .did you mean length"):
        load_design(file)
    file.write_text(FAULTS.replace("robot: delta", "robot: deltoid"))
    with pytest.raises(InputError, match=r"line 1: 'deltoid' is not a file or a robot .* delta,"):
        load_design(file)


OF_STEWART = """robot: stewart
dimensions:
  platform_radius:
    range: [0.15, 0.25]
    radius: [ball_1.a, ball_2.a, ball_3.a, ball_4.a, ball_5.a, ball_6.a]
requirements:
  region: {box: {z: [0.58, 0.62], rx: [-0.05, 0.05]}, points: 3}
  min_conditioning: 0.02
objectives: [conditioning]
"""


@pytest.mark.slow
def test_the_winner_of_a_stewart_platform_is_certified(tmp_path: Path) -> None:
    (tmp_path / "design.yaml").write_text(OF_STEWART)
    found = load_design(tmp_path / "design.yaml")
    result = design(found.space, found.requirements, found.objectives, candidates=40, population=20)
    result.write(tmp_path)
    built = ClosedLoopModel.load(tmp_path / f"{result.chosen(1)[0].name}.yaml").task
    box = np.array([[0, 0, 0.58, -0.05, 0, 0], [0, 0, 0.62, 0.05, 0, 0]])
    proven = certify(built, *box, undecided=0.0)
    assert len(proven.places[0]) and not len(proven.places[1]) and not len(proven.places[2])

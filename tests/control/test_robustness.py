"""What goes wrong in a loop: forces stay finite and within limits, and the status says why."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, RPSRobot, SingularityError, helix
from rps_pin.control import ComputedTorque, Controller, Gains, PDControl, Status, effective_inertia
from rps_pin.control.loop.rejoining import SHORTEST
from rps_pin.control.simulation.faults import Fault
from rps_pin.control.simulation.loop_run import LoopRun, run_loop
from rps_pin.control.simulation.loop_summary import LoopSummary
from rps_pin.control.simulation.plant import Plant
from rps_pin.trajectories import circle
from tests.quick import quick

Array = NDArray[np.float64]
START = np.array([0.223, 0.0, 0.0])
TICK = 0.5e-3  # half a period: one tick
KINDS = ["task", "actuator", "pd", "pd in task space"]


def made(kind: str, robot: RPSRobot | None = None, start: Array = START, **more: Any) -> Controller:
    robot = robot or RPSRobot.from_preset("micro")
    placed = Gains.placed(15.0, integral=0.2)
    if kind.startswith("pd"):
        space: Any = "task" if kind.endswith("space") else "actuator"
        gains = placed.times(effective_inertia(robot, start, space=space))
        return PDControl(robot, start, gains, space=space, **more)
    return ComputedTorque(robot, start, placed, space=kind, **more)  # type: ignore[arg-type]


def run(kind: str, *faults: Fault, duration: float = 0.5, **more: Any) -> LoopRun:
    """The micro robot on a circle of tilt."""
    robot = RPSRobot.from_preset("micro")
    path = circle(height=0.223, tilt=0.08, duration=1.0)
    start = path.sample(0.0).pose
    controller = made(kind, start=start, **more)
    plant = Plant(robot, start, substeps=1)
    found = run_loop(controller, plant, path, faults=faults, duration=duration)
    limit = more.get("force_limit", robot.parameters.actuator_force_limit)
    assert np.isfinite(found.command).all()
    assert (np.abs(found.command) <= limit).all()
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_one_step_in_a_tick_is_the_plant(kind: str) -> None:
    """The runs of this file integrate each tick in one step: the error is below 1e-12 m."""
    robot = RPSRobot.from_preset("micro")
    path = circle(height=0.223, tilt=0.08, duration=1.0)
    start = path.sample(0.0).pose
    one, eight = (
        run_loop(
            made(kind, start=start),
            Plant(robot, start, substeps=steps),
            path,
            faults=[Fault("jump", 0.05, leg=3, size=1e-3)],
            duration=0.06,
        )
        for steps in (1, 8)
    )
    np.testing.assert_array_equal(one.status, eight.status)
    np.testing.assert_allclose(one.length, eight.length, rtol=0, atol=1e-12)
    np.testing.assert_allclose(one.command, eight.command, rtol=0, atol=2e-8)


def said(found: LoopRun, flag: Status) -> NDArray[np.int64]:
    return np.flatnonzero(found.status & int(flag))


@pytest.mark.parametrize("kind", KINDS)
def test_lost_samples_are_bridged(kind: str) -> None:
    undisturbed = LoopSummary.of(run(kind), begin=0.2)
    faults = [Fault("lost", 0.1, TICK), Fault("nan", 0.2, TICK, leg=2), Fault("lost", 0.3, 3e-3)]
    found = run(kind, *faults)
    np.testing.assert_array_equal(said(found, Status.BAD_INPUT), [100, 200, 300, 301, 302])
    assert not said(found, Status.STOPPED).size
    disturbed = LoopSummary.of(found, begin=0.2)
    assert disturbed.centre_max < undisturbed.centre_max + 2.0  # um
    assert disturbed.turn_max < undisturbed.turn_max + 200.0  # urad


@pytest.mark.parametrize("kind", KINDS)
def test_a_silent_encoder_stops_the_robot_until_it_is_reset(kind: str) -> None:
    found = run(kind, Fault("lost", 0.2))
    stopped = said(found, Status.STOPPED)
    np.testing.assert_array_equal(stopped, np.arange(203, 500))
    assert "4 readings in a row" in found.events[1].text
    np.testing.assert_array_equal(found.command[204], found.command[-1])  # the weight
    controller = made(kind)
    for _ in range(5):
        status = controller.tick(None)
    assert status & Status.STOPPED
    length = RPSRobot.from_preset("micro").inverse_kinematics(START).length
    assert controller.tick(length) & Status.STOPPED  # latched, though it can see again
    controller.reset(START)
    assert controller.tick(length) == Status.OK


@pytest.mark.parametrize("kind", quick(KINDS, ["task", "pd"]))
def test_stopped_with_readings_it_comes_to_rest_where_it_was(kind: str) -> None:
    found = run(kind, Fault("lost", 0.2, 4e-3), duration=1.5)
    assert said(found, Status.STOPPED).size == 1500 - 203
    speed = np.abs(found.rate[[203, 1499]] * [1.0, 0.1, 0.1]).max(axis=1)
    assert speed[0] > 0.01
    assert speed[1] < 1e-3 * speed[0]
    np.testing.assert_allclose(found.pose[-1], found.pose[204], atol=3e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_a_jump_of_a_millimetre(kind: str) -> None:
    spike = run(kind, Fault("jump", 0.2, TICK, leg=1, size=1e-3), duration=0.25)
    np.testing.assert_array_equal(said(spike, Status.JUMP), [200])
    assert LoopSummary.of(spike, begin=0.1).centre_max < 30.0
    for size in (-1e-3, 1e-3):
        for_good = run(kind, Fault("jump", 0.2, leg=3, size=size), duration=0.28)
        assert said(for_good, Status.JUMP)[0] == 200
        assert said(for_good, Status.STOPPED)[0] == 203
        # It stays within the jump of where it was.
        assert np.abs(for_good.length[203:] - for_good.length[203]).max() < 2e-3


@pytest.mark.parametrize("kind", KINDS)
def test_a_target_out_of_the_workspace_is_held(kind: str) -> None:
    fault = Fault("target", 0.2, 0.05, offset=(0.05, 0.0, 0.0))
    found = run(kind, fault, Fault("target_nan", 0.6, TICK), duration=1.0)
    held = said(found, Status.TARGET_HELD)
    back = round(1e3 * SHORTEST)  # it comes back that long
    np.testing.assert_array_equal(held, [*range(200, 250 + back - 1), *range(600, 601 + back - 1)])
    assert "its limits are 0.2 to 0.25 m" in found.events[0].text
    assert not said(found, Status.STOPPED).size
    assert found.length.max() < 0.25
    fastest = np.abs(np.diff(found.length, axis=0)).max() / 1e-3
    limit = RPSRobot.from_preset("micro").parameters.actuator_speed_limit
    assert fastest < (limit if "pd" not in kind else 1.1 * limit)  # PD overshoots
    assert LoopSummary.of(found, begin=0.9).centre_max < 30.0  # um: it follows again


def test_on_the_way_back_to_a_target_the_words_say_so() -> None:
    controller, still = made("task"), np.zeros(3)
    length = RPSRobot.from_preset("micro").inverse_kinematics(START).length
    controller.tick(length, (START + 0.1, still, still))
    assert "the last valid target is held" in controller.status_text
    for target in ((START, still, still), None):
        assert controller.tick(length, target) == Status.TARGET_HELD
        assert "returning to the target: 0.09" in controller.status_text


@pytest.mark.parametrize(("speed", "near"), [(0.4, 0.15), (2.0, 0.05)])
@pytest.mark.parametrize("kind", KINDS)
def test_a_path_through_a_singularity_is_not_followed_into_it(
    kind: str, speed: float, near: float
) -> None:
    robot = RPSRobot.from_preset("sokolov")
    path = helix(robot, radius=0.075, pitch=0.05, height=0.4)  # check_path: crossings from 4.075 s
    safe = path.sample(1.0).pose
    with pytest.raises(SingularityError, match="too near a singularity"):
        made(kind, robot, safe)
    start = np.array([0.4, 0.6, 0.0])
    controller = made(kind, robot, start, force_limit=50.0, near_singular=near)
    plant = Plant(robot, start, substeps=1)
    held = False
    for k in range(round(0.3e3 / speed)):  # the singularity is at a tilt of 0.7975 rad
        target = (np.array([0.4, 0.6 + 1e-3 * k * speed, 0.0]), [0.0, speed, 0.0], np.zeros(3))
        status = controller.tick(plant.reading(), target)
        assert np.isfinite(controller.forces).all()
        assert np.abs(controller.forces).max() <= 50.0
        held |= bool(status & Status.TARGET_HELD)
        plant.step(controller.forces)
    assert held
    assert "too near a singularity" in controller.status_text
    if speed < 1.0 and kind != "pd":  # whose gains are a leg's, for the inertia where it started
        assert controller.estimate.type_ii > 0.1
        assert not status & Status.STOPPED
        np.testing.assert_allclose(plant.rate, 0.0, atol=1e-2)
    else:  # 50 N do not stop it in time, and that is said
        assert status & (Status.STOPPED | Status.SATURATED)


@pytest.mark.parametrize("kind", KINDS)
def test_arbitrary_numbers_never_raise_nor_pass_the_limits(kind: str) -> None:
    rng = np.random.default_rng(7)
    robot = RPSRobot.from_preset("micro")
    length = robot.inverse_kinematics(START).length
    odd: list[Any] = [math.nan, math.inf, -math.inf, 1e308, -1e308, 1e-320, 0.0, -0.1, 1e3]
    junk: list[Any] = [None, "x", [1.0], np.zeros((2, 3)), {}, 5, object(), ["a", 1, 2]]

    def three(good: Array) -> Any:
        choice = rng.integers(0, 8)
        if choice == 0:
            return junk[rng.integers(len(junk))]
        values = good + rng.normal(size=3) * 10.0 ** rng.uniform(-9, 3) * (choice < 3)
        if choice == 1:
            values[rng.integers(3)] = odd[rng.integers(len(odd))]
        return values

    controller = made(kind, force_limit=[20.0, 30.0, 40.0])
    sent = controller.forces
    stops = 0
    with np.errstate(all="ignore"):
        for _ in range(6000):
            speed = None if rng.random() < 0.5 else three(np.zeros(3))
            target = (three(START), three(np.zeros(3)), three(np.zeros(3)))
            dt = (
                None
                if rng.random() < 0.8
                else [math.nan, -1.0, 0.0, math.inf, "x", 1e-3][rng.integers(6)]
            )
            status = controller.tick(
                three(length),
                target if rng.random() < 0.9 else junk[rng.integers(len(junk))],
                speed,
                dt=dt,  # type: ignore[arg-type]
            )
            assert isinstance(status, Status)
            assert controller.forces is sent
            assert np.isfinite(sent).all()
            assert (np.abs(sent) <= [20.0, 30.0, 40.0]).all()
            assert controller.status_text
            if status & Status.STOPPED and rng.random() < 0.2:
                stops += 1
                controller.reset(START)
    assert stops > 20


def test_saturation_is_said_exactly_when_the_law_asks_for_more() -> None:
    found = run("task", force_limit=5.0)
    saturated = (found.status & int(Status.SATURATED)) != 0
    at_limit = (np.abs(found.command) >= 5.0 - 1e-9).any(axis=1)
    assert saturated.any()
    assert not saturated.all()
    np.testing.assert_array_equal(saturated & ~at_limit, np.zeros(saturated.size, bool))


def test_anti_windup_forgets_what_the_limits_did_not_give() -> None:
    """Held down for half a second by a limit below the weight, then let go."""
    robot, still = RPSRobot.from_preset("micro"), np.zeros(3)
    overshoot = {}
    for kind in ("with", "without"):
        controller = made("task", robot, compiled=False)  # its limits change between ticks
        if kind == "without":
            controller._tracking_rate = (0.0, 0.0, 0.0)
        plant = Plant(robot, START, substeps=1)
        normal = controller._limits.limit
        heights = [0.0]
        for k in range(2500):
            controller._limits.limit = (4.85,) * 3 if k < 150 else normal
            controller._limits._size = np.array(controller._limits.limit)
            controller.tick(plant.reading(), (START, still, still))
            plant.step(controller.forces)
            heights.append(plant.pose[0] - START[0])
        overshoot[kind] = np.max(heights)
    assert overshoot["with"] < overshoot["without"] / 2


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"space": "joint"}, "space = 'joint'"),
        ({"stop_singular": 0.1}, "stop_singular"),
        ({"most_lost": -1}, "most_lost"),
        ({"force_limit": [1.0, 2.0]}, "force_limit"),
        ({"force_limit": 0.0}, "force_limit"),
        ({"period": 0.0}, "period"),
    ],
)
def test_nonsense_is_refused(changes: dict[str, Any], words: str) -> None:
    robot = RPSRobot.from_preset("micro")
    with pytest.raises(InputError, match=words):
        ComputedTorque(robot, START, Gains.placed(10.0), **changes)
    with pytest.raises(InputError, match="gains"):
        ComputedTorque(robot, START, 5.0)  # type: ignore[arg-type]

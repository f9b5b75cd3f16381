"""Generated ticks of a task's controllers: whole ticks in machine code, and when they are not.

The other engine is Pinocchio's, in Python; it shares none of the generated code.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from rps_pin.arrays import Array
from rps_pin.control import ComputedTorque, Gains, PDControl, Status, effective_inertia
from rps_pin.control.loop.controller import Controller
from tests.control import float_ticks
from tests.control.tasks import plain, start, task
from tests.quick import quick
from tests.worst import worst

PERIOD = 1e-3
LAWS: dict[str, tuple[type[Controller], dict[str, Any]]] = {
    "computed torque": (ComputedTorque, {}),
    "computed torque of the actuators": (ComputedTorque, {"space": "actuator"}),
    "PD": (PDControl, {"compensation": "gravity"}),
    "PD of the task": (PDControl, {"space": "task", "compensation": "feed_forward"}),
}
#: Each law on one robot: its code is built for each anew.
CASES = [
    ("ankle", "computed torque of the actuators"),
    ("ankle", "PD of the task"),
    ("delta", "computed torque"),
    ("stewart", "computed torque"),
]


def made(name: str, law: str, compiled: bool, **more: Any) -> Controller:
    kind, options = LAWS[law]
    gains = Gains.placed(15.0, integral=0.2)
    if kind is PDControl:
        inertia = effective_inertia(
            plain(name), start(name), space=options.get("space", "actuator")
        )
        gains = gains.times(inertia)
    robot = task(name) if compiled else plain(name)
    found: Controller = kind(robot, start(name), gains, period=PERIOD, **options | more)
    return found


def swing(name: str, count: int, size: float = 0.05) -> tuple[list[Array], Array]:
    """Coordinates with rates and accelerations, and the actuators' positions, by Pinocchio."""
    one = plain(name)
    t = PERIOD * np.arange(count)[:, None]
    w = 2 * np.pi * np.linspace(1.0, 3.0, one.size)
    by = size * one.characteristic_length / one.scale
    rows = [
        start(name) + by * (1 - np.cos(w * t)),
        by * w * np.sin(w * t),
        by * w * w * np.cos(w * t),
    ]
    near = one.configuration(start(name))
    return rows, one.follow(rows[0], near)[:, one.of_actuators]


@pytest.mark.parametrize(("name", "law"), quick(CASES, CASES[:3]))
def test_statuses_and_forces_are_those_of_the_interpreted_tick(name: str, law: str) -> None:
    """Along a motion with noise, lost and bad readings, jumps, absurd times, refused targets."""
    rng = np.random.default_rng(7)
    rows, positions = swing(name, 170)
    weak = 6.0 * np.abs(made(name, law, False).forces).max()
    pair = [made(name, law, one, force_limit=weak) for one in (True, False)]
    far, generated, seen, differences = 30 * np.ones(plain(name).size), 0, set(), [0.0]
    for k in range(170):
        reading: Any = positions[k] + 1e-7 * rng.normal(size=positions.shape[1])
        target: Any = tuple(row[k] for row in rows)
        speed, dt = None, None
        if k % 5 == 1:
            target = None
        if 60 < k < 90:
            speed = (positions[k] - positions[k - 1]) / PERIOD
        if k % 17 == 3:
            dt = 1.2 * PERIOD
        faults = {
            **{100: (None, target, None, None), 104: (reading * np.nan, target, None, None)},
            **{108: (reading + 5.0, target, None, None), 112: (reading, target, None, 1e300)},
            **{116: (reading, target, None, -1.0), 120: (reading, target, reading * np.inf, None)},
            **{155: (reading, (far, far, far), None, None), 159: (reading, "no", None, None)},
        }
        given = faults.get(k, (reading, target, speed, dt))
        found = [one.tick(*given[:3], dt=given[3]) for one in pair]
        assert found[0] == found[1], k
        seen.add(found[0])
        code = pair[0]._generated
        assert code is not None, pair[0].engine
        generated += code.ahead
        size = max(1.0, np.abs(pair[1].forces).max())
        differences.append(worst(np.abs(pair[0].forces - pair[1].forces)) / size)
        for ours, theirs in zip(*(one.estimate.answers for one in pair), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-8 * (1 + np.abs(theirs).max()))
    assert worst(differences) < 1e-7
    assert Status.OK in seen
    assert any(Status.TARGET_HELD in one for one in seen)
    assert any(Status.BAD_INPUT in one for one in seen)
    assert any(Status.JUMP in one for one in seen)
    assert generated > 90


def test_what_a_generated_tick_leaves_is_there_to_be_read() -> None:
    rows, positions = swing("ankle", 40)
    pair = [made("ankle", "PD of the task", one) for one in (True, False)]
    for k in range(40):
        for one in pair:
            one.tick(positions[k], tuple(row[k] for row in rows))
    fast, slow = pair
    assert fast._generated is not None
    assert fast._generated.ahead
    assert fast.estimate.type_ii == pytest.approx(slow.estimate.type_ii, rel=1e-9)
    ours, theirs = fast.estimate.state, slow.estimate.state
    np.testing.assert_allclose(ours.rate, theirs.rate, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.jacobian.K, theirs.jacobian.K, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.geometry.pose, rows[0][-1], rtol=0, atol=1e-9)
    assert fast.status_text == slow.status_text
    assert fast.pace == slow.pace


def test_ticks_go_on_in_a_copy_and_after_a_reset() -> None:
    rows, positions = swing("ankle", 30)
    one = made("ankle", "PD of the task", True)
    for k in range(10):
        one.tick(positions[k], tuple(row[k] for row in rows))
    other = copy.deepcopy(one)
    one.reset(start("ankle"))
    for k in range(10, 30):
        other.tick(positions[k], tuple(row[k] for row in rows))
    again = made("ankle", "PD of the task", True)
    for k in range(30):
        again.tick(positions[k], tuple(row[k] for row in rows))
    np.testing.assert_allclose(other.forces, again.forces, rtol=1e-12)
    assert one.tick(positions[0]) == Status.OK
    assert one._generated is not None
    assert one._generated.ahead


def test_bounds_of_the_distance_hold_on_a_long_way_and_end_near_a_singularity() -> None:
    """Of most ticks they show that no singularity is near; where one is, Python tells so."""
    name, near = "delta", 0.072
    one = plain(name)
    fast, slow = (
        ComputedTorque(robot, start(name), Gains.placed(15.0), near_singular=near)
        for robot in (task(name), one)
    )
    down = start(name) - np.outer(np.linspace(0.0, 0.22, 250), [0.0, 0.0, 1.0])
    q = one.follow(down, one.configuration(start(name)))
    distance = one.singularities(q).distance
    assert distance[0] > near > distance[-1]
    generated, refused = [], 0
    still = np.zeros(3)
    for x, row, here in zip(down, q, distance, strict=True):
        given = row[one.of_actuators], (x, still, still), still
        statuses = [each.tick(*given) for each in (fast, slow)]
        assert statuses[0] == statuses[1]
        assert bool(statuses[0] & Status.NEAR_SINGULAR) == (here < near)
        code = fast._generated
        assert code is not None
        assert not (code.ahead and here < near)
        generated.append(code.ahead)
        refused += not code.ahead and here > near
    assert 2 < refused < 60  # where J has changed by more than the margin
    assert sum(generated) > 150


def test_some_hostile_ticks() -> None:
    """``python -m tests.control.float_ticks --robots delta stewart ankle`` computes a million."""
    statuses: dict[str, Any] = {}
    for report in float_ticks.run_task("ankle", 320, seed=3):
        assert not report.faults
        _, engine, law = report.name.split(", ")
        assert (report.generated > 0) == (engine == "generated")
        assert statuses.setdefault(law, report.statuses) == report.statuses
        assert 0.0 < report.largest <= 1.0
    assert {flag for one in statuses.values() for flag in one} >= {"OK", "STOPPED", "SATURATED"}


def test_speeds_and_targets_beyond_all_measure_are_refused_at_once() -> None:
    """Speeds beyond floats' squares raised in actuator space; far targets took seconds."""
    for compiled in (True, False):
        one = made("ankle", "computed torque of the actuators", compiled, largest_jump=1e9)
        reading = one.estimate.answers.position.copy()
        assert one.tick(reading, None, 1e60 + 0 * reading) == Status.BAD_INPUT
        assert one.tick(reading, None, 1e10 + 0 * reading) == Status.BAD_INPUT
        still = 0 * reading
        assert one.tick(reading, (start("ankle") + 1e4, still, still)) == Status.TARGET_HELD
        assert "at most 10 are followed in a tick" in one.status_text
        assert one.tick(reading + 11.0) & Status.JUMP


def test_a_task_without_a_generated_tick_is_told_why(monkeypatch: pytest.MonkeyPatch) -> None:
    class Own(ComputedTorque):
        pass

    law = Own(task("ankle"), start("ankle"), Gains.placed(15.0))
    assert law.compiled
    assert law.engine == (
        "generated code, called by an interpreted tick: this law has no generated code"
    )
    monkeypatch.setenv("RPS_PIN_COMPILE", "0")
    off = ComputedTorque(task("ankle"), start("ankle"), Gains.placed(15.0))
    assert "switched off by RPS_PIN_COMPILE=0" in off.engine
    monkeypatch.delenv("RPS_PIN_COMPILE")
    options = {"functions": ("kinematics", "closing", "dynamics"), "parameters": ("gravity",)}
    open_to_changes = plain("ankle").compile(**options)
    one = ComputedTorque(open_to_changes, start("ankle"), Gains.placed(15.0))
    assert "a task with parameters or wrenches has no generated tick" in one.engine
    assert one.tick(one.estimate.answers.position.copy()) == Status.OK

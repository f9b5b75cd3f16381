"""Compiled functions are the Python they are written in, and no loop waits for the compiler."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rps_pin import RPSRobot
from rps_pin.control import (
    ComputedTorque,
    Controller,
    Gains,
    PDControl,
    effective_inertia,
)
from rps_pin.control.estimator import leg_geometry, leg_jacobian, robot_state, state_estimate
from rps_pin.control.loop import limits
from rps_pin.numerics.compiled import COMPILES
from rps_pin.rps.kinematics import tracking

pytestmark = pytest.mark.skipif(not COMPILES, reason="Numba is not installed, or switched off")
MODULES = [leg_geometry, leg_jacobian, robot_state, state_estimate, limits, tracking]
RNG = np.random.default_rng(11)
ROBOT = RPSRobot.from_preset("micro")
G, H = ROBOT.parameters.base_radius, ROBOT.parameters.platform_radius


def compiled_functions() -> Iterator[Any]:
    for module in MODULES:
        for value in vars(module).values():
            if hasattr(value, "py_func") and value.py_func.__module__ == module.__name__:
                yield value


COMPILED: list[Any] = list(compiled_functions())


def flat(value: Any) -> list[float]:
    if isinstance(value, tuple):
        return [number for one in value for number in flat(one)]
    return [float(value)]


def triple(scale: float) -> tuple[float, float, float]:
    one, two, three = RNG.normal(scale=scale, size=3).tolist()
    return one, two, three


@pytest.fixture
def interpreted(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Every compiled function as Python, which calls none that is compiled."""
    ready = {function.py_func.__name__: function for function in COMPILED}
    answers(ready, [(0.22, 0.1, 0.2), triple(1e-3), triple(1.0), triple(1.0)])
    found = {name: function.py_func for name, function in ready.items()}
    for module in MODULES:
        for name, function in found.items():
            if name in vars(module):
                monkeypatch.setattr(module, name, function)
    return found


def answers(f: dict[str, Any], numbers: list[Any]) -> list[float]:
    """Return what the functions say of a pose, a step of the lengths, and rates."""
    pose, step, rate, acceleration = numbers
    at = f["leg_geometry"](pose, G, H)
    goal = tuple(d + s for d, s in zip(at.length, step, strict=True))
    followed = f["follow"](at.length, at.direction, goal, G, H, 1e4, 50)
    jacobian = f["leg_jacobian"](at, H)
    return flat(
        (
            *(at, followed, f["pose_of"](goal, followed.directions, G, H), jacobian),
            *(f["closure_determinant"](at, G, H), f["robot_state"](at, rate, acceleration, H)),
            *(f["pose_rate"](jacobian, rate), f["leg_speed"](jacobian, rate)),
            *(f["force_of_wrench"](jacobian, rate), f["wrench_of_force"](jacobian, rate)),
            *(f["leg_motion"](at, rate, acceleration, H), f["platform_twist"](at, rate, H)),
            f["state_estimate"](goal, followed.directions, rate, G, H),
        )
    )


def test_compiled_is_interpreted(interpreted: dict[str, Any]) -> None:
    names = {f.py_func.__name__: f for f in COMPILED}
    for _ in range(300):
        z, wx, wy = 0.22 + RNG.uniform(-0.02, 0.02), *RNG.uniform(-1.2, 1.2, size=2)
        numbers = [(float(z), float(wx), float(wy)), triple(2e-3), triple(1.0), triple(10.0)]
        ours, plain = answers(names, numbers), answers(interpreted, numbers)
        np.testing.assert_allclose(ours, plain, rtol=1e-9, atol=1e-10)


def test_there_are_compiled_functions() -> None:
    assert {f.py_func.__name__ for f in COMPILED} >= {
        "follow",
        "pose_of",
        "robot_state",
        "leg_jacobian",
    }


def controllers(start: Any) -> Iterator[Controller]:
    gains = Gains.placed(15.0, integral=0.2)
    for space in ("task", "actuator"):
        yield ComputedTorque(ROBOT, start, gains, space=space)  # type: ignore[arg-type]
        inertia = effective_inertia(ROBOT, start, space=space)  # type: ignore[arg-type]
        for compensation in ("gravity", "feed_forward", "none"):
            yield PDControl(
                *(ROBOT, start, gains.times(inertia)),
                space=space,  # type: ignore[arg-type]
                compensation=compensation,  # type: ignore[arg-type]
                force_limit=6.0,
            )


def test_nothing_is_compiled_in_a_loop() -> None:
    start, still = np.array([0.223, 0.0, 0.0]), np.zeros(3)
    length = ROBOT.inverse_kinematics(start).length
    ready = list(controllers(start))
    before = {f: len(f.signatures) for f in COMPILED}
    assert max(before.values()) > 0  # other tests in this process may have asked for more
    for controller in ready:
        for lengths in (length, length.tolist(), None, length + 1e-6, [1, 2, 3], length):
            for target in (None, (start, still, still), ([1, 0, 0], [0, 0, 0], [0, 0, 0])):
                controller.tick(lengths, target)
                controller.tick(lengths, target, [0, 0, 0], dt=1)
        for _ in range(6):
            controller.tick(None)
        controller.tick(length, None)
    assert {f: len(f.signatures) for f in COMPILED} == before


def test_a_changed_kernel_is_compiled_anew(tmp_path: Path) -> None:
    kernels, user = tmp_path / "some_kernels.py", tmp_path / "some_user.py"
    user.write_text(
        "from rps_pin.numerics.compiled import compiled\n"
        "from some_kernels import scaled\n"
        "@compiled\n"
        "def answer(x):\n    return scaled(x) + 1.0\n"
        "print(answer(2.0), sum(answer.stats.cache_hits.values()))\n"
    )
    printed = []
    for factor in (3, 3, 5):
        kernels.write_text(
            "from rps_pin.numerics.compiled import kernel\n"
            f"@kernel\ndef scaled(x):\n    return {factor} * x\n"
        )
        # -B: bytecode is dated to the second, and the two kernels are of one size
        command = [sys.executable, "-B", user]
        told = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
        printed.append(told.stdout.split())
    assert printed == [["7.0", "0"], ["7.0", "1"], ["11.0", "0"]]


def test_it_can_be_switched_off() -> None:
    code = "from rps_pin.rps.kinematics.tracking import follow; print(type(follow).__name__)"
    command = [sys.executable, "-c", code]
    for asked, wanted in (("0", "function"), ("1", "CPUDispatcher")):
        told = subprocess.run(
            command,
            env={**os.environ, "RPS_PIN_COMPILE": asked},
            capture_output=True,
            text=True,
            check=True,
        )
        assert told.stdout.strip() == wanted

"""Closed forms of one 3-RPS in many threads: the numbers of one thread, with and without code."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

from rps_pin import RPSRobot
from rps_pin.errors import CompileError
from rps_pin.rps import Payload
from rps_pin.rps.generated import engine
from tests.threads import at_once
from tests.worst import worst

THREADS = 6
_RNG = np.random.default_rng(0)
POSES = np.array([0.226, 0.0, 0.0]) + _RNG.uniform(-0.015, 0.015, (THREADS, 3))
RATES, CHANGES = _RNG.normal(size=(2, THREADS, 3))
BATCHES = POSES[:, None] + _RNG.uniform(-0.005, 0.005, (THREADS, 40, 3))
_MICRO = RPSRobot.from_preset("micro")
LENGTHS = _MICRO.inverse_kinematics(POSES).length
MANY = _MICRO.inverse_kinematics(BATCHES).length
STATES = [_MICRO.state(x, dx, ddx) for x, dx, ddx in zip(POSES, RATES, CHANGES, strict=True)]

CALLS: dict[str, Callable[[RPSRobot, int], Any]] = {
    "inverse_kinematics": lambda r, k: r.inverse_kinematics(POSES[k])[:2],
    "many inverse_kinematics": lambda r, k: r.inverse_kinematics(BATCHES[k])[:2],
    "forward_kinematics": lambda r, k: [r.forward_kinematics(LENGTHS[k], POSES[k] + 1e-3)],
    "many forward_kinematics": lambda r, k: [r.forward_kinematics(MANY[k], BATCHES[k] + 1e-4)],
    "actuator_forces": lambda r, k: [r.actuator_forces(POSES[k], RATES[k], CHANGES[k])],
    "many actuator_forces": lambda r, k: [r.actuator_forces(BATCHES[k], RATES[k], CHANGES[k])],
    "state": lambda r, k: r.state(POSES[k], RATES[k], CHANGES[k]),
    "motion": lambda r, k: [
        part for whole in r.motion(POSES[k], RATES[k], CHANGES[k]) for part in whole
    ],
    "platform_placement": lambda r, k: r.platform_placement(POSES[k]),
    "assembly_modes": lambda r, k: [r.assembly_modes(LENGTHS[k]).position[:4]],
    "inverse_dynamics": lambda r, k: [r.inverse_dynamics(*STATES[k]).tau],
}


@pytest.fixture(scope="module", params=["generated", "Python"])
def robot(request: pytest.FixtureRequest) -> Iterator[RPSRobot]:
    code = None
    if request.param == "generated":
        try:
            code = engine.built("cc")
        except CompileError as error:
            pytest.skip(str(error))
    engine.use(code)
    yield RPSRobot.from_preset("micro").with_payload(Payload(0.1, [0.0, 0.01, 0.02]))
    engine.use(None)


@pytest.mark.parametrize("name", CALLS)
def test_many_threads_get_the_numbers_of_one(robot: RPSRobot, name: str) -> None:
    """Or a `ThreadError`, where a call uses the mechanism's scratch memory."""
    call, count = CALLS[name], 4 if "modes" in name else 60

    def numbers(k: int) -> np.ndarray:
        return np.concatenate([np.ravel(part) for part in call(robot, k)])

    right = [numbers(k) for k in range(THREADS)]
    assert min(worst(one - right[0]) for one in right[1:]) > 1e-4
    found, refused = at_once([partial(numbers, k) for k in range(THREADS)], count)
    assert max(worst(one - right[k]) for k in range(THREADS) for one in found[k]) == 0.0
    assert not refused or name == "inverse_dynamics"

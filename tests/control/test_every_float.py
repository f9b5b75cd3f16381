"""Ticks for every float there is: nothing is raised, and forces are finite and within limits.

Numbers are drawn as bit patterns, so that subnormal, huge, infinite and NaN ones are as likely as
their bits are, and as multiples of powers of ten. NumPy raises where it would only warn.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from rps_pin.control import Gains, RealTimeRobot, Status
from rps_pin.control.loop.controller import Controller
from tests.control.float_ticks import LAWS, LENGTH, ROBOT, SPECIAL_NUMBERS, START

pytestmark = pytest.mark.usefixtures("both_engines")

BITS = st.integers(0, 2**64 - 1).map(lambda bits: struct.unpack("<d", struct.pack("<Q", bits))[0])
SPECIAL = st.sampled_from(SPECIAL_NUMBERS)
POWERS = st.builds(lambda x, k: x * 10.0**k, st.floats(-9.0, 9.0), st.integers(-320, 307))
ANY = BITS | SPECIAL | POWERS | st.floats(-1.0, 1.0)
TRIPLES = st.tuples(ANY, ANY, ANY)
#: Near the pose, where a reading or target is good: what follows it then meets the law.
NEAR = st.tuples(*(st.floats(-1e-4, 1e-4),) * 3)
LENGTHS = st.none() | TRIPLES | NEAR.map(lambda e: tuple(np.add(LENGTH, e).tolist()))
POSES = TRIPLES | NEAR.map(lambda e: tuple(np.add(START, e).tolist()))
TARGETS = st.none() | st.tuples(POSES, TRIPLES | NEAR, TRIPLES | NEAR)
TICKS = st.lists(
    st.tuples(LENGTHS, TARGETS, st.none() | TRIPLES | NEAR, st.none() | ANY | st.just(1e-3)),
    min_size=1,
    max_size=8,
)
MANY = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)


@pytest.fixture(scope="module", params=LAWS)
def controller(request: pytest.FixtureRequest, both_engines: str) -> Controller:
    kind, options = LAWS[request.param]
    made = kind(ROBOT, START, Gains.placed(15.0, integral=0.2), **options)
    assert made.compiled is (both_engines == "generated")
    return made


@given(ticks=TICKS)
@example(ticks=[(LENGTH, None, (1e200, -1e250, 3e180), None), (None, None, None, None)])
@example(
    ticks=[(LENGTH, None, None, None), (None, None, None, 1e300), (LENGTH, None, None, 5e-324)]
)
@example(ticks=[(LENGTH, None, (1.7e308, -1.7e308, 1.7e308), None), (LENGTH, None, None, None)])
@MANY
def test_no_tick_raises(controller: Controller, ticks: list[tuple[Any, Any, Any, Any]]) -> None:
    controller.reset(START)
    limit = ROBOT.parameters.actuator_force_limit
    with np.errstate(all="raise"):
        for length, target, speed, dt in ticks:
            status = controller.tick(length, target, speed, dt=dt)
            assert status == controller.status
            assert (np.abs(controller.forces) <= limit).all(), controller.forces  # false of NaN
            assert 0.05 <= controller.pace <= 1.0
            assert all(np.isfinite(one).all() for one in controller.estimate.answers)
            assert 0.0 <= controller.estimate.type_ii <= 1.0 + 1e-9
            assert len(controller.status_text) >= 2
            if length is None or not np.isfinite([*length, *(speed or ())]).all():
                assert status & (Status.BAD_INPUT | Status.STOPPED)


@given(
    readings=st.lists(st.tuples(LENGTHS, st.none() | TRIPLES, st.none() | ANY), max_size=4),
    motion=st.tuples(POSES, TRIPLES | NEAR, TRIPLES | NEAR),
)
@MANY
def test_no_estimate_and_no_forces_raise(
    both_engines: str, readings: list[tuple[Any, Any, Any]], motion: tuple[Any, Any, Any]
) -> None:
    loop = LOOPS.setdefault(both_engines, RealTimeRobot(ROBOT, START))
    loop.reset(START)
    with np.errstate(all="raise"):
        for length, speed, dt in readings:
            loop.estimate(length, speed, dt=dt)
            loop.forces_for(motion[2])
            assert all(np.isfinite(one).all() for one in loop.answers)
            assert len(loop.status_text) >= 2
        loop.inverse_dynamics(*motion)
        assert all(np.isfinite(one).all() for one in loop.answers)
        assert len(loop.force_status_text) >= 2


LOOPS: dict[str, RealTimeRobot] = {}

"""The comparison of ways to the forces: small where they agree, large where one is wrong."""

from __future__ import annotations

import dataclasses

import pytest

from rps_pin import RPSRobot, helix
from rps_pin.paper.three_ways import force_differences
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.dynamics.motion_run import run_motion
from rps_pin.trajectories import circle
from tests.worst import worst

ALL = {"closed form", "Lagrange, first kind", "virtual work"}


def test_three_other_ways_agree_along_a_motion() -> None:
    robot = RPSRobot.from_preset("micro")
    run = run_motion(robot, circle(height=0.223, tilt=0.1, duration=0.5), 200.0)
    found = force_differences(robot, run)
    assert set(found) == ALL
    assert worst(*found.values()) < 1e-10


def test_a_wrong_force_shows() -> None:
    robot = RPSRobot.from_preset("sokolov")
    run = run_motion(robot, helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4), 20.0)
    force = run.force.copy()
    force[7, 1] *= 1.001
    found = force_differences(robot, dataclasses.replace(run, force=force))
    for difference in found.values():
        assert difference == pytest.approx(1e-3, rel=0.5)


def test_payload_wrench_and_friction_are_known_to_the_closed_form_alone() -> None:
    micro = RPSRobot.from_preset("micro")
    loaded = micro.with_payload(Payload(0.5, (0.0, 0.01, 0.02)))
    rubbing = RPSRobot(micro.parameters.replace(prismatic_friction=1.0, revolute_damping=0.01))
    wrench = (1.0, 2.0, 3.0, 0.1, 0.2, 0.3)
    path = circle(height=0.223, tilt=0.1, duration=0.5)
    for robot, outside in ((loaded, None), (rubbing, None), (micro, wrench)):
        found = force_differences(robot, run_motion(robot, path, 100.0, wrench=outside), outside)
        assert set(found) == {"closed form"}
        assert found["closed form"] < 1e-10
        # and the load counts: without it the forces are others
        plain = run_motion(micro, path, 100.0)
        assert force_differences(robot, plain, outside)["closed form"] > 1e-3

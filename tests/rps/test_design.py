"""Designs of 3-RPS robots: against the robots of their parameter files, and certified."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import InputError, RPSParameters, RPSRobot
from rps_pin.rps.design import RPSDesignSpace
from rps_pin.rps.workspace import certify
from rps_pin.task.design import Region, Requirements, design, load_design
from rps_pin.task.design.measures import Measuring
from rps_pin.task.workspace.evaluate import gains_of
from rps_pin.trajectories.point_to_point import point_to_point

REGION = Region(box={"z": (0.215, 0.235), "rx": (-0.1, 0.1), "ry": (-0.1, 0.1)}, points=3)
RANGES = {
    "base_radius": (0.08, 0.2),
    "platform_radius": (0.06, 0.2),
    "leg_length_limits.lower": (0.15, 0.22),
    "leg_length_limits.upper": (0.24, 0.3),
}


def space() -> RPSDesignSpace:
    return RPSDesignSpace(RPSParameters.from_preset("micro"), RANGES)


def test_measures_are_those_of_the_robots_closed_forms(tmp_path: Path) -> None:
    """Reach within lengths and cones, conditioning, forces and speeds: to 1e-9."""
    path = point_to_point([0.22, -0.05, 0.05], [0.23, 0.08, 0.0], duration=0.05)
    asked = Requirements(REGION, motions={"path": path}, samples=7)
    one = Measuring(space(), asked, compiler="tcc")
    low, high = np.array([*RANGES.values()]).T
    values = np.random.default_rng(0).uniform(low, high, (12, 4))
    found, within = one(values), 0
    for k, row in enumerate(values):
        (file,) = one.space.write(row, np.empty(0), tmp_path, f"robot_{k}")
        robot = RPSRobot(RPSParameters.from_yaml(file))
        legs = robot.inverse_kinematics(one.points, errors="mask")
        task = robot.task
        q = task.configuration(one.points, within_limits=False)
        gains = gains_of(task, task.jacobian(q))
        same = gains.determinant * np.sign(gains.determinant[0]) > 0
        assert (found.unreached[k] == 0 and found.beyond[k] == 0) == bool(same.all())
        assert (found.room[k] >= 0) == bool(legs.reachable.all())
        within += legs.reachable.all()
        np.testing.assert_allclose(found.conditioning[k], gains.conditioning.min(), rtol=1e-9)
        sample = path.sample(np.linspace(0, path.duration, 7))
        state = task.state(*sample[:3], within_limits=False)
        forces = robot.mechanism.inverse_dynamics
        tau = [forces(*each).tau for each in zip(*state, strict=True)]
        np.testing.assert_allclose(found.force[k], np.abs(tau).max(), rtol=1e-9)
    assert 2 <= within <= 10


def test_the_winner_is_certified(tmp_path: Path) -> None:
    asked = Requirements(REGION, min_conditioning=0.2, limit_margin=0.01)
    found = design(space(), asked, "platform_radius", candidates=200, population=40, compiler="tcc")
    found.write(tmp_path)
    (one,) = found.chosen()
    robot = RPSRobot(RPSParameters.from_yaml(tmp_path / f"{one.name}.yaml"))
    proven = certify(robot, [0.215, -0.1, -0.1], [0.235, 0.1, 0.1], undecided=0.0)
    assert len(proven.places[0]) and not len(proven.places[1]) and not len(proven.places[2])


def test_files_name_the_fields_of_parameters(tmp_path: Path) -> None:
    text = """robot: micro
dimensions:
  base_radius: {range: [0.08, 0.2], step: 0.01}
  platform_radius: {value: 0.1}
  leg_length_limits.upper: {range: [0.24, 0.3]}
requirements: {region: {box: {z: [0.215, 0.235]}}}
objectives: [base_radius]
"""
    file = tmp_path / "design.yaml"
    file.write_text(text)
    found = load_design(file).space
    assert isinstance(found, RPSDesignSpace)
    np.testing.assert_allclose(found.nominal, [0.12, 0.12, 0.25])
    made = found.of_values(np.array([0.1, 0.09, 0.28]))
    assert (made.base_radius, made.platform_radius) == (0.1, 0.09)
    assert made.leg_length_limits == (0.2, 0.28)
    file.write_text(text.replace("base_radius: {range: [0.08, 0.2]", "base_radios: {range: [0, 1]"))
    with pytest.raises(InputError, match=r"line 3: no field 'base_radios' .*did you mean base_rad"):
        load_design(file)
    file.write_text(text.replace("step: 0.01", "length: [leg_1_revolute]"))
    with pytest.raises(InputError, match="line 3: length: a field of a 3-RPS takes"):
        load_design(file)

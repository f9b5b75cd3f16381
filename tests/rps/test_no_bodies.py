"""A 3-RPS without masses and inertias: kinematics are the same, forces are refused."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

from rps_pin import ParameterError, RPSParameters, RPSRobot
from rps_pin.control.simulation.scenario import load_scenario
from rps_pin.errors import InputError
from rps_pin.rps.dynamics.motion_run import run_motion
from rps_pin.rps.motion.time_optimal import time_optimal
from rps_pin.rps.parameters import BODIES
from rps_pin.task import check_path
from rps_pin.trajectories import circle

MICRO = RPSParameters.from_preset("micro")
POSE = np.array([[0.22, 0.1, -0.05], [0.225, 0.0, 0.08]])
_WITH = {*BODIES, "leg_inertia_about", "rod_mass", "rod_inertia"}
BARE = RPSRobot(RPSParameters(**{name: value for name, value in MICRO if name not in _WITH}))


def test_kinematics_are_those_of_the_robot_with_bodies() -> None:
    micro = RPSRobot(MICRO)
    assert not BARE.parameters.has_bodies and micro.parameters.has_bodies
    lengths = micro.inverse_kinematics(POSE).length
    np.testing.assert_array_equal(BARE.inverse_kinematics(POSE).length, lengths)
    # Sums of products round as their arrays lie in memory: once in many runs, by 1e-16.
    found, right = (one.forward_kinematics(lengths, [0.22, 0, 0]) for one in (BARE, micro))
    np.testing.assert_allclose(found, right, rtol=0.0, atol=1e-15)
    still = np.zeros_like(POSE)
    for one, other in zip(
        BARE.state(POSE, still, still), micro.state(POSE, still, still), strict=True
    ):
        np.testing.assert_array_equal(one, other)
    assert BARE.mechanism.describe().mobility == 3
    path = circle(height=0.223, tilt=0.1, duration=2.0)
    assert check_path(BARE.task, path).ok


def test_forces_are_refused_and_all_that_is_missing_named() -> None:
    still, path = np.zeros(3), circle(height=0.223, tilt=0.05, duration=1.0)
    q, v, a = BARE.state(POSE[0], still, still)
    for forces in (
        lambda: BARE.actuator_forces(POSE[0], still, still),
        lambda: BARE.inverse_dynamics(q, v, a),
        lambda: BARE.inverse_dynamics(q, v, a, wrench=np.ones(6)),
        lambda: BARE.force_terms,
        lambda: run_motion(BARE, path, 50.0),
        lambda: time_optimal(BARE, path),
        BARE.compile,
    ):
        with pytest.raises(ParameterError, match="forces need it, and it was left out") as told:
            forces()
        assert [told.value.field, *(one.field for one in told.value.others)] == [*BODIES]


def test_copies_files_and_changes_have_none_either(tmp_path: Path) -> None:
    p = BARE.parameters
    p.to_yaml(tmp_path / "bare.yaml")
    assert "platform_mass" not in (tmp_path / "bare.yaml").read_text()
    for same in (
        copy.deepcopy(p),
        pickle.loads(pickle.dumps(p)),
        RPSParameters.from_yaml(tmp_path / "bare.yaml"),
        p.replace(base_radius=0.13).replace(base_radius=p.base_radius),
    ):
        assert same == p and not same.has_bodies
    with_bodies = p.replace(**{name: getattr(MICRO, name) for name in _WITH})
    assert with_bodies == MICRO


@pytest.mark.parametrize("field", [*BODIES, "rod_mass", "rod_inertia", "leg_inertia_about"])
def test_all_or_none_are_given(field: str) -> None:
    with pytest.raises(ParameterError, match="required") as told:
        BARE.parameters.replace(**{field: getattr(MICRO, field)})
    faults = [told.value, *told.value.others]
    assert {one.field for one in faults if one.value is None} == set(BODIES) - {field}


def test_a_mass_that_is_given_is_not_zero() -> None:
    with pytest.raises(ParameterError, match=r"platform_mass = 0\.0: must be greater"):
        MICRO.replace(platform_mass=0.0)
    with pytest.raises(ParameterError, match="must be positive"):
        MICRO.replace(platform_inertia=np.zeros((3, 3)))


def test_all_faults_of_a_file_are_told_at_once_with_their_lines(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(
        "name: my robot\nbase_radus: 0.12\nplatform_radius: -0.12\nplatform_mass: 1 kg\n"
        "leg_length_limits: [0.2]\n"
    )
    with pytest.raises(ParameterError) as told:
        RPSParameters.from_yaml(file)
    words = str(told.value)
    assert words.startswith(f"{file}, line 2: base_radus = 0.12: unknown field (did you mean base_")
    for more in (
        "; line 1: name = 'my robot': a name begins with a letter and has letters a-z, digits,",
        "; line 3: platform_radius = -0.12: ",
        "; line 4: platform_mass = '1 kg': must be a number, not a text",
        "; line 5: leg_length_limits = [0.2]: must be two numbers, (lower, upper)",
        "; platform_inertia, leg_mass, leg_com, leg_inertia: required, and not given",
    ):
        assert more in words
    assert "base_radius = None" not in words  # the misspelt one stands for it
    assert len(told.value.others) == 8


def test_a_scenario_needs_bodies(tmp_path: Path) -> None:
    BARE.parameters.to_yaml(tmp_path / "bare.yaml")
    file = tmp_path / "loop.yaml"
    file.write_text(
        "trajectory: {kind: circle, height: 0.223, tilt: 0.1, duration: 2.0}\n"
        "robot: bare.yaml\ncontroller: {bandwidth: 15.0}\n"
    )
    with pytest.raises(InputError, match=r"line 2: platform_mass = None: forces"):
        load_scenario(file)

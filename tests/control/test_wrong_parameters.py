"""Wrong parameters: forces are linear in masses, factors multiply, friction adds what it says."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rps_pin import RPSParameters, RPSRobot
from rps_pin.control.simulation.wrong_parameters import wrong_parameters
from rps_pin.errors import InputError, ParameterError
from tests import strategies

Array = NDArray[np.float64]

PARTS = {
    "platform": ("platform_mass", "platform_inertia"),
    "legs": ("leg_mass", "leg_inertia"),
    "rods": ("rod_mass", "rod_inertia"),
}
FRICTION = (
    *("prismatic_damping", "prismatic_friction", "revolute_damping"),
    *("revolute_friction", "friction_speed"),
)
factors = strategies.floats(1e-3, 1e3)


def forces(p: RPSParameters, seed: int, through_the_model: bool = False) -> Array:
    """Of random motions (20, 3), Coriolis terms and inertia as large as weight."""
    rng = np.random.default_rng(seed)
    robot = RPSRobot(p)
    motion = strategies.random_motions(rng, p, 20, largest_tilt=0.6)
    if through_the_model:
        states = zip(*robot.state(*motion), strict=True)
        return np.array([robot.inverse_dynamics(*state).tau for state in states])
    found: Array = robot.actuator_forces(*motion)
    return found


def assert_equal_forces(found: Array, expected: Array) -> None:
    scale = np.abs(expected).max(axis=1, keepdims=True)
    assert np.abs((found - expected) / scale).max() < 1e-9


def random_robot(seed: int, about: Literal["joint", "com"] = "com") -> RPSParameters:
    p = strategies.random_parameters(np.random.default_rng(seed), tilted_gravity=True)
    if about == "joint":
        inertia = p.leg_inertia + p.leg_mass * p.leg_com**2
        return p.replace(leg_inertia=inertia, leg_inertia_about="joint")
    return p


@pytest.mark.parametrize("through_the_model", [False, True])
@pytest.mark.parametrize("about", ["joint", "com"])
def test_forces_grow_with_the_masses(
    about: Literal["joint", "com"], through_the_model: bool
) -> None:
    for seed in range(5):
        p = random_robot(seed, about)
        expected = forces(p, seed, through_the_model)
        for factor in (0.3, 1.2, 7.0):
            found = forces(wrong_parameters(p, masses=factor), seed, through_the_model)
            assert_equal_forces(found, factor * expected)


@pytest.mark.parametrize("part", PARTS)
def test_forces_are_linear_in_each_part(part: str) -> None:
    """F(1 + s) - F(1) is s times the part's own, whatever else there is."""
    for seed in range(5):
        p = random_robot(seed, "joint" if seed % 2 else "com")
        base = forces(p, seed)
        slope = forces(wrong_parameters(p, **{part: 2.0}), seed) - base
        for factor in (0.25, 1.5, 4.0):
            found = forces(wrong_parameters(p, **{part: factor}), seed)
            assert_equal_forces(found, base + (factor - 1) * slope)
        assert (np.abs(slope).max(axis=1) > 1e-4 * np.abs(base).max(axis=1)).all()


def test_all_three_parts_together_are_all_masses() -> None:
    for seed in range(5):
        p = random_robot(seed)
        one = wrong_parameters(p, platform=1.7, legs=1.7, rods=1.7)
        assert_equal_forces(forces(one, seed), forces(wrong_parameters(p, masses=1.7), seed))


def test_inertias_about_either_point_stay_the_same_leg() -> None:
    for seed in range(10):
        com, joint = random_robot(seed), random_robot(seed, "joint")
        for changes in ({"masses": 3.0}, {"legs": 0.2}, {"masses": 0.7, "legs": 5.0}):
            wrong = [wrong_parameters(p, **changes).leg_inertia_about_com for p in (com, joint)]
            assert wrong[0] == pytest.approx(wrong[1], rel=1e-9)


@given(strategies.parameters(), factors, factors, factors, factors)
def test_any_robot_stays_valid_and_only_masses_change(
    p: RPSParameters, masses: float, platform: float, legs: float, rods: float
) -> None:
    wrong = wrong_parameters(p, masses=masses, platform=platform, legs=legs, rods=rods)
    own = {"platform": platform, "legs": legs, "rods": rods}
    changed = {}
    for part, fields in PARTS.items():
        for field in fields:
            changed[field] = getattr(p, field)
            np.testing.assert_allclose(
                getattr(wrong, field), masses * own[part] * changed[field], rtol=1e-14
            )
    assert wrong.replace(**changed) == p
    back = wrong_parameters(wrong, masses=1 / masses)
    for part, fields in PARTS.items():
        np.testing.assert_allclose(
            getattr(back, fields[0]), own[part] * changed[fields[0]], rtol=1e-14
        )


@given(strategies.parameters(), st.data())
def test_nothing_asked_nothing_changed_and_friction_replaces_the_believed(
    p: RPSParameters, data: st.DataObject
) -> None:
    assert wrong_parameters(p) == p
    asked = {name: data.draw(strategies.floats(1e-3, 10.0)) for name in FRICTION}
    believed = wrong_parameters(p, **dict.fromkeys(FRICTION, 0.5))
    for start in (p, believed):
        wrong = wrong_parameters(start, **asked)
        assert {name: getattr(wrong, name) for name in FRICTION} == asked
        assert wrong.replace(**{name: getattr(p, name) for name in FRICTION}) == p
    assert believed.prismatic_damping == 0.5  # parameters are not changed in place


def test_friction_adds_to_the_forces_what_its_law_says() -> None:
    for seed in range(5):
        p = random_robot(seed)
        wrong = wrong_parameters(p, prismatic_damping=4.0, prismatic_friction=6.0, friction_speed=2)
        motion = strategies.random_motions(np.random.default_rng(seed), p, 20, largest_tilt=0.6)
        speed = RPSRobot(p).motion(*motion)[1].speed
        expected = forces(p, seed) + 4.0 * speed + 6.0 * np.tanh(speed / 2)
        assert_equal_forces(forces(wrong, seed), expected)


@pytest.mark.parametrize("name", ["masses", *PARTS])
@pytest.mark.parametrize("factor", [0.0, -1.0, np.nan, np.inf, "heavy", None])
def test_factors_that_are_not_positive_are_refused(name: str, factor: Any) -> None:
    with pytest.raises(InputError, match=f"^{name} "):
        wrong_parameters(RPSParameters.from_preset("micro"), **{name: factor})


@pytest.mark.parametrize("name", FRICTION)
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf, "oil", True])
def test_friction_that_cannot_be_is_refused(name: str, value: Any) -> None:
    with pytest.raises(ParameterError, match=f"^{name} = "):
        wrong_parameters(RPSParameters.from_preset("micro"), **{name: value})


def test_friction_of_unknown_name_is_refused() -> None:
    with pytest.raises(ParameterError, match="prismatic_dampng"):
        wrong_parameters(RPSParameters.from_preset("micro"), prismatic_dampng=1.0)


@pytest.mark.parametrize("name", ["base_radius", "actuator_force_limit", "rod_mass"])
def test_what_is_no_friction_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=name):
        wrong_parameters(RPSParameters.from_preset("micro"), **{name: 0.5})

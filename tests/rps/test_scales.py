"""Answers about the 3-RPS do not depend on the units: 1e-9 to 1e9 for length, mass and time."""

from __future__ import annotations

import pytest

from rps_pin import RPSParameters
from rps_pin.rps import Payload
from tests.closed_loop.scaled_answers import differences
from tests.quick import quick
from tests.rps.scaled_answers import answers
from tests.scaled import Units

SMALL, LARGE = 2.0**-30, 2.0**30


@pytest.mark.parametrize("preset", quick(RPSParameters.presets(), ["micro"]))
def test_every_call_of_a_robot_with_friction_limits_and_a_payload(preset: str) -> None:
    p = RPSParameters.from_preset(preset)
    weight = 9.81 * (p.platform_mass + 3 * p.leg_mass)
    p = p.replace(
        prismatic_damping=weight,
        prismatic_friction=0.1 * weight,
        revolute_damping=0.01 * weight * p.base_radius,
        actuator_force_limit=5 * weight,
        actuator_speed_limit=p.base_radius,
        rod_mass=0.1 * p.leg_mass,
        rod_com=0.1 * p.base_radius,
        rod_inertia=0.01 * p.leg_inertia,
    )
    h = p.platform_radius
    payload = Payload(0.5 * p.platform_mass, (0.1 * h, 0.0, 0.2 * h))
    right = answers(p, Units(1.0, 1.0, 1.0), payload)
    assert "fastest 0" in right
    assert "check 0" in right
    for units in (
        Units(SMALL, SMALL, SMALL),
        Units(LARGE, LARGE, LARGE),
        Units(SMALL, LARGE, LARGE),
        Units(1e3, 1e3, 1.0),
    ):
        found = differences(right, answers(p, units, payload))
        assert len(found) > 50
        # Conditioning at a level pose is the root of a difference.
        wrong = {
            k: v
            for k, v in found.items()
            if isinstance(v, str) or not v < (1e-8 if k.startswith("workspace") else 1e-10)
        }
        assert wrong == {}, units

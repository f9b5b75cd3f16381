"""Wrong units are doubted, right ones never."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import RPSParameters
from rps_pin.rps.unit_doubts import unit_doubts
from tests import strategies

MICRO = RPSParameters.from_preset("micro")


@pytest.mark.parametrize("preset", RPSParameters.presets())
def test_presets_are_not_doubted(preset: str) -> None:
    assert unit_doubts(RPSParameters.from_preset(preset)) == []


@pytest.mark.parametrize("seed", range(100))
def test_robots_of_any_kind_are_not_doubted(seed: int) -> None:
    assert unit_doubts(strategies.random_parameters(np.random.default_rng(seed))) == []


@pytest.mark.parametrize(
    ("changes", "doubt"),
    [
        ({"base_radius": 120.0}, "base_radius = 120 m; 120 mm would be 0.12"),
        ({"leg_length_limits": (200.0, 250.0)}, "leg_length_limits = 250 m; 250 mm would be 0.25"),
        ({"rod_com": -75.0}, "rod_com = -75 m; -75 mm would be -0.075"),
        (
            {"platform_inertia": np.diag([4320.0, 4320.0, 8640.0])},
            "platform_inertia = 8640 kg m^2 on 1.2 kg is a radius of gyration of 84.9 m; "
            "8640 kg mm^2 would be 0.00864",
        ),
        (
            {"leg_inertia": 656.25},
            "leg_inertia = 656.25 kg m^2 on 0.35 kg is a radius of gyration of 43.3 m; "
            "656.25 kg mm^2 would be 0.00065625",
        ),
    ],
)
def test_wrong_units_are_doubted(changes: dict[str, object], doubt: str) -> None:
    assert unit_doubts(MICRO.replace(**changes)) == [doubt]

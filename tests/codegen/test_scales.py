"""Generated code of mechanisms in other units: it proves itself, and answers as in SI."""

from __future__ import annotations

from pathlib import Path

import pytest

from rps_pin import ClosedLoopModel
from tests.closed_loop.scaled_answers import Inputs, answers, differences
from tests.codegen.engines import QUICK
from tests.scaled import Units, UnitsOf, scaled_mechanism

SMALL, LARGE = 2.0**-30, 2.0**30
#: Of what ends in a minimum, or somewhere on a manifold; and steps, whose projections differ.
ROUGH = ("project", "close", "jump", "simulate")


@pytest.mark.parametrize("name", ["four_bar", "slider_crank"])
def test_every_call_of_the_compiled_engine(name: str) -> None:
    mechanism = ClosedLoopModel.load(Path(__file__).parents[2] / "urdf" / f"{name}.yaml")
    inputs = Inputs(mechanism)
    right = answers(mechanism, inputs, UnitsOf(mechanism, Units(1.0, 1.0, 1.0)))
    for units in (Units(SMALL, SMALL, SMALL), Units(LARGE, SMALL, LARGE)):
        other = scaled_mechanism(mechanism, units)
        compiled = other.compile(compiler=QUICK)
        found = answers(compiled, inputs, UnitsOf(other, units))
        there = {k: v for k, v in right.items() if k in found}
        assert len(there) > 40
        wrong = {
            k: v
            for k, v in differences(there, found).items()
            if isinstance(v, str) or not v < (1e-5 if k.startswith(ROUGH) else 1e-9)
        }
        assert wrong == {}, units

"""Operations of generated code over the number of loops: chains of four-bars."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.bench_chains import chain
from rps_pin import ClosedLoopModel
from rps_pin.codegen.engine.generated import GeneratedCode
from tests.worst import worst

SHORT, LONG = 4, 16
#: In proportion to the number of loops.
LINEAR = (
    "gaps",
    "velocity",
    "inverse_dynamics",
    "forward_dynamics",
    "generalised_force",
    "closing_step",
    "projection",
    "stage",
    "inverse_dynamics_derivatives",
)


def operations(loops: int, kind: str, names: tuple[str, ...]) -> np.ndarray:
    rough = chain(loops, kind)
    angles = {"crank": -1.0, "rocker": -1.0, "coupler": 1.0}
    home = [angles[name.split("_")[0]] for name in list(rough.model.names)[1:]]
    mechanism = ClosedLoopModel(rough.model, rough.closures, rough.actuated, home=home)
    functions = GeneratedCode(mechanism).functions
    return np.array([functions[name].n_instructions() for name in names])


@pytest.mark.parametrize("kind", ["point_on_line", "spherical"])
def test_operations_grow_with_the_number_of_loops(kind: str) -> None:
    """Exponents of at most 1.05; with rows that are redundant and without."""
    few, many = (operations(loops, kind, LINEAR) for loops in (SHORT, LONG))
    exponents = dict(zip(LINEAR, np.log(many / few) / np.log(LONG / SHORT), strict=True))
    assert worst(list(exponents.values())) <= 1.05, exponents
    assert min(exponents.values()) >= 0.9, exponents


def test_derivatives_of_accelerations_grow_with_their_number() -> None:
    """They are nv nv numbers, none of them zero."""
    names = ("forward_dynamics_derivatives",)
    few, many = (operations(loops, "spherical", names)[0] for loops in (2, 8))
    velocities = [2 * loops + 1 for loops in (2, 8)]
    assert np.log(many / few) <= 2.05 * np.log(velocities[1] / velocities[0])

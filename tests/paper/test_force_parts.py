"""Forces put together from their causes are those of the robot itself, by three ways."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rps_pin import RPSParameters, RPSRobot
from rps_pin.paper.comparison import dense_times
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.force_parts import ForceParts, UnitRobot, combined, force_parts
from rps_pin.paper.interpretations import BODIES, BodyInterpretation, body_interpretations
from rps_pin.paper.lagrange import lagrange_forces
from rps_pin.paper.page import closest_interpretation
from rps_pin.paper.paper_helix import PaperHelix
from rps_pin.trajectories.path import PathSample


def robot_of(interpretation: BodyInterpretation) -> RPSParameters:
    bodies = BODIES[interpretation.bodies]
    changes: dict[str, Any] = {}
    if interpretation.gravity == "no gravity":
        changes["gravity"] = np.zeros(3)
    return RPSParameters.from_preset("sokolov").replace(
        platform_mass=bodies.platform_mass,
        leg_mass=bodies.leg_mass,
        leg_inertia_about=bodies.about,
        **changes,
    )


@pytest.fixture(scope="module")
def parts_and_motion() -> tuple[ForceParts, PathSample]:
    path = PaperHelix(0.23, 0.075, 0.05, 0.4, branch="-")
    motion = path.sample(np.linspace(0, path.duration, 101))
    return force_parts(UnitRobot(0.46, 0.23), motion), motion


@pytest.mark.parametrize("interpretation", body_interpretations(), ids=str)
def test_combined_forces_are_lagrange_s(
    interpretation: BodyInterpretation, parts_and_motion: tuple[ForceParts, PathSample]
) -> None:
    parts, motion = parts_and_motion
    printed = ["eq_14"] * (interpretation.eq_14 == "R I R")
    printed += ["eq_19"] * (interpretation.gravity == "Eq. 19 as printed")
    direct = lagrange_forces(robot_of(interpretation), *motion, as_printed=printed).force
    found = combined(parts, interpretation)
    assert_allclose(found, direct, rtol=0, atol=1e-10 * np.abs(direct).max())


def test_the_closest_interpretation_by_the_constraint_models(found: Reproduction) -> None:
    """Constrained RNEA on Pinocchio's models knows nothing of Lagrange's equations."""
    row = closest_interpretation(found)
    assert row.body == ("masses of a disc and rods", "gravity", "R I R'")
    robot = RPSRobot(robot_of(row.body))
    path = row.path.path()
    result = next(one for one in found.paths if one.interpretation == row.path)
    times = dense_times(path.duration, float(result.times[np.argmax(np.abs(result.times))]), 400)
    times = np.union1d(times, result.times[::3])
    states = robot.state(*path.sample(times))
    force = np.array([robot.inverse_dynamics(*one).tau for one in zip(*states, strict=True)])
    least, greatest = force.min(axis=0), force.max(axis=0)
    assert_allclose([*least, *greatest], row.forces.numbers(), atol=0.01 * np.abs(force).max())
    order, sign = row.labels
    assert sign == 1
    ours = combined(result.parts, row.body)  # type: ignore[arg-type]
    same = robot.state(*path.sample(result.times[::50]))
    tau = np.array([robot.inverse_dynamics(*one).tau for one in zip(*same, strict=True)])
    assert_allclose(tau, ours[::50], rtol=0, atol=1e-9 * np.abs(ours).max())
    assert_allclose(row.relabelled.least, ours.min(axis=0)[list(order)], rtol=1e-12)

"""Forces near singularities: the slope, and probes against other computations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rps_pin import RPSRobot
from rps_pin.paper.comparison import distance
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.near_singularity import RATES, height_probes, table_1_helix
from rps_pin.paper.virtual_work import virtual_work_forces


def test_forces_grow_as_one_over_the_distance(found: Reproduction) -> None:
    one = found.approach
    assert one.slope == pytest.approx(-1, abs=1e-3)
    # Two points a hundredfold apart, without a fit
    near, far = np.argmin(np.abs(one.distance - 1e-6)), np.argmin(np.abs(one.distance - 1e-4))
    slope = math.log(one.force[near] / one.force[far]) / math.log(
        one.distance[near] / one.distance[far]
    )
    assert slope == pytest.approx(-1, abs=0.01)


def test_those_forces_are_virtual_work_s(found: Reproduction) -> None:
    """Where the distance leaves digits to compare."""
    one = found.approach
    robot, path = RPSRobot.from_preset("sokolov"), table_1_helix(0.4e-3)
    far = one.distance > 1e-4
    motion = path.sample(one.crossing - one.before[far])
    force = virtual_work_forces(robot.parameters, *motion, max_gain=1e12)
    assert_allclose(np.abs(force).max(axis=-1), one.force[far], rtol=1e-6)


def test_static_forces_turn_over_at_the_crossing(found: Reproduction) -> None:
    """On either side of it, holding forces have opposite signs and about the same size."""
    robot, path = RPSRobot.from_preset("sokolov"), table_1_helix(0.4e-3)
    still = np.zeros(3)
    before, after = (
        virtual_work_forces(
            robot.parameters, path.sample(found.approach.crossing + s).pose, still, still,
            max_gain=1e12,
        )
        for s in (-1e-6, 1e-6)
    )  # fmt: skip
    assert np.abs(before).max() > 1e4
    assert_allclose(before, -after, atol=0.01 * np.abs(before).max())


def test_probes_that_do_not_cross_by_the_constraint_models() -> None:
    heights = {"+": (0.36, 0.386, 0.39), "-": (0.40, 0.41)}
    probes = height_probes(heights)  # type: ignore[arg-type]
    assert [bool(probe.crossings) for probe in probes] == [False, False, True, False, True]
    robot = RPSRobot.from_preset("sokolov")
    for probe in probes:
        if probe.forces is None:
            assert math.isnan(probe.distance)
            continue
        path = table_1_helix(probe.height, 0.1, probe.branch)
        force = robot.actuator_forces(*path.sample(np.linspace(0, path.duration, 3000)))
        found = [*force.min(axis=0), *force.max(axis=0)]
        assert_allclose(probe.forces.numbers(), found, atol=0.02 * np.abs(force).max())
        assert probe.distance == distance(probe.forces)


def test_nearer_is_harder(found: Reproduction) -> None:
    for branch in "+-":
        kept = [p for p in found.probes if p.branch == branch and p.forces is not None]
        kept.sort(key=lambda probe: probe.nearest)
        peaks = [np.abs(probe.forces.numbers()).max() for probe in kept if probe.forces]
        assert len(peaks) >= 2
        assert (np.diff(peaks) < 0).all()


def test_what_is_sampled_across_a_crossing_is_no_number(found: Reproduction) -> None:
    names = {row.path for row in found.sampled}
    assert len(found.sampled) == len(names) * len(RATES)
    for name in names:
        rows = [row for row in found.sampled if row.path == name]
        assert all(row.crossings >= 2 for row in rows)
        peaks = [np.abs(row.forces.numbers()).max() for row in rows]
        assert max(peaks) > 2 * min(peaks)

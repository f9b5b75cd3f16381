"""The paper's formulas, and how many solutions Eq. 8 has."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from rps_pin import RPSRobot
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.formula_checks import degree_of_eq_8, eq_8
from tests.worst import worst


def test_every_check_holds(found: Reproduction) -> None:
    exact = {1, 2, 3, 4, 6, 7, 8, "8 closed", 13, 20, 21, 26, 27, 28}
    differences = {15, 17, 18}
    assert set(found.checks) == exact | differences
    assert worst([found.checks[name] for name in exact]) < 1e-12
    assert worst([found.checks[name] for name in differences]) < 1e-7


def test_equation_8_is_the_distance_between_tips() -> None:
    """From Eq. 7, by vectors: |q_i - q_j|^2 - 3 h^2, closed or not."""
    rng = np.random.default_rng(3)
    g, h = 0.46, 0.23
    d, phi = rng.uniform(0.2, 0.7, (50, 3)), rng.uniform(-3, 3, (50, 3))
    turn = np.deg2rad([0.0, 120.0, -120.0])
    rho = g - d * np.cos(phi)
    tip = np.stack([rho * np.cos(turn), rho * np.sin(turn), d * np.sin(phi)], axis=-1)
    expected = [
        ((tip[:, i] - tip[:, j]) ** 2).sum(-1) - 3 * h**2 for i, j in ((0, 1), (1, 2), (2, 0))
    ]
    assert_allclose(eq_8(d, phi, g, h), np.stack(expected, axis=-1), atol=1e-14)


def test_sixteen_solutions_in_mirrored_pairs() -> None:
    assert degree_of_eq_8() == 8


def test_counts_of_real_solutions(found: Reproduction) -> None:
    assert sum(found.counts.values()) == 200
    assert all(count % 2 == 0 and 0 <= count <= 16 for count in found.counts)
    assert max(found.counts) > 8  # more than the paper's eight


def test_equal_legs_have_eight_by_the_paper_s_own_equation(found: Reproduction) -> None:
    assert len(found.modes.angle) == 8
    assert int(found.modes.above.sum()) == 4
    lengths = np.full((8, 3), 0.225)
    assert np.abs(eq_8(lengths, found.modes.angle, 0.12, 0.12)).max() < 1e-15
    table_1 = RPSRobot.from_preset("sokolov").assembly_modes([0.46] * 3)
    assert list(table_1.above) == [True] * 4 + [False] * 4

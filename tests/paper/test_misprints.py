"""Every misprint: what the printed formula misses, found in another way than the page's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from rps_pin import RPSParameters, RPSRobot
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.lagrange import lagrange_forces
from rps_pin.paper.misprints import Misprint, formula_misprints

ROOT = math.sqrt(1 + 9 * math.pi**2)


@pytest.fixture(scope="module")
def misprints() -> dict[int, Misprint]:
    return formula_misprints()


def test_all_are_confirmed(misprints: dict[int, Misprint]) -> None:
    assert list(misprints) == [5, 11, 12, 14, 16, 19, 29]
    assert all(one.confirmed for one in misprints.values())


def test_what_is_right_as_printed_would_not_be_confirmed() -> None:
    assert not Misprint(1e-15, 1e-15).confirmed
    assert not Misprint(1.0, 0.1).confirmed
    assert not Misprint(1.0, math.nan).confirmed


def test_equation_5_corrected_is_the_project_s_placement() -> None:
    robot = RPSRobot.from_preset("sokolov")
    rng = np.random.default_rng(1)
    alpha, beta = rng.uniform(-3, 3, 100), rng.uniform(0.1, 3, 100)
    tilt = beta[:, None] * np.stack([-np.sin(alpha), np.cos(alpha)], axis=1)
    position, turn = robot.platform_placement(np.column_stack([np.full(100, 0.5), tilt]))
    zyz = np.stack([alpha, beta, -alpha], axis=1)
    assert_allclose(turn, Rotation.from_euler("ZYZ", zyz).as_matrix(), atol=1e-13)
    half = 0.23 / 2 * (1 - np.cos(beta))
    assert_allclose(position[:, 0], -half * np.cos(2 * alpha), atol=1e-14)
    assert_allclose(position[:, 1], half * np.sin(2 * alpha), atol=1e-14)
    printed = np.stack([-half * np.sin(2 * alpha), half * np.cos(2 * alpha)], axis=1)
    assert np.abs(position[:, :2] - printed).max() > 0.2


def test_equation_12_with_either_sign_gives_the_same_forces() -> None:
    """lambda and -lambda: solve Eq. 22 with the constraint forces' sign turned."""
    p = RPSParameters.from_preset("sokolov")
    found = lagrange_forces(p, [0.5, 0.2, -0.1], [0.1, 0.3, 0.2], [1.0, 2.0, -1.0])
    A = found.constraint_jacobian
    turned = -found.multipliers
    # F = effort - A_d' lambda = effort + A_d' (-lambda): the force does not know the convention
    effort = found.force + A[:, :3].T @ found.multipliers
    assert_allclose(effort + A[:, :3].T @ turned, found.force, rtol=1e-12)


def test_equation_14_as_printed_is_not_even_symmetric() -> None:
    turn = Rotation.from_rotvec([0.3, -0.4, 0.0]).as_matrix()
    local = np.diag([0.093, 0.093, 0.187])
    printed = turn @ local @ turn
    assert np.abs(printed - printed.T).max() > 1e-3
    right = turn @ local @ turn.T
    assert_allclose(np.linalg.eigvalsh(right), [0.093, 0.093, 0.187], rtol=1e-12)


def test_equation_16_counts_m_r_squared_twice(misprints: dict[int, Misprint]) -> None:
    # (m r^2 + I) / I - 1 with Table 1's numbers
    assert misprints[16].error_printed == pytest.approx(0.09 * 0.2**2 / 0.05)
    printed = RPSParameters.from_preset("sokolov").replace(leg_inertia_about="com")
    assert printed.leg_inertia_about == "com"


def test_equation_19_weighs_one_kilogram(misprints: dict[int, Misprint]) -> None:
    assert misprints[19].error_printed == pytest.approx(1 / 0.18 - 1)


def test_equation_29_s_jump(misprints: dict[int, Misprint]) -> None:
    t = ROOT / 2
    middle = math.pi * (4 * t - 1) / ROOT
    last = math.pi * (-2 - 9 * math.pi**2 + 4 * (1 + ROOT) * t**2 - 4 * t**2) / ROOT
    assert misprints[29].error_printed == pytest.approx(abs(last - middle))


def test_helix_law_and_power_balance(found: Reproduction) -> None:
    law = found.law
    assert law.end == pytest.approx((1 + ROOT) / 2, abs=1e-10)
    assert law.turn_at_end == pytest.approx(2 * math.pi, abs=1e-9)
    # |(r phi', p/2pi phi')| at phi' = 4 pi / root
    assert law.greatest_speed == pytest.approx(
        math.hypot(0.75, 0.25 / math.pi) * 4 * math.pi / ROOT
    )
    assert law.ramp == pytest.approx(2.0, abs=1e-5)
    balance = dict(found.balances)
    assert balance.pop("Eq. 13 to 21 corrected") < 1e-6
    assert len(balance) == 3
    assert min(balance.values()) > 1e-3

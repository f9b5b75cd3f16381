"""The helix, corrected and as printed, against the paper's formulas and derivatives."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from rps_pin import RPSRobot, helix
from rps_pin.errors import InputError
from rps_pin.paper.paper_helix import (
    PaperHelix,
    PartOfPath,
    corrected_turn,
    printed_turn,
    smooth_parts,
)

ROOT = math.sqrt(1 + 9 * math.pi**2)
END = (1 + ROOT) / 2


@pytest.mark.parametrize("branch", ["+", "-"])
def test_corrected_it_is_the_project_s_helix(branch: Literal["+", "-"]) -> None:
    robot = RPSRobot.from_preset("sokolov")
    theirs = helix(robot, radius=0.03, pitch=0.02, height=0.5, branch=branch)
    mine = PaperHelix(0.23, 0.03, 0.02, 0.5, branch=branch)
    times = np.linspace(0, END, 301)
    for one, other in zip(mine.sample(times), theirs.sample(times), strict=True):
        assert_allclose(one, other, rtol=0, atol=1e-12)


@pytest.mark.parametrize("eq_5", ["corrected", "printed"])
@pytest.mark.parametrize("eq_29", ["corrected", "printed"])
def test_rates_and_accelerations_are_derivatives(
    eq_5: Literal["corrected", "printed"], eq_29: Literal["corrected", "printed"]
) -> None:
    path = PaperHelix(0.23, 0.05, 0.02, 0.5, eq_5=eq_5, eq_29=eq_29)
    step = 1e-6
    times = np.array([0.1, 0.3, 1.7, 3.3, 4.9, 5.1])
    after, before = path.sample(times + step), path.sample(times - step)
    _, rate, acceleration = path.sample(times)
    scale = np.abs(acceleration).max()
    assert_allclose((after.pose - before.pose) / (2 * step), rate, atol=1e-6 * scale)
    assert_allclose((after.rate - before.rate) / (2 * step), acceleration, atol=1e-5 * scale)


def test_equation_5_as_printed_is_inverted_by_its_path() -> None:
    """The pose of the path, put into the printed Eq. 5, gives the helix's centre."""
    h, radius = 0.23, 0.05
    path = PaperHelix(h, radius, 0.02, 0.5, eq_5="printed")
    times = np.linspace(0, END, 50)
    tilt = path.sample(times).pose[:, 1:]
    beta = np.linalg.norm(tilt, axis=1)
    alpha = np.arctan2(-tilt[:, 0], tilt[:, 1])
    phi = corrected_turn(times)[0]
    assert_allclose(
        -h / 2 * (1 - np.cos(beta)) * np.sin(2 * alpha), radius * np.cos(phi), atol=1e-15
    )
    assert_allclose(
        h / 2 * (1 - np.cos(beta)) * np.cos(2 * alpha), radius * np.sin(phi), atol=1e-15
    )


def test_the_corrected_path_s_centre_is_on_the_helix() -> None:
    """By rotations of SciPy and Eq. 4."""
    h, radius = 0.23, 0.05
    times = np.linspace(0, END, 50)
    pose = PaperHelix(h, radius, 0.02, 0.5, branch="-").sample(times).pose
    turn = Rotation.from_rotvec(np.column_stack([pose[:, 1:], np.zeros(50)])).as_matrix()
    phi = corrected_turn(times)[0]
    assert_allclose(h / 2 * (turn[:, 0, 0] - turn[:, 1, 1]), radius * np.cos(phi), atol=1e-14)
    assert_allclose(-h * turn[:, 1, 0], radius * np.sin(phi), atol=1e-14)
    assert_allclose(pose[:, 0], 0.5 + 0.02 * phi / (2 * math.pi), atol=1e-15)


def test_equation_29_as_the_paper_prints_it() -> None:
    for t, phi in (
        (0.3, 4 * math.pi * 0.3**2 / ROOT),
        (2.0, math.pi * (4 * 2.0 - 1) / ROOT),
        (5.0, math.pi * (-2 - 9 * math.pi**2 + 4 * (1 + ROOT) * 5.0**2 - 4 * 5.0**2) / ROOT),
    ):
        assert math.isclose(float(printed_turn(t)[0]), phi, rel_tol=1e-14)
    last = math.pi * (-2 - 9 * math.pi**2 + 4 * (1 + ROOT) * 5.0 - 4 * 5.0**2) / ROOT
    assert math.isclose(float(corrected_turn(5.0)[0]), last, rel_tol=1e-13)
    assert math.isclose(float(corrected_turn(END)[0]), 2 * math.pi, rel_tol=1e-13)
    assert abs(float(corrected_turn(END)[1])) < 1e-12


def test_a_path_is_smooth_but_where_the_printed_one_jumps() -> None:
    (whole,) = smooth_parts(PaperHelix(0.23, 0.05, 0.02, 0.5))
    assert (whole.start, whole.duration) == (0.0, pytest.approx(END))
    first, second = smooth_parts(PaperHelix(0.23, 0.05, 0.02, 0.5, eq_29="printed"))
    assert first.duration + second.duration == pytest.approx(END)
    end, start = first.sample(first.duration).pose, second.sample(0.0).pose
    assert abs(end - start).max() > 0.1


def test_a_part_is_the_whole_later() -> None:
    whole = PaperHelix(0.23, 0.05, 0.02, 0.5)
    part = PartOfPath(whole, 1.0, 3.0)
    times = np.linspace(0, part.duration, 7)
    assert_allclose(part.sample(times).pose, whole.sample(times + 1.0).pose, rtol=1e-15)
    with pytest.raises(InputError):
        part.sample(2.1)


def test_a_helix_wider_than_the_platform_is_refused() -> None:
    with pytest.raises(InputError, match=r"r_h = 0\.75 m exceeds h = 0\.23 m"):
        PaperHelix(0.23, 0.75, 0.5, 0.4)

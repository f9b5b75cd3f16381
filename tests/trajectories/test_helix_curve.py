"""The helix without a time: Eq. 26 to 28 over phi, and the law that runs along it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rps_pin import InputError, RPSRobot, helix
from rps_pin.trajectories import HelixCurve, HelixPath
from tests.trajectories.differences import difference

PHI = np.linspace(0, 2 * np.pi, 200)
INNER = PHI[5:-5]


def path(branch: str) -> HelixPath:
    robot = RPSRobot.from_preset("sokolov")
    return helix(robot, radius=0.05, pitch=0.03, height=0.4, branch=branch)  # type: ignore[arg-type]


@pytest.mark.parametrize("branch", ["+", "-"])
def test_the_centre_follows_equations_26_to_28(branch: str) -> None:
    """p = (r cos(phi), r sin(phi), z_0 + p_h phi / 2 pi), through the robot's own kinematics."""
    curve = path(branch).curve
    assert curve.length == 2 * np.pi
    centre, _ = RPSRobot.from_preset("sokolov").platform_placement(curve.at(PHI).pose)
    expected = [0.05 * np.cos(PHI), 0.05 * np.sin(PHI), 0.4 + 0.03 * PHI / (2 * np.pi)]
    np.testing.assert_allclose(centre, np.transpose(expected), rtol=0, atol=1e-15)


@pytest.mark.parametrize("branch", ["+", "-"])
def test_first_and_second_are_derivatives_by_phi(branch: str) -> None:
    curve = path(branch).curve
    found = curve.at(INNER)
    first = difference(lambda x: curve.at(x).pose, INNER, 0.02)
    second = difference(lambda x: curve.at(x).first, INNER, 0.02)
    np.testing.assert_allclose(found.first, first, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.second, second, rtol=0, atol=1e-13)


@pytest.mark.parametrize("branch", ["+", "-"])
def test_the_path_runs_along_the_curve_by_its_turn(branch: str) -> None:
    one = path(branch)
    t = np.linspace(0, one.duration, 100)
    phi, dphi, ddphi = one.turn(t)
    pose, first, second = one.curve.at(phi)
    found = one.sample(t)
    np.testing.assert_allclose(found.pose, pose, rtol=1e-15)
    np.testing.assert_allclose(found.rate, first * dphi[:, None], rtol=1e-14)
    expected = first * ddphi[:, None] + second * dphi[:, None] ** 2
    np.testing.assert_allclose(found.acceleration, expected, rtol=1e-14, atol=1e-16)


@pytest.mark.parametrize("shape", [(), (1,), (2, 3), (0,)])
def test_values_have_the_shape_of_the_parameters(shape: tuple[int, ...]) -> None:
    found = HelixCurve(0.2, 0.03, 0.4).at(np.ones(shape))
    assert [x.shape for x in found] == [(*shape, 3)] * 3


@pytest.mark.parametrize("bad", [-1e-3, 6.3, np.nan])
def test_parameters_outside_are_refused(bad: float) -> None:
    with pytest.raises(InputError, match=r"u = .* outside the curve, which runs from 0 to 6.28"):
        HelixCurve(0.2, 0.03, 0.4).at(bad)


@pytest.mark.parametrize("name", ["tilt", "pitch", "height"])
@pytest.mark.parametrize(
    "bad", [np.nan, np.inf, "wide", None, True, pytest.param(10**400, id="huge")]
)
def test_numbers_that_are_none_are_refused(name: str, bad: Any) -> None:
    arguments: dict[str, Any] = {"tilt": 0.2, "pitch": 0.03, "height": 0.4} | {name: bad}
    with pytest.raises(InputError, match=f"{name} = "):
        HelixCurve(**arguments)


def test_repr_tells_what_it_is() -> None:
    assert repr(HelixCurve(0.2, 0.03, 0.4)) == "HelixCurve(tilt=0.2, pitch=0.03, height=0.4)"

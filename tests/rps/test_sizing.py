"""The sizing sheet: motions whose forces are known, and quadrature."""

from __future__ import annotations

import json
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad

from rps_pin import InputError, RPSParameters, RPSRobot, SingularityError, UnreachableError, helix
from rps_pin.rps.dynamics.sizing import (
    positive_area,
    size_actuators,
    size_motion,
    size_trajectory,
    time_above,
)
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits, SizingSheet
from rps_pin.trajectories.path import PathSample

Array = NDArray[np.float64]

MASS, G = 3.0, 9.81


class Lift(NamedTuple):
    """Up and down: z = middle + swing sin(rate t), level."""

    middle: float
    swing: float
    rate: float
    duration: float

    def sample(self, t: ArrayLike) -> PathSample:
        angle = self.rate * np.asarray(t)
        height = (
            self.middle + self.swing * np.sin(angle),
            self.swing * self.rate * np.cos(angle),
            -self.swing * self.rate**2 * np.sin(angle),
        )
        zero = np.zeros_like(angle)
        return PathSample(*(np.stack([z, zero, zero], axis=-1) for z in height))


def upright(**changes: object) -> RPSRobot:
    """h = g and massless legs: level, each actuator bears a third of m (z'' + g), at speed z'."""
    return RPSRobot(
        RPSParameters(
            base_radius=0.2,
            platform_radius=0.2,
            platform_mass=MASS,
            platform_inertia=np.diag([0.02, 0.02, 0.04]),
            leg_mass=0.0,
            leg_com=0.0,
            leg_inertia=0.0,
            **changes,
        )
    )


def test_holding_still() -> None:
    sheet = size_trajectory(upright(), Lift(0.3, 0.0, 1.0, 2.0), 100.0)
    for actuator in sheet.actuators:
        assert actuator.force_peak == pytest.approx(MASS * G / 3, rel=1e-14)
        assert actuator.force_rms == pytest.approx(MASS * G / 3, rel=1e-14)
        assert actuator.force_min == pytest.approx(actuator.force_max, rel=1e-14)
        assert actuator.duty == pytest.approx(1.0)
        assert actuator.stroke == pytest.approx(0.0, abs=1e-15)
        for name in ("speed_peak", "power_peak", "power_mean", "energy_driven"):
            assert getattr(actuator, name) == pytest.approx(0.0, abs=1e-14)


def test_up_and_down() -> None:
    """One period: F = m/3 (g - A w^2 sin(w t)), d' = A w cos(w t); every figure in closed form."""
    swing, w = 0.05, 12.0
    period = 2 * np.pi / w
    sheet = size_trajectory(upright(), Lift(0.3, swing, w, period), 4000.0 / period)
    push = swing * w**2

    def power(t: float) -> float:
        return MASS / 3 * (G - push * np.sin(w * t)) * swing * w * np.cos(w * t)

    # F d' is positive for cos > 0 (g > A w^2): from -1/4 to 1/4 of a period, half of the time.
    assert push < G
    driven = MASS / 3 * G * 2 * swing  # the part with sin(w t) is even in cos: no net work
    peaks = [abs(power(t)) for t in np.linspace(0, period, 100_001)]
    for actuator in sheet.actuators:
        assert actuator.force_peak == pytest.approx(MASS / 3 * (G + push), rel=1e-6)
        assert actuator.force_peak_time == pytest.approx(0.75 * period, abs=period / 1000)
        assert actuator.force_min == pytest.approx(MASS / 3 * (G - push), rel=1e-4)
        rms = MASS / 3 * np.sqrt(G**2 + push**2 / 2)
        assert actuator.force_rms == pytest.approx(rms, rel=1e-6)
        assert actuator.speed_peak == pytest.approx(swing * w, rel=1e-12)
        assert actuator.power_peak == pytest.approx(max(peaks), rel=1e-6)
        assert actuator.energy_driven == pytest.approx(driven, rel=1e-5)
        assert actuator.energy_regenerated == pytest.approx(driven, rel=1e-5)
        assert actuator.power_mean == pytest.approx(2 * driven / period, rel=1e-5)
        assert actuator.stroke == pytest.approx(2 * swing, rel=1e-6)
        # Above half the peak: g - A w^2 sin > (g + A w^2)/2, that is sin < (g/(A w^2) - 1)/2.
        above = 0.5 + np.arcsin((G / push - 1) / 2) / np.pi
        assert actuator.duty == pytest.approx(above, abs=1e-6)


def test_figures_are_those_of_quadrature() -> None:
    """On the helix with its jumps of acceleration, SciPy's adaptive quadrature piece by piece."""
    robot = RPSRobot.from_preset("sokolov")
    path = helix(robot, radius=20e-3, pitch=50e-3, height=0.4, duration=1.0)
    sheet = size_trajectory(robot, path, 20_000.0)
    pieces = [0.0, path.ramp, path.duration - path.ramp, path.duration]

    @cache
    def at(t: float, leg: int) -> tuple[float, float]:
        motion = path.sample(t)
        speed = robot.motion(*motion)[1].speed[leg]
        return float(robot.actuator_forces(*motion)[leg]), float(speed)

    def integral(function: object) -> float:
        return sum(
            quad(function, a + 1e-12, b - 1e-12, limit=30, epsabs=1e-7)[0]
            for a, b in pairwise(pieces)
        )

    actuator = sheet.actuators[0]
    square = integral(lambda t: at(t, 0)[0] ** 2)
    assert actuator.force_rms == pytest.approx(np.sqrt(square / path.duration), rel=1e-4)
    driven = integral(lambda t: max(np.prod(at(t, 0)), 0.0))
    returned = integral(lambda t: max(-np.prod(at(t, 0)), 0.0))
    assert actuator.energy_driven == pytest.approx(driven, rel=1e-3)
    assert actuator.energy_regenerated == pytest.approx(returned, rel=1e-3)


def test_linear_pieces_are_exact() -> None:
    time, values = np.array([0.0, 1.0, 3.0, 4.0]), np.array([-1.0, 1.0, -3.0, -1.0])
    assert positive_area(values, time) == pytest.approx(0.25 + 0.25)
    assert positive_area(-values, time) == pytest.approx(0.25 + 2.25 + 2.0)
    assert time_above(values, 0.0, time) == pytest.approx(0.5 + 0.5)
    assert time_above(np.zeros(4), 0.0, time) == 0.0
    assert positive_area(np.array([0.0, 2.0]), np.array([0.0, 1.0])) == pytest.approx(1.0)


def limited(power: float = np.inf) -> SizingSheet:
    robot = upright(
        actuator_force_limit=12.0, actuator_speed_limit=0.5, leg_length_limits=(0.2, 0.34)
    )
    limits = ActuatorLimits.of(robot.parameters, power=power)
    return size_trajectory(robot, Lift(0.27, 0.06, 10.0, 2.0), limits=limits)


def test_margins_are_what_is_left_to_the_limits() -> None:
    sheet = limited()
    margins = {margin.quantity: margin for margin in sheet.actuators[0].margins}
    assert margins["force"].margin == pytest.approx(12 - (9.81 + 6.0), rel=1e-4)
    assert not margins["force"].kept
    assert margins["speed"].margin == pytest.approx(0.5 - 0.6)
    assert margins["power"].margin == np.inf
    assert margins["shortest leg"].margin == pytest.approx(0.01, rel=1e-3)
    assert margins["longest leg"].margin == pytest.approx(0.01, rel=1e-3)
    assert not sheet.kept
    free = size_trajectory(upright(), Lift(0.27, 0.06, 10.0, 2.0))
    assert free.kept


def test_the_sheet_is_data_and_text() -> None:
    sheet = limited(power=100.0)
    data = json.loads(json.dumps(sheet.as_dict(), allow_nan=False))
    assert data["actuators"][1]["actuator"] == 2
    assert data["actuators"][1]["force_peak"] == sheet.actuators[1].force_peak
    assert data["kept"] is False
    assert data["actuators"][0]["margins"][2]["limit"] == 100.0
    assert limited().as_dict()["actuators"][0]["margins"][2]["limit"] is None
    text = str(sheet)
    for words in ("peak force (N)", "energy regenerated (J)", "actuator 3", "BROKEN", "margin to"):
        assert words in text
    assert f"{sheet.actuators[0].force_rms:.4g}" in text
    assert "power: margin" not in str(limited())


def test_payload_wrench_and_sampled_motions() -> None:
    time = np.linspace(0, 1, 11)
    motion = Lift(0.3, 0.0, 1.0, 1.0).sample(time)
    pushed = size_motion(upright(), time, *motion, wrench=[0, 0, -30, 0, 0, 0])
    assert pushed.actuators[2].force_peak == pytest.approx(MASS * G / 3 + 10)
    assert pushed.limits == ActuatorLimits()


def test_trouble_on_the_way_says_when() -> None:
    with pytest.raises(UnreachableError, match=r"at t = 0\.\d+ s of 1 s .*leg 1: length"):
        size_trajectory(upright(leg_length_limits=(0.2, 0.31)), Lift(0.3, 0.05, 5.0, 1.0))
    robot = RPSRobot.from_preset("sokolov")
    through = helix(robot, radius=75e-3, pitch=50e-3, height=0.4)
    with pytest.raises(SingularityError, match=r"at t = 4\.0752\d* s .* crosses a type II"):
        size_trajectory(robot, through)
    flat = np.zeros((3, 3))
    flat[:, 0] = [0.2, 0.0, -0.2]
    with pytest.raises(SingularityError, match=r"at t = 1 s the motion meets a singularity"):
        size_motion(robot, [0, 1, 2], flat, np.zeros(3), np.zeros(3))


def test_bad_input_is_refused() -> None:
    ones = np.ones((3, 3))
    limits = ActuatorLimits()
    with pytest.raises(InputError, match="times must increase: 1 s, then 1 s"):
        size_actuators([0, 1, 1], ones, ones, ones, limits)
    with pytest.raises(InputError, match=r"time has shape \(1,\)"):
        size_actuators([0], ones[:1], ones[:1], ones[:1], limits)
    with pytest.raises(InputError, match=r"speed has shape \(2, 3\)"):
        size_actuators([0, 1, 2], ones, ones[:2], ones, limits)
    with pytest.raises(InputError, match="threshold = 1"):
        size_actuators([0, 1, 2], ones, ones, ones, limits, 1.0)
    with pytest.raises(InputError, match="pose has shape"):
        size_motion(upright(), [0, 1], ones, ones, ones)
    for bad in ({"force": 0.0}, {"speed": np.nan}, {"length": (0.3, 0.2)}):
        with pytest.raises(InputError, match="limit"):
            ActuatorLimits(**bad)

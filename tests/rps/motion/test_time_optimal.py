"""The shortest time along a curve: against bang-bang motions integrated otherwise, and laws of it.

Limits are checked through the constraint models as well as the closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from rps_pin import RPSParameters, RPSRobot, helix
from rps_pin.errors import InputError, RPSPinError
from rps_pin.rps import ActuatorLimits, Payload, leg_jacobians
from rps_pin.rps.motion import time_search as search
from rps_pin.rps.motion.limited_motion import LimitedMotion
from rps_pin.rps.motion.time_optimal import KEPT, time_optimal
from rps_pin.trajectories.curve import Curve, CurveSample, TimedCurve
from rps_pin.trajectories.path import PathSample
from rps_pin.trajectories.point_to_point import LineCurve
from rps_pin.trajectories.spline import ChordSpline
from rps_pin.trajectories.tilt_figures import circle, lissajous
from tests.quick import quick

Array = NDArray[np.float64]

MICRO = RPSRobot.from_preset("micro")
SOKOLOV = RPSRobot.from_preset("sokolov")
#: Nothing but a platform of 1.2 kg, weightless, on upright legs: 0.4 kg for each.
FLOATING = RPSRobot(
    MICRO.parameters.replace(
        leg_mass=0.0, leg_inertia=0.0, rod_mass=0.0, rod_inertia=0.0, gravity=[0.0, 0.0, 0.0]
    )
)
LIFT = LineCurve([0.21, 0, 0], [0.24, 0, 0])


def assert_shortest(found: float, expected: float) -> None:
    """Not shorter than the shortest time, and longer by a ten thousandth at most.

    A thousandth is what is promised.
    """
    assert expected * (1 - 1e-6) <= found <= expected * (1 + 1e-4)


# Formulas and other integrators -------------------------------------------------------------------


@pytest.mark.parametrize("force", [1.0, 50.0, 3000.0])
def test_a_free_mass_is_pushed_and_braked(force: float) -> None:
    found = time_optimal(FLOATING, LIFT, limits=ActuatorLimits(force))
    expected = 2 * math.sqrt(0.03 / (force / 0.4))
    assert_shortest(found.duration, expected)


@pytest.mark.parametrize("speed", [0.05, 0.5])
def test_a_free_mass_up_to_a_speed(speed: float) -> None:
    found = time_optimal(FLOATING, LIFT, limits=ActuatorLimits(4.0, speed))
    assert_shortest(found.duration, 0.03 / speed + speed / 10.0)


def test_creeping_against_friction() -> None:
    # Upwards on upright legs: 7 N less the weight drive 3 tanh(v / 0.01).
    robot = RPSRobot(MICRO.parameters.replace(prismatic_friction=3.0, friction_speed=0.01))
    found = time_optimal(robot, LIFT, limits=ActuatorLimits(7.0))
    spare = 7.0 - (1.2 / 3 + 0.1) * 9.81
    assert found.duration == pytest.approx(0.03 / (0.01 * math.atanh(spare / 3.0)), rel=1e-2)


class Lift:
    """A robot that climbs level: one force for all legs, from the constraint models."""

    def __init__(self, robot: RPSRobot, low: float, high: float) -> None:
        self.robot, self.low, self.high = robot, low, high

    def force(self, z: float, v: float, a: float) -> float:
        motion = ([z, 0.0, 0.0], [v, 0.0, 0.0], [a, 0.0, 0.0])
        tau = self.robot.inverse_dynamics(*self.robot.state(*motion)).tau
        np.testing.assert_allclose(tau, tau[0], rtol=1e-7, atol=1e-9)
        return float(tau[0])

    def acceleration(self, z: float, v: float, force: float) -> float:
        still = self.force(z, v, 0.0)
        return (force - still) / (self.force(z, v, 1.0) - still)

    def climb(self, limit: float, way: float) -> Any:
        """v at any z: from rest at one end under a steady force; way -1: backwards from the top."""

        def change(_: float, state: Array) -> list[float]:
            z, v = state
            return [v, self.acceleration(float(z), float(v), way * limit)]

        def arrives(_: float, state: Array) -> float:
            return float(state[0] - (self.high if way > 0 else self.low))

        arrives.terminal = True  # type: ignore[attr-defined]
        start = [self.low if way > 0 else self.high, 0.0]
        run = solve_ivp(
            change, (0, way * 10.0), start, rtol=1e-9, atol=1e-12, events=arrives,
            dense_output=True, max_step=0.02,
        )  # fmt: skip
        z = run.y[0] if way > 0 else run.y[0][::-1]
        assert (np.diff(z) > 0).all()
        t = run.t if way > 0 else run.t[::-1]

        def speed(place: float) -> float:
            # z(t) takes each value once; the ends of the way are met to rounding only
            wanted = min(max(place, float(run.sol(t[0])[0])), float(run.sol(t[-1])[0]))
            when = brentq(lambda moment: run.sol(moment)[0] - wanted, t[0], t[-1], xtol=1e-15)
            return float(run.sol(when)[1])

        return speed

    def shortest(self, force: float, speed: float) -> float:
        """The least of the three: pushed up, at the speed limit, braked."""
        up, down = self.climb(force, 1.0), self.climb(force, -1.0)

        def fastest(z: float) -> float:
            lengths = leg_jacobians(self.robot.parameters, [z, 0.0, 0.0]).length_jacobian
            return min(up(z), down(z), speed / float(lengths[0, 0]))

        def slowness(angle: float) -> float:
            z = self.low + (self.high - self.low) * math.sin(angle) ** 2
            way = (self.high - self.low) * 2 * math.sin(angle) * math.cos(angle)
            return way / fastest(z)

        angles = np.linspace(1e-9, math.pi / 2 - 1e-9, 9)
        return sum(quad(slowness, a, b, epsrel=1e-7, limit=40)[0] for a, b in pairwise(angles))


@pytest.mark.parametrize(
    ("force", "speed", "friction"),
    [(3.0, math.inf, 0.0), (6.0, 0.25, 0.0), (4.0, 0.5, 3.0)],
    ids=["force", "force and speed", "friction"],
)
def test_climbing_is_as_fast_as_integrated(force: float, speed: float, friction: float) -> None:
    parameters = SOKOLOV.parameters.replace(
        rod_mass=0.05, rod_com=0.05, prismatic_damping=friction, revolute_damping=friction / 30
    )
    robot = RPSRobot(parameters)
    expected = Lift(robot, 0.30, 0.45).shortest(force, speed)
    found = time_optimal(
        robot, LineCurve([0.30, 0, 0], [0.45, 0, 0]), limits=ActuatorLimits(force, speed)
    )
    assert_shortest(found.duration, expected)


def test_more_pieces_change_little() -> None:
    """A thousandth is promised."""
    coarse, usual, fine = (Case(29).motion(intervals=n).duration for n in (40, 100, 160))
    assert coarse == pytest.approx(fine, rel=1e-3)
    assert usual == pytest.approx(fine, rel=2e-4)


# Any curve, any limits ----------------------------------------------------------------------------


class Case:
    """A random line or spline on `micro`, with random limits, friction, payload and wrench."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 6))
        poses = np.column_stack([rng.uniform(0.215, 0.235, n), *rng.uniform(-0.1, 0.1, (2, n))])
        self.curve: Curve = LineCurve(*poses) if n == 2 else ChordSpline(poses)
        speed = rng.choice([math.inf, 10 ** rng.uniform(-1.5, 0.5)])
        self.limits = ActuatorLimits(10 ** rng.uniform(1.2, 2), float(speed))
        parameters = MICRO.parameters
        if rng.random() < 0.4:
            parameters = parameters.replace(
                prismatic_friction=rng.uniform(0, 3),
                prismatic_damping=rng.uniform(0, 20),
                revolute_friction=rng.uniform(0, 0.05),
                revolute_damping=rng.uniform(0, 0.05),
                friction_speed=10 ** rng.uniform(-2.5, -1),
            )
        payload = Payload(0.5, (0.02, -0.01, 0.05)) if rng.random() < 0.4 else None
        self.robot = RPSRobot(parameters, payload)
        loaded = rng.random() < 0.4
        self.wrench = np.append(3 * rng.normal(size=3), 0.2 * rng.normal(size=3)) * loaded

    def motion(self, **options: Any) -> LimitedMotion:
        options = {"limits": self.limits, "wrench": self.wrench, "intervals": 30} | options
        return time_optimal(self.robot, self.curve, **options)


@cache
def solved(seed: int) -> tuple[Case, LimitedMotion]:
    case = Case(seed)
    return case, case.motion()


def use_of(case: Case, motion: PathSample) -> Array:
    """The most that any limit is used, at each sample: closed forms."""
    force = case.robot.actuator_forces(*motion, wrench=case.wrench)
    jacobian = leg_jacobians(case.robot.parameters, motion.pose).length_jacobian
    speed = np.einsum("nij,nj->ni", jacobian, motion.rate)
    used = np.abs(np.concatenate([force / case.limits.force, speed / case.limits.speed], axis=-1))
    return np.asarray(used.max(axis=-1))


@pytest.mark.parametrize("seed", quick(range(30), range(8)))
def test_limits_are_kept_and_nearly_always_reached(seed: int) -> None:
    case, found = solved(seed)
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0, found.duration, 20_000))
    t[:100] = found.law.times[rng.integers(0, len(found.law.times), 100)]
    motion = found.sample(t)
    used = use_of(case, motion)
    assert used.max() <= 1 + KEPT
    assert (used >= 1 - 1e-3).mean() >= 0.99

    few = rng.integers(0, len(t), 12)
    q, v, a = case.robot.state(*(part[few] for part in motion))
    for i in range(len(few)):
        tau = case.robot.inverse_dynamics(q[i], v[i], a[i], wrench=case.wrench).tau
        assert np.abs(tau).max() <= case.limits.force * (1 + KEPT)

    ends = found.sample([0.0, found.duration])
    np.testing.assert_allclose(ends.rate, 0, atol=1e-9)
    np.testing.assert_allclose(ends.pose, case.curve.at([0.0, case.curve.length]).pose, atol=1e-12)
    u, du, _ = found.law.at(t)
    np.testing.assert_array_equal(motion.pose, case.curve.at(u).pose)
    assert (du[100:] >= 0).all()
    assert (np.diff(u[100:]) >= 0).all()


@pytest.mark.parametrize("seed", range(3))
def test_rates_and_accelerations_are_derivatives(seed: int) -> None:
    _, found = solved(seed)
    step = 1e-6 * found.duration
    t = np.random.default_rng(seed).uniform(step, found.duration - step, 500)
    t = t[np.abs(t[:, None] - found.law.times).min(axis=1) > 2 * step]
    before, here, after = (found.sample(t + d) for d in (-step, 0.0, step))
    rate = (after.pose - before.pose) / (2 * step)
    acceleration = (after.rate - before.rate) / (2 * step)
    np.testing.assert_allclose(rate, here.rate, atol=1e-7 * np.abs(here.rate).max())
    largest = np.abs(here.acceleration).max()
    np.testing.assert_allclose(acceleration, here.acceleration, atol=1e-6 * largest)


# What must follow from what -----------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(2))
def test_weightless_k_squared_of_the_force_takes_one_kth_of_the_time(seed: int) -> None:
    robot = RPSRobot(MICRO.parameters.replace(gravity=[0.0, 0.0, 0.0]))
    curve = Case(seed).curve
    once, four = (
        time_optimal(robot, curve, limits=ActuatorLimits(force)).duration for force in (5.0, 80.0)
    )
    assert once / four == pytest.approx(4.0, rel=1e-6)


@pytest.mark.parametrize("seed", [16, 1])  # without friction, and with
def test_looser_limits_are_never_slower(seed: int) -> None:
    case = Case(seed)
    force, speed = case.limits.force, min(case.limits.speed, 0.5)
    looser = [(force, speed), (1.2 * force, speed), (2 * force, 9.0)]
    times = [case.motion(limits=ActuatorLimits(*pair), intervals=40).duration for pair in looser]
    for slower, faster in pairwise(times):
        assert faster <= slower * (1 + 1e-4)  # as well as they are found
    assert times[-1] < 0.99 * times[0]


def test_the_way_back_takes_as_long_without_friction() -> None:
    there = LineCurve([0.215, 0.05, 0.0], [0.235, -0.05, 0.1])
    back = LineCurve(there.end, there.start)
    times = [time_optimal(MICRO, line, limits=ActuatorLimits(20.0, 0.8)) for line in (there, back)]
    assert times[0].duration == pytest.approx(times[1].duration, rel=1e-5)


@dataclass(frozen=True)
class Warped:
    """A line from start to end in another parameter: (u + k u^2) / (1 + k), or 3 u^2 - 2 u^3."""

    line: LineCurve
    warp: float
    length: float = 1.0

    def at(self, u: ArrayLike) -> CurveSample:
        u = np.asarray(u, dtype=np.float64)[..., None]
        k = self.warp
        if math.isinf(k):
            s, first, second = u * u * (3 - 2 * u), 6 * u * (1 - u), 6 - 12 * u
        else:
            s, first, second = (u + k * u * u) / (1 + k), (1 + 2 * k * u) / (1 + k), 2 * k / (1 + k)
        way = self.line.end - self.line.start
        return CurveSample(self.line.at(s[..., 0]).pose, first * way, second * way + 0 * first)


@pytest.mark.parametrize("warp", [0.5, 3.0, math.inf])
def test_the_parameter_does_not_matter(warp: float) -> None:
    """Not even where it leaves the curve without a tangent at the ends (the last)."""
    line = LineCurve([0.215, 0.05, 0.0], [0.235, -0.05, 0.1])
    limits = ActuatorLimits(20.0, 0.8)
    plain, warped = (
        time_optimal(MICRO, path, limits=limits) for path in (line, Warped(line, warp))
    )
    assert warped.duration == pytest.approx(plain.duration, rel=1e-4)
    ends = warped.sample([0.0, warped.duration])
    np.testing.assert_allclose(ends.rate, 0, atol=1e-9)


def test_there_and_back_turns_without_a_stop_of_the_parameter() -> None:
    """cos u goes there and back: twice the time of the line, and no more."""
    swing = lissajous(
        height=0.225, amplitude=(0.1, 0.05), frequency=(1, 1), phase=(math.pi / 2, math.pi / 2),
        duration=1.0,
    )  # fmt: skip
    limits = ActuatorLimits(20.0)
    line = LineCurve([0.225, 0.1, 0.05], [0.225, -0.1, -0.05])
    there = time_optimal(MICRO, line, limits=limits).duration
    both = time_optimal(MICRO, swing, limits=limits)
    assert both.duration == pytest.approx(2 * there, rel=1e-4)
    turning = both.sample(both.duration / 2)
    np.testing.assert_allclose(turning.pose, line.end, atol=1e-8)


@dataclass(frozen=True)
class LineAndArc:
    """Straight in tilt, then round: its second derivative jumps at the knot."""

    length: float = 0.2
    knots: tuple[float, ...] = (0.0871,)

    def at(self, u: ArrayLike) -> CurveSample:
        u = np.asarray(u, dtype=np.float64)
        radius, z = 0.03, np.full_like(u, 0.225)
        turn, straight, none = np.maximum(u - 0.0871, 0) / radius, u < 0.0871, np.zeros_like(u)
        c, s = np.cos(turn), np.sin(turn)
        x = np.where(straight, u - 0.0871, radius * s)
        y = radius * (1 - c)
        bend = np.where(straight, 0, 1 / radius)
        return CurveSample(
            np.stack([z, x, y], axis=-1),
            np.stack([none, c, s], axis=-1),
            np.stack([none, -s * bend, c * bend], axis=-1),
        )


def test_a_curvature_that_jumps() -> None:
    limits = ActuatorLimits(20.0)
    exact = time_optimal(MICRO, LineAndArc(), limits=limits, intervals=37)
    blind = time_optimal(MICRO, LineAndArc(knots=()), limits=limits, intervals=37)
    for found in (exact, blind):
        t = np.linspace(0, found.duration, 20_011)
        assert found.use(t).most.max() <= 1 + KEPT
    assert exact.duration < blind.duration < 1.02 * exact.duration


# What is taken, and what is refused ---------------------------------------------------------------


def test_what_has_a_curve_is_taken_by_its_curve() -> None:
    path = circle(height=0.225, tilt=0.1, duration=3.0)
    by_path, by_curve = time_optimal(MICRO, path), time_optimal(MICRO, path.curve)
    assert by_path.duration == by_curve.duration
    assert by_path.curve is path.curve
    turn = helix(SOKOLOV, radius=0.75e-3, pitch=0.5e-3, height=0.4)
    found = time_optimal(SOKOLOV, turn, limits=ActuatorLimits(1.0, 0.05))
    assert found.curve is turn.curve
    assert isinstance(found, TimedCurve)
    assert found.duration < turn.duration


class InItsOwnTime:
    """A trajectory that is pushed all along: nowhere without rate and acceleration both."""

    duration = 2.0

    def sample(self, t: ArrayLike) -> PathSample:
        t = np.asarray(t, dtype=np.float64)[..., None]
        way = np.array([0.01, 0.02, -0.03])
        start = np.array([0.215, 0.0, 0.0])
        return PathSample(start + way * t**2 / 2, way * t, way + 0 * t)


def test_a_trajectory_is_a_curve_in_its_own_time() -> None:
    limits = ActuatorLimits(20.0, 0.5)
    found = time_optimal(MICRO, InItsOwnTime(), limits=limits)
    line = LineCurve([0.215, 0, 0], [0.235, 0.04, -0.06])
    assert found.duration == pytest.approx(
        time_optimal(MICRO, line, limits=limits).duration, rel=1e-4
    )


def test_the_robots_own_limits_are_kept_unless_others_are_given() -> None:
    found = time_optimal(MICRO, LIFT)
    assert found.limits == ActuatorLimits.of(MICRO.parameters)
    assert found.duration > 0.03 / 0.2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"limits": ActuatorLimits(speed=1.0)}, "no limit of force"),
        ({"limits": ActuatorLimits(10.0, power=1.0)}, "power limit = 1 W"),
        ({"limits": 10.0}, "must be ActuatorLimits"),
        ({"intervals": 7}, "intervals = 7"),
        ({"intervals": 10.5}, "intervals"),
        ({"intervals": True}, "intervals"),
        ({"wrench": np.zeros((4, 6))}, "wrench has shape"),
        ({"wrench": [0, 0, math.nan, 0, 0, 0]}, "wrench is not finite"),
    ],
)
def test_bad_arguments_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        time_optimal(MICRO, LIFT, **options)


def test_what_is_no_path_is_refused() -> None:
    with pytest.raises(InputError, match="it must be a curve"):
        time_optimal(MICRO, 3.0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no limit of force"):
        time_optimal(SOKOLOV, LineCurve([0.4, 0, 0], [0.41, 0, 0]))


def test_a_search_that_does_not_end_returns_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rough = RPSRobot(MICRO.parameters.replace(prismatic_friction=2.0))
    line = LineCurve([0.215, 0.05, 0.0], [0.235, -0.05, 0.1])
    few = range(2)
    with pytest.raises(RPSPinError, match="friction does not converge"):
        time_optimal(rough, line, progress=lambda _: few[:1])
    with pytest.raises(RPSPinError, match=r"keeps the limits to 1e-06.*exceeds one by"):
        time_optimal(MICRO, line, limits=ActuatorLimits(20.0), progress=lambda _: few[:1])


def test_progress_wraps_the_rounds() -> None:
    seen: list[int] = []

    def note(rounds: Any) -> Any:
        for i in rounds:
            seen.append(i)
            yield i

    time_optimal(MICRO, LIFT, progress=note)
    assert seen == list(range(len(seen)))
    assert 0 < len(seen) < search.MOST_ROUNDS


def test_parameters_stay_as_they_are() -> None:
    before = RPSParameters.from_preset("micro")
    time_optimal(MICRO, LIFT)
    assert MICRO.parameters == before

"""The shortest time under limits of jerk: against S-curves, the time without them, and differences.

Jerks are checked as differences of accelerations, which the Pinocchio engine computes.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from rps_pin import ClosedLoopModel
from rps_pin.arrays import Array
from rps_pin.closed_loop import JointEffects
from rps_pin.errors import InfeasibleError, InputError
from rps_pin.task import MotionLimits, Task, time_optimal
from rps_pin.task.motion.jerk.jerk_search import JerkSearch
from rps_pin.task.motion.limited_motion import LimitedMotion
from rps_pin.task.motion.task_dynamics import TaskDynamics
from rps_pin.task.motion.time_search import KEPT
from rps_pin.trajectories.curve import CurveSample
from rps_pin.trajectories.point_to_point import LineCurve
from rps_pin.trajectories.spline import ChordSpline
from tests.task import robots
from tests.task.slides import ALONG, MASS, WAY, slide
from tests.worst import worst

#: How much longer than the true shortest time what is found may be, and shorter by the tolerance.
LONGER, SHORTER = 1e-3, 2e-6


def assert_shortest(found: float, expected: float) -> None:
    assert expected * (1 - SHORTER) <= found <= expected * (1 + LONGER)


def s_curve(speed: float, up: float, down: float, jerk: float, way: float = WAY) -> float:
    """The shortest time: accelerations up and down, each at a rate of `jerk`, and a speed."""

    def ramp(v: float, a: float) -> float:
        a = min(a, math.sqrt(v * jerk))
        return v / a + a / jerk

    def way_to(v: float) -> float:
        return v / 2 * (ramp(v, up) + ramp(v, down))

    if way_to(speed) <= way:
        return ramp(speed, up) + ramp(speed, down) + (way - way_to(speed)) / speed
    v = brentq(lambda v: way_to(v) - way, 1e-9, speed, xtol=1e-15)
    return ramp(v, up) + ramp(v, down)


# Formulas -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["", "coordinate_"])
@pytest.mark.parametrize(
    ("speed", "acceleration", "jerk"),
    [
        (0.5, 2.0, 20.0),  # all seven pieces
        (9.0, 2.0, 20.0),  # the speed is not reached
        (0.2, 9.0, 20.0),  # the acceleration is not reached
        (9.0, 99.0, 20.0),  # neither
    ],
)
def test_an_s_curve(kind: str, speed: float, acceleration: float, jerk: float) -> None:
    limits = {"speed": speed, "acceleration": acceleration, "jerk": jerk}
    own = MotionLimits(force=math.inf, **{kind + name: value for name, value in limits.items()})
    found = time_optimal(slide(), ALONG, limits=own, intervals=60)
    assert_shortest(found.duration, s_curve(speed, acceleration, acceleration, jerk))
    assert found.sides[-1] == "slide jerk"


def test_of_jerk_alone() -> None:
    found = time_optimal(slide(), ALONG, limits=MotionLimits(force=math.inf, jerk=20.0))
    assert_shortest(found.duration, (32 * WAY / 20.0) ** (1 / 3))
    assert found.without_jerk_limits is None
    assert found.shares()["slide jerk"] > 0.98


@pytest.mark.parametrize("kind", ["jerk", "coordinate_jerk"])
def test_jerks_up_and_down_have_limits_of_their_own(kind: str) -> None:
    up, down = 20.0, 5.0
    found = time_optimal(
        slide(), ALONG, limits=MotionLimits(force=math.inf, **{kind: [[-down], [up]]})
    )
    # Up for t, down for 2 t up / down, up for t: the speed is symmetric, and the way half of that.
    t = 1.0
    middle = t * up / down
    pushed = up * t**3 / 6 + up * t**2 / 2 * middle + up * t * middle**2 / 2
    way = pushed - down * middle**3 / 6
    # The other half: the same backwards.
    assert_shortest(found.duration, 2 * (t + middle) * (WAY / (2 * way)) ** (1 / 3))


# Robots -------------------------------------------------------------------------------------------


@cache
def bent(name: str, share: float) -> tuple[Task, Array, Array, LimitedMotion]:
    """A curve through poses, and the jerk limit as a share of what it has without."""
    task, (x, q) = robots.compiled(name), robots.poses(name)
    still = np.zeros((len(q), task.mechanism.model.nv))
    force = 5 * np.abs(task.actuator_forces(q, still, still)).max()
    curve = ChordSpline(x[:3])
    free = time_optimal(task, curve, limits=MotionLimits(force=force), near=q[0], intervals=30)
    t = np.linspace(0, free.duration, 100)
    most = np.abs(accelerations(name, free, t, q[0])).max(axis=0) / free.duration * 4 * share
    limits = MotionLimits(force=force, jerk=most)
    found = time_optimal(task, curve, limits=limits, near=q[0], intervals=60)
    assert found.duration > free.duration
    return task, q[0], most, found


def accelerations(name: str, motion: LimitedMotion, t: Array, near: Array) -> Array:
    """Of the actuators, by the Pinocchio engine."""
    slow, sample = robots.task(name), motion.sample(t)
    q = robots.compiled(name).follow(sample.pose, near=near)
    a = slow.motion(q, sample.rate, sample.acceleration).a
    return np.asarray(a[:, slow.mechanism.actuated_indices])


@pytest.mark.parametrize(("name", "share"), [("five_bar", 0.5), ("sokolov", 8.0), ("ankle", 2.0)])
def test_jerks_are_kept_between_the_knots_and_reached(name: str, share: float) -> None:
    _, near, most, found = bent(name, share)
    t = np.linspace(0, found.duration, 401)
    a = accelerations(name, found, t, near)
    assert worst(a[[0, -1]] / most) < 1e-9 * found.duration
    assert worst(found.sample(t[[0, -1]]).rate) < 1e-9
    jerk = np.diff(a, axis=0) / np.diff(t)[:, None] / most  # the mean in each interval
    assert worst(jerk) <= 1 + 1e-5
    use = found.use(t)
    assert worst(use.sides.clip(0.0)) <= 1 + KEPT
    middle = found.use((t[1:] + t[:-1]) / 2).jerk
    smooth = np.abs(np.diff(found.law.jerk_at(t))) < 1e-9  # in one piece
    assert smooth.mean() > 0.2
    assert worst((middle - jerk)[smooth]) < 2e-3
    assert (found.active((t[1:] + t[:-1]) / 2, 0.02).any(axis=1)).mean() > 0.9


def test_from_another_motion_the_same_is_found() -> None:
    """From the motion without limits of jerk, and from a smooth one that is slow."""
    task, near, most, found = bent("five_bar", 0.5)
    bounds = MotionLimits(jerk=most, force=np.inf, speed=np.inf).of(task)
    dynamics = TaskDynamics(task, found.curve, bounds, None, near)
    free = time_optimal(task, found.curve, limits=MotionLimits(acceleration=50.0), near=near)
    times = [JerkSearch(dynamics, law, 40).run(iter).duration for law in (None, free.law)]
    assert times[0] == pytest.approx(times[1], rel=LONGER)


def test_pinocchio_has_the_same_jerks() -> None:
    task, near, most, found = bent("five_bar", 0.5)
    bounds = MotionLimits(jerk=most, coordinate_jerk=100.0).of(task)
    uses = []
    for one in (robots.task("five_bar"), task):
        along = TaskDynamics(one, found.curve, bounds, None, near)
        u = np.linspace(0.05, 0.95, 7) * along.curve.length
        uses.append(along.use_along(u, 3.0 + u, 5.0 - u, 100.0 * u).sides)
    np.testing.assert_allclose(uses[0], uses[1], rtol=1e-6, atol=1e-8)


def test_friction_and_a_wrench_are_overcome() -> None:
    plain = robots.task("five_bar").mechanism
    dry, damping = np.zeros(plain.model.nv), np.zeros(plain.model.nv)
    index = plain.actuated_indices
    dry[index], damping[index] = 0.2 * plain.model.effortLimit[index], 0.01
    effects = JointEffects(damping, dry, 0 * dry, 0 * dry)
    rough = ClosedLoopModel(
        plain.model, plain.closures, plain.actuated, home=plain.home, effects=effects
    )
    task, wrench = (
        Task(rough, "left_tip", ["x", "z"]).compile(compiler="tcc"),
        [3.0, 0.0, -6.0, 0.0, 0.0, 0.0],
    )
    line = LineCurve(task.home, task.home + np.array([0.02, 0.01]))
    limits = MotionLimits(jerk=3e4)
    found = time_optimal(task, line, limits=limits, wrench=wrench, intervals=30)
    t = np.linspace(0, found.duration, 200)[1:-1]
    state = task.state(*found.sample(t))
    tau = [
        rough.inverse_dynamics(*one, wrenches={"left_tip": np.array(wrench)}).tau
        for one in zip(*state, strict=True)
    ]
    use = np.abs(tau) / plain.model.effortLimit[index]
    np.testing.assert_allclose(np.abs(found.use(t).force), use, atol=1e-7)
    assert worst(use) <= 1 + KEPT
    assert (found.use(t).most > 0.99).mean() > 0.9


# What is refused ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"jerk": 0.0}, "jerk limit = 0.0: it must be positive"),
        ({"jerk": -3.0}, "jerk limit = -3.0: it must be positive"),
        ({"jerk": math.nan}, "jerk limit"),
        ({"coordinate_jerk": math.nan}, "coordinate_jerk limit"),
        ({"jerk": "little"}, "jerk limit"),
        ({"jerk": [1.0, 2.0]}, r"jerk limit has shape \(2,\)"),
        ({"jerk": [[1.0], [2.0]]}, "jerk limit: the least must be negative"),
        ({"coordinate_jerk": [[2.0], [1.0]]}, "coordinate_jerk limit: the least .* must be below"),
    ],
)
def test_bad_limits_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        time_optimal(slide(), ALONG, limits=MotionLimits(force=1.0, **options))


class Bent:
    """A curve of one coordinate whose second derivative jumps in the middle."""

    length = 1.0

    def at(self, u: Any) -> CurveSample:
        x = np.asarray(u, float)[..., None]
        late = np.maximum(x - 0.5, 0.0)
        return CurveSample(0.1 * x + 0.1 * late**2, 0.1 + 0.2 * late, 0.2 * (x > 0.5))


class Rising:
    """A curve without a tangent at its beginning."""

    length = 1.0

    def at(self, u: Any) -> CurveSample:
        x = np.asarray(u, float)[..., None]
        return CurveSample(0.1 * x**2, 0.2 * x, 0.2 + 0 * x)


def test_curves_without_finite_jerk_are_refused() -> None:
    limits = MotionLimits(force=10.0, jerk=50.0)
    with pytest.raises(InputError, match=r"second derivative jumps at u = 0\.5 of 1"):
        time_optimal(slide(), Bent(), limits=limits)
    assert time_optimal(slide(), Bent(), limits=MotionLimits(force=10.0)).duration > 0
    with pytest.raises(InputError, match="no tangent at its beginning"):
        time_optimal(slide(), Rising(), limits=limits)


def test_what_cannot_be_held_is_infeasible() -> None:
    limits = MotionLimits(force=[[-30.0], [19.0]], jerk=10.0)
    with pytest.raises(InfeasibleError, match=r"slide force of 19\.62 N, and its limit"):
        time_optimal(slide("0 0 1"), ALONG, limits=limits)


def test_what_can_just_be_held_is_slow() -> None:
    """Held with 1 % of the limit to spare, friction nearly none."""
    limits = MotionLimits(force=[[-30.0], [1.01 * 19.62]], jerk=100.0)
    found = time_optimal(slide("0 0 1"), ALONG, limits=limits)
    up, down = 0.01 * 9.81, (30.0 + 19.62) / MASS
    expected = s_curve(1e3, up, down, 100.0)
    assert expected * (1 - SHORTER) < found.duration < expected * (1 + 3 * LONGER)

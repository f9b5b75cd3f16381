"""The search around the convex program: between looks, at the edge of what is possible."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike

from rps_pin import RPSRobot
from rps_pin.errors import InfeasibleError
from rps_pin.rps.motion.time_optimal import time_optimal
from rps_pin.rps.motion.time_search import KEPT
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits
from rps_pin.trajectories.curve import CurveSample
from rps_pin.trajectories.point_to_point import LineCurve
from rps_pin.trajectories.spline import ChordSpline
from tests.worst import worst

MICRO = RPSRobot.from_preset("micro")


class WithoutKnots:
    """A spline that does not say where its third derivative jumps."""

    def __init__(self, spline: ChordSpline) -> None:
        self._spline = spline
        self.length = spline.length

    def at(self, u: ArrayLike) -> CurveSample:
        return self._spline.at(u)


@pytest.mark.parametrize("seed", range(3))
def test_limits_are_kept_where_forces_bend_unannounced(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 7))
    poses = np.column_stack([rng.uniform(0.215, 0.235, n), rng.uniform(-0.08, 0.08, (n, 2))])
    limits = ActuatorLimits(force=10 ** rng.uniform(1.4, 2.5), speed=10 ** rng.uniform(-1, 1))
    found = time_optimal(MICRO, WithoutKnots(ChordSpline(poses)), limits=limits)
    # Other times than those looked at, and many more.
    motion = found.sample(rng.uniform(0.0, found.duration, 200_000))
    force = np.abs(MICRO.actuator_forces(*motion)).max(axis=-1) / limits.force
    speed = np.abs(MICRO.motion(*motion)[1].speed).max(axis=-1) / limits.speed
    assert worst(force, speed) <= 1 + KEPT
    assert (np.maximum(force, speed) >= 1 - 1e-3).mean() >= 0.99


def test_the_largest_static_force_decides() -> None:
    """Holding still takes most in the middle: a limit just above will do, one below will not."""
    curve = ChordSpline([[0.22, -0.1, 0.0], [0.22, 0.0, 0.12], [0.22, 0.1, 0.0]])
    u = np.linspace(0.0, curve.length, 2001)
    poses = curve.at(u).pose
    still = np.abs(MICRO.actuator_forces(poses, 0 * poses, 0 * poses)).max(axis=-1)
    worst = int(still.argmax())
    assert 500 < worst < 1500
    above, below = (ActuatorLimits(force=factor * still.max()) for factor in (1.001, 0.98))
    found = time_optimal(MICRO, curve, limits=above)
    motion = found.sample(np.linspace(0.0, found.duration, 20_000))
    assert np.abs(MICRO.actuator_forces(*motion)).max() <= above.force * (1 + KEPT)
    with pytest.raises(InfeasibleError, match=f"at u = {u[worst]:.4g}") as caught:
        time_optimal(MICRO, curve, limits=below)
    assert caught.value.violations[0].value == pytest.approx(still.max())


@pytest.mark.parametrize(("friction", "friction_speed"), [(8.0, 1e-3), (15.0, 1e-2)])
def test_friction_beyond_the_force_is_crept_against(friction: float, friction_speed: float) -> None:
    """With some 7 N to spare: friction's tanh lets the legs creep, and so they must."""
    dry = RPSRobot(
        MICRO.parameters.replace(prismatic_friction=friction, friction_speed=friction_speed)
    )
    limits = ActuatorLimits(force=12.0)
    found = time_optimal(dry, LineCurve([0.21, 0, 0], [0.24, 0, 0]), limits=limits)
    motion = found.sample(np.linspace(0.0, found.duration, 20_000))
    assert np.abs(dry.actuator_forces(*motion)).max() <= limits.force * (1 + KEPT)
    # Creeping steadily, f tanh(d' / v) is what the force leaves of the weight.
    middle = found.sample(found.duration / 2)
    weight = MICRO.actuator_forces(middle.pose, np.zeros(3), np.zeros(3))
    expected = friction_speed * np.arctanh((limits.force - weight) / friction)
    assert dry.motion(*middle)[1].speed == pytest.approx(expected, rel=2e-3)

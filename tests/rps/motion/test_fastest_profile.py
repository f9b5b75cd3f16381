"""The convex program of the shortest time, against formulas and another optimiser."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from rps_pin.errors import InputError
from rps_pin.rps.motion.fastest_profile import ProfileLimits, fastest_profile
from rps_pin.rps.motion.speed_profile import SpeedProfile

Array = NDArray[np.float64]

SHARE = np.linspace(0, 1, 5)
REST = (True, True)


def steady_limits(n: int, push: float, speed: float = np.inf) -> ProfileLimits:
    """|a| <= push and b <= speed^2 everywhere."""
    one = np.ones((n, len(SHARE), 3))
    return ProfileLimits(
        SHARE,
        one * [1 / push, -1 / push, 0],
        one * [0, 0, 1 / speed**2],
        one,
    )


def wavy_limits(seed: int, knots: Array) -> ProfileLimits:
    """Three actuators with smooth random coefficients, whose p pass through zero, and a speed."""
    rng = np.random.default_rng(seed)
    u = (1 - SHARE) * knots[:-1, None] + SHARE * knots[1:, None]
    p, q, g = (
        sum(
            rng.normal(size=3) * np.cos(k * np.pi * u[..., None] + rng.uniform(0, 6, 3))
            for k in range(3)
        )
        for _ in range(3)
    )
    g = 0.3 * np.tanh(g)
    none = np.zeros((*u.shape, 1))
    return ProfileLimits(
        SHARE,
        np.concatenate([p, -p, none], axis=-1),
        np.concatenate([q, -q, none + 0.5], axis=-1),
        np.concatenate([1 - g, 1 + g, none + 1], axis=-1),
    )


def slack(profile: SpeedProfile, limits: ProfileLimits) -> float:
    """The least r - p a - q b: negative if a limit is broken."""
    _, b, a = profile.within(limits.share)
    used = limits.by_acceleration * a[..., None] + limits.by_square * b[..., None]
    return float((limits.bound - used).min())


def parabola(knots: Array, rest: tuple[bool, bool] = REST) -> Array:
    u = knots / knots[-1]
    return (u if rest[0] else 1.0) * ((1 - u) if rest[1] else 1.0) * 4 + 0 * u


@pytest.mark.parametrize("n", [4, 10, 100])
@pytest.mark.parametrize("length", [1e-3, 1.0, 100.0])
def test_push_and_brake_is_the_fastest(n: int, length: float) -> None:
    knots = np.linspace(0, length, n + 1)
    found = fastest_profile(knots, steady_limits(n, 2.0), REST, length * parabola(knots))
    assert found is not None
    assert found.duration == pytest.approx(2 * np.sqrt(length / 2.0), rel=1e-6)
    np.testing.assert_allclose(found.squared, 4 * np.minimum(knots, length - knots), rtol=1e-5)


def test_a_trapezoid_where_speed_is_limited() -> None:
    knots = np.linspace(0, 2, 17)
    # Up to a speed of 1 with 2: a quarter of the way and half a second each.
    found = fastest_profile(knots, steady_limits(16, 2.0, 1.0), REST, parabola(knots))
    assert found is not None
    assert found.duration == pytest.approx(2 / 1.0 + 1.0 / 2.0, rel=1e-6)


@pytest.mark.parametrize(("rest", "expected"), [((True, False), 1.0), ((False, True), 1.0)])
def test_a_free_end_is_not_braked(rest: tuple[bool, bool], expected: float) -> None:
    knots = np.linspace(0, 1, 9)
    found = fastest_profile(knots, steady_limits(8, 2.0), rest, parabola(knots, rest) + 1e-3)
    assert found is not None
    assert found.duration == pytest.approx(expected, rel=1e-6)
    assert found.squared[0 if rest[1] else -1] == pytest.approx(4.0, rel=1e-5)


def test_two_free_ends_run_at_the_speed_limit() -> None:
    knots = np.linspace(0, 1, 9)
    found = fastest_profile(knots, steady_limits(8, 2.0, 0.5), (False, False), np.ones(9))
    assert found is not None
    assert found.duration == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_as_fast_as_another_optimiser_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    knots = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.5, 8))])
    knots /= knots[-1]
    limits = wavy_limits(seed, knots)
    found = fastest_profile(knots, limits, REST, parabola(knots))
    assert found is not None
    assert slack(found, limits) > -1e-7
    other = by_sqp(knots, limits)
    assert slack(other, limits) > -1e-9
    # The other makes the exact duration least, the program its sum: hence the tolerance.
    assert found.duration == pytest.approx(other.duration, rel=1e-5)


def by_sqp(knots: Array, limits: ProfileLimits) -> SpeedProfile:
    """The exact duration, made least by sequential quadratic programming from a slow start."""
    n = len(knots) - 1

    def made(x: Array) -> SpeedProfile:
        return SpeedProfile(knots, np.concatenate([[0.0], x[: n - 1], [0.0]]), x[n - 1 :])

    def duration(x: Array) -> float:
        try:
            return made(x).duration
        except InputError:
            return 1e3

    def room(x: Array) -> Array:
        b0, b1, e = np.append(0, x[: n - 1]), np.append(x[: n - 1], 0), x[n - 1 :]
        s, h = limits.share, np.diff(knots)[:, None]
        b = np.outer(b0, 1 - s) + np.outer(b1, s) + 4 * np.outer(e, s * (1 - s))
        a = ((b1 - b0)[:, None] + 4 * np.outer(e, 1 - 2 * s)) / (2 * h)
        used = limits.by_acceleration * a[..., None] + limits.by_square * b[..., None]
        return np.asarray((limits.bound - used).ravel() - 1e-9)

    size = 2 * n - 1
    gradient = np.stack([room(row) - room(np.zeros(size)) for row in np.eye(size)], axis=1)
    slow = 1e-2 * parabola(knots)[1:-1]
    best = np.concatenate([slow, np.zeros(n)])
    for _ in range(4):  # started anew, it gets on where its line search had stopped
        best = minimize(
            duration,
            best,
            method="SLSQP",
            constraints={"type": "ineq", "fun": room, "jac": lambda _: gradient},
            options={"maxiter": 500, "ftol": 1e-12},
        ).x
    return made(best)


@pytest.mark.parametrize("seed", range(6))
def test_no_feasible_change_is_faster(seed: int) -> None:
    knots = np.linspace(0, 1, 41)
    limits = wavy_limits(seed, knots)
    found = fastest_profile(knots, limits, REST, parabola(knots))
    slow = fastest_profile(
        knots, limits._replace(bound=0.8 * limits.bound + 0.0), REST, parabola(knots)
    )
    assert found is not None
    assert slow is not None
    rng = np.random.default_rng(seed)
    tried = 0
    for _ in range(300):
        # Around a slower profile, which leaves room, and from there beyond the fastest.
        change = 1e-3 * found.squared * rng.normal() * np.cos(rng.uniform(0, 40) * knots)
        mix = rng.uniform(0, 0.2)
        squared = (1 - mix) * found.squared + mix * slow.squared + change
        other = SpeedProfile(knots, squared, (1 - mix) * found.bump + mix * slow.bump)
        if slack(other, limits) >= 0:
            tried += 1
            assert other.duration > found.duration * (1 - 1e-6)
    assert tried > 10


def test_limits_that_leave_nothing() -> None:
    knots = np.linspace(0, 1, 11)
    limits = steady_limits(10, 1.0)
    bound = limits.bound.copy()
    bound[4] = -1.0  # a < -1 and -a < -1
    assert fastest_profile(knots, limits._replace(bound=bound), REST, parabola(knots)) is None


@pytest.mark.parametrize("factor", [1e-6, 1e-4, 1e-2, 1e2, 1e4, 1e6])
def test_a_guess_of_a_wrong_size_is_corrected(factor: float) -> None:
    knots = np.linspace(0, 1, 21)
    found = fastest_profile(knots, wavy_limits(3, knots), REST, factor * parabola(knots))
    good = fastest_profile(knots, wavy_limits(3, knots), REST, parabola(knots))
    assert found is not None
    assert good is not None
    assert found.duration == pytest.approx(good.duration, rel=1e-8)

"""Speed profiles: the law of time in closed form against quadrature and differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from rps_pin.errors import InputError
from rps_pin.rps.motion.speed_profile import SpeedProfile


def random_profile(
    seed: int, pieces: int = 6, rest: tuple[bool, bool] = (True, True)
) -> SpeedProfile:
    """Positive parabolas, some bent up and some down, one straight."""
    rng = np.random.default_rng(seed)
    knots = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 1.0, pieces))])
    squared = rng.uniform(0.2, 3.0, pieces + 1)
    squared[[0, -1]] *= np.logical_not(rest)
    # A bump above -1/4 of the sum of the square roots' product keeps a parabola positive.
    room = (np.sqrt(squared[:-1]) + np.sqrt(squared[1:])) ** 2 / 4
    bump = rng.uniform(-0.9, 2.0, pieces) * room
    bump[rng.integers(pieces)] = 0.0
    return SpeedProfile(knots, squared, bump)


def square_at(profile: SpeedProfile, piece: int, share: float) -> float:
    """b by the definition: chord and bump."""
    first, second = profile.squared[piece : piece + 2]
    chord = (1 - share) * first + share * second
    return float(chord + 4 * share * (1 - share) * profile.bump[piece])


@given(st.integers(0, 10_000), st.tuples(st.booleans(), st.booleans()))
def test_knots_are_met_when_the_integral_of_the_slowness_says(
    seed: int, rest: tuple[bool, bool]
) -> None:
    profile = random_profile(seed, rest=rest)
    for piece, width in enumerate(np.diff(profile.knots)):
        # share = sin^2(angle): the roots at rest cancel.
        def slowness(angle: float, piece: int = piece, width: float = width) -> float:
            way = 2 * np.sin(angle) * np.cos(angle) * width
            return float(way / np.sqrt(square_at(profile, piece, np.sin(angle) ** 2)))

        expected = quad(slowness, 0, np.pi / 2, epsabs=0, epsrel=1e-10, limit=200)[0]
        assert profile.times[piece + 1] - profile.times[piece] == pytest.approx(expected, rel=1e-8)


@given(st.integers(0, 10_000), st.tuples(st.booleans(), st.booleans()))
def test_the_law_runs_at_the_profiles_speed(seed: int, rest: tuple[bool, bool]) -> None:
    profile = random_profile(seed, rest=rest)
    t = np.random.default_rng(seed).uniform(0, profile.duration, 200)
    law = profile.at(t)
    square, acceleration = profile.along(law.u)
    np.testing.assert_allclose(law.rate**2, square, atol=1e-12 * profile.squared.max() * 10)
    np.testing.assert_allclose(law.acceleration, acceleration, atol=1e-10, rtol=1e-10)
    piece = np.searchsorted(profile.knots[1:-1], law.u, side="right")
    share = (law.u - profile.knots[piece]) / np.diff(profile.knots)[piece]
    defined = [square_at(profile, int(i), s) for i, s in zip(piece, share, strict=True)]
    np.testing.assert_allclose(square, defined, rtol=1e-12, atol=1e-14)


@given(st.integers(0, 10_000))
def test_rate_and_acceleration_are_derivatives(seed: int) -> None:
    profile = random_profile(seed)
    step = 1e-6
    t = np.random.default_rng(seed).uniform(step, profile.duration - step, 200)
    away = np.abs(t[:, None] - profile.times).min(axis=1) > 2 * step
    before, here, after = (profile.at(t[away] + d) for d in (-step, 0.0, step))
    np.testing.assert_allclose((after.u - before.u) / (2 * step), here.rate, atol=1e-7)
    change = (after.rate - before.rate) / (2 * step)
    scale = 1 + np.abs(here.acceleration).max()
    np.testing.assert_allclose(change / scale, here.acceleration / scale, atol=1e-7)


@given(st.integers(0, 10_000))
def test_starts_ends_and_is_continuous(seed: int) -> None:
    profile = random_profile(seed)
    ends = profile.at([0.0, profile.duration])
    np.testing.assert_allclose(ends.u, [0, profile.length], atol=1e-12)
    np.testing.assert_allclose(ends.rate, 0, atol=1e-12)
    at_knots, before = profile.at(profile.times), profile.at((profile.times - 1e-12).clip(0))
    np.testing.assert_allclose(at_knots.u, profile.knots, atol=1e-12)
    np.testing.assert_allclose(at_knots.rate, before.rate, atol=1e-9)


def test_a_steady_push_and_brake() -> None:
    # u'' = 2 for a second, then -2: half the way (1) each.
    profile = SpeedProfile([0, 1, 2], [0, 4, 0], [0, 0])
    assert profile.duration == pytest.approx(2, rel=1e-15)
    law = profile.at([0.0, 0.5, 1.0, 1.5, 2.0])
    np.testing.assert_allclose(law.u, [0, 0.25, 1, 1.75, 2], atol=1e-15)
    np.testing.assert_allclose(law.rate, [0, 1, 2, 1, 0], atol=1e-15)
    np.testing.assert_allclose(law.acceleration, [2, 2, -2, -2, -2], atol=1e-15)


def test_half_a_swing_is_half_a_period() -> None:
    # u'' = -(u - 1): from rest at 0 to rest at 2 in pi; b = 1 - (u - 1)^2.
    profile = SpeedProfile([0, 1, 2], [0, 1, 0], [0.25, 0.25])
    assert profile.duration == pytest.approx(np.pi, rel=1e-14)
    t = np.linspace(0, np.pi, 50)
    np.testing.assert_allclose(profile.at(t).u, 1 - np.cos(t), atol=1e-14)


def test_within_gives_each_pieces_own_acceleration() -> None:
    profile = SpeedProfile([0, 1, 2], [0, 4, 0], [0, 0])
    u, square, acceleration = profile.within(np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(u, [[0, 0.5, 1], [1, 1.5, 2]])
    np.testing.assert_allclose(square, [[0, 2, 4], [4, 2, 0]])
    np.testing.assert_allclose(acceleration, [[2, 2, 2], [-2, -2, -2]])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0, 1], [0, 1, 0], [0]), "one more"),
        (([0, 1, 2], [0, 1, 0], [0]), "one more"),
        (([0], [0], []), "one more"),
        (([0, 2, 1], [0, 1, 0], [0, 0]), "increase"),
        (([1, 2, 3], [0, 1, 0], [0, 0]), "from 0"),
        (([0, 1, 2], [0, 0, 0], [0, 0]), "positive"),
        (([0, 1, 2], [0, -1, 0], [0, 0]), "positive"),
        (([0, 1, 2], [0, 1, 0], [-0.3, 0]), "positive"),  # cannot leave
        (([0, 1, 2], [0, 1, 0], [0, -0.3]), "positive"),  # cannot arrive
        (([0, 1, 2], [1, 1, 1], [0, -1.1]), "positive"),  # stops on its way
        (([0, 1, 2], [0, np.nan, 0], [0, 0]), "finite"),
        (([[0, 1, 2]], [0, 1, 0], [0, 0]), "row"),
    ],
)
def test_refusals(arguments: tuple[list[float], ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        SpeedProfile(*arguments)


def test_times_and_parameters_outside_are_refused() -> None:
    profile = SpeedProfile([0, 1, 2], [0, 4, 0], [0, 0])
    with pytest.raises(InputError, match="outside the trajectory"):
        profile.at(2.1)
    with pytest.raises(InputError, match="outside the curve"):
        profile.along(-0.1)

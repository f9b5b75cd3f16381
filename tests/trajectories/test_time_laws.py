"""Laws of time: rest to rest, exact derivatives, and the shortest within limits.

That nothing is shorter is shown thrice: by the top speed that can be reached, found as a root; for
the S-curve also by the durations that textbooks give case by case, and by a linear program that
knows only the limits.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq, linprog

from rps_pin import InputError
from rps_pin.trajectories import QuinticLaw, SCurveLaw, TimeLaw, TrapezoidalLaw
from rps_pin.trajectories.time_laws import RAMP, time_law
from tests.each import each
from tests.trajectories.differences import difference
from tests.trajectories.law_checks import (
    DISTANCES,
    LAWS,
    POSITIVE,
    RAMPS,
    Law,
    inside,
    laws,
    peaks,
    ratio,
    uncertainty,
)

LIMITS = st.one_of(POSITIVE, st.just(math.inf))


# For a duration -----------------------------------------------------------------------------------


@given(laws())
def test_it_goes_from_rest_to_rest_over_the_distance(law: Law) -> None:
    speed = law.distance / law.duration
    u, rate, acceleration = law.at([0.0, law.duration])
    np.testing.assert_allclose(u / law.distance, [0, 1], rtol=0, atol=1e-14)
    np.testing.assert_allclose(rate / speed, [0, 0], rtol=0, atol=1e-14)
    if not isinstance(law, TrapezoidalLaw):
        limit = peaks(law).acceleration
        np.testing.assert_allclose(acceleration / limit, [0, 0], rtol=0, atol=1e-12)


@given(laws())
def test_rate_and_acceleration_are_the_derivatives(law: Law) -> None:
    """Exactly: the pieces are polynomials, and differences stay within them."""
    t, step = inside(law)
    found = law.at(t)
    scale = law.distance / step
    rate = difference(lambda x: law.at(x).u, t, step)
    acceleration = difference(lambda x: law.at(x).rate, t, step)
    assert (np.abs(found.rate - rate) <= 1e-13 * scale).all()
    assert (np.abs(found.acceleration - acceleration) <= 1e-12 * scale / step).all()


@given(laws())
def test_position_and_speed_do_not_jump(law: Law) -> None:
    if isinstance(law, QuinticLaw):
        return
    before, after = law.at(np.nextafter(law.knots[1:-1], 0)), law.at(law.knots[1:-1])
    top = peaks(law)
    atol = 1e-13 * law.duration
    np.testing.assert_allclose(before.u, after.u, rtol=0, atol=atol * top.speed)
    np.testing.assert_allclose(before.rate, after.rate, rtol=0, atol=atol * top.acceleration)
    if isinstance(law, SCurveLaw):
        atol *= top.jerk
        np.testing.assert_allclose(before.acceleration, after.acceleration, rtol=0, atol=atol)


@given(laws())
def test_backwards_it_is_the_same(law: Law) -> None:
    t, _ = inside(law)
    forth, back = law.at(t), law.at(law.duration - t)
    top = peaks(law)
    np.testing.assert_allclose(forth.u + back.u, law.distance, rtol=1e-13)
    np.testing.assert_allclose(forth.rate, back.rate, rtol=0, atol=1e-12 * top.speed)
    np.testing.assert_allclose(
        forth.acceleration, -back.acceleration, rtol=0, atol=1e-11 * top.acceleration
    )


@given(laws())
def test_it_never_goes_back(law: Law) -> None:
    found = law.at(np.linspace(0, law.duration, 301))
    assert (found.rate >= -1e-14 * law.distance / law.duration).all()
    assert (np.diff(found.u) >= -1e-14 * law.distance).all()


@given(DISTANCES, POSITIVE)
def test_the_quintic_is_its_polynomial(distance: float, duration: float) -> None:
    s = np.linspace(0, 1, 50)
    u = QuinticLaw(distance, duration).at(s * duration).u
    np.testing.assert_allclose(u, distance * (10 * s**3 - 15 * s**4 + 6 * s**5), rtol=1e-13)


@given(DISTANCES, POSITIVE, RAMPS)
def test_ramp_is_the_push_s_share_of_the_duration(
    distance: float, duration: float, ramp: float
) -> None:
    """Speed rises until then, and the top speed follows from the distance alone."""
    top = distance / (duration * (1 - ramp))
    for kind in (TrapezoidalLaw, SCurveLaw):
        law = kind(distance, duration, ramp=ramp)
        assert law.distance == pytest.approx(distance, rel=1e-14)
        assert law.duration == pytest.approx(duration, rel=1e-14)
        cruise = np.linspace(ramp, 1 - ramp, 5)[1:-1] * duration
        np.testing.assert_allclose(law.at(cruise).rate, top, rtol=1e-12)
        assert law.at(0.9 * ramp * duration).rate < 0.99 * top
        np.testing.assert_allclose(law.at(ramp * duration / 2).rate, top / 2, rtol=1e-12)


def test_ramp_is_a_quarter_if_left_out() -> None:
    assert RAMP == 0.25
    np.testing.assert_array_equal(TrapezoidalLaw(1.0, 8.0).knots, [0, 2, 6, 8])
    np.testing.assert_array_equal(SCurveLaw(1.0, 8.0).knots, [0, 1, 2, 6, 7, 8])


def test_a_ramp_of_a_half_leaves_no_cruise() -> None:
    np.testing.assert_array_equal(TrapezoidalLaw(1.0, 8.0, ramp=0.5).knots, [0, 4, 8])
    np.testing.assert_array_equal(SCurveLaw(1.0, 8.0, ramp=0.5).knots, [0, 2, 4, 6, 8])


@each("kind", LAWS)
@each("shape", [(), (1,), (2, 3), (0,)])
def test_values_have_the_shape_of_the_times(kind: type[Law], shape: tuple[int, ...]) -> None:
    assert [x.shape for x in kind(1.0, 2.0).at(np.ones(shape))] == [shape] * 3


@pytest.mark.parametrize("kind", LAWS)
def test_times_outside_are_refused(kind: type[Law]) -> None:
    for bad in (-1e-3, 2.001, np.nan, [1.0, np.inf]):
        with pytest.raises(InputError, match=r"outside .* 0 to 2 s"):
            kind(1.0, 2.0).at(bad)


@pytest.mark.parametrize("kind", LAWS)
def test_repr_tells_distance_and_duration(kind: type[Law]) -> None:
    assert repr(kind(1.5, 2.0)) == f"{kind.__name__}(distance=1.5, duration=2)"


# Within limits ------------------------------------------------------------------------------------


@given(st.sampled_from(LAWS), DISTANCES, LIMITS, LIMITS, LIMITS)
def test_limits_are_kept_and_one_is_reached(
    kind: type[Law], distance: float, speed: float, acceleration: float, jerk: float
) -> None:
    if kind is TrapezoidalLaw:
        jerk = math.inf
        acceleration = 1.0 if math.isinf(acceleration) else acceleration
    elif math.isinf(jerk):
        jerk = 1.0
    law = kind.within(distance, speed=speed, acceleration=acceleration, jerk=jerk)
    top = peaks(law)
    used = [ratio(*pair) for pair in zip(top, (speed, acceleration, jerk), strict=True)]
    assert law.distance == pytest.approx(distance, rel=1e-13)
    assert max(used) == pytest.approx(1.0, rel=uncertainty(law))


def shortest(D: float, v: float, a: float, j: float) -> float:
    """Duration by the highest speed that can be reached in half of the way: a root.

    The push to a speed p takes p/a + a/j, or 2 sqrt(p/j) where a is not reached; being symmetric,
    it covers p/2 on average.
    """

    def push(p: float) -> float:
        return p / a + a / j if p * j >= a * a else 2 * math.sqrt(p / j)

    def beyond(log_p: float) -> float:
        return math.log(math.exp(log_p) * push(math.exp(log_p)) / D)

    reached = math.exp(brentq(beyond, -60.0, 60.0, xtol=1e-14, rtol=1e-15))
    top = min(v, reached)
    return push(top) + D / top


@given(DISTANCES, LIMITS, POSITIVE)
def test_nothing_is_shorter_than_the_trapezoid(D: float, v: float, a: float) -> None:
    law = TrapezoidalLaw.within(D, speed=v, acceleration=a)
    assert law.duration == pytest.approx(shortest(D, v, a, math.inf), rel=1e-12)


@given(DISTANCES, LIMITS, LIMITS, POSITIVE)
def test_s_curve_reaches_the_highest_speed_it_can(D: float, v: float, a: float, j: float) -> None:
    law = SCurveLaw.within(D, speed=v, acceleration=a, jerk=j)
    assert law.duration == pytest.approx(shortest(D, v, min(a, 1e30), j), rel=1e-12)


def book(D: float, v: float, a: float, j: float) -> tuple[str, float]:
    """Case and duration of the double S (Biagiotti and Melchiorri, 2008, section 3.4.1)."""
    if v * j < a * a:  # the largest acceleration is not reached before the speed is
        rise, push, case = math.sqrt(v / j), 2 * math.sqrt(v / j), "speed"
    else:
        rise, push, case = a / j, a / j + v / a, "acceleration and speed"
    if D / v >= push:
        return case, D / v + push
    rise = a / j
    push = rise / 2 + math.sqrt((rise / 2) ** 2 + D / a)
    if push >= 2 * rise:
        return "acceleration", 2 * push
    return "neither", 4 * (D / (2 * j)) ** (1 / 3)


SEGMENTS = {"speed": 5, "acceleration and speed": 7, "acceleration": 6, "neither": 4}


@given(DISTANCES, POSITIVE, POSITIVE, POSITIVE)
def test_s_curve_s_duration_is_the_textbook_s(D: float, v: float, a: float, j: float) -> None:
    _, expected = book(D, v, a, j)
    law = SCurveLaw.within(D, speed=v, acceleration=a, jerk=j)
    assert law.duration == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("case", "limits"),
    [
        ("acceleration and speed", (10.0, 2.0, 3.0, 5.0)),
        ("speed", (10.0, 2.0, 30.0, 5.0)),
        ("speed", (10.0, 2.0, math.inf, 5.0)),
        ("acceleration", (10.0, 20.0, 3.0, 5.0)),
        ("acceleration", (10.0, math.inf, 3.0, 5.0)),
        ("neither", (10.0, 20.0, 30.0, 5.0)),
        ("neither", (10.0, math.inf, math.inf, 5.0)),
    ],
)
def test_every_case_of_the_s_curve_has_its_pieces(
    case: str, limits: tuple[float, float, float, float]
) -> None:
    D, v, a, j = limits
    finite = (D, min(v, 1e6), min(a, 1e6), j)
    found, expected = book(*finite)
    law = SCurveLaw.within(D, speed=v, acceleration=a, jerk=j)
    assert found == case
    assert len(law.knots) - 1 == SEGMENTS[case]
    assert law.duration == pytest.approx(expected, rel=1e-13)
    assert (peaks(law).speed == pytest.approx(v)) == ("speed" in case)
    assert (peaks(law).acceleration == pytest.approx(a)) == ("acceleration" in case)


@given(POSITIVE, POSITIVE)
def test_rounding_leaves_no_sliver_of_a_cruise(D: float, a: float) -> None:
    assert len(TrapezoidalLaw.within(D, acceleration=a).knots) - 1 == 2
    assert len(SCurveLaw.within(D, jerk=a).knots) - 1 == SEGMENTS["neither"]
    jerk = 100 * math.sqrt(a**3 / D)
    found = SCurveLaw.within(D, acceleration=a, jerk=jerk)
    assert len(found.knots) - 1 == SEGMENTS["acceleration"]


@given(DISTANCES, POSITIVE)
def test_jerk_alone_makes_four_pieces_without_a_cruise_of_rounding(D: float, j: float) -> None:
    law = SCurveLaw.within(D, jerk=j)
    np.testing.assert_allclose(np.diff(law.knots) / law.duration, [0.25] * 4, rtol=1e-14)


@pytest.mark.parametrize("edge", [1 - 1e-15, 1.0, 1 + 1e-15])
def test_the_cases_of_the_s_curve_join(edge: float) -> None:
    """Where a piece is just about to vanish, rounding decides, and the law is the same."""
    # v j = a^2; and D = v push; both at once with v = a = j = 1, D = 2.
    law = SCurveLaw.within(2.0, speed=edge, acceleration=1.0, jerk=1.0)
    assert law.duration == pytest.approx(4.0, rel=1e-14)
    t = np.linspace(0, 1, 20)
    np.testing.assert_allclose(law.at(t).u, t**3 / 6, rtol=0, atol=1e-14)


def farthest(steps: int, h: float, v: float, a: float, j: float) -> float:
    """Longest way from rest to rest in a duration: a linear program in the jerk of each step.

    Speed is limited at the steps only; between them it can exceed v by j h^2 / 8.
    """
    # a_k = sum j_i h,  v_k = sum j_i h^2 (k - i - 1/2),  x_n = sum j_i h^3 ((n-i)^3 - (n-i-1)^3)/6
    k, i = np.indices((steps + 1, steps))
    past = i < k
    to_a = past * h
    to_v = past * (k - i - 0.5) * h**2
    left = steps - np.arange(steps)
    to_x = (left**3 - (left - 1) ** 3) / 6 * h**3
    rows = np.concatenate([to_a, -to_a, to_v, -to_v])
    limits = np.repeat([a, a, v, v], steps + 1)
    ends: Any = np.stack([to_a[-1], to_v[-1]])
    solved = linprog(-to_x, rows, limits, ends, [0.0, 0.0], bounds=(-j, j))
    assert solved.status == 0
    return -float(solved.fun)


@each("rise", [3, 6])
@each(("steady", "cruise"), [(4, 7), (4, 0), (0, 7), (0, 0)], ids=["all", "v-", "a-", "neither"])
def test_nothing_is_shorter_than_the_s_curve(rise: int, steady: int, cruise: int) -> None:
    """In its duration, no jerk within the limits goes farther: a program that can do its pieces."""
    h, j = 0.1, 2.0
    r, s = rise * h, steady * h
    top_a, top_v = j * r, j * r * (r + s)
    v = top_v if cruise else 1.3 * top_v
    a = top_a if steady else 1.3 * top_a
    D = top_v * (2 * r + s + cruise * h)
    law = SCurveLaw.within(D, speed=v, acceleration=a, jerk=j)
    steps = 4 * rise + 2 * steady + cruise
    assert law.duration == pytest.approx(steps * h, rel=1e-13)
    assert 0 <= farthest(steps, h, v, a, j) / D - 1 + 1e-9 <= law.duration * j * h**2 / 8 / D + 2e-9


@given(DISTANCES, LIMITS, POSITIVE)
def test_with_much_jerk_the_s_curve_is_the_trapezoid(D: float, v: float, a: float) -> None:
    quick = TrapezoidalLaw.within(D, speed=v, acceleration=a)
    jerk = 1e9 * a / quick.duration
    smooth = SCurveLaw.within(D, speed=v, acceleration=a, jerk=jerk)
    # Each push takes as long as a jerk takes to raise the acceleration longer, at most.
    late = smooth.duration - quick.duration
    assert -1e-12 * quick.duration <= late <= 2 * a / jerk + 1e-12 * quick.duration


@each(
    ("kind", "limits", "message"),
    [
        (QuinticLaw, {}, "quintic law needs a limit of speed, acceleration or jerk"),
        (TrapezoidalLaw, {"speed": 1.0}, "needs a limit of acceleration"),
        (
            TrapezoidalLaw,
            {"acceleration": 1.0, "jerk": 1.0},
            "cannot limit the jerk; .* 's-curve'",
        ),
        (SCurveLaw, {"speed": 1.0, "acceleration": 1.0}, "needs a limit of jerk"),
        *((kind, {"speed": bad}, "limit of speed = ") for kind in LAWS for bad in (0.0, -1, "a")),
        (SCurveLaw, {"jerk": math.nan}, "limit of jerk = nan: it must be a positive number"),
        (SCurveLaw, {"jerk": -math.inf}, "limit of jerk = -inf"),
        (QuinticLaw, {"acceleration": True}, "limit of acceleration = True"),
        (QuinticLaw, {"acceleration": [1.0]}, "limit of acceleration"),
        (QuinticLaw, {"acceleration": 1e-99}, "1e-99: it must be .* from 1e-50 to 1e"),
    ],
)
def test_limits_that_make_no_law_are_refused(
    kind: Any, limits: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        kind.within(1.0, **limits)


BAD_NUMBERS = [
    0.0,
    -1.0,
    math.nan,
    math.inf,
    -math.inf,
    "long",
    None,
    True,
    [1.0],
    1e-60,
    1e60,
    pytest.param(10**400, id="huge"),
]


@each("kind", LAWS)
@each("bad", BAD_NUMBERS)
def test_distances_and_durations_that_are_none_are_refused(kind: Any, bad: Any) -> None:
    with pytest.raises(InputError, match="distance = "):
        kind(bad, 1.0)
    with pytest.raises(InputError, match="duration = "):
        kind(1.0, bad)
    with pytest.raises(InputError, match="distance = "):
        kind.within(bad, acceleration=1.0, **({} if kind is TrapezoidalLaw else {"jerk": 1.0}))


@each("kind", [TrapezoidalLaw, SCurveLaw])
@each("bad", [*BAD_NUMBERS, np.nextafter(0.5, 1)])
def test_ramps_that_are_none_are_refused(kind: Any, bad: Any) -> None:
    with pytest.raises(InputError, match="ramp = "):
        kind(1.0, 1.0, ramp=bad)


# By name ------------------------------------------------------------------------------------------

NAMES = {"quintic": QuinticLaw, "trapezoidal": TrapezoidalLaw, "s-curve": SCurveLaw}


@pytest.mark.parametrize("name", NAMES)
def test_time_law_makes_the_law_of_the_name(name: Any) -> None:
    limits = {"acceleration": 2.0} | ({} if name == "trapezoidal" else {"jerk": 5.0})
    pairs: list[tuple[TimeLaw, TimeLaw]] = [
        (time_law(3.0, name, duration=2.0), NAMES[name](3.0, 2.0)),
        (time_law(3.0, name, **limits), NAMES[name].within(3.0, **limits)),  # type: ignore[attr-defined]
    ]
    for found, expected in pairs:
        assert type(found) is NAMES[name]
        t = np.linspace(0, expected.duration, 30)
        np.testing.assert_array_equal(found.at(t), expected.at(t))


@pytest.mark.parametrize("bad", ["cubic", None, 3, "Quintic", ["quintic"]])
def test_other_profiles_are_refused_with_the_choice(bad: Any) -> None:
    with pytest.raises(InputError, match="must be 'quintic' or 'trapezoidal' or 's-curve'"):
        time_law(1.0, bad, duration=1.0)


def test_duration_and_limits_exclude_each_other() -> None:
    with pytest.raises(InputError, match="neither is given"):
        time_law(1.0, "quintic")
    with pytest.raises(InputError, match="both are given"):
        time_law(1.0, "quintic", duration=1.0, jerk=1.0)

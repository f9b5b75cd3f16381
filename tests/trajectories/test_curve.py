"""A law of time in a curve: the chain rule against the composition's own derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from rps_pin import InputError
from rps_pin.trajectories import (
    ChordSpline,
    Curve,
    CurveSample,
    HarmonicCurve,
    HelixCurve,
    LawSample,
    LineCurve,
    PathSample,
    QuinticLaw,
    TimedCurve,
)
from tests.trajectories.differences import difference
from tests.trajectories.law_checks import LAWS, RAMPS, inside

Array = NDArray[np.float64]

T, U = sympy.symbols("t u")
LAW = sympy.sin(T) + T**2
CURVE = [U**3 - U, sympy.exp(-U), sympy.cos(2 * U)]


def values(expressions: list[sympy.Expr], symbol: sympy.Symbol, order: int, x: Array) -> Array:
    """Derivatives of some order, stacked along the last axis."""
    found = [sympy.lambdify(symbol, sympy.diff(e, symbol, order)) for e in expressions]
    return np.stack([np.broadcast_to(f(x), x.shape) for f in found], axis=-1)


class Law:
    duration = 2.0

    def at(self, t: ArrayLike) -> LawSample:
        times = np.asarray(t)
        assert ((times >= 0) & (times <= self.duration)).all()
        return LawSample(*(values([LAW], T, order, times)[..., 0] for order in range(3)))

    def __repr__(self) -> str:
        return "Law()"


class Bends:
    length = 4 + np.sin(2)

    def at(self, u: ArrayLike) -> CurveSample:
        return CurveSample(*(values(CURVE, U, order, np.asarray(u)) for order in range(3)))

    def __repr__(self) -> str:
        return "Bends()"


TIMED = TimedCurve(Bends(), Law())


@pytest.mark.parametrize("shape", [(), (1,), (7,), (2, 3), (0,), (4, 0, 2)])
def test_sample_is_the_composition_s_own_derivatives(shape: tuple[int, ...]) -> None:
    composed = [sympy.sympify(x).subs(U, LAW) for x in CURVE]
    t = np.random.default_rng(1).uniform(0, 2, shape)
    found = TIMED.sample(t)
    assert isinstance(found, PathSample)
    for order, one in enumerate(found):
        assert one.shape == (*shape, 3)
        np.testing.assert_allclose(one, values(composed, T, order, t), rtol=1e-12, atol=1e-12)


CURVES: list[Curve] = [
    LineCurve([0.2, 0.1, 0.0], [0.3, -0.1, 0.2]),
    ChordSpline([[0.2, 0.1, 0.0], [0.25, 0.3, 0.1], [0.2, 0.0, 0.2], [0.3, 0.1, 0.1]]),
    HarmonicCurve([0.3, 0, 0.1], [0.02, 0.2, 0.1], [3, 1, 2], [0.5, 0, 1], 4.0),
    HelixCurve(0.3, 0.05, 0.4),
]


@pytest.mark.parametrize("curve", CURVES, ids=lambda curve: type(curve).__name__)
@pytest.mark.parametrize("kind", LAWS)
@given(st.floats(0.1, 10), RAMPS)
def test_every_curve_can_run_by_every_law(
    curve: Curve, kind: Any, duration: float, ramp: float
) -> None:
    """Rate and acceleration are the derivatives by time where nothing jumps."""
    shape: dict[str, Any] = {} if kind is QuinticLaw else {"ramp": ramp}
    law = kind(curve.length, duration, **shape)
    path = TimedCurve(curve, law)
    t, step = inside(law)
    step = step / 64  # the differences' error, of sixth order, is then no more than rounding's
    if isinstance(curve, ChordSpline):  # its third derivative jumps at its knots
        u = [law.at(t + 3 * k * step).u for k in (-1, 1)]
        smooth = np.equal(*(np.searchsorted(curve.knots, one) for one in u))
        t, step = t[smooth], step[smooth]
    found, size = path.sample(t), [np.abs(x).max() for x in path.sample(t)]
    for k in (1, 2):
        slope = difference(lambda x, k=k: path.sample(x)[k - 1], t, step)
        rounding = 1e-14 * size[k - 1] / step[:, None]
        assert (np.abs(found[k] - slope) <= 1e-9 * size[k] + rounding).all()


def test_it_keeps_its_curve_and_its_law_and_lasts_as_long_as_the_law() -> None:
    assert isinstance(TIMED.curve, Bends)
    assert isinstance(TIMED.law, Law)
    assert TIMED.duration == 2.0
    assert repr(TIMED) == "TimedCurve(Bends(), Law())"


def test_rounding_beyond_the_end_does_not_reach_the_law() -> None:
    beyond = np.nextafter(2.0, 3.0)
    np.testing.assert_array_equal(TIMED.sample(beyond).pose, TIMED.sample(2.0).pose)


@pytest.mark.parametrize("bad", [-1e-3, 2.001, np.nan, [0.0, np.inf]])
def test_times_outside_are_refused(bad: ArrayLike) -> None:
    with pytest.raises(InputError, match="outside the trajectory, which runs from 0 to 2 s"):
        TIMED.sample(bad)


def test_things_that_are_no_times_are_refused() -> None:
    with pytest.raises(InputError, match=r"times = .*must be numbers"):
        TIMED.sample("soon")

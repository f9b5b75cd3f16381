"""Completion in generated code keeps the assembly mode of its guess, near and far, in batches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rps_pin.errors import ClosureError, SingularityError
from tests.closed_loop.test_complete import (
    Linkage,
    double_rocker,
    drawn,
    five_bar,
    four_bar,
    jansen,
    wrapped,
)
from tests.codegen.engines import QUICK
from tests.worst import worst


@pytest.mark.parametrize(("make", "seed"), [(four_bar, 3), (five_bar, 5), (jansen, 0)])
def test_never_another_branch(
    make: Callable[[np.random.Generator], Linkage | None], seed: int
) -> None:
    """Against circle intersection; what ends in a singularity is NaN."""
    one, rng = drawn(make, seed)
    fast, start = one.mechanism.compile(compiler=QUICK), one.exact(one.start)[0]
    reach = 4.0 / one.start.size
    goals = one.start + rng.uniform(-reach, reach, (30, one.start.size))
    found = fast.complete(goals, start, errors="mask")
    right = 0
    for goal, q in zip(goals, found, strict=True):
        way = [one.exact(one.start + s * (goal - one.start))[1] for s in np.linspace(0, 1, 301)]
        if min(way) > 2e-3:
            assert worst(np.abs(wrapped(q - one.exact(goal)[0]))) < 1e-9
            right += 1
        elif min(way) < -2e-3:
            assert np.isnan(q).all()
    assert right >= 6


def test_hands_over_what_it_does_not_follow() -> None:
    """Open guesses, jumps, and ways that end, as in the Pinocchio engine."""
    mechanism, q = double_rocker()
    fast = mechanism.compile(compiler=QUICK)
    rough = q + np.array([0.05, -0.02, 0.03])
    expected = mechanism.complete([0.7], rough)
    np.testing.assert_allclose(fast.complete([0.7], rough), expected, rtol=0, atol=1e-12)
    far = [0.6 + 2 * np.pi]
    with pytest.raises(SingularityError, match="a singularity is met"):
        fast.complete(far, q)
    with pytest.raises(ClosureError, match="stays open"):
        fast.complete([3.0], q)
    assert fast.loop_gap(fast.complete(far, q, jump=True)) < 1e-12
    by_guess = fast.complete([0.7], np.array([q, fast.complete([0.9], q)]))
    np.testing.assert_allclose(by_guess[0], by_guess[1], rtol=0, atol=1e-12)

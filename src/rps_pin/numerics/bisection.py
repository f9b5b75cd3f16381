"""Bisection of many brackets at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rps_pin.arrays import Array, Bools, Indices


def bisected(
    same_as_low: Callable[[Array, Indices], Bools], low: Array, high: Array, width: float
) -> tuple[Array, Array]:
    """Return brackets of at most `width` around changes of a condition, all halved together.

    The condition may be a sign or any other test, and what it is at the ends is taken from the
    caller. (`scipy.optimize.elementwise.find_root` needs values of opposite signs at both ends,
    and stops at an exact zero without closing its bracket.)

    Parameters
    ----------
    same_as_low
        Of arguments (n,) and of the index of the bracket that each belongs to, (n,): whether the
        condition is as at `low` there.
    low, high
        Ends, shape (n,) each; `high` may be the smaller one.
    width
        Widest bracket to end with; at the least the spacing of floats.

    Returns
    -------
    low, high : arrays
        Shape (n,) each.
    """
    low, high = low.copy(), high.copy()
    which = np.arange(low.size)
    while True:
        middle = (low[which] + high[which]) / 2
        wide = np.abs(high - low)[which] > width
        wide &= (middle != low[which]) & (middle != high[which])  # no further than floats go
        which, middle = which[wide], middle[wide]
        if not which.size:
            return low, high
        stays = same_as_low(middle, which)
        low[which[stays]], high[which[~stays]] = middle[stays], middle[~stays]

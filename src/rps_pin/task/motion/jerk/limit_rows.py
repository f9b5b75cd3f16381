"""Limits along a time law, and their slopes by the law.

What is limited is multiplied by a power of kappa, by how much longer a law of the same shape takes:

    m u'' + c u'^2 + (friction + g) kappa^2 <= F kappa^2,     d_u u' <= V kappa,
    d_u u''' + 3 d_uu u' u'' + d_uuu u'^3 <= J kappa^3,

with derivatives by t at kappa = 1. The slopes are those at kappa = 1. On a straight line with
constant m and g, what keeps these limits made linear keeps the limits themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.task.motion.curve_dynamics import CurveDynamics, LimitUse
from rps_pin.task.motion.jerk.curve_table import CurveTable, TableRow
from rps_pin.task.motion.jerk.jerk_profile import JerkProfile, LawPieces

#: Where in each piece limits are imposed.
IMPOSED = np.array([0.0, 0.5, 1.0])


class LimitRows(NamedTuple):
    """Limits as value <= 0, relative to themselves, and their slopes; (n, m, r) each.

    Slopes are by u / length, and its derivatives by t / duration.
    """

    value: Array
    by_place: Array
    by_rate: Array
    by_acceleration: Array
    by_jerk: Array
    by_duration: Array
    """By kappa."""

    @property
    def excess(self) -> float:
        """By how much a limit is exceeded at most."""
        return float(self.value.max(initial=0.0))


def limit_rows(
    dynamics: CurveDynamics, table: CurveTable, profile: JerkProfile, tightened: Array
) -> LimitRows:
    """Return the limits of a law at the places where they are imposed.

    Parameters
    ----------
    dynamics, table
        What is limited, and its terms.
    profile
        The law, of n pieces.
    tightened
        By how much each limit is tightened in each piece, shape (n, sides), relative.
    """
    law = profile.within(IMPOSED)
    law = law._replace(rate=law.rate.clip(0.0))
    row, slope, fourth = table.at(law.u, profile.phase)
    least, largest = dynamics.bounds.jerks
    levels = _levels(dynamics, law, row, slope)
    speeds = _speeds(dynamics, law, row, slope)
    jerks = _jerks(law, row, slope, fourth)
    sides = [
        np.concatenate([one, -one, two, three / largest, three / least], axis=-1)
        for one, two, three in zip(levels, speeds, jerks, strict=True)
    ]
    k, fast, j = (part.shape[-1] for part in (levels[0], speeds[0], jerks[0]))
    kept = (1 - tightened)[:, None]
    kept = np.concatenate([kept, kept[..., 2 * k + fast :]], axis=-1)
    by_time = profile.length / profile.duration ** np.arange(4)
    value, *slopes, by_duration = sides
    found = (
        value - kept,
        *(part * by for part, by in zip(slopes, by_time, strict=True)),
        by_duration - kept * np.repeat([2, 1, 3], [2 * k, fast, 2 * j]),
    )
    either = dynamics.limited
    limited = np.concatenate([either[: 2 * k + fast], np.isfinite(largest), np.isfinite(least)])
    return LimitRows(*(part[..., limited] for part in found))


def limit_use(
    dynamics: CurveDynamics, table: CurveTable, profile: JerkProfile, share: Array
) -> LimitUse:
    """Return what a law uses of the limits, by the table, at shares (m,) of its pieces, (n, m)."""
    law = profile.within(share)
    law = law._replace(rate=law.rate.clip(0.0))
    row, slope, _ = table.at(law.u, profile.phase)
    levels = row.levels(law.rate, law.acceleration)
    if dynamics.has_friction:
        levels = levels + dynamics.friction(law.u, law.rate**2)[0]
    jerks = row.jerks(slope.second, law.rate, law.acceleration, law.jerk)
    return dynamics.use_of(levels, row.speed_slope * law.rate[..., None], jerks)


def _levels(
    dynamics: CurveDynamics, law: LawPieces, row: TableRow, slope: TableRow
) -> tuple[Array, ...]:
    """Return levels over their limits, and slopes by u, u', u'', u''' and kappa, (n, m, k)."""
    r = law.rate[..., None]
    friction = rubs = none = np.zeros_like(row.holding)
    if dynamics.has_friction:
        friction, by_square = dynamics.friction(law.u, law.rate**2)
        rubs = 2 * r * by_square
    still = row.holding + friction - dynamics.middle
    found = (
        row.levels(law.rate, law.acceleration) + friction - dynamics.middle,
        slope.levels(law.rate, law.acceleration),
        2 * row.velocity_product * r + rubs,
        row.inertia,
        none,
        2 * still - rubs * r,
    )
    return tuple(part / dynamics.half for part in found)


def _speeds(
    dynamics: CurveDynamics, law: LawPieces, row: TableRow, slope: TableRow
) -> tuple[Array, ...]:
    """Return speeds over their limits, and slopes as those of levels, (n, m, l)."""
    least, largest = dynamics.bounds.speeds
    r = law.rate[..., None]
    over = np.where(row.speed_slope < 0, 1 / least, 1 / largest)
    found, none = row.speed_slope * over, np.zeros_like(over)
    return found * r, slope.speed_slope * over * r, found, none, none, none


def _jerks(law: LawPieces, row: TableRow, slope: TableRow, fourth: Array) -> tuple[Array, ...]:
    """Return jerks, and slopes as those of levels, (n, m, j)."""
    r, a, third = law.rate[..., None], law.acceleration[..., None], slope.second
    return (
        row.jerks(third, *law[1:]),
        slope.jerks(fourth, *law[1:]),
        3 * row.second * a + 3 * third * r**2,
        3 * row.second * r,
        row.first,
        np.zeros_like(third),
    )

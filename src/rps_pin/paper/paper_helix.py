"""The helix with Eq. 5 and 29 corrected or as printed, and parts of trajectories."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.paper.paper_data import (
    BRAKE_START,
    END,
    HELIX_HEIGHT,
    HELIX_PITCH,
    HELIX_RADIUS,
    PRINTED_TIMES,
    RAMP_END,
    ROOT,
)
from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.helix import Branch, HelixPath, helix
from rps_pin.trajectories.path import PathSample, Trajectory, checked_times

#: An equation corrected, or as the paper prints it.
Form = Literal["corrected", "printed"]


def printed_turn(t: ArrayLike) -> tuple[Array, Array, Array]:
    """Return phi and its first two derivatives at times (...), s: Eq. 29 as printed.

    The last branch is pi (-2 - 9 pi^2 + 4 (1 + sqrt(1 + 9 pi^2)) t^2 - 4 t^2) / sqrt(1 + 9 pi^2):
    phi jumps where it begins.
    """
    return _turn(t, _printed_branch)


def corrected_turn(t: ArrayLike) -> tuple[Array, Array, Array]:
    """Return the same with 4 (1 + sqrt(1 + 9 pi^2)) t instead of ... t^2 in the last branch."""
    return _turn(t, _corrected_branch)


class PaperHelix:
    """The helix of Eq. 26 to 28, with Eq. 5 and Eq. 29 corrected or as printed.

    On p_x = r cos(phi), p_y = r sin(phi), Eq. 5 gives a constant tilt beta, r = h sin^2(beta/2),
    and alpha = pi/2 - phi/2; Eq. 5 as printed gives alpha = phi/2 - pi/4, and the legs then carry
    the centre along another helix. The two branches are (alpha, beta) and (alpha, -beta).

    Parameters
    ----------
    platform_radius, radius, pitch, height
        h, r_h, p_h and z_0, m.
    branch
        ``"+"`` or ``"-"``, as in `rps_pin.trajectories.helix`.
    eq_5, eq_29
        ``"corrected"`` or ``"printed"``.

    Raises
    ------
    InputError
        If r_h exceeds h.
    """

    def __init__(
        self,
        platform_radius: float,
        radius: float,
        pitch: float,
        height: float,
        *,
        branch: Branch = "+",
        eq_5: Form = "corrected",
        eq_29: Form = "corrected",
    ) -> None:
        if radius > platform_radius:
            raise InputError(
                f"r_h = {radius:g} m exceeds h = {platform_radius:g} m: the centre of the platform "
                "does not reach the helix"
            )
        self.duration = END
        self.jumps = eq_29 == "printed"
        self._height, self._climb = height, pitch / (2 * math.pi)
        self._turn = printed_turn if self.jumps else corrected_turn
        self._tilt = 2 * math.asin(math.sqrt(radius / platform_radius))
        if branch == "-":
            self._tilt = -self._tilt
        self._alpha = (math.pi / 2, -0.5) if eq_5 == "corrected" else (-math.pi / 4, 0.5)

    def sample(self, t: ArrayLike) -> PathSample:
        """Return pose, rate and acceleration at times t of shape (...), s; exact."""
        phi, dphi, ddphi = self._turn(checked_times(t, self.duration))
        first, slope = self._alpha
        alpha, dalpha, ddalpha = first + slope * phi, slope * dphi, slope * ddphi
        # w = beta (-sin(alpha), cos(alpha)), and dw/dalpha = -beta (cos(alpha), sin(alpha)).
        w = self._tilt * np.stack([-np.sin(alpha), np.cos(alpha)], axis=-1)
        by_alpha = -self._tilt * np.stack([np.cos(alpha), np.sin(alpha)], axis=-1)
        dw = by_alpha * dalpha[..., None]
        ddw = by_alpha * ddalpha[..., None] - w * (dalpha**2)[..., None]
        return PathSample(
            _pose(self._height + self._climb * phi, w),
            _pose(self._climb * dphi, dw),
            _pose(self._climb * ddphi, ddw),
        )


def regular_helix(robot: RPSRobot, branch: Branch = "+") -> HelixPath:
    """Return Table 1's helix with z_0 = 0.4 m instead of 0.4 mm: it meets no singularity."""
    return helix(
        robot,
        radius=1e-3 * HELIX_RADIUS,
        pitch=1e-3 * HELIX_PITCH,
        height=HELIX_HEIGHT,
        branch=branch,
    )


class PartOfPath:
    """A part of a trajectory, as a trajectory that begins at time 0."""

    def __init__(self, whole: Trajectory, start: float, end: float) -> None:
        self.whole = whole
        self.start = start
        self.duration = end - start

    def sample(self, t: ArrayLike) -> PathSample:
        """Return pose, rate and acceleration at times t of shape (...), s."""
        times = checked_times(t, self.duration) + self.start
        return self.whole.sample(np.minimum(times, self.start + self.duration))


def smooth_parts(path: PaperHelix) -> tuple[PartOfPath, ...]:
    """Return the parts in which a helix does not jump: two if Eq. 29 is as printed."""
    if path.jumps:
        # The first ends on the middle branch's side of the jump.
        return PartOfPath(path, 0.0, BRAKE_START - 1e-12), PartOfPath(path, BRAKE_START, END)
    return (PartOfPath(path, 0.0, END),)


class HelixLaw(NamedTuple):
    """Times, angles and speeds that follow from Eq. 29."""

    end: float
    """First time after the brakes go on at which phi' is zero, s."""
    turn_at_end: float
    """phi there, rad."""
    greatest_speed: float
    """Of the centre with r_h = 0.75 and p_h = 0.5, units/s."""
    ramp: float
    """Its acceleration along the path while phi' rises, units/s^2."""
    turn_at_printed_end: float
    """phi at Table 1's t_t = 5.2 s, rad."""
    printed_end_turn: float
    """phi at the end with the last branch as printed, rad."""
    printed_end_rate: float
    """phi' there, rad/s."""


def helix_law() -> HelixLaw:
    """Return the properties of Eq. 29, corrected and as printed, by root finding and sampling."""

    def rate(t: float) -> float:
        return float(corrected_turn(t)[1])

    end = float(brentq(rate, BRAKE_START, 6.0, xtol=1e-14))
    times = np.linspace(0.0, end, 20_001)
    phi, _, _ = corrected_turn(times)
    radius, climb = HELIX_RADIUS, HELIX_PITCH / (2 * math.pi)
    path = np.stack([radius * np.cos(phi), radius * np.sin(phi), climb * phi], axis=-1)
    speed = np.linalg.norm(np.gradient(path, times, axis=0, edge_order=2), axis=-1)
    rising = times < RAMP_END - 0.01
    ramp = np.polynomial.polynomial.polyfit(times[rising], speed[rising], 1)[1]
    last = printed_turn(end)
    return HelixLaw(
        end,
        float(corrected_turn(end)[0]),
        float(speed.max()),
        float(ramp),
        float(corrected_turn(PRINTED_TIMES[2])[0]),
        float(last[0]),
        float(last[1]),
    )


def _pose(z: Array, tilt: Array) -> Array:
    return np.concatenate([z[..., None], tilt], axis=-1)


def _turn(
    t: ArrayLike, last_branch: Callable[[Array], tuple[Array, Array, Array]]
) -> tuple[Array, Array, Array]:
    times = np.asarray(t, dtype=np.float64)
    rising, falling = times < RAMP_END, times >= BRAKE_START
    first = (4 * times**2, 8 * times, np.full_like(times, 8.0))
    middle = (4 * times - 1, np.full_like(times, 4.0), np.zeros_like(times))
    phi, rate, acceleration = (
        math.pi / ROOT * np.select([rising, falling], [one, three], two)
        for one, two, three in zip(first, middle, last_branch(times), strict=True)
    )
    return phi, rate, acceleration


def _printed_branch(t: Array) -> tuple[Array, Array, Array]:
    slope = 4 * (1 + ROOT) - 4
    return -2 - 9 * math.pi**2 + slope * t**2, 2 * slope * t, np.full_like(t, 2 * slope)


def _corrected_branch(t: Array) -> tuple[Array, Array, Array]:
    first = 4 * (1 + ROOT)
    return -2 - 9 * math.pi**2 + first * t - 4 * t**2, first - 8 * t, np.full_like(t, -8.0)

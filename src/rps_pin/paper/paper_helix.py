"""The helix with Eq. 5 and 29 corrected or as printed, and parts of trajectories."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from rps_pin.arrays import Array, ComplexArray
from rps_pin.errors import InputError
from rps_pin.paper import paper_data as paper
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
    return _turn(t, _PRINTED)


def corrected_turn(t: ArrayLike) -> tuple[Array, Array, Array]:
    """Return the same with 4 (1 + sqrt(1 + 9 pi^2)) t instead of ... t^2 in the last branch."""
    return _turn(t, _CORRECTED)


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
        self.duration = paper.END
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
        # As a complex number, w is i beta exp(i alpha), and w' = i alpha' w.
        w, turning = 1j * self._tilt * np.exp(1j * (first + slope * phi)), 1j * slope * dphi
        return PathSample(
            _pose(self._height + self._climb * phi, w),
            _pose(self._climb * dphi, turning * w),
            _pose(self._climb * ddphi, (1j * slope * ddphi + turning**2) * w),
        )


def regular_helix(robot: RPSRobot, branch: Branch = "+") -> HelixPath:
    """Return Table 1's helix with z_0 = 0.4 m instead of 0.4 mm: it meets no singularity."""
    return helix(
        robot,
        radius=1e-3 * paper.HELIX_RADIUS,
        pitch=1e-3 * paper.HELIX_PITCH,
        height=paper.HELIX_HEIGHT,
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
        brake = paper.BRAKE_START
        return PartOfPath(path, 0.0, brake - 1e-12), PartOfPath(path, brake, paper.END)
    return (PartOfPath(path, 0.0, paper.END),)


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

    end = float(brentq(rate, paper.BRAKE_START, 6.0, xtol=1e-14))
    times = np.linspace(0.0, end, 20_001)
    phi, _, _ = corrected_turn(times)
    radius, climb = paper.HELIX_RADIUS, paper.HELIX_PITCH / (2 * math.pi)
    path = np.stack([radius * np.cos(phi), radius * np.sin(phi), climb * phi], axis=-1)
    speed = np.linalg.norm(np.gradient(path, times, axis=0, edge_order=2), axis=-1)
    rising = times < paper.RAMP_END - 0.01
    ramp = np.polynomial.polynomial.polyfit(times[rising], speed[rising], 1)[1]
    last = printed_turn(end)
    return HelixLaw(
        end,
        float(corrected_turn(end)[0]),
        float(speed.max()),
        float(ramp),
        float(corrected_turn(paper.PRINTED_TIMES[2])[0]),
        float(last[0]),
        float(last[1]),
    )


def _pose(z: Array, tilt: ComplexArray) -> Array:
    return np.stack([z, tilt.real, tilt.imag], axis=-1)


#: Eq. 29's phi in its three branches, without pi / sqrt(1 + 9 pi^2): coefficients of 1, t and t^2.
_RISING, _STEADY = (0.0, 0.0, 4.0), (-1.0, 4.0, 0.0)
_PRINTED = (-2 - 9 * math.pi**2, 0.0, 4 * (1 + paper.ROOT) - 4)
_CORRECTED = (-2 - 9 * math.pi**2, 4 * (1 + paper.ROOT), -4.0)


def _turn(t: ArrayLike, last: tuple[float, float, float]) -> tuple[Array, Array, Array]:
    """Return phi and its first and second time derivatives, of Eq. 29 with a last branch."""
    times = np.asarray(t, dtype=np.float64)
    branches = math.pi / paper.ROOT * np.array([_RISING, _STEADY, last])
    branch = 1 * (times >= paper.RAMP_END) + (times >= paper.BRAKE_START)
    a, b, c = np.moveaxis(branches[branch], -1, 0)
    return a + b * times + c * times**2, b + 2 * c * times, 2 * c

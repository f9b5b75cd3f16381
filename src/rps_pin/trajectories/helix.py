"""Helix of the paper (Eq. 26 to 29): the platform's centre climbs on a cylinder.

The centre of a 3-RPS moves sideways only by tilting (Eq. 4). On the circle p_x = r cos(phi),
p_y = r sin(phi), Eq. 5 gives a constant tilt beta and an axis that turns at half the speed:

    r = h/2 (1 - cos(beta)),    alpha = +-pi/2 - phi/2,    w = beta (-sin(alpha), cos(alpha)).

The two signs are the paper's (alpha, beta) and (alpha, -beta): two branches with the same centre
and opposite tilts. One turn of the helix leads from each to the other.

phi(t) is Eq. 29 with its last branch corrected (4 (1 + sqrt(1 + 9 pi^2)) t - 4 t^2 instead of
... t^2 - 4 t^2): constant acceleration for half a second, constant speed, and the same
deceleration. With r_h : p_h = 3 : 2 in one unit, the speed along the helix is one unit a
second at its highest. Other proportions keep the same phi(t).
"""

from __future__ import annotations

import math
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.trajectories.curve import CurveSample, TimedCurve
from rps_pin.trajectories.path import checked_parameters
from rps_pin.trajectories.piecewise_law import PiecewiseLaw
from rps_pin.validation import choice, finite_number, positive_number

#: Eq. 29: t_a and t_t of Table 1, the latter unrounded (5.2388 s).
PAPER_RAMP = 0.5
PAPER_DURATION = 0.5 + math.sqrt(1 + 9 * math.pi**2) / 2

Branch = Literal["+", "-"]


class _HasParameters(Protocol):
    @property
    def platform_radius(self) -> float: ...


class _Robot(Protocol):
    @property
    def parameters(self) -> _HasParameters: ...


@refuses_other_kinds
class HelixCurve:
    """The helix without a time: u is phi, from 0 to 2 pi.

    Parameters
    ----------
    tilt
        The platform's constant tilt beta, rad; negative for the branch (alpha, -beta).
    pitch, height
        The climb in the turn, and where it starts, m.

    Raises
    ------
    InputError
        If a number is not finite.
    """

    length = 2 * math.pi

    def __init__(self, tilt: float, pitch: float, height: float) -> None:
        self.tilt = finite_number(tilt, "tilt")
        self.pitch = finite_number(pitch, "pitch")
        self.height = finite_number(height, "height")

    def __repr__(self) -> str:
        return f"HelixCurve(tilt={self.tilt}, pitch={self.pitch}, height={self.height})"

    def at(self, u: ArrayLike) -> CurveSample:
        """Return pose and derivatives at phi = u of shape (...), rad."""
        phi = checked_parameters(u, self.length)
        # alpha = pi/2 - phi/2: (-sin(alpha), cos(alpha)) = (-cos(phi/2), sin(phi/2))
        w = self.tilt * np.stack([-np.cos(phi / 2), np.sin(phi / 2)], axis=-1)
        across = self.tilt * np.stack([np.sin(phi / 2), np.cos(phi / 2)], axis=-1)
        climb = np.full_like(phi, self.pitch / (2 * math.pi))
        return CurveSample(
            _pose(self.height + climb * phi, w),
            _pose(climb, across / 2),
            _pose(np.zeros_like(phi), -w / 4),
        )


@refuses_other_kinds
class HelixPath(TimedCurve):
    """A helix of the platform's centre: a `HelixCurve` and Eq. 29, corrected, scaled in time.

    See `helix` for the parameters.
    """

    curve: HelixCurve

    def __init__(
        self,
        platform_radius: float,
        radius: float,
        pitch: float,
        height: float,
        *,
        branch: Branch = "+",
        duration: float = PAPER_DURATION,
    ) -> None:
        for name, value in {"radius": radius, "pitch": pitch, "height": height}.items():
            finite_number(value, name, "metres")
        if not 0 <= radius <= platform_radius:
            raise InputError(
                f"radius = {radius} m: the centre of a platform of radius h = {platform_radius} m "
                f"reaches 0 to {platform_radius} m sideways"
            )
        positive_number(duration, "duration", "seconds")
        self.radius = radius
        self.pitch = pitch
        self.height = height
        self.branch = choice(branch, "branch", ("+", "-"))
        #: The constant tilt of the platform, rad: r = h/2 (1 - cos(beta)) = h sin^2(beta/2).
        self.tilt = 2 * math.asin(math.sqrt(radius / platform_radius))
        #: Duration of the rise and of the fall of the speed, s.
        self.ramp = duration * PAPER_RAMP / PAPER_DURATION
        speed = 2 * math.pi / (duration - self.ramp)  # of the middle piece
        pieces = [self.ramp, duration - 2 * self.ramp, self.ramp]
        law = PiecewiseLaw(pieces, [0.0] * 3, [speed / self.ramp, 0.0, -speed / self.ramp])
        tilt = self.tilt if branch == "+" else -self.tilt
        super().__init__(HelixCurve(tilt, pitch, height), law)

    def __repr__(self) -> str:
        return (
            f"HelixPath(radius={self.radius}, pitch={self.pitch}, height={self.height}, "
            f"branch={self.branch!r}, duration={self.duration:.6g})"
        )

    def turn(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return phi and its first and second time derivatives at times t: Eq. 29, corrected.

        The acceleration jumps at the ends of the ramps; there it is the later piece's.
        """
        return self.law.at(t)


@refuses_other_kinds
def helix(
    robot: _Robot,
    *,
    radius: float,
    pitch: float,
    height: float,
    branch: Branch = "+",
    duration: float = PAPER_DURATION,
) -> HelixPath:
    """Return one turn of the paper's helix for a robot (Eq. 26 to 29, Eq. 29 corrected).

    Parameters
    ----------
    robot
        The 3-RPS; its platform's centre follows the helix.
    radius
        r_h of Table 1, m; at most the platform's radius.
    pitch
        p_h: the climb in the one turn, m.
    height
        z_0: where it starts, m.
    branch
        ``"+"`` for the paper's (alpha, beta), which starts at alpha = pi/2; ``"-"`` for
        (alpha, -beta), the opposite tilt with the same centre.
    duration
        In s; Eq. 29's 5.2388 s if left out. phi(t) is scaled in time.

    Raises
    ------
    InputError
        If a number is not finite, the radius exceeds the platform's, or the branch is unknown.
    """
    return HelixPath(
        robot.parameters.platform_radius, radius, pitch, height, branch=branch, duration=duration
    )


def _pose(z: Array, tilt: Array) -> Array:
    return np.concatenate([z[..., None], tilt], axis=-1)

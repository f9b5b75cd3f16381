"""Motions at limits, as `time_optimal` returns them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Bools
from rps_pin.errors import InputError
from rps_pin.task.motion.curve_dynamics import ACTIVE, CurveDynamics, LimitUse
from rps_pin.task.motion.jerk.jerk_profile import JerkProfile
from rps_pin.task.motion.speed_profile import SpeedProfile
from rps_pin.trajectories.curve import TimedCurve
from rps_pin.trajectories.path import checked_times

#: A limit counts as reached within this part of it, where jerks have limits.
ACTIVE_OF_JERK = 1e-2


class LimitedMotion(TimedCurve):
    """A motion along a curve in the shortest time, made by `time_optimal`.

    Attributes
    ----------
    curve : Curve
        The curve of poses.
    law : SpeedProfile or JerkProfile
        Its time law: pieces, and the squared rate at their ends; under limits of jerk, pieces of
        constant jerk.
    sides : tuple of str
        Names of the limits, in the order of `LimitUse.sides`.
    without_jerk_limits : float or None
        The shortest time without limits of jerk, s, which none with them is below. None if there
        are no limits of jerk, or no others that would make it finite.
    """

    law: SpeedProfile | JerkProfile

    def __init__(
        self,
        dynamics: CurveDynamics,
        law: SpeedProfile | JerkProfile,
        free: SpeedProfile | None = None,
    ) -> None:
        super().__init__(dynamics.curve, law)
        self.without_jerk_limits = None if free is None else free.duration
        self.sides = dynamics.sides
        self._dynamics = dynamics

    def __repr__(self) -> str:
        return f"LimitedMotion({self.curve!r}, {self.law!r})"

    def use(self, t: ArrayLike) -> LimitUse:
        """Return forces, accelerations and speeds over their limits at times of shape (...), s.

        Raises
        ------
        InputError
            If a time lies outside the motion.
        """
        times = checked_times(t, self.duration)
        u, rate, acceleration = self.law.at(times)
        jerk = self.law.jerk_at(times) if isinstance(self.law, JerkProfile) else None
        return self._dynamics.use_along(u, rate**2, acceleration, jerk)

    @property
    def _within(self) -> float:
        """Return the part of a limit within which it counts as reached."""
        return ACTIVE_OF_JERK if isinstance(self.law, JerkProfile) else ACTIVE

    def active(self, t: ArrayLike, within: float | None = None) -> Bools:
        """Return which limits are reached at times of shape (...), s: (..., n), as `sides`.

        A limit counts as reached `within` this part of it: left out, 0.001, and under limits of
        jerk 0.01, for there the limits are met at the ends of pieces, and nearly between.

        Raises
        ------
        InputError
            If a time lies outside the motion, or `within` is not between 0 and 1.
        """
        part = self._within if within is None else within
        if not 0 < part < 1:
            raise InputError(f"within = {part}: it must be between 0 and 1")
        reached: Bools = self.use(t).sides >= 1 - part
        return reached

    def shares(self, within: float | None = None, samples: int = 10_001) -> dict[str, float]:
        """Return the share of the time at each limit, and at none (``"none"``)."""
        reached = self.active(np.linspace(0.0, self.duration, samples), within)
        found = dict(zip(self.sides, reached.mean(axis=0).tolist(), strict=True))
        return found | {"none": float((~reached.any(axis=-1)).mean())}

    def report(self) -> str:
        """Return the duration, and the share of the time at each limit, as text."""
        shares = self.shares().items()
        width = max(len(name) for name in (*self.sides, "none")) + 1
        than = ""
        if self.without_jerk_limits is not None:
            longer = self.duration / self.without_jerk_limits - 1
            than = f" ({longer:.2%} longer than without limits of jerk)"
        head = f"{self.duration:.6g} s{than}, {self.law.pieces} pieces"
        return "\n".join(
            [f"{head}; at a limit to {self._within:.1%}:"]
            + [f"  {name:<{width}} {share:7.2%} of the time" for name, share in shares if share > 0]
        )

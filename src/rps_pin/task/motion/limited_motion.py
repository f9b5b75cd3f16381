"""Motions at limits, as `time_optimal` returns them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Bools
from rps_pin.errors import InputError
from rps_pin.task.motion.curve_dynamics import ACTIVE, CurveDynamics, LimitUse
from rps_pin.task.motion.speed_profile import SpeedProfile
from rps_pin.trajectories.curve import TimedCurve
from rps_pin.trajectories.path import checked_times


class LimitedMotion(TimedCurve):
    """A motion along a curve in the shortest time, made by `time_optimal`.

    Attributes
    ----------
    curve : Curve
        The curve of poses.
    law : SpeedProfile
        Its time law: pieces, and the squared rate at their ends.
    sides : tuple of str
        Names of the limits, in the order of `LimitUse.sides`.
    """

    law: SpeedProfile

    def __init__(self, dynamics: CurveDynamics, law: SpeedProfile) -> None:
        super().__init__(dynamics.curve, law)
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
        u, rate, acceleration = self.law.at(checked_times(t, self.duration))
        return self._dynamics.use_along(u, rate**2, acceleration)

    def active(self, t: ArrayLike, within: float = ACTIVE) -> Bools:
        """Return which limits are reached at times of shape (...), s: (..., n), as `sides`.

        Raises
        ------
        InputError
            If a time lies outside the motion, or `within` is not between 0 and 1.
        """
        if not 0 < within < 1:
            raise InputError(f"within = {within}: it must be between 0 and 1")
        reached: Bools = self.use(t).sides >= 1 - within
        return reached

    def shares(self, within: float = ACTIVE, samples: int = 10_001) -> dict[str, float]:
        """Return the share of the time at each limit, and at none (``"none"``)."""
        reached = self.active(np.linspace(0.0, self.duration, samples), within)
        found = dict(zip(self.sides, reached.mean(axis=0).tolist(), strict=True))
        return found | {"none": float((~reached.any(axis=-1)).mean())}

    def report(self) -> str:
        """Return the duration, and the share of the time at each limit, as text."""
        shares = self.shares().items()
        width = max(len(name) for name in (*self.sides, "none")) + 1
        return "\n".join(
            [f"{self.duration:.6g} s, {len(self.law.bump)} pieces; at a limit to {ACTIVE:.1%}:"]
            + [f"  {name:<{width}} {share:7.2%} of the time" for name, share in shares if share > 0]
        )

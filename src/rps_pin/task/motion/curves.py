"""Curves that are given for time scaling: what has one, and where its rate must be zero."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.trajectories.curve import Curve, CurveSample
from rps_pin.trajectories.path import PathSample, Trajectory

#: Points of a curve at which its derivatives and its holding forces are checked.
POINTS = 4001
#: First and second derivatives are zero below these parts of the largest first derivative.
_NO_TANGENT, _NO_CURVATURE = 1e-6, 1e-2


@dataclass(frozen=True)
class OwnTime:
    """A trajectory as a curve: u is its own time."""

    trajectory: Trajectory

    @property
    def length(self) -> float:
        """Its duration."""
        return self.trajectory.duration

    def at(self, u: ArrayLike) -> CurveSample:
        """Return pose and derivatives at times of shape (...)."""
        return CurveSample(*self.trajectory.sample(u))


@dataclass(frozen=True)
class AsTrajectory:
    """A curve as a trajectory, with the parameter u for the time."""

    curve: Curve

    @property
    def duration(self) -> float:
        """The curve's length."""
        return self.curve.length

    def sample(self, t: ArrayLike) -> PathSample:
        """Return pose and derivatives at parameters of shape (...)."""
        return PathSample(*self.curve.at(t))


def curve_of(path: object) -> Curve:
    """Return a curve, that of what has one, or a trajectory as a curve in its own time.

    Raises
    ------
    InputError
        If it is none of these.
    """
    for candidate in (path, getattr(path, "curve", None)):
        if hasattr(candidate, "at") and hasattr(candidate, "length"):
            return candidate
    if hasattr(path, "sample") and hasattr(path, "duration"):
        return OwnTime(path)
    raise InputError(
        f"path = {shown(path)}: it must be a curve (length, at), have one (curve), or be a "
        "trajectory (duration, sample)"
    )


def ends_at_rest(curve: Curve, size: Array) -> tuple[bool, bool]:
    """Return at which ends the rate u' must be zero: where the curve has a tangent.

    Without a tangent what moves is at rest at any rate, if the second derivative is not zero.

    Parameters
    ----------
    curve
        The curve.
    size
        Factors that make its coordinates comparable, shape (m,).

    Raises
    ------
    InputError
        If first and second derivatives of the curve are zero at some point: the rate of the
        shortest time is infinite there.
    """
    u = np.linspace(0.0, curve.length, POINTS)
    _, first, second = curve.at(u)
    tangent = np.linalg.norm(first * size, axis=-1)
    curvature = np.linalg.norm(second * size, axis=-1) * curve.length
    longest = tangent.max()
    if not longest > 0:
        raise InputError(f"the pose is the same all along {curve!r}: nothing moves")
    without = tangent <= _NO_TANGENT * longest
    still = without & (curvature <= _NO_CURVATURE * longest)
    if still.any():
        raise InputError(
            f"the curve stands still at u = {u[np.argmax(still)]:.6g} of {curve.length:.6g}: its "
            "first and second derivatives vanish there, and u' would have to be infinite. A "
            "trajectory that rests in its own time is no curve to scale: give the curve it runs "
            "along, with a tangent everywhere (of a spline, its poses without times)"
        )
    return not without[0], not without[-1]

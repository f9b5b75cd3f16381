"""Curves that are given for time scaling: what has one, where its rate must be zero, and jumps."""

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
#: Changes of the second derivative below this part of the first, over the length, are no jumps.
_NO_JUMP = 1e-6
#: How often the interval of the largest change is halved.
_HALVINGS = 16


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


def refuse_infinite_jerk(curve: Curve, size: Array, rest: tuple[bool, bool]) -> None:
    """Refuse a curve along which no motion has a finite jerk.

    Parameters
    ----------
    curve, size
        As for `ends_at_rest`.
    rest
        What that returns.

    Raises
    ------
    InputError
        If the curve has no tangent at an end, or its second derivative jumps.
    """
    if not all(rest):
        at = "beginning" if not rest[0] else "end"
        raise InputError(
            f"the curve has no tangent at its {at}: with a limit of jerk, u would begin there like "
            "t^1.5. Give a curve with a tangent everywhere (of a spline, its poses without times)"
        )
    low, high = 0.0, curve.length
    for parts in (POINTS - 1, *[2] * _HALVINGS):  # towards the largest change
        u = np.linspace(low, high, parts + 1)
        change = np.linalg.norm(np.diff(curve.at(u).second * size, axis=0), axis=-1)
        largest = int(np.argmax(change))
        if parts != 2:
            first = change[largest]
        low, high = u[largest], u[largest + 1]
    tangent = np.linalg.norm(curve.at(u).first * size, axis=-1).max()
    if change.max() > first / 2 and first * curve.length > _NO_JUMP * tangent:
        raise InputError(
            f"the curve's second derivative jumps at u = {low:.6g} of {curve.length:.6g}: a motion "
            "through there has no finite jerk"
        )

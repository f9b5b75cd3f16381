"""Smooth motions through given poses.

With times, x(t) is the quintic spline through the poses: of all curves with these values, pieces of
fifth degree that join with four continuous derivatives, at rest at both ends.

Without times, x(u) is the natural cubic spline over the chord length u, two continuous derivatives,
and a law of time runs along it. Heights and tilts have different units: a chord's length is

    sqrt(dz^2 + L^2 (dtilt_x^2 + dtilt_y^2)),    L = `tilt_scale`, m/rad.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.trajectories.curve import CurveSample, TimedCurve
from rps_pin.trajectories.path import PathSample, Trajectory, checked_parameters, checked_times
from rps_pin.trajectories.poses import checked_poses, times_from_zero
from rps_pin.trajectories.resampled import ResampledCurve
from rps_pin.trajectories.time_laws import Profile, positive, time_law

#: Metres that a radian of tilt counts for in a chord's length: the size of a small platform.
TILT_SCALE = 0.1
#: How well a spline must meet its poses, over the largest of them.
_MET = 1e-9


class ChordSpline:
    """The natural cubic spline through poses, over the length of the chords between them.

    Parameters
    ----------
    poses
        Shape (n, 3), m and rad; no two neighbours alike.
    tilt_scale
        L, m/rad: how tilts and heights make up a length; positive.

    Attributes
    ----------
    poses : (n, 3) array
        As given, read-only.
    knots : (n,) array
        The parameters u at which the poses are met, read-only, m.
    length : float
        The last of them.

    Raises
    ------
    InputError
        If poses are not finite, of another shape, or neighbours are the same.
    """

    def __init__(self, poses: ArrayLike, *, tilt_scale: float = TILT_SCALE) -> None:
        self.poses = checked_poses(poses, "poses")
        scale = np.array([1.0, *2 * [positive(tilt_scale, "tilt_scale")]])
        chords = np.linalg.norm(np.diff(self.poses, axis=0) * scale, axis=-1)
        self.knots = np.concatenate([[0.0], np.cumsum(chords)])
        self.knots.setflags(write=False)
        rising = np.diff(self.knots) > 0
        if not rising.all():
            i = int(np.argmin(rising))
            raise InputError(f"poses {i} and {i + 1} are the same: the chord has no length")
        self.length = float(self.knots[-1])
        self._spline = CubicSpline(self.knots, self.poses, bc_type="natural")

    def __repr__(self) -> str:
        return f"ChordSpline(<{len(self.poses)} poses>, length={self.length:.6g})"

    def at(self, u: ArrayLike) -> CurveSample:
        """Return pose and derivatives at u of shape (...), m."""
        along = checked_parameters(u, self.length)
        return CurveSample(*(np.asarray(self._spline(along, order)) for order in range(3)))


class TimedSpline:
    """The quintic spline through poses at given times, at rest at both ends.

    Parameters
    ----------
    times
        Increasing, shape (n,), s; the first counts as 0.
    poses
        Shape (n, 3), m and rad.

    Attributes
    ----------
    times : (n,) array
        From 0, read-only, s.
    poses : (n, 3) array
        As given, read-only.

    Raises
    ------
    InputError
        If poses or times are not finite, of other shapes, or do not increase; or if steps are so
        unequal that rounding keeps the spline from meeting its poses.
    """

    def __init__(self, times: ArrayLike, poses: ArrayLike) -> None:
        self.poses = checked_poses(poses, "poses")
        self.times = times_from_zero(times, len(self.poses))
        spline = _at_rest(self.times, self.poses)
        self._derivatives = [spline, spline.derivative(1), spline.derivative(2)]

    @property
    def duration(self) -> float:
        """Length in time, s."""
        return float(self.times[-1])

    @cached_property
    def curve(self) -> ResampledCurve:
        """The way without its times, to run along by another law."""
        return ResampledCurve(self, self.times)

    def __repr__(self) -> str:
        return f"TimedSpline(<{len(self.poses)} poses>, duration={self.duration:.6g})"

    def sample(self, t: ArrayLike) -> PathSample:
        """Return pose, rate and acceleration at times t of shape (...), s; exact.

        Raises
        ------
        InputError
            If a time lies outside the trajectory.
        """
        times = checked_times(t, self.duration)
        values: list[Array] = [np.asarray(spline(times)) for spline in self._derivatives]
        return PathSample(*values)


def _at_rest(times: Array, poses: Array) -> BSpline:
    """Return the quintic spline, or refuse steps for which its equations are ill-conditioned."""
    rest: Any = [(1, np.zeros(3)), (2, np.zeros(3))]  # scipy-stubs know names only
    try:
        with np.errstate(all="ignore"):  # what overflows is not met
            spline: BSpline = make_interp_spline(times, poses, k=5, bc_type=(rest, rest))
            missed = np.abs(spline(times) - poses).max()
    except (ValueError, np.linalg.LinAlgError):  # infinite, or singular
        missed = np.inf
    if not missed <= _MET * np.abs(poses).max():
        steps = np.diff(times)
        raise InputError(
            f"times: steps of {steps.min():.3g} s to {steps.max():.3g} s are too unequal for a "
            "spline"
        )
    return spline


def spline(
    poses: ArrayLike,
    times: ArrayLike | None = None,
    *,
    duration: float | None = None,
    profile: Profile = "s-curve",
    tilt_scale: float = TILT_SCALE,
) -> Trajectory:
    """Return a smooth motion through poses, from rest to rest.

    Parameters
    ----------
    poses
        (z, tilt_x, tilt_y) each, shape (n, 3), n of 2 or more, m and rad.
    times
        When each is met, increasing, shape (n,), s; the motion begins at the first. The result is
        then a `TimedSpline`.
    duration, profile, tilt_scale
        Without times: how long the motion takes (s), by which law of time, and what a radian counts
        for beside a metre (m/rad). The result is a `TimedCurve` of a `ChordSpline`, which can be
        scaled in time.

    Raises
    ------
    InputError
        If poses or times are not finite, of other shapes, or do not increase; or if both or neither
        of times and duration are given.
    """
    if (times is None) == (duration is None):
        given = "neither is given" if times is None else "both are given"
        raise InputError(f"give the poses' times, or a duration for all: {given}")
    if times is not None:
        return TimedSpline(times, poses)
    curve = ChordSpline(poses, tilt_scale=tilt_scale)
    return TimedCurve(curve, time_law(curve.length, profile, duration=duration))

"""Smooth motions through given poses, from rest to rest.

With times, x(t) is the quintic spline of `sampled_path`.

Without times, x(u) is the natural cubic spline over the chord length u, two continuous derivatives,
and u(t) is a law of time. Heights and tilts have different units: a chord's length is

    sqrt(dz^2 + L^2 (dtilt_x^2 + dtilt_y^2)),    L = `tilt_scale`, m/rad,

or of other coordinates x_i sqrt(sum_i (s_i dx_i)^2), s = `scale`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.trajectories.curve import CurveSample, TimedCurve
from rps_pin.trajectories.path import Trajectory, checked_parameters, checked_poses, length_scale
from rps_pin.trajectories.resampled import TILT_SCALE
from rps_pin.trajectories.sampled_path import SampledPath
from rps_pin.trajectories.time_laws import Profile, time_law
from rps_pin.validation import positive_number


@refuses_other_kinds
class ChordSpline:
    """The natural cubic spline through poses, over the length of the chords between them.

    Parameters
    ----------
    poses
        Shape (n, m), m and rad; no two neighbours alike.
    tilt_scale, scale
        L (m/rad), or s, shape (m,), positive. Without s, coordinates count in their units, but
        three of them are (z, tilt_x, tilt_y). Of a task: its ``scale``.

    Attributes
    ----------
    poses : (n, m) array
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

    def __init__(
        self,
        poses: ArrayLike,
        *,
        tilt_scale: float = TILT_SCALE,
        scale: ArrayLike | None = None,
    ) -> None:
        self.poses = checked_poses(poses, "poses")
        tilts = positive_number(tilt_scale, "tilt_scale")
        lengths = length_scale(scale, self.poses.shape[1], tilts)
        chords = np.linalg.norm(np.diff(self.poses, axis=0) * lengths, axis=-1)
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


@refuses_other_kinds
class TimedSpline(SampledPath):
    """The quintic spline through poses at given times, at rest at both ends: see `SampledPath`."""

    def __init__(self, times: ArrayLike, poses: ArrayLike) -> None:
        super().__init__(times, poses, ends="at rest")


@refuses_other_kinds
def spline(
    poses: ArrayLike,
    times: ArrayLike | None = None,
    *,
    duration: float | None = None,
    profile: Profile = "s-curve",
    tilt_scale: float = TILT_SCALE,
    scale: ArrayLike | None = None,
) -> Trajectory:
    """Return a smooth motion through poses, from rest to rest.

    Parameters
    ----------
    poses
        (z, tilt_x, tilt_y), or a task's coordinates, shape (n, m), n of 2 or more, m and rad.
    times
        When each is met, increasing, shape (n,), s; the motion begins at the first. The result is
        then a `TimedSpline`.
    duration, profile, tilt_scale, scale
        Without times: the duration (s), the law of time, and the L above (m/rad) or s; see
        `ChordSpline`. The result is a `TimedCurve` of one, which can be scaled in time.

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
    curve = ChordSpline(poses, tilt_scale=tilt_scale, scale=scale)
    return TimedCurve(curve, time_law(curve.length, profile, duration=duration))

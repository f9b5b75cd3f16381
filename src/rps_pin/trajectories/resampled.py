"""Arc-length curves of trajectories: the path without its times, for another law of time.

A trajectory that is at rest at its ends has no tangent there over time. Over the length of its
path,

    sqrt(dz^2 + L^2 (dtilt_x^2 + dtilt_y^2)),    L = `tilt_scale`, m/rad,

or of other coordinates x_i sqrt(sum_i (s_i dx_i)^2) with s = `scale`, it has one. The
curve is the quintic spline (not-a-knot) through points of the path at equal distances. Their number
is doubled until the curve is within `ON_PATH` of the path.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.trajectories.curve import CurveSample
from rps_pin.trajectories.path import Trajectory, checked_parameters, length_scale

#: Number of pieces: at first, and at most (or four to a step between times).
PIECES, MOST_PIECES = 400, 25_600
#: Largest distance of the curve from the path, over the path's length.
ON_PATH = 1e-7
#: Metres that a radian of tilt counts for.
TILT_SCALE = 0.1
#: Least number of samples between two times, from which the path is divided.
_SAMPLES = 64


class ResampledCurve:
    """The path of a trajectory over its length.

    Parameters
    ----------
    trajectory
        The motion.
    times
        Increasing, from 0 to its duration, shape (n,), s: between two of them it is smooth.
    tilt_scale, scale
        L (m/rad), or s, shape (m,); see `length_scale`.

    Attributes
    ----------
    length : float
        Of the path, m.

    Raises
    ------
    InputError
        If the trajectory does not move, or has a corner (stops, and goes on in another direction).
    """

    def __init__(
        self,
        trajectory: Trajectory,
        times: Array,
        *,
        tilt_scale: float = TILT_SCALE,
        scale: ArrayLike | None = None,
    ) -> None:
        self._trajectory = trajectory
        size = trajectory.sample(0.0).pose.size
        self._scale = length_scale(scale, size, tilt_scale)
        samples = max(_SAMPLES, 16 * PIECES // (len(times) - 1))
        fine = np.linspace(times[:-1], times[1:], samples, endpoint=False, axis=-1)
        t = np.append(fine.ravel(), times[-1])
        covered = self._lengths(trajectory.sample(t).pose)
        if not covered[-1] > 0:
            raise InputError("the trajectory stays in one pose: its path has no length")
        moving = np.append(True, np.diff(covered) > 0)
        pieces = PIECES
        while True:
            when = np.interp(np.linspace(0.0, covered[-1], pieces + 1), covered[moving], t[moving])
            off, where = self._fit(when)
            if off <= ON_PATH * self.length:
                return
            pieces *= 2
            if pieces > max(MOST_PIECES, 4 * len(times)):
                raise InputError(
                    f"the trajectory turns too sharply at t = {where:.6g} s: a smooth curve of "
                    f"{pieces // 2} pieces is {off:.3g} m off it there. Where it stops and turns, "
                    "make it two trajectories"
                )

    def _fit(self, when: Array) -> tuple[float, float]:
        """Fit the spline to the poses at some times; return its largest distance, and when."""
        poses = self._trajectory.sample(when).pose
        knots = self._lengths(poses)
        self.length = float(knots[-1])
        spline = make_interp_spline(knots, poses, k=5)
        self._derivatives = [spline, spline.derivative(1), spline.derivative(2)]
        between = (when[1:] + when[:-1]) / 2
        apart = self._trajectory.sample(between).pose
        u = knots[:-1] + np.linalg.norm((apart - poses[:-1]) * self._scale, axis=-1)
        here = self.at(u.clip(0.0, self.length))
        miss, along = (apart - here.pose) * self._scale, here.first * self._scale
        ahead = (miss * along).sum(axis=-1) / (along * along).sum(axis=-1)
        off = np.linalg.norm(miss - ahead[:, None] * along, axis=-1)
        worst = int(off.argmax())
        return float(off[worst]), float(between[worst])

    def _lengths(self, poses: Array) -> Array:
        """Return the length of the path up to each pose, by chords, m."""
        chords = np.linalg.norm(np.diff(poses, axis=0) * self._scale, axis=-1)
        return np.concatenate([[0.0], np.cumsum(chords)])

    def __repr__(self) -> str:
        return f"ResampledCurve(length={self.length:.6g})"

    def at(self, u: ArrayLike) -> CurveSample:
        """Return pose and derivatives at u of shape (...), m."""
        along = checked_parameters(u, self.length)
        return CurveSample(*(np.asarray(one(along)) for one in self._derivatives))

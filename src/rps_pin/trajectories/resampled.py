"""The way of a trajectory without its times: a curve that another law of time can run along.

A trajectory that rests at its ends has no tangent there in its own time. Over the length of its
way,

    sqrt(dz^2 + L^2 (dtilt_x^2 + dtilt_y^2)),    L = `tilt_scale`, m/rad,

it has one. The curve is the quintic spline through close points of the way, evenly spaced: pieces
of fifth degree with four continuous derivatives, the ends *not-a-knot*. They are as many as it
takes to stay on the way.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.trajectories.curve import CurveSample
from rps_pin.trajectories.path import Trajectory, checked_parameters

#: Pieces that the way is divided into: at first, and at most (or four to a step between times).
PIECES, MOST_PIECES = 400, 25_600
#: How far the curve may be from the way, over its length.
ON_THE_WAY = 1e-7
#: Metres that a radian of tilt counts for.
TILT_SCALE = 0.1
#: Looks between two times for where the way is divided: its length is known to their square.
_LOOKS = 64


class ResampledCurve:
    """The way of a trajectory, u from 0 to its length.

    Parameters
    ----------
    trajectory
        What is followed.
    times
        Increasing, from 0 to its duration, shape (n,), s: between two of them it is smooth.
    tilt_scale
        L, m/rad.

    Attributes
    ----------
    length : float
        Of the way, m.

    Raises
    ------
    InputError
        If the trajectory stays where it is, or has a corner: stops, and goes on another way.
    """

    def __init__(
        self, trajectory: Trajectory, times: Array, *, tilt_scale: float = TILT_SCALE
    ) -> None:
        self._trajectory = trajectory
        self._scale = np.array([1.0, tilt_scale, tilt_scale])
        looks = max(_LOOKS, 16 * PIECES // (len(times) - 1))
        fine = np.linspace(times[:-1], times[1:], looks, endpoint=False, axis=-1)
        t = np.append(fine.ravel(), times[-1])
        gone = self._lengths(trajectory.sample(t).pose)
        if not gone[-1] > 0:
            raise InputError("the trajectory stays in one pose: there is no way to run along")
        moving = np.append(True, np.diff(gone) > 0)
        pieces = PIECES
        while True:
            when = np.interp(np.linspace(0.0, gone[-1], pieces + 1), gone[moving], t[moving])
            off, where = self._follow(when)
            if off <= ON_THE_WAY * self.length:
                return
            pieces *= 2
            if pieces > max(MOST_PIECES, 4 * len(times)):
                raise InputError(
                    f"the trajectory turns too sharply at t = {where:.6g} s: a smooth curve of "
                    f"{pieces // 2} pieces is {off:.3g} m off it there. Where it stops and turns, "
                    "make it two trajectories"
                )

    def _follow(self, when: Array) -> tuple[float, float]:
        """Lay the spline through the poses at some times; return how far it is off, and when."""
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
        """Return how much of the way is gone at each pose, by chords, m."""
        chords = np.linalg.norm(np.diff(poses, axis=0) * self._scale, axis=-1)
        return np.concatenate([[0.0], np.cumsum(chords)])

    def __repr__(self) -> str:
        return f"ResampledCurve(length={self.length:.6g})"

    def at(self, u: ArrayLike) -> CurveSample:
        """Return pose and derivatives at u of shape (...), m."""
        along = checked_parameters(u, self.length)
        return CurveSample(*(np.asarray(one(along)) for one in self._derivatives))

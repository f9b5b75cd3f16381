"""A motion known at samples, and what it is between them.

With poses alone it is the quintic spline through them: pieces of fifth degree that join with four
continuous derivatives. Nothing is assumed about its ends, neither rest nor anything else: the first
three pieces are one polynomial, and so are the last three (*not-a-knot*). A polynomial of fifth
degree is met exactly. Noise in the poses is met too, and its derivatives with it.

With rates and accelerations it is the quintic Hermite interpolant: in each step the one polynomial
of fifth degree that has pose, rate and acceleration of both its ends. These are met exactly and
continuous; nothing in a step depends on samples elsewhere.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BPoly, BSpline, make_interp_spline

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.trajectories.path import PathSample, checked_times
from rps_pin.trajectories.poses import checked_poses, finite_array, times_from_zero
from rps_pin.trajectories.resampled import ResampledCurve

#: Samples that a quintic spline needs.
FEWEST_POSES = 6
#: How well a spline must meet its poses, over the largest of them: beyond, its equations are too
#: ill-conditioned (steps of very unequal length).
_MET = 1e-9


class SampledPath:
    """A trajectory through samples.

    Parameters
    ----------
    times
        Increasing, shape (n,), s; the first counts as 0.
    poses
        (z, tilt_x, tilt_y), shape (n, 3), m and rad; 6 or more, or 2 with rates and accelerations.
    rates, accelerations
        Their time derivatives, shape (n, 3); both or neither.

    Attributes
    ----------
    times : (n,) array
        From 0, s. All arrays are read-only.
    poses : (n, 3) array
    rates, accelerations : (n, 3) arrays or None

    Raises
    ------
    InputError
        If an array is not finite or of another shape, times do not increase, samples are too few,
        or steps so unequal, or so short, that the motion between them cannot be found.
    """

    def __init__(
        self,
        times: ArrayLike,
        poses: ArrayLike,
        rates: ArrayLike | None = None,
        accelerations: ArrayLike | None = None,
    ) -> None:
        self.poses = checked_poses(poses, "poses")
        self.times = times_from_zero(times, len(self.poses))
        if (rates is None) != (accelerations is None):
            raise InputError("rates and accelerations are given together, or neither is")
        self.rates = self.accelerations = None
        moved: Any  # BSpline or BPoly, which are used alike
        with np.errstate(all="ignore"):  # what overflows is refused
            if rates is None or accelerations is None:
                self._from, moved = _spline(self.times, self.poses)
            else:
                self.rates = self._like_poses(rates, "rates")
                self.accelerations = self._like_poses(accelerations, "accelerations")
                self._from, moved = _hermite(self.times, self.poses, self.rates, self.accelerations)
            self._moved = [moved, moved.derivative(1), moved.derivative(2)]
            finite = all(np.isfinite(piece.c).all() for piece in self._moved)
        if not finite:
            step = np.diff(self.times).min()
            raise InputError(f"no finite motion joins the samples: the shortest step is {step} s")

    @property
    def duration(self) -> float:
        """Length in time, s."""
        return float(self.times[-1])

    @cached_property
    def curve(self) -> ResampledCurve:
        """The way without its times, to run along by another law."""
        return ResampledCurve(self, self.times)

    def __repr__(self) -> str:
        return f"SampledPath(<{len(self.times)} samples>, duration={self.duration:.6g})"

    def sample(self, t: ArrayLike) -> PathSample:
        """Return pose, rate and acceleration at times t of shape (...), s; exact.

        Raises
        ------
        InputError
            If a time lies outside the trajectory.
        """
        times = checked_times(t, self.duration)
        i = np.searchsorted(self.times[1:-1], times, side="right")
        moved, rate, acceleration = (np.asarray(piece(times)) for piece in self._moved)
        return PathSample(self._from[i] + moved, rate, acceleration)

    def _like_poses(self, value: ArrayLike, name: str) -> Array:
        array = finite_array(value, 2, name)
        if array.shape != self.poses.shape:
            raise InputError(f"{name} has shape {array.shape}; the poses have {self.poses.shape}")
        return array


def _spline(times: Array, poses: Array) -> tuple[Array, BSpline]:
    """Return where each step counts from (n - 1, 3), and the spline of the way from there."""
    if len(times) < FEWEST_POSES:
        raise InputError(
            f"{len(times)} samples; {FEWEST_POSES} or more are needed where rates and "
            "accelerations are not given"
        )
    way = poses - poses[0]
    try:
        spline: BSpline = make_interp_spline(times, way, k=5)
        missed = np.abs(spline(times) - way).max()
    except (ValueError, np.linalg.LinAlgError):
        missed = np.inf
    if not missed <= _MET * np.abs(way).max():
        steps = np.diff(times)
        raise InputError(
            f"steps of {steps.min():.3g} s to {steps.max():.3g} s are too unequal for a spline"
        )
    return np.broadcast_to(poses[0], way[1:].shape), spline


def _hermite(times: Array, x: Array, v: Array, a: Array) -> tuple[Array, BPoly]:
    """Return where each step counts from (n - 1, 3), and the polynomials of the way from there.

    With c_k the Bernstein coefficients of a step of length h, the derivatives at its beginning are
    5 (c_1 - c_0) / h and 20 (c_2 - 2 c_1 + c_0) / h^2, and at its end likewise.
    """
    h = np.diff(times)[:, None]
    way = np.diff(x, axis=0)
    push, brake = v[:-1] * h / 5, v[1:] * h / 5
    bend, bend_end = a[:-1] * h**2 / 20, a[1:] * h**2 / 20
    c = [0 * way, push, 2 * push + bend, way - 2 * brake + bend_end, way - brake, way]
    return x[:-1], BPoly(np.stack(c), times)

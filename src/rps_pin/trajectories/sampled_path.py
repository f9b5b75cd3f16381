"""Trajectories through samples: quintic splines, or quintic polynomials of measured derivatives.

With poses alone, or poses and rates, x(t) is the quintic spline through the poses: polynomials of
fifth degree that join with four continuous derivatives. Two conditions at each end complete it:

==============  ==========================================================================
``"at rest"``   x' = 0 and x'' = 0
``"measured"``  x' is the measured rate, and x''' = 0
``"free"``      not-a-knot: the first three polynomials are one, and so are the last three
==============  ==========================================================================

Of all curves through the poses with these values of x' and x'', the first two are those with the
smallest integral of x'''^2. The third reproduces a polynomial of fifth degree; between coarse
samples of a motion from rest it can start backwards. Noise in the poses is followed.

With rates and accelerations x(t) is the quintic Hermite interpolant: in each step the polynomial of
fifth degree that has pose, rate and acceleration of both its ends. Nothing in a step depends on
samples elsewhere.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BPoly, BSpline, make_interp_spline

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.trajectories import path
from rps_pin.trajectories.path import POSE, PathSample
from rps_pin.trajectories.resampled import ResampledCurve
from rps_pin.validation import choice, fixed_array

Ends = Literal["at rest", "measured", "free"]

#: Samples that a spline with free ends needs.
FEWEST_POSES = 6
#: How well a spline must meet its poses, over the largest distance from the first: beyond, its
#: equations are too ill-conditioned (steps of very unequal length).
_MET = 1e-9


@refuses_other_kinds
class SampledPath:
    """A trajectory through samples.

    Parameters
    ----------
    times
        Increasing, shape (n,), s; the first counts as 0.
    poses
        (z, tilt_x, tilt_y), or a task's coordinates, shape (n, m), m and rad; 2 or more, 6 with
        free ends.
    rates, accelerations
        Their time derivatives, shape (n, m). Rates alone are used at the two ends only.
    ends
        What is assumed at both ends of the spline: ``"at rest"``, ``"measured"`` (the rates given)
        or ``"free"``. If left out, ``"measured"`` with rates and ``"at rest"`` without. Samples
        with accelerations take none.

    Attributes
    ----------
    times : (n,) array
        From 0, s. All arrays are read-only.
    poses : (n, m) array
    rates, accelerations : (n, m) arrays or None
    starts, ends : str
        How the motion starts and ends, for reports: ``"at rest"``, ``"with the measured rate"``,
        ``"with the rate of the fitted spline"``.

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
        *,
        ends: Ends | None = None,
    ) -> None:
        self.poses = path.checked_poses(poses, "poses")
        self.times = path.times_from_zero(times, len(self.poses))
        shape = self.poses.shape
        self.rates = None if rates is None else fixed_array(rates, "rates", shape, POSE)
        self.accelerations = None
        moved: Any  # BSpline or BPoly, which are used alike
        with np.errstate(all="ignore"):  # what overflows is refused
            if accelerations is None:
                if ends == "measured" and rates is None:
                    raise InputError("ends = 'measured': no rates are given")
                default = "at rest" if rates is None else "measured"
                assumed = choice(default if ends is None else ends, "ends", get_args(Ends))
                self._from, moved = _spline(self.times, self.poses, assumed, self.rates)
            elif self.rates is None:
                raise InputError("accelerations are given without rates")
            elif ends is not None:
                raise InputError(f"ends = {ends!r}: samples with accelerations have measured ends")
            else:
                assumed = "measured"
                a = fixed_array(accelerations, "accelerations", shape, POSE)
                self._from, moved = _hermite(self.times, self.poses, self.rates, a)
                self.accelerations = a
            self._moved = [moved, moved.derivative(1), moved.derivative(2)]
            finite = all(np.isfinite(piece.c).all() for piece in self._moved)
        if not finite:
            step = np.diff(self.times).min()
            raise InputError(f"no finite motion joins the samples: the shortest step is {step} s")
        self.starts, self.ends = (_said(assumed, self.rates, sample) for sample in (0, -1))

    @property
    def duration(self) -> float:
        """Length in time, s."""
        return float(self.times[-1])

    @cached_property
    def curve(self) -> ResampledCurve:
        """The path without its times, for another law of time."""
        return ResampledCurve(self, self.times)

    def __repr__(self) -> str:
        name = type(self).__name__
        return f"{name}(<{len(self.times)} samples>, duration={self.duration:.6g})"

    def sample(self, t: ArrayLike) -> PathSample:
        """Return pose, rate and acceleration at times t of shape (...), s; exact.

        Raises
        ------
        InputError
            If a time lies outside the trajectory.
        """
        times = path.checked_times(t, self.duration)
        i = np.searchsorted(self.times[1:-1], times, side="right")
        moved, rate, acceleration = (np.asarray(piece(times)) for piece in self._moved)
        return PathSample(self._from[i] + moved, rate, acceleration)


def _said(assumed: str, rates: Array | None, sample: int) -> str:
    """Return how the motion is at its first or last sample."""
    if assumed == "measured" and rates is not None:
        return "with the measured rate" if rates[sample].any() else "at rest, as measured"
    return "at rest" if assumed == "at rest" else "with the rate of the fitted spline"


def _spline(times: Array, poses: Array, assumed: str, rates: Array | None) -> tuple[Array, BSpline]:
    """Return where each step counts from (n - 1, m), and the spline of the motion from there."""
    if assumed == "free" and len(times) < FEWEST_POSES:
        raise InputError(
            f"{len(times)} samples; {FEWEST_POSES} or more are needed for a spline with free ends"
        )
    still = np.zeros(poses.shape[1])
    rest = [(1, still), (2, still)]
    conditions: Any = None if assumed == "free" else (rest, rest)
    if assumed == "measured" and rates is not None:
        conditions = tuple([(1, rate), (3, still)] for rate in rates[[0, -1]])
    motion = poses - poses[0]
    try:
        spline: BSpline = make_interp_spline(times, motion, k=5, bc_type=conditions)
        missed = np.abs(spline(times) - motion).max()
    except (ValueError, np.linalg.LinAlgError):  # infinite, or singular
        missed = np.inf
    if not missed <= _MET * np.abs(motion).max():
        steps = np.diff(times)
        raise InputError(
            f"times: steps of {steps.min():.3g} s to {steps.max():.3g} s are too unequal for a "
            "spline"
        )
    return np.broadcast_to(poses[0], motion[1:].shape), spline


def _hermite(times: Array, x: Array, v: Array, a: Array) -> tuple[Array, BPoly]:
    """Return where each step counts from (n - 1, m), and the polynomials of the motion from there.

    With c_k the Bernstein coefficients of a step of length h, the derivatives at its beginning are
    5 (c_1 - c_0) / h and 20 (c_2 - 2 c_1 + c_0) / h^2, and at its end likewise.
    (`BPoly.from_derivatives` builds them one by one: 100 us a step.)
    """
    h = np.diff(times)[:, None]
    motion = np.diff(x, axis=0)
    first, last = v[:-1] * h / 5, v[1:] * h / 5
    second, fourth = 2 * first + a[:-1] * h**2 / 20, motion - 2 * last + a[1:] * h**2 / 20
    c = np.stack([0 * motion, first, second, fourth, motion - last, motion])
    return x[:-1], BPoly(c, times)

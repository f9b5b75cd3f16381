"""The zero-phase filter of positions, forces and regressors, and derivatives by time.

A Butterworth low-pass of order 4, run forwards and backwards (SciPy's ``sosfiltfilt``): the phase
is zero, and the gain is that of the filter squared, 1/2 at the cut-off frequency. Speeds and
accelerations are the derivatives of the quintic spline through the filtered positions.

Positions are filtered first; forces and the regressor of the filtered motion by the same filter
afterwards, so that what it takes from one it takes from the other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.fft import rfft, rfftfreq
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, sosfiltfilt, sosfreqz

from rps_pin.arrays import Array

#: Of the Butterworth filter, each way.
ORDER = 4
#: The cut-off frequency that is taken if none is given: so many times the frequency below which
#: the positions have all but this share of their power.
_ABOVE, _LEFT = 8.0, 1e-4
#: Most of the sampling rate that a cut-off frequency may be.
MOST = 0.4
#: After a change, the filter's answer has died away in so many periods of the cut-off frequency.
REACH = 4.0


class Filter(NamedTuple):
    """The filter at a sampling rate."""

    cut_off: float
    """Hz."""
    step: float
    """Between samples, s."""

    @property
    def _sections(self) -> Array:
        return np.asarray(butter(ORDER, self.cut_off, fs=1 / self.step, output="sos"))

    @property
    def reach(self) -> int:
        """Samples after which a change is no longer felt."""
        return int(np.ceil(REACH / (self.cut_off * self.step)))

    def __call__(self, values: Array) -> Array:
        """Return values (n, ...) filtered along the first axis."""
        return np.asarray(sosfiltfilt(self._sections, values, axis=0))

    @property
    def noise(self) -> float:
        """Share of white noise's power that is left: the mean of the gain's square."""
        _, answer = sosfreqz(self._sections, worN=4096)
        return float(np.mean(np.abs(answer) ** 4))


def motion_of(position: Array, filtered: Filter) -> tuple[Array, Array, Array]:
    """Return filtered positions (n, na), speeds and accelerations."""
    a = filtered(position)
    spline = make_interp_spline(filtered.step * np.arange(len(a)), a, k=5)
    time = spline.t[0] + filtered.step * np.arange(len(a))
    return a, np.asarray(spline(time, 1)), np.asarray(spline(time, 2))


def usual_cut_off(position: Array, step: float) -> float:
    """Return a cut-off frequency for positions (n, na), Hz; see the module's constants."""
    window = np.hanning(len(position))[:, None]
    power = (np.abs(rfft(window * (position - position.mean(axis=0)), axis=0)) ** 2).sum(axis=1)
    share = np.cumsum(power) / power.sum() if power.sum() > 0 else np.ones(power.size)
    frequency = rfftfreq(len(position), step)[int(np.searchsorted(share, 1 - _LEFT))]
    return float(min(max(_ABOVE * frequency, 1 / (step * len(position))), MOST / step))

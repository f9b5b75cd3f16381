"""The least-squares problem of a calibration: poses and parameters from weighed readings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import UnreachableError
from rps_pin.numerics.linear_algebra import rank
from rps_pin.task.calibration.information import Identifiable, identifiable, reduced, svd
from rps_pin.task.calibration.measured.instruments import Tracker
from rps_pin.task.calibration.outliers import outliers
from rps_pin.task.calibration.prediction import CalibrationModel, Predicted
from rps_pin.task.calibration.sensors import Readings

_POSE_STEPS, _POSE_CHANGE, _HALVINGS = 30, 1e-9, 6


class State(NamedTuple):
    """Poses and parameters."""

    x: Array
    """Task coordinates, shape (poses, m)."""
    q: Array
    """Configurations there, shape (poses, nq)."""
    p: Array
    """Parameters, shape (p,)."""


class Weighed(NamedTuple):
    """Residuals, (read - predicted) / deviation, and slopes of predictions; 0 where unread."""

    residuals: Array
    """Shape (poses, sensors)."""
    by_pose: Array
    """A, shape (poses, sensors, m), by coordinates in one unit."""
    by_parameters: Array
    """B, shape (poses, sensors, p), by parameters in one unit."""


class Problem:
    """The residuals of readings, with what is known of poses and parameters so far.

    Parameters
    ----------
    model, read
        As for `calibrate`.
    prior
        Deviations of the parameters about the believed ones, shape (p,); infinite if free.
    """

    def __init__(self, model: CalibrationModel, read: Readings, prior: Array) -> None:
        self._model, self._read = model, read
        self.prior = np.diag(1.0 / (prior * model.units))[np.isfinite(prior)]
        self._known = np.isfinite(read.values)
        self._values = np.where(self._known, read.values, 0.0)
        self._weights = np.where(self._known, 1.0 / read.deviations, 0.0)
        self.used: Bools = self._known.copy()
        self.state = State(np.zeros((0, 0)), np.zeros((0, 0)), model.nominal.copy())

    @property
    def priors(self) -> int:
        """Number of parameters that have a prior."""
        return len(self.prior)

    @property
    def x(self) -> Array:
        """Task coordinates of the poses, shape (poses, m)."""
        return self.state.x

    @property
    def p(self) -> Array:
        """The parameters, shape (p,)."""
        return self.state.p

    def weighed(self, at: State | None = None) -> Weighed:
        """Return residuals and slopes at a state, the present one if left out."""
        at = at or self.state
        return self._weighed(self._model.predict(at.x, at.q, at.p))

    def off_prior(self, p: Array) -> Array:
        """Return how far parameters with a prior are from what is believed, over deviations."""
        return np.asarray(self.prior @ ((p - self._model.nominal) * self._model.units))

    def moved(self, dx: Array, dp: Array, start: State | None = None) -> State | None:
        """Return a state, the present one if left out, moved by poses (n, m) and parameters (p,).

        Both in one unit. None if a pose is not reached.
        """
        start = start or self.state
        x, p = start.x + dx / self._model.task.scale, start.p + dp / self._model.units
        q, reached = self._model.continued(x, start.q, p)
        return State(x, q, p) if reached.all() else None

    def _weighed(self, found: Predicted) -> Weighed:
        weights = self._weights[..., None]
        return Weighed(
            (self._values - found.readings) * self._weights,
            found.by_pose * weights / self._model.task.scale,
            found.by_parameters * weights / self._model.units,
        )

    def begin(self, start: Array | None, p: Array | None = None) -> None:
        """Find the poses from about `start` (poses, m), with the believed parameters or others."""
        task, sensors = self._model.task, self._model.sensors
        home = np.tile(task.home, (len(self._values), 1))
        guess = home.copy() if start is None else start.copy()
        for i, name in enumerate(task.coordinates):
            if start is None and name in sensors:
                k = sensors.index(name)
                guess[:, i] = np.where(self._known[:, k], self._values[:, k], guess[:, i])
        self.state = State(home, self._model.home(home, self.p), self.p)
        self._move_poses(guess - home)
        if p is None:
            self._place_trackers()
        else:
            # Not from home with p: there a rotation about the axis that is no coordinate of the
            # task has two rotation vectors with the same coordinates, where these are all zero.
            self.state = State(self.x, self._model.closed(self.x, self.state.q, p), p.copy())
        self._find_poses(self._known)

    def find_poses(self) -> None:
        """Leave outliers out, and correct the poses, with the parameters as they are."""
        self.leave_out()
        self._find_poses(self.used)

    def _find_poses(self, used: Bools) -> None:
        """Correct the poses by some readings, with the parameters as they are."""
        task = self._model.task
        least = _POSE_CHANGE * task.characteristic_length
        for _ in range(_POSE_STEPS):
            r, A, _ = self.weighed()
            A = A * used[..., None]
            step = (np.linalg.pinv(A) @ (r * used)[..., None])[..., 0]
            self._move_poses(step / task.scale)
            if np.abs(step).max() < least:
                return

    def _place_trackers(self) -> None:
        """Find where trackers stand of which it is not known, with the poses by the others."""
        lost = [
            one
            for one in self._model.instruments
            if isinstance(one, Tracker) and one.placement is None
        ]
        if not lost:
            return
        told = {name for one in lost for name in one.sensors}
        others = np.array([name not in told for name in self._model.sensors])
        self._find_poses(self._known & others)
        for one in lost:
            read = np.full((len(self._values), len(one.sensors)), np.nan)
            for k, name in enumerate(one.sensors):
                if name in self._model.sensors:
                    at = self._model.sensors.index(name)
                    read[:, k] = np.where(self._known[:, at], self._values[:, at], np.nan)
            first = self._model.labels.index(one.labels[0])
            self.p[first : first + 6] = one.placed(self._model.frames(self.state.q, one), read)

    def _move_poses(self, step: Array) -> None:
        """Move poses, (poses, m), half as far where that is not reached, and so on."""
        x, q, p = self.state
        for _ in range(_HALVINGS):
            found, reached = self._model.continued(x + step, q, p)
            beyond = ~reached
            if not beyond.any():
                break
            step = np.where(beyond[:, None], step / 2, step)
        keep = beyond[:, None]
        self.state = State(np.where(keep, x, x + step), np.where(keep, q, found), p)

    def identifiable(self) -> Identifiable:
        """Return which combinations of parameters the readings, and priors, determine."""
        found = self._model.predict(*self.state)
        _, A, B = self._weighed(found)
        opening = np.vstack([*(found.opening / self._model.units)])
        return identifiable(np.vstack([*reduced(A, B), self.prior]), opening)

    def covariance(self, seen: Identifiable) -> Array:
        """Return that of the combinations that are seen, in one unit, of the readings in use."""
        _, A, B = self.weighed()
        used = self.used[..., None]
        rows = np.vstack([*(reduced(A * used, B * used)), self.prior]) @ seen.seen
        s, across = svd(rows)[1:]
        if rank(s, 1e-12) < len(s):
            raise UnreachableError(
                f"the {int(self.used.sum())} readings that are no outliers do not determine the "
                "parameters that all of them together do"
            )
        return np.asarray((across.T / s**2) @ across)

    def contradicted(self, seen: Identifiable) -> float:
        """Return by how many deviations the readings in use contradict what was left as believed.

        The largest of the combinations that are seen too weakly, each of which may be off by as
        much as changes the readings by one deviation.
        """
        r, A, B = self.weighed()
        used = self.used[..., None]
        rows = np.vstack([*(reduced(A * used, B * used)), self.prior])
        right = np.concatenate([(r * self.used).ravel(), -self.off_prior(self.p)])
        fitted = rows @ seen.seen
        weak = rows @ seen.unseen[:, : seen.weak]
        weak = weak - fitted @ np.linalg.lstsq(fitted, weak, rcond=None)[0]
        size = np.linalg.norm(weak, axis=0)
        return float(np.abs(weak.T @ right / np.maximum(size, 1e-300)).max(initial=0.0))

    def leave_out(self) -> None:
        """Decide anew which readings are outliers: `outliers`, with the parameters as they are."""
        r, A, _ = self.weighed()
        self.used = self._known & ~outliers(r, A, self._known)

    def residuals(self) -> Array:
        """Return the residuals, shape (poses, sensors); NaN where nothing was read."""
        return np.where(self._known, self.weighed().residuals, np.nan)

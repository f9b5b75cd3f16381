"""The least-squares problem of a calibration: poses and parameters from weighed readings."""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import UnreachableError
from rps_pin.numerics.linear_algebra import rank
from rps_pin.task.calibration.information import Identifiable, identifiable, reduced
from rps_pin.task.calibration.instruments import Tracker
from rps_pin.task.calibration.outliers import outliers
from rps_pin.task.calibration.prediction import CalibrationModel, Predicted
from rps_pin.task.calibration.sensors import Readings

#: Residuals over their deviations where the robust loss begins to count them less, at the end; and
#: over their median before.
_ROBUST, _TYPICAL = 2.0, 4.0
_STEPS, _POSE_STEPS, _POSE_CHANGE, _HALVINGS = 100, 30, 1e-9, 6
#: A step that changes no predicted reading by more, over its deviation, is the last; of the robust
#: loss, which only finds outliers, it is a larger one.
_SMALL, _NEAR = 1e-4, 1e-2
_LEAST_DAMPING, _MOST_DAMPING, _ROUNDING = 1e-4, 1e10, 1e-9


class Weighed(NamedTuple):
    """Residuals, (read - predicted) / deviation, and slopes of predictions; 0 where unread."""

    residuals: Array
    """Shape (poses, sensors)."""
    by_pose: Array
    """A, shape (poses, sensors, m), by coordinates in one unit."""
    by_parameters: Array
    """B, shape (poses, sensors, p), by parameters in one unit."""


class _Step(NamedTuple):
    x: Array
    """Of the poses, in one unit, shape (n, m)."""
    p: Array
    """Of the combinations of parameters, shape (c,)."""
    largest: float
    """Largest change of a reading over its deviation."""


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
        self._prior = np.diag(1.0 / (prior * model.units))[np.isfinite(prior)]
        self._known = np.isfinite(read.values)
        self._values = np.where(self._known, read.values, 0.0)
        self._weights = np.where(self._known, 1.0 / read.deviations, 0.0)
        self.used: Bools = self._known.copy()
        self.p = model.nominal.copy()
        self.x = self.q = np.zeros((0, 0))

    @property
    def priors(self) -> int:
        """Number of parameters that have a prior."""
        return len(self._prior)

    def weighed(self, x: Array, p: Array) -> Weighed:
        """Return residuals and slopes at task coordinates (poses, m), parameters (p,)."""
        return self._weighed(self._model.predict(x, self.q, p))

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
        self.x, self.q = home, self._model.home(home, self.p)
        self._move_poses(guess - home)
        if p is None:
            self._place_trackers()
        else:
            # Not from home with p: there a rotation about the axis that is no coordinate of the
            # task has two rotation vectors with the same coordinates, where these are all zero.
            self.q, self.p = self._model.closed(self.x, self.q, p), p.copy()
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
            r, A, _ = self.weighed(self.x, self.p)
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
            self.p[first : first + 6] = one.placed(self._model.frames(self.q, one), read)

    def _move_poses(self, step: Array) -> None:
        """Move poses, (poses, m), half as far where that is not reached, and so on."""
        for _ in range(_HALVINGS):
            q, reached = self._model.continued(self.x + step, self.q, self.p)
            beyond = ~reached
            if not beyond.any():
                break
            step = np.where(beyond[:, None], step / 2, step)
        self.x = np.where(beyond[:, None], self.x, self.x + step)
        self.q = np.where(beyond[:, None], self.q, q)

    def identifiable(self) -> Identifiable:
        """Return which combinations of parameters the readings, and priors, determine."""
        found = self._model.predict(self.x, self.q, self.p)
        _, A, B = self._weighed(found)
        opening = np.vstack([*(found.opening / self._model.units)])
        return identifiable(np.vstack([*reduced(A, B), self._prior]), opening)

    def fit(self, seen: Identifiable, scale: float = np.inf) -> None:
        """Correct the poses, and the combinations that are seen, by the readings in use.

        By damped Gauss-Newton steps in which the poses are eliminated. With a finite `scale` c the
        loss of a residual r is Cauchy's c^2 log(1 + (r/c)^2), as weights 1 / (1 + (r/c)^2) of the
        squares.

        Raises
        ------
        UnreachableError
            If that does not converge.
        """
        damping, turn, model = 0.0, seen.seen, self._model
        now, cost = self._costed(self.x, self.p, scale)
        for _ in range(_STEPS):
            r, A, B = now
            w = np.sqrt(self.used / (1.0 + (r / scale) ** 2))[..., None]
            step = self._step(r * w[..., 0], A * w, B @ turn * w, turn, damping)
            if step.largest < (_NEAR if np.isfinite(scale) else _SMALL):
                return
            x, p = self.x + step.x / model.task.scale, self.p + turn @ step.p / model.units
            q, reached = model.continued(x, self.q, p)
            least = np.inf
            if reached.all():
                found, least = self._costed(x, p, scale)
            if least <= cost * (1 + _ROUNDING):
                self.x, self.p, self.q, now, cost = x, p, q, found, least
                damping = damping / 10 if damping > _LEAST_DAMPING else 0.0
            else:
                damping = max(10 * damping, _LEAST_DAMPING)
                if damping > _MOST_DAMPING:
                    break
        raise UnreachableError(
            "the calibration does not converge: the residuals, over their deviations, are "
            f"{np.sqrt(cost / max(int(self.used.sum()), 1)):.3g} (root mean square); "
            "are the readings those of this mechanism, and the believed parameters near?"
        )

    def _costed(self, x: Array, p: Array, scale: float) -> tuple[Weighed, float]:
        """Return residuals and slopes, and the sum of the losses of the readings in use."""
        found = self.weighed(x, p)
        squares = found.residuals[self.used] ** 2
        if np.isfinite(scale):
            squares = scale**2 * np.log1p(squares / scale**2)
        off = self._prior @ ((p - self._model.nominal) * self._model.units)
        return found, float(squares.sum() + (off**2).sum())

    def _step(self, r: Array, A: Array, B: Array, turn: Array, damping: float) -> _Step:
        """Return the step of weighed residuals (n, s), with A (n, s, m) and B (n, s, c)."""
        M = np.linalg.pinv(A)
        rest = B - A @ (M @ B)
        rows = np.vstack([*rest, self._prior @ turn])
        off = self._prior @ ((self.p - self._model.nominal) * self._model.units)
        right = np.concatenate([r.ravel(), -off])
        own = np.sqrt(damping) * np.diag(np.linalg.norm(rows, axis=0))
        dp = np.linalg.lstsq(np.vstack([rows, own]), np.pad(right, (0, len(own))), rcond=None)[0]
        dx = (M @ (r - B @ dp)[..., None])[..., 0]
        moved = np.einsum("nsm,nm->ns", A, dx) + B @ dp
        return _Step(dx, dp, float(np.abs(moved).max(initial=0.0)))

    def approach(self, seen: Identifiable) -> None:
        """Fit with a robust loss whose scale falls with the residuals; most readings agree then.

        At first all residuals are large, as the parameters are wrong; those that remain so are of
        outliers.
        """
        scale = np.inf
        while scale > _ROBUST:
            size = np.median(np.abs(self.weighed(self.x, self.p).residuals[self.used]))
            scale = max(_ROBUST, min(_TYPICAL * float(size), scale / 2))
            with suppress(UnreachableError):  # this only tells outliers; the last fit decides
                self.fit(seen, scale)

    def covariance(self, seen: Identifiable) -> Array:
        """Return that of the combinations that are seen, in one unit, of the readings in use."""
        _, A, B = self.weighed(self.x, self.p)
        used = self.used[..., None]
        rows = np.vstack([*(reduced(A * used, B * used)), self._prior]) @ seen.seen
        s, across = np.linalg.svd(rows, full_matrices=False)[1:]
        if rank(s, 1e-12) < len(s):
            raise UnreachableError(
                f"the {int(self.used.sum())} readings that are no outliers do not determine the "
                "parameters that all of them together do"
            )
        return np.asarray((across.T / s**2) @ across)

    def leave_out(self) -> None:
        """Decide anew which readings are outliers: `outliers`, with the parameters as they are."""
        r, A, _ = self.weighed(self.x, self.p)
        self.used = self._known & ~outliers(r, A, self._known)

    def residuals(self) -> Array:
        """Return the residuals, shape (poses, sensors); NaN where nothing was read."""
        return np.where(self._known, self.weighed(self.x, self.p).residuals, np.nan)

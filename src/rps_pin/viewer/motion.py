"""Motion of a robot: its state at any time, and at an even frame rate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.validation import positive_number, real_array, real_vector

FRAME_RATE = 30.0
"""Pictures per second, unless told otherwise."""
_UNIT_TOLERANCE = 1e-3
"""Deviation of a quaternion's length from one that is accepted; it cannot be seen."""


class MotionState(NamedTuple):
    """State of a motion at one time."""

    q: Array
    """Configuration, shape (nq,)."""
    v: Array
    """Velocity, shape (nv,)."""
    a: Array
    """Acceleration, shape (nv,)."""
    tau: Array | None = None
    """Actuator forces, shape (na,); None where they follow from q, v and a by inverse dynamics."""
    constraint_forces: Array | None = None
    """Forces of the closures, shape (nc,); None where they follow from q, v, a and tau."""


class Motion:
    """Configurations at increasing times, interpolated on the robot's configuration manifold.

    Parameters
    ----------
    model
        The robot.
    times : array_like, shape (n,)
        Times in seconds, strictly increasing; n may be one.
    configurations : array_like, shape (n, nq)
        The configuration at each time.
    velocities, accelerations : array_like, shape (n, nv)
        Velocities and accelerations, for the layers that show forces. Default: zero.
    forces : array_like, shape (n, na)
        Actuator forces. Default: those of inverse dynamics.
    constraint_forces : array_like, shape (n, nc)
        Forces of the closures, as `InverseDynamics` has them. Default: those that follow from the
        motion, its actuator forces and wrenches.
    wrenches
        Constant external wrenches by frame name, for these layers too: force (N) and moment (N m)
        at the frame's origin in world axes, shape (6,).

    Raises
    ------
    InputError
        If the shapes do not fit, a value is not finite, the times do not increase, or a
        configuration holds a quaternion that is not of unit length.
    """

    def __init__(
        self,
        model: pin.Model,
        times: ArrayLike,
        configurations: ArrayLike,
        velocities: ArrayLike | None = None,
        accelerations: ArrayLike | None = None,
        *,
        forces: ArrayLike | None = None,
        constraint_forces: ArrayLike | None = None,
        wrenches: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        self._model = model
        self.configurations = checked_configurations(model, configurations)
        n, nv = len(self.configurations), model.nv
        self.times = real_vector(times, n, "times")
        if np.any(np.diff(self.times) <= 0.0):
            raise InputError("times must be strictly increasing")
        self.forces = _rows(forces, n, "na", "forces")
        self.constraint_forces = _rows(constraint_forces, n, "nc", "constraint_forces")
        self.wrenches = dict(wrenches or {})
        self.at_rest = velocities is None and accelerations is None
        v, a = _rows(velocities, n, nv, "velocities"), _rows(accelerations, n, nv, "accelerations")
        self.velocities = np.zeros((n, nv)) if v is None else v
        self.accelerations = np.zeros((n, nv)) if a is None else a

    @property
    def duration(self) -> float:
        """Time from the first configuration to the last, in seconds."""
        return float(self.times[-1] - self.times[0])

    def at(self, elapsed: float) -> Array:
        """Return the configuration, shape (nq,), `elapsed` seconds after the first one.

        Before the start and after the end it is the first and the last configuration.
        """
        (before, fraction), q = self._locate(elapsed), self.configurations
        if fraction == 0.0:
            return np.asarray(q[before])
        return np.asarray(pin.interpolate(self._model, q[before], q[before + 1], fraction))

    def state_at(self, elapsed: float) -> MotionState:
        """Return configuration, velocity and acceleration `elapsed` seconds after the first."""
        before, fraction = self._locate(elapsed)
        after = before + (fraction > 0.0)

        def between(rows: Array) -> Array:
            return np.asarray((1.0 - fraction) * rows[before] + fraction * rows[after])

        known = (self.forces, self.constraint_forces)
        tau, constraint = (None if rows is None else between(rows) for rows in known)
        rates = between(self.velocities), between(self.accelerations)
        return MotionState(self.at(elapsed), *rates, tau, constraint)

    def _locate(self, elapsed: float) -> tuple[int, float]:
        """Return the index of the sample before a time, and the fraction of the step after it."""
        time = self.times[0] + elapsed
        after = int(np.searchsorted(self.times, time, side="right"))
        if after == 0 or after == len(self.times):
            return max(after - 1, 0), 0.0
        start, end = self.times[after - 1], self.times[after]
        return after - 1, float((time - start) / (end - start))

    def states(self, frame_rate: float = FRAME_RATE) -> Iterator[MotionState]:
        """Give the states at the times of `sampled`."""
        for elapsed in self.sample_times(frame_rate):
            yield self.state_at(float(elapsed))

    def sample_times(self, frame_rate: float = FRAME_RATE) -> Array:
        """Return the times of `sampled`, in seconds since the first configuration, shape (m,)."""
        positive_number(frame_rate, "frame_rate")
        steps = max(1, round(self.duration * frame_rate)) if self.duration > 0.0 else 0
        return np.linspace(0.0, self.duration, steps + 1)

    def sampled(self, frame_rate: float = FRAME_RATE) -> tuple[Array, ...]:
        """Return evenly spaced samples, from the first configuration to the last.

        Parameters
        ----------
        frame_rate
            Samples per second; the spacing is adjusted so that the last one falls on the end.

        Returns
        -------
        elapsed : ndarray, shape (m,)
            Seconds since the first configuration; m is one for a motion of no duration.
        configurations : ndarray, shape (m, nq)
            The configurations then.

        Raises
        ------
        InputError
            If the frame rate is not a positive number.
        """
        elapsed = self.sample_times(frame_rate)
        return elapsed, np.array([self.at(float(time)) for time in elapsed])


def _rows(given: ArrayLike | None, n: int, size: int | str, name: str) -> Array | None:
    """Return n rows of finite numbers, or None; a size that is text is for the error only."""
    if given is None:
        return None
    rows = real_array(given, name)
    if rows.ndim != 2 or len(rows) != n or (isinstance(size, int) and rows.shape[1] != size):
        raise InputError(f"{name} has shape {rows.shape}; it must be ({n}, {size})")
    return rows


def checked_configurations(model: pin.Model, configurations: ArrayLike) -> Array:
    """Return configurations as an array of shape (n, nq), n at least one.

    Parameters
    ----------
    model
        The robot.
    configurations : array_like, shape (nq,) or (n, nq)
        One or more configurations.

    Raises
    ------
    InputError
        If the shape does not fit, a value is not finite, or a quaternion is not of unit length.
    """
    q = real_array(configurations, "configurations")
    if q.ndim not in (1, 2) or q.shape[-1] != model.nq or q.size == 0:
        raise InputError(
            f"a configuration of this robot has nq = {model.nq} numbers: the shape must be "
            f"({model.nq},) or (n, {model.nq}), not {q.shape}"
        )
    q = q.reshape(-1, model.nq)
    for index, row in enumerate(q):
        if not pin.isNormalized(model, row, _UNIT_TOLERANCE):
            raise InputError(
                f"configuration {index} holds a quaternion (or a cosine and sine) that is not of "
                f"unit length to within {_UNIT_TOLERANCE}"
            )
    return q

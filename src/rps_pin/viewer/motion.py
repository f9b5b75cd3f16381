"""Motion of a robot: its state at any time, and at an even frame rate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError

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
        self.times: Array = np.asarray(times, dtype=np.float64)
        self.configurations = checked_configurations(model, configurations)
        if self.times.shape != (len(self.configurations),):
            raise InputError(
                f"times has shape {self.times.shape}; with configurations of shape "
                f"{self.configurations.shape} it must be ({len(self.configurations)},)"
            )
        if not np.all(np.isfinite(self.times)) or np.any(np.diff(self.times) <= 0.0):
            raise InputError("times must be finite and strictly increasing")
        self.forces = self._known_forces(forces, "forces", "na")
        self.constraint_forces = self._known_forces(constraint_forces, "constraint_forces", "nc")
        self.wrenches = dict(wrenches or {})
        self.at_rest = velocities is None and accelerations is None
        self.velocities = self._rates(velocities, "velocities")
        self.accelerations = self._rates(accelerations, "accelerations")

    def _rates(self, given: ArrayLike | None, name: str) -> Array:
        wanted = (len(self.times), self._model.nv)
        if given is None:
            return np.zeros(wanted)
        rates = np.asarray(given, dtype=np.float64)
        if rates.shape != wanted or not np.isfinite(rates).all():
            raise InputError(f"{name} has shape {rates.shape}; it must be {wanted}, all finite")
        return rates

    def _known_forces(self, given: ArrayLike | None, name: str, size: str) -> Array | None:
        if given is None:
            return None
        forces = np.asarray(given, dtype=np.float64)
        n = len(self.times)
        if forces.ndim != 2 or len(forces) != n or not np.isfinite(forces).all():
            raise InputError(f"{name} has shape {forces.shape}; it must be ({n}, {size}), finite")
        return forces

    @property
    def duration(self) -> float:
        """Time from the first configuration to the last, in seconds."""
        return float(self.times[-1] - self.times[0])

    def at(self, elapsed: float) -> Array:
        """Return the configuration, shape (nq,), `elapsed` seconds after the first one.

        Before the start and after the end it is the first and the last configuration.
        """
        before, fraction = self._place(elapsed)
        if fraction == 0.0:
            given: Array = self.configurations[before]
            return given
        between: Array = pin.interpolate(
            self._model, self.configurations[before], self.configurations[before + 1], fraction
        )
        return between

    def state_at(self, elapsed: float) -> MotionState:
        """Return configuration, velocity and acceleration `elapsed` seconds after the first."""
        before, fraction = self._place(elapsed)
        after = before + (fraction > 0.0)

        def between(rows: Array) -> Array:
            row: Array = (1.0 - fraction) * rows[before] + fraction * rows[after]
            return row

        known = (self.forces, self.constraint_forces)
        tau, constraint = (None if rows is None else between(rows) for rows in known)
        rates = between(self.velocities), between(self.accelerations)
        return MotionState(self.at(elapsed), *rates, tau, constraint)

    def _place(self, elapsed: float) -> tuple[int, float]:
        """Return the sample at or before a time, and the share of the way to the next one."""
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
        check_frame_rate(frame_rate)
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


def check_frame_rate(frame_rate: float) -> None:
    """Raise `InputError` unless `frame_rate` is positive and finite."""
    if not np.isfinite(frame_rate) or frame_rate <= 0.0:
        raise InputError(f"frame_rate = {frame_rate!r}: it must be positive and finite")


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
    q = np.asarray(configurations, dtype=np.float64)
    if q.ndim not in (1, 2) or q.shape[-1] != model.nq or q.size == 0:
        raise InputError(
            f"a configuration of this robot has nq = {model.nq} numbers: the shape must be "
            f"({model.nq},) or (n, {model.nq}), not {q.shape}"
        )
    q = q.reshape(-1, model.nq)
    if not np.all(np.isfinite(q)):
        raise InputError("a configuration holds a number that is not finite")
    for index, row in enumerate(q):
        if not pin.isNormalized(model, row, _UNIT_TOLERANCE):
            raise InputError(
                f"configuration {index} holds a quaternion (or a cosine and sine) that is not of "
                f"unit length to within {_UNIT_TOLERANCE}"
            )
    return q

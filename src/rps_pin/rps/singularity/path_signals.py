"""Signals of a path of the 3-RPS: functions of time that are zero where something goes wrong.

The signals are the signed measures of singularities (`rps_pin.rps.singularity.measure_rates`) and,
for each limit of each leg, the room that is left, each with its exact rate along the path.
"""

from __future__ import annotations

import math

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.rps.kernels import legs, tips
from rps_pin.rps.kernels.limits import LIMIT_TOLERANCE
from rps_pin.rps.kinematics.pose import components, tilt_of
from rps_pin.rps.kinematics.rates import LegJacobians, masked_leg_jacobians
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.singularity.measure_rates import rates_of_legs
from rps_pin.rps.singularity.measures import checked_tilt
from rps_pin.task.paths.findings import Signal, checked_samples, checked_times
from rps_pin.trajectories.path import Trajectory

#: A leg shorter than this part of h, where the sign of type II jumps, is passing through zero.
_VANISHING = 1e-6
#: Times that are worked on at once.
_CHUNK = 50_000


#: In the order of `measure_rates`.
SINGULARITIES = (
    Signal("type II", 0),
    Signal("constraint", 0),
    *(Signal("type I", leg) for leg in (1, 2, 3)),
)
TYPE_I = slice(2, 5)


class PathSignals:
    """A trajectory of a robot as signals of time."""

    kinds = SINGULARITIES

    def __init__(
        self, parameters: RPSParameters, trajectory: Trajectory, tolerance: float | None
    ) -> None:
        self.parameters = parameters
        self.trajectory = trajectory
        self.duration, self.tolerance = checked_times(trajectory, tolerance)
        self.limits = _limits_of(parameters)
        self.scale = np.array([1 / parameters.platform_radius, 1.0, 1.0])

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Return poses and rates at times (n,), shape (n, 3) each, checked."""
        found = self.trajectory.sample(times)
        pose, rate = (checked_samples(getattr(found, n), times, n, 3) for n in ("pose", "rate"))
        return checked_tilt(pose), rate

    def signals(self, times: Array) -> tuple[Array, Array]:
        """Return every signal and its rate at times (n,), shape (n, signals) each."""
        parts = [self._signals(times[i : i + _CHUNK]) for i in range(0, times.size, _CHUNK)]
        values, rates = zip(*parts, strict=True)
        return np.concatenate(values), np.concatenate(rates)

    def rates(self, times: Array) -> Array:
        """Return the rates alone at times (n,)."""
        return self.signals(times)[1]

    def matters(self, sizes: Array, slopes: Array, steps: Array, threshold: float) -> Bools:
        """Return that every turning point does: signals cost little."""
        return np.ones(sizes[1:].shape, dtype=bool)

    def may_jump(self, values: Array) -> Bools:
        """Return where type II's sign may flip: a leg passes through no length, type I."""
        return np.asarray(values[:, TYPE_I].min(axis=-1) <= _VANISHING)

    def where(self, pose: Array) -> str:
        """Return nothing: events have words for these poses."""
        return ""

    def _signals(self, times: Array) -> tuple[Array, Array]:
        pose, rate = self.sample(times)
        jacobians, vanishing = masked_leg_jacobians(self.parameters, pose)
        value, change = rates_of_legs(self.parameters, pose, rate, jacobians, vanishing)
        # A leg without length is a type I singularity; type II is not determined there.
        value[(value[:, TYPE_I] == 0).any(axis=-1), 0] = 1.0
        room, room_rate = _room_of(self.parameters, self.limits, pose, rate, jacobians, vanishing)
        return np.concatenate([value, room], axis=-1), np.concatenate([change, room_rate], axis=-1)


class RobotLimits:
    """The limits of a robot's legs, as `rps_pin.task.paths.limits` has them of any mechanism."""

    def __init__(self, parameters: RPSParameters) -> None:
        self._parameters = parameters
        self.signals = _limits_of(parameters)

    def rooms(self, q: Array, v: Array, pose: Array, rate: Array) -> tuple[Array, Array]:
        """Return the room to each limit and its rate, shape (n, limits), at poses (n, 3)."""
        jacobians = masked_leg_jacobians(self._parameters, pose)
        return _room_of(self._parameters, self.signals, pose, rate, *jacobians)


def _room_of(
    parameters: RPSParameters,
    limits: tuple[Signal, ...],
    pose: Array,
    rate: Array,
    jacobians: LegJacobians,
    vanishing: Bools,
) -> tuple[Array, Array]:
    speed = np.einsum("...ij,...j->...i", jacobians.length_jacobian, rate)
    turning = np.einsum("...ij,...j->...i", jacobians.angle_jacobian, rate)
    legs = {
        "length": (jacobians.length, np.where(vanishing, 0.0, speed)),
        "angle": (jacobians.angle, turning),
    }
    return _rooms(parameters, limits, pose, rate, legs)


def _limits_of(parameters: RPSParameters) -> tuple[Signal, ...]:
    """Return the limits that a leg can break."""
    p = parameters
    sides = [
        ("length", "lower", p.leg_length_limits[0], "m", 0.0),
        ("length", "upper", p.leg_length_limits[1], "m", math.inf),
        ("angle", "lower", p.leg_angle_limits[0], "rad", -math.pi),
        ("angle", "upper", p.leg_angle_limits[1], "rad", math.pi),
        ("spherical joint", "upper", p.spherical_cone_limit, "rad", math.pi),
    ]
    return tuple(
        Signal(quantity, leg, side, limit, unit)
        for quantity, side, limit, unit, widest in sides
        if (limit > widest if side == "lower" else limit < widest)
        for leg in (1, 2, 3)
    )


def _rooms(
    parameters: RPSParameters,
    limits: tuple[Signal, ...],
    pose: Array,
    rate: Array,
    quantities: dict[str, tuple[Array, Array]],
) -> tuple[Array, Array]:
    """Return the room to each limit and its rate, shape (n, limits); negative beyond the limit.

    For the spherical joints it is that of the angle's cosine, which is smooth. `quantities` are the
    legs' lengths and angles with their rates, (n, 3 legs) each.
    """
    rooms, rates = np.empty((2, len(pose), len(limits)))
    if any(signal.name == "spherical joint" for signal in limits):
        angles = _cone_cosines(parameters, pose, rate, *quantities["angle"])
        quantities = quantities | {"spherical joint": angles}
    for column, signal in enumerate(limits):
        value, change = (array[:, signal.leg - 1] for array in quantities[signal.name])
        if signal.name == "spherical joint":
            room = value - math.cos(min(signal.limit + LIMIT_TOLERANCE, math.pi))
        elif signal.side == "lower":
            room = value - signal.limit + _slack(signal)
        else:
            room, change = signal.limit + _slack(signal) - value, -change
        rooms[:, column], rates[:, column] = room, change
    return rooms, rates


def _slack(signal: Signal) -> float:
    """Return by how much a limit may be passed: by rounding."""
    return LIMIT_TOLERANCE * (signal.limit if signal.unit == "m" else 1.0)


def _cone_cosines(
    parameters: RPSParameters, pose: Array, rate: Array, angle: Array, angle_rate: Array
) -> tuple[Array, Array]:
    """Return the cosines of the angles between legs and rest axes, and their rates, (n, 3 legs)."""
    rest = math.cos(parameters.spherical_rest_angle), math.sin(parameters.spherical_rest_angle)
    x, y, tilt = tilt_of(pose)
    _, dx, dy = components(rate)
    e, t, de, dt = (tips.at_legs((0.0, *pair)) for pair in ((x, y), (y, -x), (dx, dy), (dy, -dx)))
    out, _, up = legs.rest_axis(e, t, tilt, *rest)
    cosine, sine = np.cos(angle.T), np.sin(angle.T)
    turning = angle_rate.T * legs.across_leg(cosine, sine, out, up)
    axis_rate = legs.rest_axis_rate(e, t, de, dt, tilt, *rest)
    return (
        legs.cone_cosine(cosine, sine, out, up).T,
        (turning + legs.cone_cosine(cosine, sine, *axis_rate)).T,
    )

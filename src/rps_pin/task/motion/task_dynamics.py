"""Forces, accelerations and speeds of a task's motion along a curve, by inverse dynamics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InfeasibleError, LimitExcess, RPSPinError, SingularityError
from rps_pin.task.motion.curve_dynamics import CurveDynamics, CurveLimits
from rps_pin.task.motion.limits import sides_of, unit
from rps_pin.task.task import Task
from rps_pin.trajectories.curve import Curve, CurveSample

#: Places of the curve from which configurations are continued, and where holding is checked.
_ANCHORS = 257
#: Places that are remembered.
_MOST_KNOWN = 100_000
#: At how many times the motion is checked at last, of a task that is not compiled.
_FEW_TIMES = 2_001


class Place(NamedTuple):
    """Points of a curve."""

    curve: CurveSample
    """Coordinates and their derivatives."""
    q: Array
    """Configurations, shape (..., nq)."""
    velocity: Array
    """Velocities at u' = 1, shape (..., nv)."""
    acceleration: Array
    """Accelerations at u' = 1 and u'' = 0, shape (..., nv)."""
    wrench: Array
    """Forces of the actuators against the wrench, shape (..., na)."""


class TaskDynamics(CurveDynamics):
    """Forces, accelerations and speeds of a task that moves along a curve.

    Parameters
    ----------
    task
        The task.
    curve
        Of its coordinates.
    bounds
        Limits of actuators and coordinates.
    wrench
        Constant wrench that the surroundings exert on the output frame, shape (6,), or None.
    near
        Closed configuration whose assembly mode the curve begins in, shape (nq,), or None.

    Raises
    ------
    RPSPinError
        If the curve cannot be followed, as `Task.configuration`; says at which u.
    SingularityError
        If it crosses a singularity of type II.
    """

    def __init__(
        self,
        task: Task,
        curve: Curve,
        bounds: CurveLimits,
        wrench: Array | None,
        near: ArrayLike | None,
    ) -> None:
        self.task = task
        self.wrench = wrench
        self._actuated = task.mechanism.actuated_indices
        self._u = np.linspace(0.0, curve.length, _ANCHORS)
        self._known: Array = np.empty(0)
        self._rows: tuple[Array, ...] = ()
        if not task.is_compiled:
            self.times = _FEW_TIMES
        self._anchors = _followed(task, curve, self._u, near)
        self._refuse_crossing(curve)
        effects = task.mechanism.effects
        rubs = effects is not None and bool(effects.damping.any() or effects.friction.any())
        super().__init__(curve, bounds, sides_of(task, bounds), rubs)

    def place(self, u: Array) -> Place:
        """Return configurations, and velocities and accelerations at u' = 1; computed once each."""
        wanted = np.unique(u)
        if self._known.size + wanted.size > _MOST_KNOWN:
            self._known, self._rows = np.empty(0), ()
        new = np.setdiff1d(wanted, self._known, assume_unique=True)
        if new.size:
            rows = self._computed(new)
            where = np.searchsorted(self._known, new)
            both = zip(self._rows, rows, strict=True) if self._rows else ((x[:0], x) for x in rows)
            self._rows = tuple(np.insert(old, where, more, axis=0) for old, more in both)
            self._known = np.insert(self._known, where, new)
        index = np.searchsorted(self._known, u)
        return Place(self.curve.at(u), *(row[index] for row in self._rows))

    def levels(self, place: Place, rate: Array, acceleration: Array) -> Array:
        """Return the actuators' forces, and accelerations that have limits, shape (..., k)."""
        r, a = rate[..., None], acceleration[..., None]
        change = place.velocity * a + place.acceleration * r**2
        force = self.task.actuator_forces(place.q, place.velocity * r, change) + place.wrench
        parts = [force]
        if self.bounds.acceleration.size:
            parts.append(change[..., self._actuated])
        if self.bounds.coordinate_acceleration.size:
            parts.append(place.curve.first * a + place.curve.second * r**2)
        return np.concatenate(parts, axis=-1)

    def speed_slopes(self, place: Place) -> Array:
        """Return the speeds at u' = 1 that have limits, shape (..., l)."""
        speed = place.velocity[..., self._actuated]
        if not self.bounds.coordinate_speed.size:
            return speed
        return np.concatenate([speed, place.curve.first], axis=-1)

    def jerk_slopes(self, place: Place) -> tuple[Array, Array]:
        """Return first and second derivatives by u of what has limits of jerk, (..., j) each."""
        parts = [(place.curve.first[..., :0], place.curve.second[..., :0])]
        if self.bounds.jerk.size:
            actuators = place.velocity, place.acceleration
            parts.append((actuators[0][..., self._actuated], actuators[1][..., self._actuated]))
        if self.bounds.coordinate_jerk.size:
            parts.append((place.curve.first, place.curve.second))
        first, second = zip(*parts, strict=True)
        return np.concatenate(first, axis=-1), np.concatenate(second, axis=-1)

    def infeasible(self) -> InfeasibleError:
        """Return the error of a curve without a time law: the forces at rest exceed their limits.

        If holding is possible at every point, so is a motion that is slow enough.
        """
        holding = self.terms(self._u).holding
        over = np.abs((holding - self.middle) / self.half)
        place, level = np.unravel_index(int(over.argmax()), over.shape)
        value, most = float(holding[place, level]), float(over[place, level])
        name = self.sides[level].removesuffix(" +")
        x = self.curve.at(self._u[place]).pose
        told = ", ".join(f"{c} = {v:.6g}" for c, v in zip(self.task.coordinates, x, strict=True))
        where = f"at u = {self._u[place]:.6g} of {self.curve.length:.6g} ({told})"
        if most <= 1:
            return InfeasibleError(
                f"no time law was found that keeps the limits, although holding still takes at "
                f"most {most:.4g} of one, of {name} {where}"
            )
        angular = self.task.mechanism.system.equations.angular_velocities[self._actuated[level]]
        of = unit("force", bool(angular))
        limit = float(
            self.middle[level] + np.copysign(self.half[level], value - self.middle[level])
        )
        return InfeasibleError(
            f"no time law keeps the actuators' limits from rest to rest: {where}, holding still "
            f"takes a {name} of {value:.6g} {of}, and its limit is {limit:.6g} {of}",
            [LimitExcess(name, value, limit, of)],
        )

    # Parts ----------------------------------------------------------------------------------------

    def _computed(self, u: Array) -> tuple[Array, ...]:
        """Return the parts of a `Place` that take time, at parameters (n,)."""
        x = self.curve.at(u)
        nearest = np.rint(u / self.curve.length * (_ANCHORS - 1)).astype(np.intp)
        q = self.task.configuration(x.pose, self._anchors[nearest])
        _, velocity, acceleration = self.task.motion(q, x.first, x.second, x=x.pose)
        wrench = np.zeros((u.size, self._actuated.size))
        if self.wrench is not None:
            wrench = -self.task.wrench_to_actuators(q, self.wrench)
        return q, velocity, acceleration, wrench

    def _refuse_crossing(self, curve: Curve) -> None:
        """Refuse a curve along which the determinant of K changes its sign."""
        if self._actuated.size != self.task.size:
            return
        sign = np.sign(self.task.singularities(self._anchors).determinant)
        crossed = np.flatnonzero(sign[1:] * sign[:-1] <= 0)
        if crossed.size:
            first, last = self._u[crossed[0]], self._u[crossed[0] + 1]
            raise SingularityError(
                f"between u = {first:.6g} and {last:.6g} of {curve.length:.6g} the curve crosses a "
                "type II singularity: no actuator forces carry the mechanism through it",
                np.inf,
                self.task.mechanism.max_condition,
            )


def _followed(task: Task, curve: Curve, u: Array, near: ArrayLike | None) -> Array:
    """Return configurations at increasing parameters, each continued from the one before."""
    poses, found = curve.at(u).pose, []
    q: ArrayLike | None = near
    for value, pose in zip(u, poses, strict=True):
        try:
            q = task.configuration(pose, q)
        except RPSPinError as error:
            error.args = (f"at u = {value:.6g} of {u[-1]:.6g}: {error}", *error.args[1:])
            raise
        found.append(q)
    return np.array(found)

"""What points of a task demand of the actuators' forces and speeds, as shares of their limits.

Forces are those at rest: of weights, springs and a payload, and of each of a set of wrenches. With
W = K^-T E' (`Task.wrench_map`) a wrench w on the output frame takes -W w of the actuators; a
payload is the wrench of its weight. Forces are linear in the wrench, so that those of a set's
corners bound those of all wrenches between them. Speeds are K x'. In any direction, the largest of
a row's product with a vector is the row's length times the vector's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, shown
from rps_pin.task.loads import Loads, Payload
from rps_pin.task.paths.findings import Signal
from rps_pin.task.paths.limits import LIMIT_TOLERANCE
from rps_pin.task.sizing.actuator_sizing import UNITS, limits_of_each
from rps_pin.task.sizing.sizing import limits_of
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits
from rps_pin.task.task import Task
from rps_pin.validation import positive_number, real_array

Limits = ActuatorLimits | Sequence[ActuatorLimits]


class Demands:
    """Forces and speeds that a task demands at each point, as shares of the actuators' limits.

    Parameters
    ----------
    task, payload, wrench, force, moment, speed, turning_speed, rates, limits
        As for `rps_pin.task.workspace.workspace`.

    Attributes
    ----------
    forces, speeds : bool
        Whether there are such demands.
    signals : tuple of Signal
        The limits that can be broken: first those of forces, then those of speeds.

    Raises
    ------
    InputError, MechanismError
        As `rps_pin.task.workspace.workspace`.
    """

    def __init__(
        self,
        task: Task,
        *,
        payload: Payload | None = None,
        wrench: ArrayLike | None = None,
        force: float | None = None,
        moment: float | None = None,
        speed: float | None = None,
        turning_speed: float | None = None,
        rates: ArrayLike | None = None,
        limits: Limits | None = None,
    ) -> None:
        self._task, self._payload = task, payload
        self.forces = any(given is not None for given in (payload, wrench, force, moment))
        given = Loads(task, payload, np.zeros(6) if self.forces and wrench is None else wrench)
        self._wrenches = np.zeros((0, 6))
        if given.wrench is not None:
            self._wrenches = _corners(given.wrench, "wrench", 6)
        self._pushes = tuple(
            0.0 if size is None else positive_number(size, name, unit)
            for size, name, unit in ((force, "force", "N"), (moment, "moment", "N m"))
        )
        self._rates = None if rates is None else real_array(rates, "rates", (task.size,))
        if self._rates is not None:
            self._rates = _corners(self._rates, "rates", task.size)
        self._speeds = (
            _any_direction(task, speed, "speed", "m/s", turns=False),
            _any_direction(task, turning_speed, "turning_speed", "rad/s", turns=True),
        )
        self.speeds = rates is not None or any(self._speeds)
        each = _limits(task, limits)
        self._force_limits = np.array([one.force for one in each])
        self._speed_limits = np.array([one.speed for one in each])
        if limits is not None and not (self.forces or self.speeds):
            raise InputError("limits are for a load, a speed or rates; there are none")
        forces = _signals(task, "force", self._force_limits) if self.forces else ()
        speeds = _signals(task, "speed", self._speed_limits) if self.speeds else ()
        self.signals = (*forces, *speeds)
        of = task.mechanism.actuated.index
        self._which = [np.array([of(s.joint) for s in one], int) for one in (forces, speeds)]

    @property
    def widths(self) -> tuple[int, int]:
        """Columns of the shares of forces and of speeds: as many as actuators, or none."""
        count = len(self._task.mechanism.actuated)
        return count * self.forces, count * self.speeds

    def broken(self, forces: Array, speeds: Array) -> Bools:
        """Return of shares (n, na) which limits are broken, (n, signals)."""
        limited = (
            share[:, which] for share, which in zip((forces, speeds), self._which, strict=True)
        )
        return np.concatenate([~(part <= 1 + LIMIT_TOLERANCE) for part in limited], axis=-1)

    def at_rest(self, q: Array, W: Array | None) -> Array:
        """Return the actuators' forces at rest with the payload, (n, na); infinite if singular."""
        still = np.zeros((len(q), self._task.mechanism.model.nv))
        forces = self._task.actuator_forces(q, still, still, errors="mask")
        if self._payload is not None:
            assert W is not None
            weight = self._weight(q, self._payload)
            forces = forces - np.einsum("nij,nj->ni", W, weight)
        return np.where(np.isfinite(forces), forces, np.inf)

    def wrench_map(self, q: Array, x: Array) -> Array | None:
        """Return W, (n, na, 6), if there is a load, NaN where it is singular."""
        return self._task.wrench_map(q, x=x, errors="mask") if self.forces else None

    def force_share(self, at_rest: Array, W: Array | None) -> Array:
        """Return the largest force of each actuator over its limit, (n, na); 0 without a limit."""
        if not self.forces:
            return np.zeros((len(at_rest), 0))
        assert W is not None
        most = np.zeros_like(at_rest)
        for wrench in self._wrenches:
            most = np.maximum(most, np.abs(at_rest - W @ wrench))
        for size, part in zip(self._pushes, (slice(3), slice(3, 6)), strict=True):
            most += size * np.linalg.norm(W[..., part], axis=-1)
        return _share(most, self._force_limits)

    def speed_share(self, K: Array) -> Array:
        """Return the largest speed of each actuator over its limit, (n, na); of K (n, na, m).

        Any direction: the largest of K_i x' with |x'| = 1 is |K_i|.
        """
        if not self.speeds:
            return np.zeros((len(K), 0))
        turns = np.array(self._task.angular)
        most = np.zeros(K.shape[:-1])
        for speed, which in zip(self._speeds, (~turns, turns), strict=True):
            most += speed * np.linalg.norm(K[..., which], axis=-1)
        for rate in () if self._rates is None else self._rates:
            most = np.maximum(most, np.abs(K @ rate))
        return _share(most, self._speed_limits)

    def _weight(self, q: Array, payload: Payload) -> Array:
        """Return the wrench of the payload's weight at the output frame's origin, (n, 6)."""
        frame, offset = self._task.output_frame
        placed = self._task.engines[1].frame_placement(q, frame, errors="mask")
        arm = placed[:, :3, :3] @ (offset.rotation @ np.asarray(payload.centre))
        force = payload.mass * np.asarray(self._task.mechanism.model.gravity.linear)
        return np.concatenate([np.broadcast_to(force, arm.shape), np.cross(arm, force)], axis=-1)


def _share(most: Array, limit: Array) -> Array:
    """Return magnitudes over limits; infinite where they are not finite and there is a limit."""
    most = np.where(np.isfinite(most), most, np.inf)
    return np.where(np.isfinite(limit), most / np.where(np.isfinite(limit), limit, 1.0), 0.0)


def _corners(given: Array, name: str, size: int) -> Array:
    """Return (k, size) numbers, of one or of several."""
    found = given[None] if given.ndim == 1 else given
    if found.ndim != 2 or not len(found):
        raise InputError(f"{name} has shape {given.shape}; it must be ({size},) or (k, {size})")
    return found


def _any_direction(task: Task, given: float | None, name: str, unit: str, *, turns: bool) -> float:
    """Return a speed of all lengths, or of all angles; zero if left out."""
    if given is None:
        return 0.0
    found = positive_number(given, name, unit)
    if turns not in task.angular:
        kind = "an angle" if turns else "a length"
        raise InputError(
            f"{name} = {shown(given)} {unit}: no coordinate of the task is {kind} "
            f"({', '.join(task.coordinates)})"
        )
    return found


def _limits(task: Task, given: Limits | None) -> tuple[ActuatorLimits, ...]:
    """Return the limits of each actuator: those of the mechanism's file, or those given."""
    own = limits_of(task)
    if given is None:
        return own
    each = limits_of_each(given, len(own))
    for name, one, of_file in zip(task.mechanism.actuated, each, own, strict=True):
        if np.isfinite(one.power):
            raise InputError(
                f"{name}: a limit of power ({one.power:g} W) needs a motion: size_trajectory"
            )
        if one.length not in (of_file.length, type(one)().length):
            raise InputError(
                f"{name}: limits of positions are those of the mechanism's file, not {one.length}"
            )
    return each


def _signals(task: Task, quantity: str, limits: Array) -> tuple[Signal, ...]:
    """Return the limits of a quantity as signals, in the order of the actuators.

    Raises
    ------
    InputError
        If no actuator has one.
    """
    mechanism = task.mechanism
    if not np.isfinite(limits).any():
        raise InputError(
            f"no actuator of {mechanism.name or 'the mechanism'} has a limit of {quantity}; give "
            "limits=DriveLimits(force=..., speed=...), or write them into its file"
        )
    angular = mechanism.angular_velocities[mechanism.actuated_indices]
    which = ("force", "speed").index(quantity)
    return tuple(
        Signal(quantity, 0, "both", float(limit), UNITS[int(turns)][which], name)
        for name, limit, turns in zip(mechanism.actuated, limits, angular, strict=True)
        if np.isfinite(limit)
    )

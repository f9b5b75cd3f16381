"""What sensors read at poses, and how that changes with the poses and with the parameters.

The state of a pose is the extended mechanism's q(x, p): x are the task's coordinates, p the
parameters, and the gaps of its closures are zero,

    g(q, p) = 0,     J_d dq_d = -(J_x dx + G dp),

with J the closures' Jacobian, d its columns of the joints other than x, and G = dg/dp.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.errors import InputError
from rps_pin.task.calibration.sensors import sensor_columns
from rps_pin.task.task import Task

#: Groups of numbers that decide positions; see `rps_pin.codegen.expressions.parameters`.
_GEOMETRY = ("placement", "closure", "distance")
#: Singular values of the closures' Jacobian below this part of the largest are none.
_REDUNDANT = 1e-8


class Predicted(NamedTuple):
    """Readings that a model predicts at poses, and their derivatives."""

    q: Array
    """Configurations of the extended mechanism, shape (poses, nq)."""
    readings: Array
    """Shape (poses, sensors)."""
    by_pose: Array
    """Derivatives by the task's coordinates, shape (poses, sensors, m)."""
    by_parameters: Array
    """Derivatives by the parameters, shape (poses, sensors, p)."""
    opening: Array
    """What changes of the parameters open of the loops, in spite of all that the joints can do,
    shape (poses, rows, p): empty unless the closures have redundant rows."""


class CalibrationModel:
    """A mechanism with parameters, and sensors that have an offset and a scale.

    Parameters
    ----------
    task
        The task of the mechanism as it is believed to be.
    groups
        Groups of geometric numbers that are parameters: ``placement:JOINT``, ``closure:NAME``.
    sensors
        What is read, as in `Readings`.
    offsets, scales
        Sensors whose offset, or scale, is a parameter.
    options
        Of `ClosedLoopModel.compile`.

    Attributes
    ----------
    labels : tuple of str
        What each parameter is: ``placement:leg_1.x``, ``offset:leg_1_slide``.
    nominal : array
        The parameters of the mechanism as it is believed to be, shape (p,).
    units : array
        What a unit of each parameter counts for as a length, shape (p,), m.

    Raises
    ------
    InputError
        If a group is not geometric or unknown, or a sensor is not among those given.
    """

    def __init__(
        self,
        task: Task,
        groups: Sequence[str],
        sensors: Sequence[str],
        offsets: Sequence[str] = (),
        scales: Sequence[str] = (),
        **options: Any,
    ) -> None:
        for group in groups:
            if group.partition(":")[0] not in _GEOMETRY:
                raise InputError(
                    f"{group!r} is no group of geometric parameters; these are "
                    + ", ".join(f"{kind}:NAME" for kind in _GEOMETRY)
                )
        self.task, self.sensors = task, tuple(sensors)
        columns = sensor_columns(task, self.sensors)
        self._read, self._moved = columns.q, columns.v
        self._offsets, self._scales = (_places(self.sensors, one) for one in (offsets, scales))
        options.setdefault("functions", ("kinematics", "closing"))
        self._engine = task.extended.compile(parameters=list(groups), **options)
        own = self._engine.parameters
        self._count = len(own)
        self.labels = (
            *own,
            *(f"offset:{self.sensors[k]}" for k in self._offsets),
            *(f"scale:{self.sensors[k]}" for k in self._scales),
        )
        none, one = np.zeros(self._offsets.size), np.ones(self._scales.size)
        self.nominal = np.concatenate([self._engine.nominal_parameters, none, one])
        self.units = self._units()
        independent = task.extended.actuated_indices
        self._dependent = np.setdiff1d(np.arange(task.extended.model.nv), independent)

    @property
    def engine(self) -> Any:
        """The extended mechanism's generated code, with its parameters."""
        return self._engine

    def home(self, x: Array, p: Array) -> Array:
        """Return configurations at task coordinates (n, m), continued from home, (n, nq)."""
        return self.closed(x, np.broadcast_to(self.task.extended.home, (len(x), self._nq)), p)

    def continued(self, x: Array, q: Array, p: Array) -> tuple[Array, Bools]:
        """Return configurations at task coordinates (n, m), near others, and which are reached."""
        own = self._own(p)
        each = None if own is None else np.broadcast_to(own, (len(x), own.size))
        found, reached = self._engine.continued(x, np.array(q), each)
        return found, reached

    def closed(self, x: Array, q: Array, p: Array) -> Array:
        """Return configurations at task coordinates (n, m), near others (n, nq).

        Raises
        ------
        ClosureError, UnreachableError
            If loops do not close there.
        """
        own = self._own(p)
        return np.asarray(
            self._engine.complete(x, q, within_limits=False, restarts=0, parameters=own)
        )

    def predict(self, x: Array, q: Array, p: Array) -> Predicted:
        """Return what the sensors read at task coordinates x (n, m), from near q (n, nq)."""
        q = self.closed(x, q, p)
        own = self._own(p)
        T = np.asarray(self._engine.motion_basis(q, parameters=own))
        values = q[:, self._read]
        offset, scale = self._sensor_numbers(p)
        readings = (values - offset) / scale
        by_parameters = np.zeros((*readings.shape, p.size))
        moved, opening = self._sensitivity(q, own)
        by_parameters[:, :, : self._count] = moved[:, self._moved]
        first, second = self._count, self._count + self._offsets.size
        by_parameters[:, self._offsets, first + np.arange(self._offsets.size)] = -1.0
        by_parameters[:, self._scales, second + np.arange(self._scales.size)] = -readings[
            :, self._scales
        ]
        each = scale[:, None]
        by_pose = T[:, self._moved] / each
        return Predicted(q, readings, by_pose, by_parameters / each, opening)

    def _sensitivity(self, q: Array, own: Array | None) -> tuple[Array, Array]:
        """Return dq/dp with the task's coordinates held, (n, nv, p), and what opens the loops."""
        found = np.zeros((len(q), self.task.extended.model.nv, self._count))
        none = np.zeros((len(q), 0, len(self.labels)))
        if not self._count:
            return found, none
        J = self._engine.jacobian(q, parameters=own)[:, :, self._dependent]
        G = self._engine.gaps_by_parameters(q, parameters=own)
        if J.shape[1] == J.shape[2]:
            found[:, self._dependent] = -np.linalg.solve(J, G)
            return found, none
        found[:, self._dependent] = -np.linalg.pinv(J, rcond=_REDUNDANT) @ G
        left = J @ found[:, self._dependent] + G
        return found, np.pad(left, ((0, 0), (0, 0), (0, len(self.labels) - self._count)))

    def _own(self, p: Array) -> Array | None:
        """Return the parameters of the generated code, if it has any."""
        return p[: self._count] if self._count else None

    def _sensor_numbers(self, p: Array) -> tuple[Array, Array]:
        """Return offsets and scales of all sensors."""
        offset, scale = np.zeros(len(self.sensors)), np.ones(len(self.sensors))
        first, second = self._count, self._count + self._offsets.size
        offset[self._offsets], scale[self._scales] = p[first:second], p[second:]
        return offset, scale

    def _units(self) -> Array:
        length = self.task.characteristic_length
        angular = dict(zip(self.task.coordinates, self.task.angular, strict=True))
        turning = self.task.extended.system.equations.angular_velocities
        found = []
        for label in self.labels:
            kind, _, name = label.partition(":")
            if kind == "scale":
                found.append(length)
            elif kind == "offset":
                k = self.sensors.index(name)
                turns = angular.get(name, bool(turning[self._moved[k]]))
                found.append(length if turns else 1.0)
            else:
                found.append(
                    length if label.rpartition(".")[2] in ("roll", "pitch", "yaw") else 1.0
                )
        return np.array(found)

    @property
    def _nq(self) -> int:
        return int(self.task.extended.model.nq)


def _places(sensors: Sequence[str], chosen: Sequence[str]) -> Indices:
    """Return the places of some sensors."""
    for name in chosen:
        if name not in sensors:
            raise InputError(f"{name!r} is not read; the sensors are {', '.join(sensors)}")
    return np.array([sensors.index(name) for name in chosen], dtype=np.intp)

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
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.constraints.frame_coordinates import ANGULAR, LINEAR
from rps_pin.errors import InputError
from rps_pin.task.calibration.measured.instruments import Instrument, sensors_of
from rps_pin.task.calibration.sensors import possible_sensors, sensor_columns
from rps_pin.task.coordinates import of_frame
from rps_pin.task.task import Task

#: Groups of numbers that decide positions; see `rps_pin.codegen.expressions.parameters`.
_GEOMETRY = ("placement", "closure", "distance")
#: Singular values of the closures' Jacobian below this part of the largest are none.
_REDUNDANT = 1e-8
#: Last parts of labels of angles.
_TURNS = ("roll", "pitch", "yaw", *ANGULAR)


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


class _Frame(NamedTuple):
    """Where a frame's x, y, z, rx, ry, rz stand in q and v."""

    q: Indices
    v: Indices


class _Use(NamedTuple):
    instrument: Instrument
    frame: _Frame
    sensors: list[int]
    """Which sensors it gives, and which of its readings they are."""
    rows: list[int]
    own: slice
    """Its parameters."""


class CalibrationModel:
    """A mechanism with parameters, and sensors that have an offset and a scale.

    Parameters
    ----------
    task
        The task of the mechanism as it is believed to be.
    groups
        Groups of geometric numbers that are parameters: ``placement:JOINT``, ``closure:NAME``,
        ``distance:NAME``; `geometric_groups` returns all.
    sensors
        What is read, as in `Readings`.
    offsets, scales
        Sensors whose offset, or scale, is a parameter.
    instruments
        What reads points, distances or angles of frames: `Tracker`, `BallBar`, `Height`,
        `Inclinometer`.
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
        instruments: Sequence[Instrument] = (),
        **options: Any,
    ) -> None:
        for group in groups:
            if group.partition(":")[0] not in _GEOMETRY:
                raise InputError(
                    f"{group!r} is no group of geometric parameters; these are "
                    + ", ".join(f"{kind}:NAME" for kind in _GEOMETRY)
                )
        self.task, self.groups, self.sensors = task, tuple(groups), tuple(sensors)
        self.instruments = tuple(instruments)
        of_instruments = sensors_of(self.instruments)
        plain = [k for k, name in enumerate(self.sensors) if name not in of_instruments]
        columns = sensor_columns(task, [self.sensors[k] for k in plain])
        self._plain = np.array(plain, dtype=np.intp)
        self._read, self._moved = columns.q, columns.v
        self._offsets, self._scales = (_places(self.sensors, one) for one in (offsets, scales))
        options.setdefault("functions", ("kinematics", "closing"))
        mechanism, frames = _with_frames(task, self.instruments)
        self.mechanism = mechanism
        self._engine = mechanism.compile(parameters=list(groups), **options)
        own = self._engine.parameters
        self._count = len(own)
        labels, nominal = list(own), [self._engine.nominal_parameters]
        self._uses = []
        for one in self.instruments:
            where = [k for k, name in enumerate(self.sensors) if name in one.sensors]
            rows = [one.sensors.index(self.sensors[k]) for k in where]
            first = len(labels)
            labels += one.labels
            nominal.append(one.nominal)
            self._uses.append(_Use(one, frames[one.frame], where, rows, slice(first, len(labels))))
        self._first = len(labels)
        labels += [f"offset:{self.sensors[k]}" for k in self._offsets]
        labels += [f"scale:{self.sensors[k]}" for k in self._scales]
        twice = [name for name in labels if labels.count(name) > 1]
        if twice:
            raise InputError(f"two parameters are called {twice[0]!r}: rename an instrument")
        self.labels: tuple[str, ...] = tuple(labels)
        none, ones = np.zeros(self._offsets.size), np.ones(self._scales.size)
        self.nominal = np.concatenate([*nominal, none, ones])
        kinds = possible_sensors(task) | of_instruments
        self.angular = tuple(kinds[name] for name in self.sensors)
        self.units = self._units()
        independent = mechanism.actuated_indices
        self._dependent = np.setdiff1d(np.arange(mechanism.model.nv), independent)
        read = np.concatenate([self._moved, *(use.frame.v for use in self._uses)])
        self._wanted = np.flatnonzero(np.isin(self._dependent, read))

    @property
    def engine(self) -> Any:
        """The extended mechanism's generated code, with its parameters."""
        return self._engine

    def home(self, x: Array, p: Array) -> Array:
        """Return configurations at task coordinates (n, m), continued from home, (n, nq)."""
        return self.closed(x, np.broadcast_to(self.mechanism.home, (len(x), self._nq)), p)

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
        shape = len(q), len(self.sensors)
        values, by_pose = np.empty(shape), np.zeros((*shape, self.task.size))
        by_parameters = np.zeros((*shape, p.size))
        moved, opening = self._sensitivity(q, own)
        values[:, self._plain] = q[:, self._read]
        by_pose[:, self._plain] = T[:, self._moved]
        by_parameters[:, self._plain, : self._count] = moved[:, self._moved]
        for use in self._uses:
            seen = use.instrument.read(q[:, use.frame.q], p[use.own])
            slopes = seen.by_frame[:, use.rows]
            values[:, use.sensors] = seen.values[:, use.rows]
            by_pose[:, use.sensors] = slopes @ T[:, use.frame.v]
            by_parameters[:, use.sensors, : self._count] = slopes @ moved[:, use.frame.v]
            by_parameters[:, use.sensors, use.own] = seen.by_own[:, use.rows]
        offset, scale = self._sensor_numbers(p)
        readings = (values - offset) / scale
        second = self._first + self._offsets.size
        by_parameters[:, self._offsets, self._first + np.arange(self._offsets.size)] = -1.0
        by_parameters[:, self._scales, second + np.arange(self._scales.size)] = -readings[
            :, self._scales
        ]
        each = scale[:, None]
        return Predicted(q, readings, by_pose / each, by_parameters / each, opening)

    def frames(self, q: Array, instrument: Instrument) -> Array:
        """Return the coordinates of an instrument's frame at configurations (n, nq), (n, 6)."""
        use = next(one for one in self._uses if one.instrument is instrument)
        return np.asarray(q[:, use.frame.q])

    def _sensitivity(self, q: Array, own: Array | None) -> tuple[Array, Array]:
        """Return dq/dp with the task's coordinates held, (n, nv, p), and what opens the loops.

        Rows of joints that nothing reads are zero.
        """
        found = np.zeros((len(q), self.mechanism.model.nv, self._count))
        none = np.zeros((len(q), 0, len(self.labels)))
        if not self._count:
            return found, none
        J = self._engine.jacobian(q, parameters=own)[:, :, self._dependent]
        G = self._engine.gaps_by_parameters(q, parameters=own)
        if J.shape[1] == J.shape[2]:
            # Rows of -J^-1 G that are read: (J'^-1 E)' G, with columns of the unit matrix, E.
            E = np.eye(J.shape[1])[:, self._wanted]
            adjoint = np.swapaxes(np.linalg.solve(np.swapaxes(J, 1, 2), E[None]), 1, 2)
            found[:, self._dependent[self._wanted]] = -adjoint @ G
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
        second = self._first + self._offsets.size
        offset[self._offsets], scale[self._scales] = p[self._first : second], p[second:]
        return offset, scale

    def _units(self) -> Array:
        length = self.task.characteristic_length
        found = []
        for label in self.labels:
            kind, _, name = label.partition(":")
            turns = label.rpartition(".")[2] in _TURNS
            if kind == "offset":
                turns = self.angular[self.sensors.index(name)]
            found.append(length if turns or kind == "scale" else 1.0)
        return np.array(found)

    @property
    def _nq(self) -> int:
        return int(self.mechanism.model.nq)


def _places(sensors: Sequence[str], chosen: Sequence[str]) -> Indices:
    """Return the places of some sensors."""
    for name in chosen:
        if name not in sensors:
            raise InputError(f"{name!r} is not read; the sensors are {', '.join(sensors)}")
    return np.array([sensors.index(name) for name in chosen], dtype=np.intp)


def geometric_groups(task: Task) -> tuple[str, ...]:
    """Return all groups of geometric numbers of a task's mechanism.

    The placements of its joints, its closures' ends and the lengths of its rods.
    """
    mechanism = task.mechanism
    names = {closure.name for closure in mechanism.closures if hasattr(closure, "frame_a")}
    rods = [one.name for one in mechanism.closures if getattr(one, "distance", None) is not None]
    return (
        *(f"placement:{name}" for name in list(mechanism.model.names)[1:]),
        *(f"closure:{one.name}" for one in mechanism.closures if one.name in names),
        *(f"distance:{name}" for name in rods),
    )


def _with_frames(
    task: Task, instruments: Sequence[Instrument]
) -> tuple[ClosedLoopModel, dict[str, _Frame]]:
    """Return the extended mechanism with the coordinates of the instruments' frames, too."""
    mechanism, found = task.extended, {}
    for frame in dict.fromkeys(one.frame for one in instruments):
        extension = of_frame(mechanism, frame, (*LINEAR, *ANGULAR), "universe", None)
        mechanism = extension.mechanism.with_actuated(mechanism.actuated)
        last = mechanism.model.nv - extension.added
        found[frame] = _Frame(extension.idx_q, last + np.arange(extension.added))
    return mechanism, found

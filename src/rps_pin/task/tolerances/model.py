"""The pose of a mechanism's output while its actuators' readings are held, and its parameters vary.

The task's coordinates x are joints of the extended mechanism (`rps_pin.task.coordinates`). Here its
independent joints are the actuators. With the gaps g(q, p) of all its closures zero,

    dx/dp = -(J_d^-1 G)_x,      J_d = dg/dq_d,    G = dg/dp,

where d are the joints other than the actuators. That is what `CalibrationModel` predicts of a task
of the actuators, whose sensors read x.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.constraints.frame_coordinates import ANGULAR, LINEAR
from rps_pin.closed_loop.model import of_codegen
from rps_pin.errors import InputError, MechanismError, RPSPinError
from rps_pin.task.calibration.prediction import CalibrationModel
from rps_pin.task.coordinates import Extended, of_frame
from rps_pin.task.task import Task

_TURNS = ("roll", "pitch", "yaw")
_GEOMETRY = ("placement", "closure", "distance")
#: In which errors grow, of machines that are not closed at once.
_STEPS = 10


class Nominal(NamedTuple):
    """Poses of the mechanism as it is drawn."""

    q: Array
    """Configurations of the extended mechanism, shape (n, nq)."""
    actuators: Array
    """Positions, shape (n, na), m or rad."""
    x: Array
    """Coordinates of the output, shape (n, m), m or rad."""


class Slopes(NamedTuple):
    """Derivatives at poses."""

    x: Array
    """Of the output's coordinates by the numbers, shape (n, m, p)."""
    opening: Array
    """How far a unit of each number opens loops, whatever the joints do, shape (p,), as a part of
    that unit: 0 unless there are redundant closures."""


class Output(NamedTuple):
    """The extended mechanism whose independent joints are the actuators, and names."""

    task: Task
    """Of the actuators."""
    extension: Extended
    held: tuple[str, ...]
    """Actuators that hold their readings."""
    kinds: dict[str, str]
    """By name, each number that can have a tolerance: ``"length"``, ``"angle"``, ``"ratio"``."""
    own: dict[str, str]
    """By name, what generated code calls it; of the geometric ones."""


def output_of(
    task: Task, coordinates: Sequence[str] | None = None, held: Sequence[str] | None = None
) -> Output:
    """Return the mechanism whose output is looked at, and what can have a tolerance.

    Parameters
    ----------
    task
        The task.
    coordinates
        Of the output frame, of x, y, z, rx, ry, rz; those of the task if left out.
    held
        Actuators that hold their readings; all if left out.

    Raises
    ------
    InputError
        If a task of joints is given coordinates of a frame.
    MechanismError
        If the actuators that are held do not determine the pose, or are more than do.
    """
    extension = task.extension
    if coordinates is not None:
        if task.frame is None:
            raise InputError(
                f"coordinates {', '.join(coordinates)}: a task of joints has no output frame"
            )
        options = task.options
        extension = of_frame(
            task.mechanism,
            task.frame,
            tuple(coordinates),
            options["reference"],
            options["placement"],
        )
    names = tuple(task.mechanism.actuated if held is None else held)
    try:
        actuators = Task(extension.mechanism, joints=names)
    except RPSPinError as error:
        raise MechanismError(
            f"tolerances take actuators that determine the pose, and no more of them: {error}"
            "; held=[...] says which hold their readings"
        ) from None
    kinds, own = _names(task.mechanism, extension)
    angular = dict(zip(actuators.coordinates, actuators.angular, strict=True))
    for name in names:
        kinds[f"offset:{name}"] = "angle" if angular[name] else "length"
        kinds[f"scale:{name}"] = "ratio"
    return Output(actuators, extension, names, kinds, own)


def _names(
    mechanism: ClosedLoopModel, extension: Extended
) -> tuple[dict[str, str], dict[str, str]]:
    """Return kinds of the geometric numbers by name, and their names in generated code."""
    of_groups = of_codegen("Parameters", "rps_pin.codegen.expressions.parameters")
    system = extension.mechanism.system
    held = {f"placement:{name}" for name in extension.mechanism.model.names} - {
        f"placement:{name}" for name in mechanism.model.names
    }
    groups = [
        group
        for group in of_groups(system).possible
        if group.partition(":")[0] in _GEOMETRY and group not in held
    ]
    named = {closure.name for closure in mechanism.closures}
    kinds, own = {}, {}
    for label in of_groups(system, groups).labels:
        name = label
        kind, _, rest = label.partition(":")
        if kind == "closure" and (parts := rest.rsplit(".", 2))[0] not in named:
            frame = extension.frame if parts[1] == "b" else extension.reference
            name = f"frame:{frame}.{parts[2]}"
        own[name] = label
        kinds[name] = "angle" if label.rpartition(".")[2] in _TURNS else "length"
    return kinds, own


class ToleranceModel:
    """The output's pose and its derivatives by some numbers of a mechanism, in generated code.

    Parameters
    ----------
    task
        The task.
    output
        Of `output_of`.
    labels
        The numbers that vary.
    options
        Of `ClosedLoopModel.compile`.
    """

    def __init__(self, task: Task, output: Output, labels: Sequence[str], **options: Any) -> None:
        self.task, self.output = task, output
        geometric = [output.own[label] for label in labels if label in output.own]
        groups = dict.fromkeys(_group(one) for one in geometric)
        extended = output.extension.mechanism
        self._model = CalibrationModel(output.task, list(groups), extended.actuated, **options)
        self.coordinates = output.extension.names
        self.angular = np.array(output.extension.angular)
        self._x = output.extension.idx_q
        self._choose(labels)

    def _choose(self, labels: Sequence[str]) -> None:
        """Say where each number is: among the parameters, and offsets and scales of actuators."""
        own, held = self.output.own, self.output.held
        places = {label: k for k, label in enumerate(self._model.labels)}
        self.labels = tuple(labels)
        self._geometric = np.array([label in own for label in labels], dtype=bool)
        self._place = np.array([places[own[one]] for one in labels if one in own], dtype=np.intp)
        self._sensors = [
            (k, label.partition(":")[0], held.index(label.partition(":")[2]))
            for k, label in enumerate(labels)
            if label not in own
        ]

    def with_labels(self, labels: Sequence[str]) -> ToleranceModel:
        """Return the same generated code for some of its numbers."""
        other = copy(self)
        other._choose(labels)
        return other

    @property
    def engine(self) -> Any:
        """The generated code, with its parameters."""
        return self._model.engine

    @property
    def calibration(self) -> CalibrationModel:
        """What predicts the output's coordinates from the actuators' positions."""
        return self._model

    def nominal(self, q: Array, x: Array) -> Nominal:
        """Return the poses of the mechanism's configurations (n, nq) with task coordinates x."""
        extension = self.output.extension
        actuators = q[:, self.output.task.extension.idx_q]
        if extension.added:
            q = np.pad(q, ((0, 0), (0, extension.added)))
            for k, name in enumerate(extension.names):
                if name in self.task.coordinates:  # decides between two rotation vectors
                    q[:, self._x[k]] = x[:, self.task.coordinates.index(name)]
            own = self._model.nominal if self._model.nominal.size else None
            gaps = self.engine.gaps(q, parameters=own)
            q[:, self._x] -= gaps[:, extension.rows]
        return Nominal(q, actuators, q[:, self._x])

    def slopes(self, at: Nominal) -> Slopes:
        """Return derivatives by the numbers at poses.

        Raises
        ------
        SingularityError
            If the actuators do not determine the motion at a pose.
        """
        model = self._model
        found = model.predict(at.actuators, at.q, model.nominal)
        slopes = np.zeros((*at.x.shape, len(self.labels)))
        slopes[:, :, self._geometric] = found.by_parameters[:, :, self._place]
        for k, kind, actuator in self._sensors:
            # position = offset + scale reading, and the reading is the nominal position
            by_reading = found.by_pose[:, :, actuator]
            if kind == "scale":
                by_reading = by_reading * at.actuators[:, None, actuator]
            slopes[:, :, k] = by_reading
        opening = np.zeros(len(self.labels))
        if found.opening.shape[1]:
            largest = np.abs(found.opening).max(axis=(0, 1)) / model.units
            opening[self._geometric] = largest[self._place]
        return Slopes(slopes, opening)

    def poses(self, at: Nominal, errors: Array) -> tuple[Array, Bools]:
        """Return the output's coordinates of machines with errors of their numbers, exactly.

        Parameters
        ----------
        at
            Poses; the actuators' readings are those of the mechanism as it is drawn.
        errors
            Of the numbers, shape (s, p).

        Returns
        -------
        tuple
            Coordinates, shape (s, n, m), and whether the machine reaches the pose, (s, n);
            coordinates are NaN where not.
        """
        machines, poses = len(errors), len(at.x)
        actuators = np.broadcast_to(at.actuators, (machines, *at.actuators.shape)).copy()
        for k, kind, actuator in self._sensors:
            by = at.actuators[:, actuator] if kind == "scale" else 1.0
            actuators[:, :, actuator] += errors[:, None, k] * by
        own = self._own(errors)
        rows = machines * poses
        start = np.tile(at.q, (machines, 1)), np.tile(at.actuators, (machines, 1))
        wanted = actuators.reshape(rows, -1)
        each = None if own is None else np.repeat(own, poses, axis=0)
        q, reached = self.engine.continued(wanted, start[0], each)
        missed = ~reached
        if missed.any():
            from_ = start[0][missed], start[1][missed]
            to = wanted[missed], None if each is None else each[missed]
            q[missed], reached[missed] = self._by_steps(from_, to)
        x = np.where(reached[:, None], q[:, self._x], np.nan)
        return x.reshape(machines, poses, -1), reached.reshape(machines, poses)

    def _by_steps(
        self, start: tuple[Array, Array], to: tuple[Array, Array | None]
    ) -> tuple[Array, Bools]:
        """Return configurations (r, nq) of machines whose errors grow in steps, as `continued`."""
        (q, actuators), (wanted, own) = start, to
        nominal = self._model.nominal
        reached = np.ones(len(q), dtype=bool)
        for part in np.linspace(0.0, 1.0, _STEPS + 1)[1:]:
            now = None if own is None else nominal + part * (own - nominal)
            found, ok = self.engine.continued(actuators + part * (wanted - actuators), q, now)
            reached &= ok
            q = np.where(reached[:, None], found, q)
        return q, reached

    def _own(self, errors: Array) -> Any:
        """Return parameters of generated code, (s, ...), of errors (s, p); None without any."""
        nominal = self._model.nominal
        if not nominal.size:
            return None
        found = np.tile(nominal, (len(errors), 1))
        found[:, self._place] += errors[:, self._geometric]
        return found


def _group(label: str) -> str:
    """Return the group of a number of generated code: ``placement:leg`` of ``placement:leg.x``."""
    kind = label.partition(":")[0]
    return label if kind == "distance" else label.rsplit(".", 2 if kind == "closure" else 1)[0]


#: All coordinates of an output frame.
WHOLE_POSE = (*LINEAR, *ANGULAR)

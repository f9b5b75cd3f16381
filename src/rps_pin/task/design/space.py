"""The robots that a design chooses from: a mechanism with a task, and the dimensions that vary.

A candidate is a row of the dimensions' values. Its numbers are those of the groups of parameters of
generated code (`rps_pin.codegen.expressions.parameters`), so that nothing is compiled again for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.constraints.closures import joint_id
from rps_pin.errors import InputError, MechanismError, did_you_mean, few
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.design.geometry.bodies import projector, stretched
from rps_pin.task.design.geometry.dimensions import (
    KINDS,
    OF_LIMITS,
    OF_POINTS,
    Dimension,
    measured,
    move,
    together,
)
from rps_pin.task.design.geometry.points import OUTPUT, Moved, Points
from rps_pin.task.task import Task


class Candidates(NamedTuple):
    """What candidates have in place of the file's numbers."""

    numbers: dict[str, Array]
    """Of groups of parameters of the extended mechanism, (n, size) each."""
    lower: Array
    """Lower limits of positions, shape (n, nq)."""
    upper: Array
    """Upper limits, shape (n, nq)."""
    mass: Array
    """Of all bodies, kg, shape (n,)."""
    size: Array
    """Sum of all lengths, m, shape (n,); see `DesignSpace`."""
    length: Array
    """Characteristic length, in which angles of the task count as arcs, m, shape (n,)."""


class Space(Protocol):
    """What `design` takes: dimensions, a task, and what values of the dimensions mean."""

    @property
    def dimensions(self) -> tuple[Dimension, ...]:
        """The dimensions, in the order of the values."""
        ...

    @property
    def task(self) -> Task:
        """The task of the file's robot."""
        ...

    @property
    def nominal(self) -> Array:
        """What the file's robot has of each dimension, shape (d,)."""
        ...

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups of parameters of the extended mechanism that differ between candidates."""
        ...

    def candidates(self, values: Array) -> Candidates:
        """Return what candidates of values (n, d) have in place of the file's numbers."""
        ...

    def rooms(self, values: Array, q: Array, x: Array) -> Array:
        """Return the room to further limits, shape (n, k, limits), of q (n, k, nq) and x."""
        ...

    @property
    def room_names(self) -> tuple[str, ...]:
        """Names of the further limits."""
        ...

    def identity(self) -> str:
        """Return a digest of all that decides the numbers of candidates."""
        ...

    def files(self, folder: Path, name: str) -> list[Path]:
        """Return the files that `write` writes."""
        ...

    def write(self, values: Array, q: Array, folder: Path, name: str) -> list[Path]:
        """Write a candidate (d,) as a robot's file, its home the configuration q (nq,)."""
        ...


@refuses_other_kinds
class DesignSpace:
    """Robots that a mechanism becomes by changes of its dimensions.

    What the dimensions do not name stays as the file has it: masses and inertias of bodies that are
    not stretched, limits, friction, springs. Shapes that are drawn, or checked for collisions, do
    not follow the dimensions: they are left out of the robots that are written, which a viewer
    draws as skeletons.

    The ``size`` of a candidate is the sum of the distances of all joints from the joint before
    them, of the ends of closures from the joints that carry them, of rods, and of the upper limits
    of the prismatic actuators.

    Parameters
    ----------
    task
        The task of the mechanism. A home that decides the assembly mode is part of the mechanism.
    dimensions
        Which dimensions vary; `Dimension`.

    Raises
    ------
    InputError
        If there are none, two have one name, or one moves nothing.
    MechanismError
        If a point, closure or joint is unknown.
    """

    room_names: tuple[str, ...] = ()

    def __init__(self, task: Task, dimensions: Sequence[Dimension]) -> None:
        self.task, self.dimensions = task.interpreted(), tuple(dimensions)
        refuse_names(self.dimensions)
        self._points = Points(self.task)
        self._model = task.mechanism.model
        for dimension in self.dimensions:
            self._refuse_unknown(dimension)
        self.nominal = np.array([self._nominal(one) for one in self.dimensions])
        self._stretch = [
            (index, joint_id(self._model, joint, "stretch"), *projector(directions))
            for index, dimension in enumerate(self.dimensions)
            for joint, directions in dimension.stretch.items()
        ]
        for index, *_ in self._stretch:
            if not self.nominal[index] > 0:
                name = self.dimensions[index].name
                raise InputError(f"dimension {name!r} is 0 in the file: nothing stretches with it")
        self._sizes = self._groups()
        self.groups = tuple(self._sizes)

    @classmethod
    def check(cls, task: Task, dimension: Dimension) -> None:
        """Raise `InputError` unless a dimension is possible for a task's mechanism."""
        cls(task, [dimension, _ANOTHER])

    # Names ----------------------------------------------------------------------------------------

    def _refuse_unknown(self, dimension: Dimension) -> None:
        if not dimension.kinds:
            raise InputError(
                f"dimension {dimension.name!r} moves nothing: give one of {', '.join(KINDS)}"
            )
        for kind in OF_POINTS:
            for entry in dimension.of(kind):
                self._points.same_carrier(together(entry))
        for closure in dimension.distance:
            if closure not in self._points.rods:
                known = few([*self._points.rods]) or "none"
                raise MechanismError(
                    f"dimension {dimension.name!r}: no rod {closure!r}"
                    f"{did_you_mean(closure, self._points.rods)}; closures of kind 'distance' are: "
                    f"{known}"
                )
        for kind in OF_LIMITS:
            for name in dimension.of(kind):
                joint = self._model.joints[joint_id(self._model, name, dimension.name)]
                if joint.nq != 1:
                    raise MechanismError(
                        f"dimension {dimension.name!r}: joint {name!r} has not one coordinate"
                    )

    def _nominal(self, dimension: Dimension) -> float:
        """Return what a dimension is in the file, the mean of all it moves."""
        found = [
            measured(self._points, dimension, kind, entry)
            for kind in OF_POINTS
            for entry in dimension.of(kind)
        ]
        found += [self._points.rods[name] for name in dimension.distance]
        for kind in OF_LIMITS:
            for name in dimension.of(kind):
                at = self._model.joints[self._model.getJointId(name)].idx_q
                low, high = self._model.lowerPositionLimit[at], self._model.upperPositionLimit[at]
                found.append(float({"stroke": high - low, "lower": low, "upper": high}[kind]))
        if dimension.scale:
            found.append(1.0)
        finite = [one for one in found if np.isfinite(one)]
        return float(np.mean(finite)) if finite else float(dimension.lower)

    def _groups(self) -> dict[str, int]:
        found: dict[str, int] = {}
        if any(one.scale for one in self.dimensions):
            for name in self._points:
                group = self._points[name].group
                found[group] = 12 if group.startswith("closure:") else 6
            found |= {f"distance:{name}": 1 for name in self._points.rods}
        for dimension in self.dimensions:
            for kind in OF_POINTS:
                for entry in dimension.of(kind):
                    for name in together(entry):
                        group = self._points[name].group
                        found[group] = 12 if group.startswith("closure:") else 6
            found |= {f"distance:{name}": 1 for name in dimension.distance}
        for _, joint, *_ in self._stretch:
            found[f"inertia:{self._model.names[joint]}"] = 10
        return found

    # Candidates -----------------------------------------------------------------------------------

    def candidates(self, values: Array) -> Candidates:
        """Return what candidates of values (n, d) have in place of the file's numbers."""
        moved, rods = self._moved(values)
        lower, upper = self._limits(values)
        placed = {g: s for g, s in self._sizes.items() if g.startswith(("placement:", "closure:"))}
        numbers = self._points.numbers(moved, placed)
        for group in self._sizes:
            if group.startswith("distance:"):
                numbers[group] = rods[group.partition(":")[2]][:, None]
        bodies = self._bodies(values)
        numbers |= {f"inertia:{self._model.names[joint]}": body for joint, body in bodies.items()}
        mass = np.full(len(values), sum(body.mass for body in list(self._model.inertias)[1:]))
        for joint, body in bodies.items():
            mass += body[:, 0] - self._model.inertias[joint].mass
        lengths = [np.linalg.norm(p, axis=-1) for name, p in moved.origin.items() if name != OUTPUT]
        size = np.sum([*lengths, *rods.values()], axis=0)
        for at in self._strokes():
            size = size + np.where(np.isfinite(upper[:, at]), upper[:, at], 0.0)
        length = np.full(len(values), self.task.characteristic_length)
        return Candidates(numbers, lower, upper, mass, size, length)

    def _strokes(self) -> list[int]:
        """Return where prismatic actuators are in q."""
        angular = self.task.mechanism.angular_velocities
        joints = [
            self._model.joints[self._model.getJointId(n)] for n in self.task.mechanism.actuated
        ]
        return [joint.idx_q for joint in joints if joint.nq == 1 and not angular[joint.idx_v]]

    def _moved(self, values: Array) -> tuple[Moved, dict[str, Array]]:
        moved = self._points.at_home(len(values))
        rods = {name: np.full(len(values), rod) for name, rod in self._points.rods.items()}
        for column, dimension in zip(values.T, self.dimensions, strict=True):
            if dimension.scale:
                for name in moved.origin:
                    moved.origin[name] = column[:, None] * moved.origin[name]
                rods = {name: column * rod for name, rod in rods.items()}
        for kind in OF_POINTS:
            for column, dimension in zip(values.T, self.dimensions, strict=True):
                move(moved, self._points, dimension, kind, column)
        for column, dimension in zip(values.T, self.dimensions, strict=True):
            rods |= dict.fromkeys(dimension.distance, column)
        return moved, rods

    def _limits(self, values: Array) -> tuple[Array, Array]:
        model, count = self._model, len(values)
        lower, upper = (
            np.tile(np.asarray(limit, dtype=np.float64), (count, 1))
            for limit in (model.lowerPositionLimit, model.upperPositionLimit)
        )
        angular = self.task.mechanism.angular_velocities
        lengths = [
            joint.idx_q
            for joint in list(model.joints)[1:]
            if joint.nq == 1 and not angular[joint.idx_v]
        ]
        for column, dimension in zip(values.T, self.dimensions, strict=True):
            if dimension.scale:
                lower[:, lengths] *= column[:, None]
                upper[:, lengths] *= column[:, None]
        for kind in ("lower", "upper", "stroke"):
            for column, dimension in zip(values.T, self.dimensions, strict=True):
                for name in dimension.of(kind):
                    at = model.joints[model.getJointId(name)].idx_q
                    if kind == "lower":
                        lower[:, at] = column
                    else:
                        upper[:, at] = column + (lower[:, at] if kind == "stroke" else 0.0)
        return lower, upper

    def _bodies(self, values: Array) -> dict[int, Array]:
        found: dict[int, Array] = {}
        for index, joint, projection, rank in self._stretch:
            if joint not in found:
                body = np.array(self._model.inertias[joint].toDynamicParameters())
                found[joint] = np.tile(body, (len(values), 1))
            ratio = values[:, index] / self.nominal[index]
            found[joint] = stretched(found[joint], projection, rank, ratio)
        return found

    def rooms(self, values: Array, q: Array, x: Array) -> Array:
        """Return the room to further limits: there are none."""
        return np.empty((*q.shape[:2], 0))

    def identity(self) -> str:
        """Return a digest of all that decides the numbers of candidates."""
        from rps_pin.codegen.engine.identity import digest  # noqa: PLC0415 (needs CasADi)

        return digest(self.task.extended.system, [repr(self.dimensions)])

    # Robots ---------------------------------------------------------------------------------------

    def robot(self, values: Array, q: Array | None = None, name: str = "") -> ClosedLoopModel:
        """Return a candidate (d,) as a mechanism, its home closed from a configuration (nq,)."""
        from rps_pin.codegen.engine.applied import with_parameters  # noqa: PLC0415 (needs CasADi)

        one, mechanism = self.candidates(np.asarray(values)[None]), self.task.mechanism
        of_task = self._points[OUTPUT].group if self.task.frame is not None else ""
        groups = [group for group in self.groups if group != of_task]
        numbers = np.concatenate([np.zeros(0), *(one.numbers[group][0] for group in groups)])
        changed = with_parameters(mechanism, groups, numbers)
        changed.model.lowerPositionLimit = one.lower[0]
        changed.model.upperPositionLimit = one.upper[0]
        changed.model.name = name or mechanism.name
        return ClosedLoopModel(
            changed.model,
            changed.closures,
            mechanism.actuated,
            home=mechanism.home if q is None else q,
            effects=mechanism.effects,
            name=name or mechanism.name,
            characteristic_length=mechanism.characteristic_length,
            max_condition=mechanism.max_condition,
            accuracy=mechanism.accuracy,
            task=self._task_of(one, of_task),
        )

    def _task_of(self, one: Candidates, of_task: str) -> dict[str, Any]:
        """Return the task's entry in a description."""
        found = self.task.options
        if of_task in one.numbers:
            shift, turn = one.numbers[of_task][0, 6:9], one.numbers[of_task][0, 9:]
            moved = self.task.extension.placement * pin.SE3(pin.rpy.rpyToMatrix(*turn), shift)
            found["placement"] = moved.homogeneous
        return {name: value for name, value in found.items() if value is not None}

    def files(self, folder: Path, name: str) -> list[Path]:
        """Return the files that `write` writes: a description and the URDF of its tree."""
        return [folder / f"{name}.yaml", folder / f"{name}.urdf"]

    def write(self, values: Array, q: Array, folder: Path, name: str) -> list[Path]:
        """Write a candidate (d,), its home the configuration q (nq,); replace what is there."""
        robot = self.robot(values, q, name)
        robot.to_urdf(folder / f"{name}.urdf", overwrite=True)
        return self.files(folder, name)


#: So that one alone may be held.
_ANOTHER = Dimension("another", 1.0, 2.0, scale=True)


def refuse_names(dimensions: Sequence[Dimension]) -> None:
    """Refuse no dimensions, two of one name, and only such as are held."""
    names = [one.name for one in dimensions]
    if not names:
        raise InputError("a design needs at least one dimension")
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"dimension {twice!r} is given twice")
    if all(one.lower == one.upper for one in dimensions):
        raise InputError("all dimensions are held: there is nothing to choose")

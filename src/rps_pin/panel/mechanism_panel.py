"""Panel of any mechanism: its actuated joints, and its task's coordinates."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.assembly.joint_limits import JointLimits
from rps_pin.errors import InputError
from rps_pin.panel.panel import Actuator, Panel
from rps_pin.panel.slider import DEGREE, MM, Slider, quantity, slider
from rps_pin.task.maps import TaskState
from rps_pin.trajectories.path import Trajectory

#: Sliders of a task's angles reach so far to both sides, rad; those of lengths reach the
#: characteristic length.
_TURN = math.pi / 3
#: Sliders of joints reach beyond their limits by this share of the range.
_ROOM = 0.1
_WIDEST = 1e3


class MechanismPanel(Panel):
    """Panel of a mechanism: its actuated joints, ``"joints"``, and its task, ``"task"``.

    The second group is there if the mechanism has a task. The loops are closed for the joints' or
    the task's coordinates, in the assembly mode of the last configuration. Joints
    beyond their limits and actuators that would need more than their effort are listed in
    `trouble`. Where the loops cannot be closed the last configuration stays; `trouble` says why.

    Parameters
    ----------
    mechanism
        The mechanism; its actuated joints must have one coordinate each.
    q
        Its first configuration, shape (nq,). Default: its home.
    visual
        Its geometry. Default: bars between its joints.

    Raises
    ------
    InputError
        If an actuated joint has another number of coordinates than one, or q does not fit.
    """

    def __init__(
        self,
        mechanism: ClosedLoopModel,
        q: ArrayLike | None = None,
        visual: pin.GeometryModel | None = None,
    ) -> None:
        self._visual = visual
        model = mechanism.model
        for name in mechanism.actuated:
            if not model.existJointName(name):
                raise InputError(f"{name!r} is a part of a joint; a slider moves a whole joint")
            count = model.joints[model.getJointId(name)].nq
            if count != 1:
                raise InputError(
                    f"the actuated joint {name!r} has {count} coordinates; a slider moves one"
                )
        self._joint_limits = JointLimits(model)
        turns = mechanism.angular_velocities
        actuators = tuple(
            Actuator(name, DEGREE, "degrees", "N m")
            if turns[index]
            else Actuator(name, MM, "mm", "N")
            for name, index in zip(mechanism.actuated, mechanism.actuated_indices, strict=True)
        )
        task = mechanism.task if mechanism.has_task else None
        super().__init__(
            mechanism, task, actuators, mechanism.close(mechanism.home if q is None else q)
        )

    def visual_model(self) -> pin.GeometryModel | None:
        """Return its visual geometry; None for bars between its joints."""
        return self._visual

    def coordinates(self) -> list[tuple[str, str]]:
        """Return the task's coordinates."""
        if self.task is None or self._x is None:
            return []
        return [
            (name, quantity(value, *((DEGREE, "degrees") if turns else (MM, "mm"))))
            for name, value, turns in zip(
                self.task.coordinates, self._x, self.task.angular, strict=True
            )
        ]

    def of_actuators(self) -> list[tuple[str, str]]:
        """Return the actuators' positions, and the forces that hold the weight or move it."""
        rows = [
            (one.name, quantity(value, one.scale, one.unit))
            for one, value in zip(self.actuators, self._position, strict=True)
        ]
        if isinstance(self._held, str):
            return rows
        return rows + [
            (f"holds: {one.name}", quantity(tau, 1.0, one.force_unit))
            for one, tau in zip(self.actuators, self._held, strict=True)
        ]

    def remarks(self) -> list[tuple[str, str]]:
        """Return how far it is from singularities, and the loop gap."""
        rows: list[tuple[str, str]] = []
        if self.task is not None:
            found = self.task.singularities(self._q)
            for kind, distance in (("I", found.type_i), ("II", found.type_ii)):
                rows.append((f"distance to type {kind}", f"{float(distance):.4f} (0 singular)"))
        gap = f"{self.mechanism.loop_gap(self._q):.1e} m"
        return [*rows, *super().remarks(), ("largest loop gap", gap)]

    def _sliders(self) -> dict[str, tuple[Slider, ...]]:
        found = {"joints": tuple(map(self._slider, range(len(self.actuators))))}
        if self.task is None:
            return found
        return {"task": tuple(map(self._task_slider, range(self.task.size))), **found}

    def _task_slider(self, number: int) -> Slider:
        assert self.task is not None and self._x is not None
        name, turns = self.task.coordinates[number], self.task.angular[number]
        if self.task.frame is None:
            model = self.mechanism.model
            return self._joint_slider(name, turns, model.joints[model.getJointId(name)].idx_q)
        here = float(self._x[number])
        reach = _TURN if turns else self.task.characteristic_length
        return slider(name, turns, here - reach, here + reach)

    def _slider(self, number: int) -> Slider:
        one = self.actuators[number]
        return self._joint_slider(one.name, one.unit == "degrees", self._actuated[number])

    def _joint_slider(self, name: str, turns: bool, index: int) -> Slider:
        """Return the slider of a joint's coordinate in q."""
        model, here = self.mechanism.model, float(self._q[index])
        low, high = float(model.lowerPositionLimit[index]), float(model.upperPositionLimit[index])
        if not high - low < _WIDEST:  # no limits
            ends = (-math.pi, math.pi) if turns else (here - 1.0, here + 1.0)
            return slider(name, turns, *ends)
        room = _ROOM * (high - low)
        return slider(name, turns, low - room, high + room, (low, high))

    def _read(self, path: str | os.PathLike[str]) -> Trajectory:
        from rps_pin.task.trajectory_file import load_task_trajectory  # noqa: PLC0415

        assert self.task is not None
        return load_task_trajectory(path, self.task)

    def _of_task(self, x: Array, near: Array) -> Array:
        assert self.task is not None
        return self.task.configuration(x, near, within_limits=False)

    def _of_actuators(self, position: Array) -> Array:
        wanted = dict(zip(self.mechanism.actuated, position.tolist(), strict=True))
        return self.mechanism.complete(wanted, self._q, within_limits=False)

    def _moving(self, q: Array, x: Array, rate: Array, acceleration: Array) -> TaskState:
        assert self.task is not None
        return self.task.motion(q, rate, acceleration, x=x)

    def _dynamics(self, state: TaskState) -> Array:
        return np.asarray(self.mechanism.inverse_dynamics(*state).tau)

    def _broken(self) -> Iterable[tuple[str, str]]:
        joints, turns = self._joint_limits, self.mechanism.angular_velocities
        for k in np.flatnonzero(joints.beyond(self._q)):
            scale, unit = (DEGREE, "degrees") if turns[joints.v[k]] else (MM, "mm")
            here, low, high = (
                scale * float(one)
                for one in (self._q[joints.q[k]], joints.lower[k], joints.upper[k])
            )
            name = joints.names[k]
            yield f"joint {name!r} at {here:.6g} {unit} ({low:.6g} to {high:.6g})", name

    def _too_weak(self) -> Iterable[tuple[str, str]]:
        model, indices = self.mechanism.model, self.mechanism.actuated_indices
        for one, index, tau in zip(self.actuators, indices, self.forces.tolist(), strict=True):
            low, high = model.lowerEffortLimit[index], model.upperEffortLimit[index]
            if not low <= tau <= high:
                need = f"would need {tau:.6g} {one.force_unit} ({low:.6g} to {high:.6g})"
                yield f"joint {one.name!r} {need}", one.name

"""Panel of any mechanism: sliders of its actuated joints, and of its task's coordinates."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.assembly.joint_limits import JointLimits
from rps_pin.errors import InputError, RPSPinError
from rps_pin.panel.panel import Slider, quantity, slider_values
from rps_pin.task import Task

_MM, _DEGREE = 1e3, 180.0 / math.pi
#: Sliders of a task's angles reach so far to both sides, rad; those of lengths reach the
#: characteristic length.
_TURN = math.pi / 3


class MechanismPanel:
    """Sliders of a mechanism's actuated joints, ``"joints"``, and of its task, ``"task"``.

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
        self.mechanism, self._visual = mechanism, visual
        model = mechanism.model
        parts = [name for name in mechanism.actuated if not model.existJointName(name)]
        if parts:
            raise InputError(f"{parts[0]!r} is a part of a joint; a slider moves a whole joint")
        self._joints = [model.joints[model.getJointId(name)] for name in mechanism.actuated]
        for name, joint in zip(mechanism.actuated, self._joints, strict=True):
            if joint.nq != 1:
                raise InputError(
                    f"the actuated joint {name!r} has {joint.nq} coordinates; a slider moves one"
                )
        self._limits = JointLimits(model)
        self._q: Array = mechanism.close(mechanism.home if q is None else q)
        self._units = [
            (_MM, "mm", "N") if "P" in joint.shortname()[10:11] else (_DEGREE, "degrees", "N m")
            for joint in self._joints
        ]
        self.groups = {"joints": tuple(map(self._slider, range(len(self._joints))))}
        self._task: Task | None = mechanism.task if mechanism.has_task else None
        if self._task is not None:
            self._x: Array = self._task.at(self._q)
            sliders = tuple(map(self._task_slider, range(self._task.size)))
            self.groups = {"task": sliders, **self.groups}
        self._take(self._q)

    def values(self, group: str = "joints") -> Array:
        """Return the coordinates of the actuated joints, or of the task, rad or m."""
        if group == "task" and self._task is not None:
            return self._x.copy()
        return np.array([self._q[joint.idx_q] for joint in self._joints])

    def move(self, group: str, values: Any) -> bool:
        """Close the loops for the joints' or the task's coordinates; return whether they close."""
        try:
            asked = slider_values(self.groups, group, values)
            if group == "task" and self._task is not None:
                self._take(self._task.configuration(asked, self._q, within_limits=False), asked)
                return True
            wanted = dict(zip(self.mechanism.actuated, asked.tolist(), strict=True))
            closed = self.mechanism.complete(wanted, self._q, within_limits=False)
        except RPSPinError as error:
            self.trouble = [*self._beyond(), f"not followed: {error}"]
            return False
        self._take(closed)
        return True

    def readings(self) -> list[tuple[str, str]]:
        """Return coordinates, the forces that hold the weight, conditioning and the loop gap."""
        names, units = self.mechanism.actuated, self._units
        rows = [
            *self._of_task(),
            *(
                (name, quantity(value, scale, unit))
                for name, value, (scale, unit, _) in zip(names, self.values(), units, strict=True)
            ),
        ]
        if isinstance(self._held, str):
            rows.append(("holds", self._held))
        else:
            rows += [
                (f"holds: {name}", quantity(tau, 1.0, unit))
                for name, tau, (_, _, unit) in zip(names, self._held, units, strict=True)
            ]
        conditioning = 1.0 / self.mechanism.condition(self._q)
        words = f"{conditioning:.4f} (0 singular, 1 best)"
        rows.append(("conditioning of the passive joints", words))
        rows.append(("largest loop gap", f"{self.mechanism.loop_gap(self._q):.1e} m"))
        return rows

    @property
    def configuration(self) -> Array:
        """Configuration of the mechanism, shape (nq,)."""
        return self._q

    def visual_model(self) -> pin.GeometryModel | None:
        """Return its visual geometry; None for bars between its joints."""
        return self._visual

    def _take(self, q: Array, x: Array | None = None) -> None:
        """Go to a closed configuration, whose task coordinates may be known."""
        still = np.zeros(self.mechanism.model.nv)
        self._q = q
        if self._task is not None:
            self._x = self._task.at(q, near=self._x) if x is None else x.copy()
        self._held: Array | str
        try:
            self._held = self.mechanism.inverse_dynamics(q, still, still).tau
        except RPSPinError as error:
            self._held = str(error)
        self.trouble = self._beyond()

    def _of_task(self) -> list[tuple[str, str]]:
        """Return the task's coordinates, and how far it is from singularities."""
        if self._task is None:
            return []
        rows = [
            (name, quantity(value, *((_DEGREE, "degrees") if turns else (_MM, "mm"))))
            for name, value, turns in zip(
                self._task.coordinates, self._x, self._task.angular, strict=True
            )
        ]
        found = self._task.singularities(self._q)
        for kind, distance in (("I", found.type_i), ("II", found.type_ii)):
            rows.append((f"distance to type {kind}", f"{float(distance):.4f} (0 singular)"))
        return rows

    def _task_slider(self, number: int) -> Slider:
        task = self._task
        assert task is not None
        name, here, turns = task.coordinates[number], float(self._x[number]), task.angular[number]
        scale, unit = (_DEGREE, "degrees") if turns else (_MM, "mm")
        reach = _TURN if turns else task.characteristic_length
        low, high = here - reach, here + reach
        return Slider(f"{name} ({unit})", scale * low, scale * high, scale * reach / 500, scale)

    def _beyond(self) -> list[str]:
        """Return a sentence for each limit that is broken."""
        words = [f"joint {phrase}" for phrase in self._limits.outside(self._q).values()]
        if isinstance(self._held, str):
            return words
        model = self.mechanism.model
        joints = zip(self.mechanism.actuated, self._joints, self._units, strict=True)
        for (name, joint, (*_, unit)), tau in zip(joints, self._held.tolist(), strict=True):
            low, high = model.lowerEffortLimit[joint.idx_v], model.upperEffortLimit[joint.idx_v]
            if not low <= tau <= high:
                need = f"would need {tau:.6g} {unit} ({low:.6g} to {high:.6g})"
                words.append(f"joint {name!r} {need}")
        return words

    def _slider(self, number: int) -> Slider:
        index, (scale, unit, _) = self._joints[number].idx_q, self._units[number]
        model, here = self.mechanism.model, float(self._q[index])
        low, high = float(model.lowerPositionLimit[index]), float(model.upperPositionLimit[index])
        if not high - low < 1e3:  # no limits
            low, high = (-math.pi, math.pi) if unit == "degrees" else (here - 1.0, here + 1.0)
        name = f"{self.mechanism.actuated[number]} ({unit})"
        return Slider(name, scale * low, scale * high, scale * (high - low) / 1000, scale)

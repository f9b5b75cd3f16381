"""The arrays of a task's generated tick, and what its law asks of the mechanism."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from rps_pin.codegen.units import Kernel
from rps_pin.control.any_task.motion import TaskGeometry, TaskJacobian, departure
from rps_pin.control.generated.tick import LAWS, Form, feedback_of
from rps_pin.control.loop.force_limits import recovered_pace, within_limits
from rps_pin.control.loop.setpoints import Setpoint, all_below
from rps_pin.control.loop.vectors import columns
from rps_pin.numerics.elementary import select
from rps_pin.rps.generated.layout import Layout
from rps_pin.task import Task

#: Rotation vectors of a regular tick are shorter than that, and those of its target change by less,
#: rad: they are then the shorter of the two of a rotation.
LONGEST_TURN, LARGEST_TURN = 3.0, 0.25
#: A configuration that is only known to the C text.
_NONE = np.empty(0)


class Call(NamedTuple):
    """What a law asks of the mechanism's dynamics, in C."""

    kind: str
    """``"motion"`` (the actuators' speeds and accelerations) or ``"forces"``."""
    at: str
    """``"state"`` or ``"target"``."""
    kernel: Kernel
    """Of rate and acceleration of the task, by what is known before the call."""


def form_of_task(task: Task) -> Form:
    """Return the layouts of a tick's arrays."""
    mechanism = task.mechanism
    m, whole = task.size, mechanism.model.nq + task.extension.added
    entries = mechanism.constraint_size * mechanism.model.nv
    limited = mechanism.system.limits.q.size
    bounds = {"lower": limited, "upper": limited} if limited else {}
    entries_of = {"reference": entries, "target_reference": entries} if entries else {}
    return Form(
        Layout(
            {"most": m, "most_speed": m, "fastest": m, "jump": m, **bounds}
            | {"near": 1, "largest": 1}
            | {"kp": m, "kd": m, "ki": m, "stop": 1, "side": 1, "force_limit": m}
        ),
        Layout(
            {"whole": whole, "pose": m, "position": m, "rate": m, "speed": m, "started": 1}
            | {"target": whole, "target_pose": m, "target_rate": m, "target_acceleration": m}
            | {"integral": m, "last_rate": m, "filtered_rate": m, "pace": 1}
            # The last are only read: J at an earlier place, and its singular values there.
            | {"values": 2, "target_values": 2, **entries_of}
        ),
        Layout(
            {"reading": m, "reading_speed": m, "measured": 1, "elapsed": 1, "share": 1}
            | {"pose": m, "rate": m, "acceleration": m, "given": 1}
        ),
        {
            "pose": m,
            "rate": m,
            "position": m,
            "speed": m,
            "configuration": mechanism.model.nq,
            "forces": m,
        },
    )


class TickKernels:
    """The formulas of a tick, as kernels: those of the interpreted tick, on CasADi's columns.

    Attributes
    ----------
    read : Kernel
        Of numbers, memory and reading: whether the reading is a good one, and the speeds.
    aim : Kernel
        Of the same: pose, rate and acceleration of the target, and whether they are in range.
    calls : list of Call
        In the law's order; the kernel of each takes the results of those before.
    end : Kernel
        The forces, what the law hands to the next tick, and whether the forces are within limits.
    """

    def __init__(self, task: Task, form: Form, law: str) -> None:
        import casadi as ca  # noqa: PLC0415

        self._ca, self._m = ca, task.size
        self._angular = [
            k for k, turns in enumerate(task.angular) if turns and task.extension.added
        ]
        self._whole = {
            name: ca.SX.sym(name, layout.size)
            for name, layout in zip(("numbers", "memory", "reading"), form[:3], strict=True)
        }
        self._numbers, self._memory, self._reading = (
            {name: self._whole[of][part] for name, part in layout.slices.items()}
            for of, layout in zip(self._whole, form[:3], strict=True)
        )
        self.vectors = columns(self._m)
        self.read, self.aim = self._read(), self._aim()
        self.calls: list[Call] = []
        self._given = dict(self._whole)
        self.end = self._end(LAWS[law])

    def _kernel(self, name: str, given: Mapping[str, Any], made: Mapping[str, Any]) -> Kernel:
        ca = self._ca
        results = [ca.densify(one) for one in made.values()]
        return Kernel(ca.Function(name, [*given.values()], results, [*given], [*made]))

    def _read(self) -> Kernel:
        numbers, memory, reading = self._numbers, self._memory, self._reading
        d, elapsed = reading["reading"], reading["elapsed"]
        change = self.vectors.backward_difference(d, memory["position"], elapsed)
        filtered = self.vectors.low_pass(change, memory["speed"], reading["share"])
        filtered = select(memory["started"], filtered, memory["speed"])
        away = departure(d, memory["position"], memory["speed"], elapsed)
        good = self._all(self._ca.fabs(d) < numbers["most"])
        good = good * self._all(self._ca.fabs(away) <= numbers["jump"])
        speed = select(reading["measured"], reading["reading_speed"], filtered)
        good = good * self._all(self._ca.fabs(speed) < numbers["most_speed"])
        return self._kernel("control_read", self._whole, {"good": good, "speed": speed})

    def _aim(self) -> Kernel:
        numbers, memory, reading = self._numbers, self._memory, self._reading
        pose, rate, acceleration = (
            select(reading["given"], reading[name], memory[f"target_{name}"])
            for name in ("pose", "rate", "acceleration")
        )
        parts = [*self._parts(rate), *self._parts(acceleration)]
        good = all_below(parts, numbers["largest"])
        good = good * all_below(self._parts(pose), self._ca.inf)
        turned = [pose[k] - memory["target_pose"][k] for k in self._angular]
        good = good * (sum(one * one for one in turned) < LARGEST_TURN**2)
        good = good * (sum(pose[k] * pose[k] for k in self._angular) < LONGEST_TURN**2)
        made = {"goal": pose, "goal_rate": rate, "goal_acceleration": acceleration, "good": good}
        return self._kernel("control_aim", self._whole, made)

    # The law --------------------------------------------------------------------------------------

    def _end(self, law: Callable[..., Any]) -> Kernel:
        m, symbol = self._m, self._symbol
        state = (
            TaskGeometry(symbol("pose", m), symbol("position", m), _NONE, 0.0, 1.0),
            symbol("rate", m),
            symbol("speed", m),
            TaskJacobian(symbol("inverse", m, m), 0.0),
        )
        self._state = state[0]
        goal = TaskGeometry(symbol("goal", m), symbol("goal_position", m), _NONE, 0.0, 1.0)
        setpoint = Setpoint(goal, symbol("goal_rate", m), symbol("goal_acceleration", m))
        after: dict[str, Any] = {}
        groups = self._numbers, self._memory, self._reading
        feedback = feedback_of(self.vectors, select, *groups, after)
        force = law(state, setpoint, self, feedback, self._dynamics)
        limit = self._numbers["force_limit"]
        good = within_limits(self._parts(force), self._parts(limit))
        pace = recovered_pace(self._memory["pace"], self._reading["elapsed"])
        made = {"good": good, "forces": force, **after, "pace": pace}
        renamed = {
            name if name in ("good", "forces") else f"{name}_out": made[name] for name in made
        }
        return self._kernel("control_end", self._given, renamed)

    def _symbol(self, name: str, *shape: int) -> Any:
        self._given[name] = found = self._ca.SX.sym(name, *shape)
        return found

    def _call(self, kind: str, geometry: Any, rate: Any, acceleration: Any) -> Any:
        number, m = len(self.calls), self._m
        made = {"task_rate": rate, "task_acceleration": acceleration}
        kernel = self._kernel(f"control_call_{number}", dict(self._given), made)
        at = "state" if geometry is self._state else "target"
        self.calls.append(Call(kind, at, kernel))
        return self._symbol(f"result_{number}", 2 * m if kind == "motion" else m)

    def _dynamics(self, geometry: Any, rate: Any, acceleration: Any) -> Any:
        return self._call("forces", geometry, rate, acceleration)

    def motion(self, geometry: Any, rate: Any, acceleration: Any) -> tuple[Any, Any]:
        """Return the actuators' speeds and accelerations; see `Formulas`."""
        found = self._call("motion", geometry, rate, acceleration)
        return found[: self._m], found[self._m :]

    def pose_rate(self, jacobian: TaskJacobian, speed: Any) -> Any:
        """Return x' of K x' = the actuators' speeds; the Jacobian here holds K^-1."""
        return jacobian.K @ speed

    def force_of_wrench(self, jacobian: TaskJacobian, wrench: Any) -> Any:
        """Return f of K' f = wrench."""
        return jacobian.K.T @ wrench

    # Parts ----------------------------------------------------------------------------------------

    def _parts(self, column: Any) -> list[Any]:
        return [column[k] for k in range(column.numel())]

    def _all(self, conditions: Any) -> Any:
        found: Any = 1.0
        for one in self._parts(conditions):
            found = found * one
        return found

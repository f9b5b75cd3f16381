"""A regular tick of a task as C: the mechanism's routines in their order, and the law's kernels.

With the last closed configuration as the guess, and distances bounded from below,

    reading -> closed configuration -> T, K^-1 -> pose, rate
    target -> closed configuration -> T, K^-1
    law -> acceleration of all joints -> inverse dynamics -> forces.

**Distance to a singularity.** Singular values are not computed in a tick. With T, K and J in one
unit, and J_0 an earlier J with singular values s_1 and s_r,

    type_i >= 1 / |T|,  type_ii >= 1 / |K^-1|,  constraint >= (s_r - |J - J_0|) / (s_1 + |J - J_0|),

Frobenius norms, the last by Weyl's inequality. A tick is regular if these bounds are above
`near_singular`; otherwise the interpreted tick answers, and gives a new J_0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rps_pin.closed_loop.constraints.unit_parts import unit_parts
from rps_pin.codegen.emit import constant
from rps_pin.codegen.expressions.functions import MechanismFunctions
from rps_pin.codegen.expressions.routines import with_calls
from rps_pin.codegen.units import Kernel, Unit, prelude
from rps_pin.control.any_task.tick_form import LONGEST_TURN, Call, TickKernels, form_of_task
from rps_pin.control.loop import status as flags
from rps_pin.rps.generated.layout import Layout
from rps_pin.task import Task


def task_tick_text(task: Task, law: str) -> str:
    """Return the C text of ``int LAW_tick(double *x, double *const *answers)``; see `tick_texts`.

    Parameters
    ----------
    task
        In generated code, whose independent velocities are the actuators' and the coordinates'.
    law
        One of `LAWS`.
    """
    return _Text(task, law).whole()


class _Text:
    """The parts of the text."""

    def __init__(self, task: Task, law: str) -> None:
        self._task, self._law, self._form = task, law, form_of_task(task)
        self._kernels = TickKernels(task, self._form, law)
        mechanism, x = task.mechanism, task.extension
        self._m, self._nq, self._nv = task.size, mechanism.model.nq, mechanism.model.nv
        self._added, self._rows = x.added, mechanism.constraint_size
        self._nx, self._nw = self._nv + x.added, self._nq + x.added

    def whole(self) -> str:
        """Return the text."""
        by_task, by_actuators = (one.code.functions for one in self._task.engines)
        of_task = ["completed", "motion_basis", "acceleration", *(["gaps"] if self._added else [])]
        of_actuators = ["completed", "inverse_dynamics", *(["jacobian"] if self._rows else [])]
        k = self._kernels
        own = [k.read, k.aim, *(call.kernel for call in k.calls), k.end]
        names = tuple(one.name for one in own)
        return "\n".join(
            [
                prelude("scalar.h"),
                _mechanism(by_task, of_task, "of_task"),
                _mechanism(by_actuators, of_actuators, "of_actuators"),
                Unit("control", tuple(own), (), names).local("own"),
                self._tables(),
                prelude("task_tick.h"),
                self._placed(),
                *(self._dynamics(kind) for kind in ("motion", "forces")),
                self._tick(),
            ]
        )

    # Constants ------------------------------------------------------------------------------------

    def _tables(self) -> str:
        task, mechanism, x = self._task, self._task.mechanism, self._task.extension
        columns, units = mechanism.velocity_scale, 1 / task.scale
        of_actuators = columns[mechanism.actuated_indices]
        angular = [x.idx_q[k] for k, turns in enumerate(x.angular) if turns and x.added]
        tables: dict[str, Any] = {
            "basis_scale": units / columns[:, None],
            "inverse_scale": of_actuators / units[:, None],
            "jacobian_scale": mechanism.system.scaled(np.ones((self._rows, self._nv))),
        }
        numbers: dict[str, Sequence[int]] = {
            "actuators": task.of_actuators.tolist(),
            "driven": mechanism.actuated_indices.tolist(),
            "coordinates": x.idx_q.tolist(),
            "coordinate_rows": x.rows.tolist(),
            "angles": [int(one) for one in angular],
            "limited": mechanism.system.limits.q.tolist(),
        }
        texts = {
            **{f"double {k}": map(constant, one.ravel().tolist()) for k, one in tables.items()},
            **{f"int {k}": map(str, row) for k, row in numbers.items()},
        }
        rows = {name: ", ".join(entries) for name, entries in texts.items()}
        lines = [f"static const {name}[] = {{{row}}};" for name, row in rows.items() if row]
        sizes = {"M": self._m, "NQ": self._nq, "NV": self._nv, "NX": self._nx, "NW": self._nw}
        return "\n".join([*lines, *(f"#define {name} {size}" for name, size in sizes.items())])

    # Functions ------------------------------------------------------------------------------------

    def _placed(self) -> str:
        """Return what puts a mechanism at coordinates of `independent`, and checks the place."""
        far, limits = "", ""
        if self._rows:
            far = f"""
    jacobian_of_actuators(whole, jacobian);
    away = distance(jacobian, jacobian_scale, reference, {self._rows * self._nv});
    if (!(values[0] - away > near * (values[1] + away))) return 0;"""
        count = self._task.mechanism.system.limits.q.size
        if count:
            limits = f"""
    for (i = 0; i < {count}; ++i)
        *beyond |= whole[limited[i]] < lower[i] || whole[limited[i]] > upper[i];"""
        return f"""
/* Bounds the distance to a singularity from below, and computes K^-1 and the sign of det K. */
static int placed(const double *whole, const double *reference, const double *values, double near,
    const double *lower, const double *upper, double *basis, double *inverse, double *determinant,
    int *beyond)
{{
    double check[2], K[M * M], jacobian[{max(1, self._rows * self._nv)}], away;
    int i, j;
    (void)reference, (void)values, (void)lower, (void)upper, (void)jacobian, (void)away;
    near *= 1.000000001; /* these are bounds, but for rounding */
    motion_basis_of_task(whole, basis, check);
    if (!holds(check)) return 0;{far}
    if (!(near * near * squares(basis, basis_scale, NV * M) < 1.0)) return 0;
    for (i = 0; i < M; ++i)
        for (j = 0; j < M; ++j) K[i * M + j] = basis[driven[i] * M + j];
    *determinant = inverted(K, inverse, M);
    if (!(near * near * squares(inverse, inverse_scale, M * M) < 1.0)) return 0;
    *beyond = 0;{limits}
    return 1;
}}
"""

    def _dynamics(self, kind: str) -> str:
        """Return what computes a motion of the task: its actuators' motion, or their forces."""
        if kind not in {call.kind for call in self._kernels.calls}:
            return ""
        results = dict(self._functions_of_forces()) if kind == "forces" else {}
        more = "".join(f", {name}[{max(1, size)}]" for name, size in results.items())
        end = """
    for (i = 0; i < M; ++i) {
        result[i] = v[driven[i]];
        result[M + i] = a[driven[i]];
    }
    return 1;"""
        if kind == "forces":
            arguments = ", ".join(["whole", "v", "a", "result", *results, "check"])
            end = f"""
    inverse_dynamics_of_actuators({arguments});
    return holds(check);"""
        return f"""
static int task_{kind}(const double *whole, const double *basis, const double *rate,
    const double *acceleration, double *result)
{{
    double v[NX], a[NX], check[2]{more};
    int i, j;
    for (i = 0; i < NX; ++i) {{
        v[i] = 0.0;
        for (j = 0; j < M; ++j) v[i] += basis[i * M + j] * rate[j];
    }}
    acceleration_of_task(whole, v, acceleration, a, check);
    if (!holds(check)) return 0;{end}
}}
"""

    def _functions_of_forces(self) -> list[tuple[str, int]]:
        """Return the results of inverse dynamics besides the forces and its check."""
        function = self._task.engines[1].code.functions["inverse_dynamics"]
        return list(Kernel(function).outputs[1:-1])

    def _tick(self) -> str:
        form, kernels = self._form, self._kernels
        where = {
            **_places("numbers", form.numbers),
            **_places("memory", form.memory),
            **_places("reading", form.reading),
        }
        memory, reading = _places("memory", form.memory), _places("reading", form.reading)
        bounds = [where.get(one, "0") for one in ("lower", "upper")]
        call = self._called
        return f"""
int {self._law}_tick(double *x, double *const *answers)
{{
    const double *numbers = x;
    double *memory = x + {form.numbers.size};
    const double *reading = memory + {form.memory.size};
    double whole[NW], target[NW], given[NW], basis[NX * M], target_basis[NX * M], inverse[M * M];
    double target_inverse[M * M], determinant, check[2], good[1], pose[M], position[M], rate[M];
    double speed[M], goal[M], goal_rate[M], goal_acceleration[M], goal_position[M];
    int i, j, beyond, target_beyond;

    /* The reading, its configuration, the pose and its rate. */
    {call(kernels.read)}
    if (good[0] != 1.0) return -1;
    for (i = 0; i < NQ; ++i) given[i] = {memory["whole"]}[i];
    for (i = 0; i < M; ++i) given[actuators[i]] = {reading["reading"]}[i];
    completed_of_actuators({memory["whole"]}, given, whole, check);
    if (!holds(check)) return -1;
    {self._unit_lengths("whole")}{self._coordinates(memory)}
    if (!placed(whole, {memory.get("reference", "0")}, {memory["values"]}, {where["near"]}[0],
        {", ".join(bounds)}, basis, inverse, &determinant, &beyond)) return -1;
    for (i = 0; i < M; ++i) {{
        pose[i] = whole[coordinates[i]];
        position[i] = whole[actuators[i]];
        rate[i] = 0.0;
        for (j = 0; j < M; ++j) rate[i] += inverse[i * M + j] * speed[j];
        beyond |= !(fabs(speed[i]) <= {where["fastest"]}[i]);
    }}
    if (!all_finite(rate, M)) return -1;

    /* The target. */
    {call(kernels.aim)}
    if (good[0] != 1.0) return -1;
    for (i = 0; i < NW; ++i) given[i] = {memory["target"]}[i];
    for (i = 0; i < M; ++i) given[coordinates[i]] = goal[i];
    completed_of_task({memory["target"]}, given, target, check);
    if (!holds(check)) return -1;
    {self._unit_lengths("target")}
    if (!placed(target, {memory.get("target_reference", "0")}, {memory["target_values"]},
        {where["near"]}[0], {", ".join(bounds)}, target_basis, target_inverse, &determinant,
        &target_beyond)) return -1;
    if (target_beyond || !(determinant * {where["side"]}[0] > 0.0)) return -1;
    for (i = 0; i < M; ++i) goal_position[i] = target[actuators[i]];

    /* The law. */{"".join(map(self._of_call, range(len(kernels.calls))))}
    double forces[M], {", ".join(f"{name}[{size}]" for name, size in self._handed_on())};
    {call(kernels.end)}
    if (good[0] != 1.0 || !all_finite(forces, M)) return -1;
{self._written(memory)}
    return beyond ? {flags.BEYOND_LIMIT} : 0;
}}
"""

    def _called(self, kernel: Kernel) -> str:
        """Return the call of a kernel with variables of its arguments' names."""
        names = [name for name, _ in (*kernel.inputs, *kernel.outputs)]
        return f"{kernel.name}_own({', '.join(names)});"

    def _of_call(self, number: int) -> str:
        one: Call = self._kernels.calls[number]
        result, size = f"result_{number}", 2 * self._m if one.kind == "motion" else self._m
        at, basis = ("whole", "basis") if one.at == "state" else ("target", "target_basis")
        rows = f"rate_{number}, acceleration_{number}"
        inputs = ", ".join(name for name, _ in one.kernel.inputs)
        return f"""
    double rate_{number}[M], acceleration_{number}[M], {result}[{size}];
    {one.kernel.name}_own({inputs}, {rows});
    if (!task_{one.kind}({at}, {basis}, {rows}, {result})) return -1;"""

    def _handed_on(self) -> list[tuple[str, int]]:
        """Return the results of the last kernel that are memory."""
        return [(n, size) for n, size in self._kernels.end.outputs if n not in ("good", "forces")]

    def _coordinates(self, memory: dict[str, str]) -> str:
        """Return what sets the coordinates of the frame, of rotation vectors near the last."""
        if not self._added:
            return ""
        size = self._task.extended.constraint_size
        turns = ""
        angles = sum(self._task.extension.angular)
        if angles:
            turns = f"""
    check[0] = 0.0;
    for (i = 0; i < {angles}; ++i) check[0] += whole[angles[i]] * whole[angles[i]];
    if (!(check[0] < {LONGEST_TURN**2})) return -1;"""
        return f"""
    double gaps[{size}];
    for (i = 0; i < M; ++i) whole[coordinates[i]] = {memory["pose"]}[i];
    gaps_of_task(whole, gaps);
    for (i = 0; i < M; ++i) whole[coordinates[i]] -= gaps[coordinate_rows[i]];{turns}"""

    def _unit_lengths(self, q: str) -> str:
        parts = unit_parts(self._task.mechanism.model)
        return " ".join(f"normalise({q} + {p.start}, {p.stop - p.start});" for p in parts)

    def _written(self, memory: dict[str, str]) -> str:
        """Return what writes the memory and the answers."""
        groups = {
            **{"whole": "whole", "pose": "pose", "position": "position", "rate": "rate"},
            **{"speed": "speed", "target": "target", "target_pose": "goal"},
            **{"target_rate": "goal_rate", "target_acceleration": "goal_acceleration"},
            **{name.removesuffix("_out"): name for name, _ in self._handed_on()},
        }
        sizes = self._form.memory.sizes
        lines = [
            f"    for (i = 0; i < {sizes[name]}; ++i) {memory[name]}[i] = {source}[i];"
            for name, source in groups.items()
        ]
        lines.append(f"    {memory['started']}[0] = 1.0;")
        for k, (name, size) in enumerate(self._form.answers.items()):
            source = "whole" if name == "configuration" else name
            lines.append(f"    for (i = 0; i < {size}; ++i) answers[{k}][i] = {source}[i];")
        return "\n".join(lines)


def _places(start: str, layout: Layout) -> dict[str, str]:
    """Return C expressions of where the groups of an array begin, by name."""
    return {name: f"({start} + {part.start})" for name, part in layout.slices.items()}


def _mechanism(functions: MechanismFunctions, names: Sequence[str], end: str) -> str:
    """Return the text of a mechanism's functions, which end in a word."""
    called, routines = with_calls(functions, names)
    kernels = tuple(Kernel(functions[one]) for one in called)
    return Unit(end, kernels, routines, tuple(names)).local(end)

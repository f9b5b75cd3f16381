"""A regular tick as expressions, and as C: estimate, setpoint, law, dynamics, limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from rps_pin.codegen.units import Kernel, Routine, Unit
from rps_pin.control.estimator.leg_formulas import LegFormulas
from rps_pin.control.estimator.leg_geometry import (
    LegGeometry,
    closure_determinant,
    in_range,
    legs_have_length,
    legs_to,
    platform_tips,
)
from rps_pin.control.estimator.leg_jacobian import leg_jacobian
from rps_pin.control.estimator.state_estimate import (
    StateEstimate,
    departure,
    geometry_of_legs,
    moving,
)
from rps_pin.control.laws import Dynamics, Feedback, computed_torque, pd_control
from rps_pin.control.loop import status as flags
from rps_pin.control.loop.force_limits import recovered_pace
from rps_pin.control.loop.force_limits import within_limits as forces_within
from rps_pin.control.loop.limits import none_beyond, within_limits
from rps_pin.control.loop.setpoints import LARGEST_RATE, Setpoint, all_below
from rps_pin.control.loop.vectors import TRIPLES, Vectors, backward_difference, low_pass
from rps_pin.numerics.elementary import Number, select_all
from rps_pin.rps.generated.follow import FOLLOW, follow_kernels, kernel, symbols
from rps_pin.rps.generated.forces import TERMS, terms_of
from rps_pin.rps.generated.layout import Layout
from rps_pin.rps.generated.reactions import forces_and_reactions
from rps_pin.rps.kinematics.tracking import Triple

#: Numbers that a loop does not change: of the robot and of `RealTimeRobot`.
ESTIMATE_NUMBERS = Layout(
    {
        "radii": 2,
        "bounds": 7,
        "speed_limit": 1,
        "largest": 1,
        "near": 1,
        "jump": 1,
        "condition_limit": 1,
        "most_steps": 1,
    }
)
#: Those of a controller besides: side is the sign of Eq. 8's determinant at the start.
CONTROL_NUMBERS = Layout(
    ESTIMATE_NUMBERS.sizes
    | TERMS.sizes
    | {"kp": 3, "kd": 3, "ki": 3, "stop": 1, "side": 1, "force_limit": 3}
)
#: Those of inverse dynamics.
DYNAMICS_NUMBERS = Layout(ESTIMATE_NUMBERS.sizes | TERMS.sizes | {"force_limit": 1})
#: Numbers that a tick hands to the next: `started` is 1 after the first reading. The last three are
#: only read.
ESTIMATE_MEMORY = Layout(
    {
        "length": 3,
        "direction": 6,
        "speed": 3,
        "started": 1,
        "determinant": 1,
        "pose": 3,
        "rate": 3,
    }
)
DYNAMICS_MEMORY = Layout({"determinant": 1})
CONTROL_MEMORY = Layout(
    ESTIMATE_MEMORY.sizes
    | {
        "target_pose": 3,
        "target_rate": 3,
        "target_acceleration": 3,
        "integral": 3,
        "last_rate": 3,
        "filtered_rate": 3,
        "pace": 1,
    }
)
#: Arguments of a tick: `measured` and `given` say whether there are a speed and a target; share is
#: the filters'.
ESTIMATE_READING = Layout(
    {"reading": 3, "reading_speed": 3, "measured": 1, "elapsed": 1, "share": 1}
)
DYNAMICS_READING = Layout({"pose": 3, "rate": 3, "acceleration": 3})
CONTROL_READING = Layout(
    ESTIMATE_READING.sizes | {"pose": 3, "rate": 3, "acceleration": 3, "given": 1}
)
#: What a tick writes for the caller, in the order of `Answers`; a controller also its forces.
ESTIMATE_ANSWERS = {"pose": 3, "rate": 3, "twist": 6, "angle": 3, "speed": 3}
CONTROL_ANSWERS = ESTIMATE_ANSWERS | {"forces": 3}
DYNAMICS_ANSWERS = {"forces": 3, "reactions": 9}

_Law = Callable[..., Any]
#: Laws by name: functions of state, setpoint, h, feedback and dynamics.
LAWS: Mapping[str, _Law] = {
    "computed_torque_task": partial(computed_torque, True),
    "computed_torque_actuator": partial(computed_torque, False),
    **{
        f"pd_control_{space}_{compensation}": partial(pd_control, space == "task", compensation)
        for space in ("task", "actuator")
        for compensation in ("gravity", "feed_forward", "none")
    },
}
#: The ticks of `RealTimeRobot` beside those of the laws.
ESTIMATE, DYNAMICS = "estimate", "inverse_dynamics"
#: One C function holds a tick: its parts share most of their values.
_CHUNK = 4000


class Form(NamedTuple):
    """Layouts of a tick's arrays."""

    numbers: Layout
    memory: Layout
    reading: Layout
    answers: Mapping[str, int]


def form_of(name: str) -> Form:
    """Return the layouts of a tick: `ESTIMATE`, `DYNAMICS`, or the name of a law."""
    if name == DYNAMICS:
        return Form(DYNAMICS_NUMBERS, DYNAMICS_MEMORY, DYNAMICS_READING, DYNAMICS_ANSWERS)
    if name == ESTIMATE:
        return Form(ESTIMATE_NUMBERS, ESTIMATE_MEMORY, ESTIMATE_READING, ESTIMATE_ANSWERS)
    return Form(CONTROL_NUMBERS, CONTROL_MEMORY, CONTROL_READING, CONTROL_ANSWERS)


class Tick(NamedTuple):
    """A tick as expressions."""

    regular: Number
    """Whether it is a regular one."""
    status: Number
    """`Status`, of a regular one."""
    memory: dict[str, Any]
    answers: dict[str, Any]
    state: StateEstimate | None = None


def tick_kernel(name: str) -> Kernel:
    """Return what follows `FOLLOW` in a tick, as a kernel.

    Its outputs are the verdict (1 for a regular tick, its `Status`), the memory and the answers.
    """
    form = form_of(name)
    given = {
        "numbers": symbols("n", form.numbers.size),
        "memory": symbols("m", form.memory.size),
        "reading": symbols("r", form.reading.size),
    }
    numbers, memory, reading = (
        layout.split(given[one]) for layout, one in zip(form[:3], given, strict=True)
    )
    if name == DYNAMICS:
        found = _forces(numbers, reading)
    else:
        given |= {"direction": symbols("direction", 6), "progress": symbols("progress", 3)}
        found = _estimate(numbers, memory, reading, given["direction"], given["progress"][0])
        if name != ESTIMATE:
            found = _control(LAWS[name], numbers, memory, reading, found)
    outputs = {
        "verdict": (found.regular, found.status),
        "memory": form.memory.join(found.memory),
        **{f"{one}_answer": found.answers[one] for one in form.answers},
    }
    made = kernel(f"{name}_kernel", given, outputs)
    return Kernel(made.function, _CHUNK)


def _estimate(
    numbers: dict[str, Any],
    memory: dict[str, Any],
    reading: dict[str, Any],
    direction: tuple[Number, ...],
    done: Number,
) -> Tick:
    """Return the estimate of `RealTimeRobot.estimate`."""
    g, h = numbers["radii"]
    d, elapsed, last = reading["reading"], reading["elapsed"], memory["length"]
    change = backward_difference(d, last, elapsed)
    filtered = select_all(
        memory["started"], low_pass(change, memory["speed"], reading["share"]), memory["speed"]
    )
    speed = select_all(reading["measured"], reading["reading_speed"], filtered)
    geometry = geometry_of_legs(d, direction, g, h)
    jacobian = leg_jacobian(geometry, h)
    state, twist = moving(geometry, jacobian, speed, h)
    largest = numbers["largest"]
    regular = (
        (elapsed > 0.0)
        * (elapsed < math.inf)
        * _product(one > 0.0 for one in d)
        * _product(one < largest for one in d)
        * (departure(d, last, memory["speed"], elapsed) <= numbers["jump"])
        * (done >= 1.0)
        * (abs(jacobian.determinant) >= numbers["near"])
        * (abs(sum(twist)) < math.inf)
    )
    kept = within_limits(geometry, numbers["bounds"]) * none_beyond(speed, numbers["speed_limit"])
    return Tick(
        regular,
        flags.BEYOND_LIMIT * (1.0 - kept),
        {
            "length": d,
            "direction": direction,
            "speed": speed,
            "started": 1.0,
            "determinant": jacobian.determinant,
            "pose": geometry.pose,
            "rate": state.rate,
        },
        {
            "pose": geometry.pose,
            "rate": state.rate,
            "twist": twist,
            "angle": geometry.angle,
            "speed": speed,
        },
        state,
    )


def _control(
    law: _Law,
    numbers: dict[str, Any],
    memory: dict[str, Any],
    reading: dict[str, Any],
    found: Tick,
) -> Tick:
    """Return the tick of a controller, after its estimate."""
    g, h = numbers["radii"]
    given, elapsed, state = reading["given"], reading["elapsed"], found.state
    assert state is not None
    pose, rate, acceleration = (
        select_all(given, reading[name], memory[f"target_{name}"])
        for name in ("pose", "rate", "acceleration")
    )
    platform = platform_tips(pose, h)
    setpoint = Setpoint(legs_to(platform, g), rate, acceleration)
    side = numbers["side"] * closure_determinant(setpoint.geometry, g, h)
    regular = (
        found.regular
        * in_range(pose, g, h)
        * legs_have_length(platform, g)
        * within_limits(setpoint.geometry, numbers["bounds"])
        * (side >= numbers["near"])
        * all_below((*rate, *acceleration), numbers["largest"])
        * (abs(state.jacobian.determinant) > numbers["stop"])
        * (abs(closure_determinant(state.geometry, g, h)) > numbers["stop"])
    )
    after: dict[str, Any] = {}
    force = law(
        state,
        setpoint,
        LegFormulas(h),
        feedback_of(TRIPLES, select_all, numbers, memory, reading, after),
        _dynamics(numbers),
    )
    regular = regular * (abs(sum(force)) < math.inf) * forces_within(force, numbers["force_limit"])
    return Tick(
        regular,
        found.status,
        {
            **found.memory,
            **after,
            "target_pose": pose,
            "target_rate": rate,
            "target_acceleration": acceleration,
            "pace": recovered_pace(memory["pace"], elapsed),
        },
        {**found.answers, "forces": force},
    )


def _forces(numbers: dict[str, Any], reading: dict[str, Any]) -> Tick:
    """Return `RealTimeRobot.inverse_dynamics`."""
    g, h = numbers["radii"]
    pose, rate, acceleration = reading["pose"], reading["rate"], reading["acceleration"]
    platform = platform_tips(pose, h)
    geometry = legs_to(platform, g)
    (_, x, y), length, _, direction, tilt = geometry
    forces, reactions = forces_and_reactions(
        *(terms_of(numbers), (x, y, tilt), length, direction, rate, acceleration)
    )
    determinant = closure_determinant(geometry, g, h)
    regular = (
        in_range(pose, g, h)
        * legs_have_length(platform, g)
        * (abs(determinant) >= numbers["near"])
        * all_below(rate, LARGEST_RATE)
        * (abs(sum((*forces, *reactions))) < math.inf)
    )
    kept = within_limits(geometry, numbers["bounds"]) * none_beyond(forces, numbers["force_limit"])
    answers = {"forces": forces, "reactions": reactions}
    return Tick(regular, flags.BEYOND_LIMIT * (1.0 - kept), {"determinant": determinant}, answers)


def feedback_of(
    vectors: Vectors,
    choose: Callable[[Any, Any, Any], Any],
    numbers: Mapping[str, Any],
    memory: Mapping[str, Any],
    reading: Mapping[str, Any],
    after: dict[str, Any],
) -> Feedback:
    """Return `Controller._pid` of vectors of any kind; it puts its memory into `after`.

    `choose` is `select` of two of these vectors.
    """

    def feedback(error: Any, wanted: Any, rate: Any) -> Any:
        measured = reading["measured"]
        u = vectors.mean(wanted, memory["last_rate"])
        filtered = vectors.low_pass(u, memory["filtered_rate"], reading["share"])
        after["last_rate"] = choose(measured, memory["last_rate"], wanted)
        after["filtered_rate"] = choose(measured, memory["filtered_rate"], filtered)
        error_rate = vectors.difference(choose(measured, wanted, filtered), rate)
        gains = numbers["kp"], numbers["kd"], numbers["ki"]
        command, after["integral"] = vectors.pid(
            error, error_rate, memory["integral"], gains, reading["elapsed"]
        )
        return command

    return feedback


def _dynamics(numbers: dict[str, Any]) -> Dynamics:
    """Return the actuator forces of a motion."""
    terms = terms_of(numbers)

    def dynamics(geometry: LegGeometry, rate: Triple, acceleration: Triple) -> Triple:
        (_, x, y), length, _, direction, tilt = geometry
        motion = (length, direction, rate, acceleration)
        return forces_and_reactions(terms, (x, y, tilt), *motion)[0]

    return dynamics


def _product(conditions: Any) -> Number:
    result: Number = 1.0
    for one in conditions:
        result = result * one
    return result


# C ------------------------------------------------------------------------------------------------


_BODY = """{followed}
    {name}_kernel(numbers, memory, reading, {more}{written});
"""


def _followed(form: Form) -> str:
    """Return the C statements that follow the leg lengths to a reading."""
    numbers, memory, reading = (layout.slices for layout in form[:3])
    arguments = [
        f"memory + {memory['length'].start}",
        f"memory + {memory['direction'].start}",
        f"reading + {reading['reading'].start}",
        f"numbers + {numbers['radii'].start}",
        f"numbers + {numbers['condition_limit'].start}",
        f"numbers + {numbers['most_steps'].start}",
        *("direction", "progress"),
    ]
    return f"""
    REAL direction[6], progress[3];
    {FOLLOW.name}({", ".join(arguments)});"""


def tick_texts(name: str) -> tuple[str, ...]:
    """Return the C text of a tick, with ``int NAME_tick(double *x, double *const *answers)``.

    x holds numbers, memory and reading, one after the other. Of a regular tick it returns the
    `Status`, and writes the memory and the answers; of any other it returns -1 and writes nothing.
    """
    form = form_of(name)
    written = ["verdict", "memory_out", *(f"{one}_answer" for one in form.answers)]
    routine = Routine(
        name,
        (
            ("numbers", form.numbers.size),
            ("memory", form.memory.size),
            ("reading", form.reading.size),
        ),
        (
            *(("verdict", 2), ("memory_out", form.memory.size)),
            *((f"{one}_answer", size) for one, size in form.answers.items()),
        ),
        _BODY.format(followed="", more="", name=name, written=", ".join(written))
        if name == DYNAMICS
        else _BODY.format(
            followed=_followed(form),
            more="direction, progress, ",
            name=name,
            written=", ".join(written),
        ),
        (FOLLOW.name, f"{name}_kernel"),
    )
    kernels = (*follow_kernels(), tick_kernel(name))
    unit = Unit(f"{name}_unit", kernels, (FOLLOW, routine), (name,))
    return (unit.c99() + _entry(unit.name, name, form),)


def _entry(unit: str, name: str, form: Form) -> str:
    """Return the C function that writes only after a regular tick."""
    begin, size = form.numbers.size, form.memory.size
    places = ["x", f"x + {begin}", f"x + {begin + size}", "y", "y + 2"]
    at = 2 + size
    for count in form.answers.values():
        places.append(f"y + {at}")
        at += count
    lines = [
        f"int {name}_tick(double *x, double *const *answers)",
        "{",
        f"    double y[{2 + size + sum(form.answers.values())}];",
        f"    {unit}_{name}({', '.join(places)}); /* its status: limits may be infinite */",
        "    if (y[0] != 1.0) return -1;",
        f"    for (int i = 0; i < {size}; ++i) x[{begin} + i] = y[2 + i];",
    ]
    at = 2 + size
    for k, count in enumerate(form.answers.values()):
        lines.append(f"    for (int i = 0; i < {count}; ++i) answers[{k}][i] = y[{at} + i];")
        at += count
    return "\n".join([*lines, "    return (int)y[1];", "}", ""])

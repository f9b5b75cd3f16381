"""Machine code of a task's regular ticks: built for one mechanism and law, proven, and kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.control.any_task.tick_form import form_of_task
from rps_pin.control.estimator.loop_arguments import floats
from rps_pin.control.generated.code import GeneratedTick
from rps_pin.control.generated.engine import TICK_SOURCES, built_once, refuse_without
from rps_pin.control.generated.proof import Case, MakeLoop, prove
from rps_pin.errors import CompileError, RPSPinError
from rps_pin.rps.generated.digest import digest_of
from rps_pin.task import Task

if TYPE_CHECKING:
    from rps_pin.codegen.build import Library

#: Both engines close the loops and solve for the rates; their answers differ by rounding, and more
#: where a mechanism is stiff.
_TOLERANCE = 1e-8
_TICKS, _PERIOD = 120, 1e-3


def generated_task_tick(
    task: Task,
    law: str,
    near: ArrayLike,
    make: MakeLoop,
    answers: tuple[Array, ...],
    own: tuple[float, Callable[[float], float], Callable[[dict[str, Any]], None]],
    given: Library | None = None,
) -> GeneratedTick:
    """Return the machine code of a controller's ticks.

    Parameters
    ----------
    task
        In generated code, with as many actuators as coordinates.
    law
        One of `LAWS`; none: a law of the user's.
    near
        Coordinates about which it is proven, if it is built.
    make
        As for `prove`.
    answers, own
        As for `GeneratedTick`; own are period, share and take.
    given
        The library to use, which is being proven.

    Raises
    ------
    CompileError
        If there is no such code, or it cannot be built.
    """
    library = given if given is not None else _built(task, law, near, make)
    convert = partial(floats, count=task.size)
    return GeneratedTick(law, form_of_task(task), library, answers, *own, convert)


def _built(task: Task, law: str, near: ArrayLike, make: MakeLoop) -> Library:
    from rps_pin.codegen.build import Source, build  # noqa: PLC0415

    refuse_without(law)
    codes = [one.code for one in task.engines]
    if any(one.parameters or one.wrench_frames for one in codes):
        raise CompileError("a task with parameters or wrenches has no generated tick", "")
    if not all(one.partition.is_actuated for one in codes):
        raise CompileError(
            "the actuators, or the coordinates, are not all motions of the mechanism", ""
        )
    parts = (
        *(law, repr(task.coordinates), repr(task.characteristic_length)),
        *(one.identity for one in codes),
        digest_of("rps/generated", "control/any_task", *TICK_SOURCES),
    )
    key = " ".join(parts)

    def texts() -> tuple[str, ...]:
        from rps_pin.control.any_task.tick_text import task_tick_text  # noqa: PLC0415

        return (task_tick_text(task, law),)

    source = Source(
        f"{task.mechanism.name or 'mechanism'}: control loop, {law}",
        (f"{law}_tick",),
        texts,
        flags=("-O1",),
        determined_by=key,
        count=1,
    )

    def proof(library: Library) -> dict[str, Any]:
        return prove(law, library, make, cases(task, near), _TOLERANCE)

    def made() -> Library:
        try:
            return build(source, proof, codes[0].compiler)
        except CompileError:
            raise
        except RPSPinError as error:  # of a mechanism that has no such motion
            raise CompileError(f"it cannot be proven here: {error}", "") from error

    return built_once(key, made)


def cases(task: Task, near: ArrayLike) -> Iterator[Case]:
    """Yield a small swing about coordinates, followed with noise, with faults and weak actuators.

    Raises
    ------
    RPSPinError
        If it is out of reach.
    """
    rng = np.random.default_rng(19)
    start = np.array(near, dtype=np.float64)
    t = _PERIOD * np.arange(_TICKS)[:, None]
    w = 2 * np.pi * np.linspace(2.0, 5.0, task.size)
    size = 2e-3 * task.scale.max() / task.scale
    x, rate, acceleration = (
        start + size * np.sin(w * t),
        size * w * np.cos(w * t),
        -size * w**2 * np.sin(w * t),
    )
    first = task.configuration(start, within_limits=False)
    length = task.follow(x, first, within_limits=False)[:, task.of_actuators]
    read = length + 1e-8 * np.abs(length).max() * rng.normal(size=length.shape)
    still = np.zeros_like(start)
    weight = float(
        np.abs(task.mechanism.inverse_dynamics(*task.motion(first, still, still)).tau).max()
    )
    ticks: list[tuple[Any, Any, Any, float | None]] = []
    for k in range(_TICKS):
        reading: Any = read[k]
        target: Any = (x[k], rate[k], acceleration[k])
        speed, dt = None, None
        if k % 7 == 3:
            target = None
        if k % 11 == 5:
            reading = reading.tolist()
        if 40 <= k < 60:
            speed = (read[k] - read[k - 1]) / _PERIOD
        if k % 13 == 6:
            dt = _PERIOD * float(rng.uniform(0.9, 1.1))
        if k == 70:
            reading = read[k] * np.nan
        if k == 90:
            target = (x[k] * np.nan, rate[k], acceleration[k])
        ticks.append((reading, target, speed, dt))
    size_of_force = max(weight, 1e-3)
    yield Case(task, start, {"period": _PERIOD}, ticks, size_of_force)

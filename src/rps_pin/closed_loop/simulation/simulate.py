"""Simulation: a mechanism's motion in time under its actuators, its loops kept closed.

The state (q, v) moves by the reduced dynamics of `closed_manifold`, in steps of `integrators`. With
``closing="projection"`` each step ends with a projection to the closed configurations and the
velocities that keep them closed: gaps stay at rounding error, and since the correction is as small
as the step's own error the order of the method stays what it is. With ``closing="baumgarte"``
nothing is projected; gaps that the steps' errors open die out like exp(-alpha t), and stand at what
is opened anew in the meantime.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.simulation.integrators import AdaptiveStepper, rk4_step, times
from rps_pin.closed_loop.simulation.motion import (
    Controller,
    Drive,
    Motion,
    State,
    WrenchesInTime,
    closed_start,
)
from rps_pin.closed_loop.simulation.result import Recorder, Sample, Simulation
from rps_pin.errors import InputError, RPSPinError

if TYPE_CHECKING:
    from rps_pin.closed_loop.model import ClosedLoopModel


#: How often `progress` is called, about.
_PROGRESS_CALLS = 200


def simulate(
    mechanism: ClosedLoopModel,
    q: ArrayLike,
    v: ArrayLike | None = None,
    *,
    duration: float,
    step: float = 1e-3,
    method: Literal["rk4", "adaptive"] = "rk4",
    controller: Controller | None = None,
    tau: ArrayLike | None = None,
    wrenches: Wrenches | WrenchesInTime | None = None,
    closing: Literal["projection", "baumgarte"] = "projection",
    tolerance: float = 1e-12,
    baumgarte_gain: float = 10.0,
    record_every: int = 1,
    forces: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Return the motion of a mechanism from a closed state.

    Joint limits are not enforced; `Simulation.limits_passed` tells when a joint first left its own.

    Parameters
    ----------
    mechanism
        What moves. Its scratch memory is used: simulate it from one thread at a time.
    q, v
        Closed configuration (nq,), and a velocity that keeps it closed (nv,); at rest if left out.
        What rounding left open is closed before the start.
    duration
        s; positive.
    step
        Time between two calls of the controller, and two rows of the answer (but see
        `record_every`), s; the last is shorter where it does not divide the duration. For
        ``"rk4"``, also the length of the steps.
    method
        ``"rk4"``: fixed steps of order 4 (see `integrators.rk4_step`); a mode of circular frequency
        omega loses about (omega step)^6 / 72 of its energy in each. ``"adaptive"``: steps of
        order 8 as long as `tolerance` allows, over several `step` where there is no controller;
        rows between are interpolated to order 7 and projected.
    controller
        ``controller(t, q, v)`` returns tau (na,). It is called once at the beginning of each
        `step`, its answer held to the end of it, as by a real one, and once at the end.
    tau
        Constant actuator forces, shape (na,), instead of a controller; zero if left out.
    wrenches
        External wrenches by frame name, as for `ClosedLoopModel.inverse_dynamics`; or a function
        of (t, q, v) that returns them, smooth in time, called at every stage of a step.
    closing
        ``"projection"`` keeps the loops closed to 1e-12 m; ``"baumgarte"`` pulls them together.
    tolerance
        Relative and absolute error per step of ``"adaptive"``.
    baumgarte_gain
        alpha, 1/s; positive. More is not better: what the stages of a step see as open grows with
        alpha^2, and fixed steps are unstable for alpha * step above about 2.
    record_every
        One row of so many steps is recorded, and the last.
    forces
        Whether to record the closures' constraint forces too.
    progress
        Called with the fraction done, 0 to 1, about two hundred times.

    Returns
    -------
    Simulation
        The motion. Where it breaks off, the rows until then are in the error's attribute
        ``partial``, a `Simulation`: of the errors below, and of whatever else passes through, an
        exception of the controller's own or Ctrl-C.

    Raises
    ------
    InputError
        If an argument does not fit, or the controller returns no finite (na,) vector; says when.
    ClosureError
        If the loops are open, or v opens them, at the start; or if a step is so long that they
        cannot be closed any more.
    SingularityError
        If the motion is not determined any more (see `ClosedLoopModel.forward_dynamics`), if it
        grows beyond all numbers, or no step is short enough for the tolerance; says when.
    """
    _check_choices(method, closing)
    for name, number in (
        ("duration", duration),
        ("step", step),
        ("tolerance", tolerance),
        ("baumgarte_gain", baumgarte_gain),
    ):
        if not 0 < number < math.inf:
            raise InputError(f"{name} = {number}: it must be positive and finite")
    if record_every < 1:
        raise InputError(f"record_every = {record_every}: it must be at least 1")
    drive = Drive(mechanism, controller, tau, wrenches)
    start = closed_start(mechanism, q, v)
    motion = Motion(mechanism, start, drive, baumgarte_gain if closing == "baumgarte" else 0.0)
    advance: _Advance = _Fixed(motion)
    if method == "adaptive":
        stepper = AdaptiveStepper(mechanism.model, tolerance, min(step, duration))
        advance = _Adaptive(motion, stepper, start, None if controller else duration)
    recorder = Recorder(mechanism.model, mechanism.actuated_indices)
    time, shown = 0.0, 0.0
    try:
        state, gap = start, motion.gap(start[0])
        for k, time, following in _intervals(duration, step):
            drive.command(time, *state)
            recorder.watch(time, state[0])
            with np.errstate(over="ignore", invalid="ignore"):  # refused in words
                a = motion.acceleration(time, *state)
            if k % record_every == 0 or following is None:
                recorder.add(_sample(mechanism, drive, time, state, a, gap, forces))
            if following is None:
                break
            with np.errstate(over="ignore", invalid="ignore"):
                state, gap = advance(time, state, following, a)
            if progress and following / duration >= shown + 1 / _PROGRESS_CALLS:
                shown = following / duration
                progress(shown)
    except BaseException as error:
        if isinstance(error, RPSPinError):
            error.args = (f"at t = {time:.6g} s: {error}", *error.args[1:])
        vars(error)["partial"] = recorder.simulation()
        raise
    if progress and shown < 1:
        progress(1.0)
    return recorder.simulation()


# From one time to the next ------------------------------------------------------------------------


class _Advance(Protocol):
    def __call__(
        self, time: float, state: State, following: float, a: Array
    ) -> tuple[State, float]: ...


class _Fixed:
    """One step of the fixed kind."""

    def __init__(self, motion: Motion) -> None:
        self._motion = motion

    def __call__(
        self, time: float, state: State, following: float, a: Array
    ) -> tuple[State, float]:
        motion = self._motion
        step = following - time
        return motion.finish(rk4_step(motion.model, motion.acceleration, time, state, step, a))


class _Adaptive:
    """As many adaptive steps as it takes.

    With a `horizon`, steps go on from each other, on to it, and the states asked for on the way
    are interpolated; without, each interval is a problem of its own, starting from its state.
    """

    def __init__(
        self, motion: Motion, stepper: AdaptiveStepper, start: State, horizon: float | None
    ) -> None:
        self._motion, self._stepper, self._horizon = motion, stepper, horizon
        self._time, self._state, self._gap = 0.0, start, 0.0
        self._at: Callable[[float], State] = lambda _: start

    def __call__(
        self, time: float, state: State, following: float, a: Array
    ) -> tuple[State, float]:
        if self._horizon is None:
            self._time, self._state = time, state
        until = following if self._horizon is None else self._horizon
        while self._time < following:
            end, self._at = self._stepper.step(
                self._motion.acceleration, self._time, self._state, until
            )
            self._time = end
            self._state, self._gap = self._motion.finish(self._at(end))
        if following == self._time:
            return self._state, self._gap
        return self._motion.finish(self._at(following))


def _intervals(duration: float, step: float) -> list[tuple[int, float, float | None]]:
    """Return (k, t_k, t_k+1), None for the time after the last."""
    grid = list(times(duration, step))
    following: list[float | None] = [time for _, time in grid[1:]]
    return [(k, t, after) for (k, t), after in zip(grid, [*following, None], strict=True)]


# Start and record ---------------------------------------------------------------------------------


def _check_choices(method: str, closing: str) -> None:
    for name, given, choices in (
        ("method", method, ("rk4", "adaptive")),
        ("closing", closing, ("projection", "baumgarte")),
    ):
        if given not in choices:
            raise InputError(f"{name} = {given!r}; it must be {' or '.join(map(repr, choices))}")


def _sample(
    mechanism: ClosedLoopModel,
    drive: Drive,
    time: float,
    state: State,
    a: Array,
    gap: float,
    forces: bool,
) -> Sample:
    q, v = state
    multipliers = None
    if forces:
        wrenches = drive.wrenches(time, q, v)
        multipliers = mechanism.constraint_forces(q, v, a, drive.tau, wrenches=wrenches)
    return Sample(time, q, v, a, drive.tau, mechanism.energy(q, v), gap, multipliers)

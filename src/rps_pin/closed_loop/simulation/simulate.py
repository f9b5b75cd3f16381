"""Simulation of a mechanism's motion in time, its loops kept closed.

The state (q, v) moves by the reduced dynamics of `manifold`, in steps of `integrators`. With
``closing="projection"`` each step ends with a projection to the closed configurations and the
velocities that keep them closed: gaps stay at rounding error, and since the correction is as small
as the step's error the order of the method is kept. With ``closing="baumgarte"``
nothing is projected; gaps that the steps' errors open decay like exp(-alpha t), and stay at the
size where as much is opened as decays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.system import ConstraintSystem, Mechanism
from rps_pin.closed_loop.dynamics.generalised_forces import energy
from rps_pin.closed_loop.dynamics.inverse_dynamics import constraint_forces
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.simulation import integrators
from rps_pin.closed_loop.simulation.fixed_step import fixed_step
from rps_pin.closed_loop.simulation.motion import (
    Controller,
    Drive,
    Motion,
    State,
    WrenchesInTime,
    closed_start,
)
from rps_pin.closed_loop.simulation.result import Recorder, Simulation
from rps_pin.errors import RPSPinError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import choice, positive_number

#: How often `progress` is called, about.
_PROGRESS_CALLS = 200


@refuses_other_kinds
def simulate(
    mechanism: Mechanism,
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

    Joint limits are not enforced; `Simulation.limits_passed` tells when a joint first left its
    limits.

    Parameters
    ----------
    mechanism
        The mechanism. Its scratch memory is used: simulate it from one thread at a time.
    q, v
        Closed configuration (nq,), and a velocity that keeps it closed (nv,); at rest if left out.
        Gaps of rounding error are closed before the start.
    duration
        s; positive.
    step
        Time between two calls of the controller, and two rows of the result (but see
        `record_every`), s; the last is shorter where it does not divide the duration. For
        ``"rk4"``, also the length of the steps.
    method
        ``"rk4"``: fixed steps of order 4 (see `integrators.rk4_step`); a mode of circular frequency
        omega loses about (omega step)^6 / 72 of its energy in each. Where damping is too stiff for
        them, they are implicit in it, of the same order (see `damped`). ``"adaptive"``: steps of
        order 8 as long as `tolerance` allows, over several `step` where there is no controller;
        rows between are interpolated to order 7 and projected.
    controller
        ``controller(t, q, v)`` returns tau (na,). It is called once at the beginning of each
        `step`, its result held to the end of it, as in a sampled controller, and once at the end.
    tau
        Constant actuator forces, shape (na,), instead of a controller; zero if left out.
    wrenches
        External wrenches by frame name, as for `ClosedLoopModel.inverse_dynamics`; or a function
        of (t, q, v) that returns them, smooth in time, called at every stage of a step.
    closing
        ``"projection"`` keeps the loops closed as `ClosedLoopModel.close` does; ``"baumgarte"``
        stabilises them.
    tolerance
        Relative and absolute error per step of ``"adaptive"``; the absolute one in rad and
        characteristic lengths L, and in these by the time of a fall by L / 2 (the duration, where
        gravity is zero).
    baumgarte_gain
        alpha, 1/s; positive. More is not better: the correction of the gaps within a step grows
        with alpha^2, and fixed steps are unstable for alpha * step above about 2.
    record_every
        One row of so many steps is recorded, and the last.
    forces
        Whether to record the closures' constraint forces too.
    progress
        Called with the fraction done, 0 to 1, about two hundred times.

    Returns
    -------
    Simulation
        The motion. Where it breaks off, the rows until then are in the exception's attribute
        ``partial``, a `Simulation`: for the errors below, exceptions of the controller, and Ctrl-C.

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
    choice(method, "method", ("rk4", "adaptive"))
    choice(closing, "closing", ("projection", "baumgarte"))
    integrators.check_times(duration, step, record_every)
    positive_number(tolerance, "tolerance")
    positive_number(baumgarte_gain, "baumgarte_gain", "1/s")
    system = mechanism.system
    drive = Drive(system, controller, tau, wrenches)
    start = closed_start(system, q, v)
    motion = Motion(system, start, drive, baumgarte_gain if closing == "baumgarte" else 0.0)
    advance = fixed_steps(motion)
    if method == "adaptive":
        sizes = state_sizes(system, duration)
        stepper = integrators.AdaptiveStepper(system.model, tolerance, min(step, duration), sizes)
        advance = _Adaptive(motion, stepper, start, None if controller else duration)
    recorder = Recorder(system.model, system.actuated)
    time, shown, work = 0.0, 0.0, 0.0
    try:
        state, gap = start, motion.gap(start[0])
        followers = (t for k, t in integrators.times(duration, step) if k)
        for k, time in integrators.times(duration, step):
            following = next(followers, None)
            drive.command(time, *state)
            recorder.watch(time, state[0])
            with np.errstate(over="ignore", invalid="ignore"):  # refused in words
                a = motion.acceleration(time, *state)
            if k % record_every == 0 or following is None:
                kinetic, potential = energy(system, *state)
                row = {"time": time, "a": a, "tau": drive.tau, "gap": gap, "work": work}
                if forces:
                    acting = drive.wrenches(time, *state)
                    row["constraint_forces"] = constraint_forces(
                        system, *state, a, drive.tau, acting
                    )
                recorder.add(q=state[0], v=state[1], kinetic=kinetic, potential=potential, **row)
            if following is None:
                break
            with np.errstate(over="ignore", invalid="ignore"):
                state, gap, done = advance(time, state, following, a)
            work += done
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


def state_sizes(system: ConstraintSystem, duration: float) -> Array:
    """Return what errors of q and v are absolute by, (2 nv,): m or rad, and per s."""
    equations = system.equations
    rate = equations.speed / equations.length or 1 / duration
    sizes = equations.length * system.column_scale
    return np.concatenate([sizes, rate * sizes])


# From one time to the next ------------------------------------------------------------------------


#: Function of (time, state, following time, a) that returns the state at the following time, its
#: gap, and the work done on the way.
_Advance = Callable[[float, State, float, Array], tuple[State, float, float]]


def fixed_steps(motion: Motion) -> _Advance:
    """Return the function that takes one step of fixed length."""

    def advance(
        time: float, state: State, following: float, a: Array
    ) -> tuple[State, float, float]:
        moved, work = fixed_step(motion, time, state, following - time, a)
        return *motion.finish(moved), work

    return advance


class _Adaptive:
    """As many adaptive steps as it takes.

    With a `horizon`, steps continue from each other, on to it, and the states asked for on the way
    are interpolated; without, each interval is a separate problem, starting from its state.
    """

    def __init__(
        self,
        motion: Motion,
        stepper: integrators.AdaptiveStepper,
        start: State,
        horizon: float | None,
    ) -> None:
        self._motion, self._stepper, self._horizon = motion, stepper, horizon
        self._time, self._state, self._gap = 0.0, start, 0.0
        self._at: Callable[[float], State] = lambda _: start

    def __call__(
        self, time: float, state: State, following: float, a: Array
    ) -> tuple[State, float, float]:
        if self._horizon is None:
            self._time, self._state = time, state
        until = following if self._horizon is None else self._horizon
        work = -self._stepper.work(time) if self._time > time else 0.0
        motion = self._motion
        while self._time < following:
            if self._time > time:
                work += self._stepper.work(self._time)
            self._time, self._at = self._stepper.step(
                motion.acceleration, self._time, self._state, until, lambda: motion.power
            )
            self._state, self._gap = motion.finish(self._at(self._time))
        work += self._stepper.work(following)
        if following == self._time:
            return self._state, self._gap, work
        return *motion.finish(self._at(following)), work

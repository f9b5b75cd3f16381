"""Simulation in generated code: whole steps in C, several at a time where nothing happens between.

Fixed steps with projection, under a controller or constant forces and under constant wrenches, are
generated; everything else that `rps_pin.closed_loop.simulation.simulate` can do is left to it. A
step that the code flags is taken by the Pinocchio engine. So are those under stiff damping, which
is looked at before every block of steps.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.closed_loop.simulation import simulate as pinocchio_engine
from rps_pin.closed_loop.simulation.damped import is_stiff
from rps_pin.closed_loop.simulation.integrators import check_times, times
from rps_pin.closed_loop.simulation.motion import (
    Controller,
    Drive,
    Motion,
    State,
    WrenchesInTime,
    closed_start,
)
from rps_pin.closed_loop.simulation.result import Recorder, Simulation
from rps_pin.codegen.expressions.routines import BLOCK
from rps_pin.errors import RPSPinError


class Compiled(Protocol):
    """What is used of a `CompiledMechanism`."""

    def reference(self, parameters: ArrayLike | None = None) -> ClosedLoopModel:
        """Return the mechanism of the Pinocchio engine."""

    def generated(
        self,
        name: str,
        wrenches: Wrenches | None,
        parameters: ArrayLike | None,
        *given: ArrayLike,
    ) -> tuple[Any, ...]:
        """Return a function's results and status."""

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        parameters: ArrayLike | None = None,
    ) -> Array:
        """Return accelerations."""

    def constraint_forces(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        tau: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        parameters: ArrayLike | None = None,
    ) -> Array:
        """Return the closures' multipliers."""

    def energy(
        self, q: ArrayLike, v: ArrayLike, *, parameters: ArrayLike | None = None
    ) -> tuple[Any, Any]:
        """Return kinetic and potential energy."""

    def loop_gap(self, q: ArrayLike, *, parameters: ArrayLike | None = None) -> Any:
        """Return the largest gaps."""


def simulate(
    compiled: Compiled,
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
    record_every: int = 1,
    forces: bool = False,
    progress: Callable[[float], None] | None = None,
    parameters: ArrayLike | None = None,
    **tuning: float,
) -> Simulation:
    """Return the motion from a closed state; see `ClosedLoopModel.simulate` for the options.

    `tuning` are those that fixed steps with projection do not need.
    """
    given: dict[str, Any] = {
        "duration": duration,
        "step": step,
        "controller": controller,
        "tau": tau,
        "wrenches": wrenches,
        "record_every": record_every,
        "forces": forces,
        "progress": progress,
    }
    if tuning or (method, closing) != ("rk4", "projection") or callable(wrenches):
        others: dict[str, Any] = {"method": method, "closing": closing, **tuning}
        return pinocchio_engine.simulate(compiled.reference(parameters), q, v, **given, **others)
    check_times(duration, step, record_every)
    return _Run(compiled, q, v, given, parameters).simulation()


class _Run:
    """One simulation: the states of all steps, then everything that is computed from them."""

    def __init__(
        self,
        compiled: Compiled,
        q: ArrayLike,
        v: ArrayLike | None,
        given: dict[str, Any],
        parameters: ArrayLike | None,
    ) -> None:
        self._compiled, self._given, self._parameters = compiled, given, parameters
        self._reference = compiled.reference(parameters)
        self._wrenches: Wrenches | None = given["wrenches"]
        system = self._reference.system
        self._drive = Drive(system, given["controller"], given["tau"], self._wrenches)
        self._controlled = given["controller"] is not None
        self._time = np.array([t for _, t in times(given["duration"], given["step"])])
        rows = len(self._time)
        self._q, self._v = np.empty((rows, system.model.nq)), np.empty((rows, system.model.nv))
        self._tau, self._work = np.empty((rows, system.actuated.size)), np.zeros(rows)
        self._q[0], self._v[0] = closed_start(system, q, v)
        self._row = 0  # that the motion has come to
        self._stiff_until = self._checked_until = 0  # rows
        self._known = 0  # rows whose state and tau are known

    def simulation(self) -> Simulation:
        """Return the whole motion; where it breaks off, the error has what there is of it."""
        try:
            self._advance()
        except BaseException as error:
            if isinstance(error, RPSPinError):
                text = f"at t = {self._time[self._row]:.6g} s: {error}"
                error.args = (text, *error.args[1:])
            vars(error)["partial"] = self._partial()
            raise
        return self._recorded(len(self._time))

    def _advance(self) -> None:
        last, progress, shown = len(self._time) - 1, self._given["progress"], 0.0
        self._command(0)
        while self._row < last:
            fraction = self._time[self._row] / self._time[-1]
            if progress and fraction >= shown + 0.005:
                shown = fraction
                progress(float(fraction))
            if self._row >= self._checked_until:
                self._look_at_damping()
            stiff = self._row < self._stiff_until
            if not (stiff or self._controlled) and last - self._row >= BLOCK and self._block():
                continue
            self._single(stiff)
        if progress:
            progress(1.0)

    def _look_at_damping(self) -> None:
        """Leave the next rows to the Pinocchio engine if damping is stiff here."""
        k, system = self._row, self._reference.system
        self._checked_until = k + BLOCK
        if system.effects is not None:
            step = float(self._time[k + 1] - self._time[k])
            if is_stiff(system, self._q[k], self._v[k], step):
                self._stiff_until = k + BLOCK

    def _command(self, row: int) -> None:
        self._row = row
        self._drive.command(float(self._time[row]), self._q[row], self._v[row])
        self._tau[row] = self._drive.tau
        self._known = row + 1

    def _block(self) -> bool:
        """Take a block of steps under constant forces; False if the code flags one of them."""
        k = self._row
        h = np.diff(self._time[k : k + BLOCK + 1])
        q, v, work, status = self._taken("steps", k, h)
        if status:
            return False
        rows = slice(k + 1, k + BLOCK + 1)
        self._q[rows], self._v[rows] = q.reshape(BLOCK, -1), v.reshape(BLOCK, -1)
        self._work[rows] = self._work[k] + np.cumsum(work)
        self._tau[rows] = self._drive.tau
        self._row += BLOCK
        self._known = self._row + 1
        return True

    def _single(self, stiff: bool) -> None:
        """Take one step; what the code flags, or is stiff, is the Pinocchio engine's matter."""
        k = self._row
        status = stiff
        if not stiff:
            q, v, work, status = self._taken("step", k, np.diff(self._time[k : k + 2]))
            done = float(work[0])
        if status:
            (q, v), done = self._by_pinocchio((self._q[k], self._v[k]), k)
        self._q[k + 1], self._v[k + 1] = q, v
        self._work[k + 1] = self._work[k] + done
        self._command(k + 1)

    def _taken(self, name: str, k: int, h: Array) -> tuple[Any, ...]:
        """Return the results of a routine of steps from row k, and its status."""
        state = self._q[k], self._v[k], self._drive.tau, h
        return self._compiled.generated(name, self._wrenches, self._parameters, *state)

    def _by_pinocchio(self, state: State, k: int) -> tuple[State, float]:
        motion = Motion(self._reference.system, state, self._drive, 0.0)
        time, following = float(self._time[k]), float(self._time[k + 1])
        with np.errstate(over="ignore", invalid="ignore"):  # refused in words
            a = motion.acceleration(time, *state)
            moved, _, work = pinocchio_engine.fixed_steps(motion)(time, state, following, a)
        return moved, work

    def _partial(self) -> Simulation:
        """Return what is known where the motion breaks off."""
        try:
            return self._recorded(self._known)
        except RPSPinError:  # the last state has no acceleration
            return self._recorded(self._known - 1)

    def _recorded(self, rows: int) -> Simulation:
        """Return what follows from the first rows' states."""
        compiled, system = self._compiled, self._reference.system
        every = self._given["record_every"]
        kept = np.arange(0, rows, every)
        if rows == len(self._time) and kept[-1] != rows - 1:
            kept = np.append(kept, rows - 1)
        recorder = Recorder(system.model, system.actuated)
        recorder.watch_all(self._time[:rows], self._q[:rows])
        q, v, tau = self._q[kept], self._v[kept], self._tau[kept]
        under: dict[str, Any] = {"wrenches": self._wrenches, "parameters": self._parameters}
        a = compiled.forward_dynamics(q, v, tau, **under)
        kinetic, potential = compiled.energy(q, v, parameters=self._parameters)
        columns = {
            "time": self._time[kept],
            "q": q,
            "v": v,
            "a": a,
            "tau": tau,
            "kinetic": kinetic,
            "potential": potential,
            "gap": compiled.loop_gap(q, parameters=self._parameters),
            "work": self._work[kept],
        }
        if self._given["forces"]:
            columns["constraint_forces"] = compiled.constraint_forces(q, v, a, tau, **under)
        return recorder.whole(columns)

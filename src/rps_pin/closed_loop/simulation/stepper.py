"""Simulation of a mechanism step by step, for a caller's own loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.closed_loop.constraints.system import Mechanism
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.simulation.fixed_step import fixed_step
from rps_pin.closed_loop.simulation.motion import (
    Drive,
    ForceLaw,
    Motion,
    WrenchesInTime,
    closed_start,
)
from rps_pin.copies import DeepCopied
from rps_pin.one_thread import one_thread
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import positive_number, real_vector, whole_number


@refuses_other_kinds
@one_thread("_system.guard")
class Stepper(DeepCopied):
    """Simulation with fixed steps and projection, as `simulate` does it, one call at a time.

    Parameters
    ----------
    mechanism
        The mechanism. Its scratch memory is used: one thread at a time.
    q, v
        Closed configuration (nq,), and a velocity that keeps it closed (nv,); at rest if left out.
    wrenches
        As for `simulate`.

    Attributes
    ----------
    time : float
        Since the start, s.
    q, v : arrays
        The state now, shapes (nq,) and (nv,): new arrays at each step.
    gap : float
        Largest gap between closed frames, m.

    Raises
    ------
    InputError
        If an argument does not fit.
    ClosureError
        If the loops are open, or v opens them.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        q: ArrayLike,
        v: ArrayLike | None = None,
        *,
        wrenches: Wrenches | WrenchesInTime | None = None,
    ) -> None:
        self._system = system = mechanism.system
        self._drive = Drive(system, None, None, wrenches)
        self.q, self.v = closed_start(system, q, v)
        self._motion = Motion(system, (self.q, self.v), self._drive, 0.0)
        self.time, self.gap = 0.0, self._motion.gap(self.q)

    def advance(self, tau: ArrayLike | ForceLaw, duration: float, steps: int = 1) -> None:
        """Move on under actuator forces.

        Parameters
        ----------
        tau
            Shape (na,), N or N m, held; or a function that returns them from time, q and v, which
            is called within the steps too: those of springs, or of drives with loops of their own.
        duration
            s; positive.
        steps
            Into how many steps of order 4 it is divided.

        Raises
        ------
        InputError
            If an argument does not fit.
        SingularityError
            If the motion is not determined any more, or grows beyond all numbers.
        ClosureError
            If a step is so long that the loops cannot be closed any more.
        """
        positive_number(duration, "duration", "s")
        whole_number(steps, "steps")
        if callable(tau):
            self._drive.law = tau
        else:
            self._drive.tau = real_vector(tau, self._drive.tau.size, "tau").copy()
        motion, step = self._motion, duration / steps
        start, state, gap = self.time, (self.q, self.v), self.gap
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # refused in words
                for k in range(steps):
                    time = start + k * step
                    a = motion.acceleration(time, *state)
                    moved, _ = fixed_step(motion, time, state, step, a)
                    state, gap = motion.finish(moved)
        finally:
            self._drive.law = None
        (self.q, self.v), self.gap, self.time = state, gap, start + duration

"""Proof of generated code: every function against the Pinocchio engine, each time it is built.

The states are closed and random: near home, farther away, and one as near to a singularity as is
found among them. Each function is called for one state after another and for all in a batch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.closed_loop.simulation.stepper import Stepper
from rps_pin.codegen.applied import with_parameters
from rps_pin.codegen.calls import CompiledFunction
from rps_pin.codegen.independent import Partition, regular_samples
from rps_pin.codegen.routines import BLOCK
from rps_pin.errors import CompileError, RPSPinError

#: Largest difference from the Pinocchio engine, relative to the largest number of a result.
ACCEPTED = 1e-10
#: Of the steps that the proof takes, s.
_STEP = 1e-4


class State(NamedTuple):
    """A closed state with forces on it, and the arguments of all functions by their names."""

    q: Array
    v: Array
    a: Array
    tau: Array
    wrenches: dict[str, Array]
    """By frame."""


Reference = Callable[[ClosedLoopModel, State], Sequence[Any]]


def _wrenches(state: State) -> dict[str, Array] | None:
    return state.wrenches or None


def _inverse_dynamics(m: ClosedLoopModel, s: State) -> Sequence[Any]:
    found = m.inverse_dynamics(s.q, s.v, s.a, wrenches=_wrenches(s))
    unproduced = np.zeros(m.model.nv) if found.unproduced is None else found.unproduced
    return found.tau, found.constraint_forces, None, unproduced


def _step(m: ClosedLoopModel, s: State) -> Sequence[Any]:
    stepper = Stepper(m, s.q, s.v, wrenches=_wrenches(s))
    stepper.advance(s.tau, _STEP)
    return stepper.q, stepper.v


def _steps(m: ClosedLoopModel, s: State) -> Sequence[Any]:
    stepper, qs, vs = Stepper(m, s.q, s.v, wrenches=_wrenches(s)), [], []
    for _ in range(BLOCK):
        stepper.advance(s.tau, _STEP)
        qs.append(stepper.q)
        vs.append(stepper.v)
    return np.concatenate(qs), np.concatenate(vs)

"""What is identified of a mechanism with a task, and its regressor along motions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError, MechanismError, RPSPinError
from rps_pin.numerics.linear_algebra import singular_values
from rps_pin.task.identification.base import BaseParameters, base_parameters
from rps_pin.task.identification.columns import Columns
from rps_pin.task.task import Task

Progress = Callable[[Iterable[int]], Iterable[int]]

#: States that the base parameters are found at: so many times the rows that are needed.
_PLENTY = 3
#: How far random states are from home, over the characteristic length; its rates (1/s) and
#: accelerations (1/s^2) over it.
_SPREAD, _RATE, _ACCELERATION = 0.15, 2.0, 20.0
_TRIES = 40


class States(NamedTuple):
    """A motion of all joints, n samples."""

    q: Array
    """Shape (n, nq)."""
    v: Array
    """Shape (n, nv)."""
    a: Array
    """Shape (n, nv)."""
    basis: Array
    """T, the motions by the actuators' velocities, shape (n, nv, na)."""


class DynamicsModel:
    """A mechanism whose dynamics is identified, and which of its parameters are unknown.

    Parameters
    ----------
    task
        The task of the mechanism as it is believed to be, or the mechanism, which has one; a task
        in generated code (`Task.compile`) takes a fraction of the time.
    bodies
        Joints whose bodies' mass, first moment and inertia are estimated; those that have a mass
        if left out.
    damping, friction
        Joints whose viscous damping and dry friction are estimated; left out: the actuated ones,
        and those that the mechanism says to have some.
    stiffness, armature
        Joints whose springs and rotors' inertias are estimated; left out: those that have some.
    offsets
        Joints with a constant force, such as that of a force sensor's zero.

    Attributes
    ----------
    labels : tuple of str
        What each estimated parameter is: ``inertia:platform.mass``, ``damping:leg_1``.
    nominal : array
        The estimated parameters of the mechanism as it is believed to be, shape (p,).

    Raises
    ------
    InputError
        If a joint is unknown or named twice, or nothing is estimated.
    MechanismError
        If there are not as many actuators as motions, or an actuated joint has not one coordinate.
    """

    def __init__(
        self,
        task: Task | ClosedLoopModel,
        *,
        bodies: Sequence[str] | None = None,
        damping: Sequence[str] | None = None,
        friction: Sequence[str] | None = None,
        stiffness: Sequence[str] | None = None,
        armature: Sequence[str] | None = None,
        offsets: Sequence[str] = (),
    ) -> None:
        if isinstance(task, ClosedLoopModel):
            task = task.task
        if not isinstance(task, Task):
            raise InputError(
                f"task is a {type(task).__name__}; it must be a Task, or a ClosedLoopModel that "
                "has one"
            )
        self.task, self.mechanism = task, task.mechanism
        self._engine = task.engines[1]
        self._refuse_other_counts()
        own = Columns(self.mechanism, ())
        asked = {
            "inertia": self._with_mass() if bodies is None else bodies,
            "damping": self._usual("damping", own) if damping is None else damping,
            "friction": self._usual("friction", own) if friction is None else friction,
            "stiffness": _named("stiffness", own) if stiffness is None else stiffness,
            "armature": _named("armature", own) if armature is None else armature,
            "offset": offsets,
        }
        groups = [f"{kind}:{name}" for kind, names in asked.items() for name in names]
        self.columns = Columns(self.mechanism, groups)
        free = self.columns.free
        if not free.any():
            raise InputError("nothing is to be estimated: name bodies, damping or friction")
        self.labels = tuple(np.array(self.columns.labels)[free].tolist())
        self.nominal: Array = self.columns.nominal[free]
        self.actuators = self.mechanism.actuated

    def _refuse_other_counts(self) -> None:
        mechanism, size = self.mechanism, self.task.size
        if mechanism.actuated_indices.size != size:
            raise MechanismError(
                f"{mechanism.actuated_indices.size} actuators for {size} motions: the forces are "
                "those of a motion only if there are as many"
            )
        _ = self.task.of_actuators  # or refuse

    def _with_mass(self) -> list[str]:
        model = self.mechanism.model
        return [model.names[k] for k in range(1, model.njoints) if model.inertias[k].mass > 0]

    def _usual(self, kind: str, own: Columns) -> list[str]:
        """Return the actuated joints, and others that have such an effect."""
        there = list(self.mechanism.actuated)
        return [*there, *(name for name in _named(kind, own) if name not in there)]

    # The regressor --------------------------------------------------------------------------------

    def states(
        self,
        position: Array,
        speed: Array,
        acceleration: Array,
        near: ArrayLike | None = None,
        progress: Progress = iter,
    ) -> States:
        """Return the motion of all joints that a motion of the actuators makes, (n, na) each.

        Parameters
        ----------
        position, speed, acceleration
            Of the actuators, in the order of the motion.
        near
            Closed configuration whose assembly mode the motion begins in, shape (nq,); home if
            left out.
        progress
            Wraps the loop over the samples.

        Raises
        ------
        RPSPinError
            If the loops cannot be closed, or the actuators do not determine the motion; with the
            number of the sample.
        """
        q = np.empty((len(position), self.mechanism.model.nq))
        last = self.mechanism.home if near is None else np.asarray(near, dtype=np.float64)
        for k in progress(range(len(position))):
            try:
                last = self._engine.complete(position[k], last, within_limits=False, restarts=0)
            except RPSPinError as error:
                error.args = (f"sample {k}: {error}", *error.args[1:])
                raise
            q[k] = last
        v = self._engine.velocity(q, speed)
        a = self._engine.acceleration(q, v, acceleration)
        return States(q, v, a, self._engine.motion_basis(q))

    def regressor(self, states: States) -> tuple[Array, Array]:
        """Return W of the estimated parameters, (n, na, p), and the forces of the known, (n, na).

        tau = W p + known.
        """
        rows, free = self.columns.rows(*states), self.columns.free
        return rows[..., free], rows[..., ~free] @ self.columns.nominal[~free]

    @cached_property
    def base(self) -> BaseParameters:
        """The base parameters, found at random closed states about home (seeded)."""
        rng = np.random.default_rng(0)
        p, na = self.nominal.size, len(self.actuators)
        needed = _PLENTY * p // na + 20
        found: list[Array] = []
        for _ in range(_TRIES):
            rows, _ = self.regressor(self.random_states(rng, needed))
            found.append(rows)
            if sum(map(len, found)) >= needed:
                break
        rows = np.concatenate(found).reshape(-1, p)
        if len(rows) < 2 * p:
            raise MechanismError(
                f"only {len(rows) // na} of {_TRIES * needed} random poses about home can be "
                "reached: too few to find the base parameters"
            )
        return base_parameters(rows)

    def random_states(self, rng: np.random.Generator, count: int) -> States:
        """Return random closed states about home that are regular: at most `count`."""
        task = self.task
        unit = task.characteristic_length / task.scale
        x, rate, acceleration = (
            size * unit * rng.uniform(-1, 1, (count, task.size))
            for size in (_SPREAD, _RATE, _ACCELERATION)
        )
        return self.states_of_task(task.home + x, rate, acceleration)

    def states_of_task(self, x: Array, rate: Array, acceleration: Array) -> States:
        """Return the states of task coordinates (n, m) that are reached from home, and regular."""
        task = self.task
        q = task.configuration(x, within_limits=False, errors="mask")
        known = np.isfinite(q).all(axis=1)
        q, v, a = task.motion(q[known], rate[known], acceleration[known], x=x[known], errors="mask")
        basis = self._engine.motion_basis(q, errors="mask")
        found = (q, v, a, basis)
        finite = [np.isfinite(one.reshape(len(q), -1)).all(axis=1) for one in found]
        regular = np.all(finite, axis=0)
        return States(*(one[regular] for one in found))

    @cached_property
    def believed(self) -> Array:
        """The base parameters of the mechanism as it is believed to be, shape (b,)."""
        return np.asarray(self.base.matrix @ self.nominal)


def condition_of(rows: Array) -> float:
    """Return the condition number of a base regressor (n, b), columns of one length."""
    lengths = np.linalg.norm(rows, axis=0)
    if not (lengths > 0).all():
        return float("inf")
    values = singular_values(rows / lengths)
    return float(values[0] / values[-1]) if values[-1] > 0 else float("inf")


def _named(kind: str, columns: Columns) -> list[str]:
    """Return the joints that have an effect."""
    start = f"{kind}:"
    return [label.removeprefix(start) for label in columns.labels if label.startswith(start)]

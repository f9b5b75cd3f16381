"""Fields of a batch of configurations: actuators, gains, and the reasons why a point is out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, MechanismError
from rps_pin.numerics.bits import Flags, bit_of
from rps_pin.numerics.linear_algebra import many_singular_values
from rps_pin.task.paths.limits import Cone, ConeRooms
from rps_pin.task.sizing.demands import Demands
from rps_pin.task.task import Task
from rps_pin.task.workspace.reasons import (
    INTERFERENCE,
    SINGULAR,
    UNREACHABLE,
    reason_names,
)

#: A configuration whose conditioning is below this counts as singular unless told otherwise.
MIN_CONDITIONING = 1e-3


class TaskFields(NamedTuple):
    """Fields over points of a workspace; all zero where a point is unreachable."""

    reason: Flags
    """Bits why a point is out, shape (...), 0 inside; see `TaskWorkspace.reasons`."""
    actuators: Array
    """Positions of the actuated joints, shape (..., na), m or rad."""
    gains: Array
    """Singular values of K = d(actuators)/d(task) in one unit, falling, shape (..., m)."""
    conditioning: Array
    """Least gain over the largest, shape (...): 0 singular, 1 at best."""
    determinant: Array
    """Of K in one unit, shape (...): its sign is the side of a type II singularity. Where there are
    more actuators than coordinates, the product of the gains."""
    stroke_left: Array
    """Least way of an actuator to its limits over its stroke, shape (...): 0.5 at best, negative
    beyond a limit, 0.5 if no actuator has two limits."""
    holding: Array
    """Forces of the actuators at rest, with the payload, shape (..., na), N or N m; (..., 0) if not
    asked for."""
    force_share: Array
    """Largest force of each actuator under payload and wrenches, over its limit, shape (..., na);
    (..., 0) if there are none. 0 without a limit, infinite at a singularity."""
    speed_share: Array
    """Largest speed of each actuator at the task's speeds asked for, likewise."""


class Gains(NamedTuple):
    """Measures of K in one unit."""

    gains: Array
    conditioning: Array
    determinant: Array


def gains_of(task: Task, K: Array) -> Gains:
    """Return the measures of K, shape (n, na, m); zero where it is NaN (type I)."""
    K = task.in_one_unit(K)
    there = np.asarray(np.isfinite(K).all(axis=(-2, -1)))
    K = np.where(there[:, None, None], K, 0.0)
    gains = many_singular_values(K)
    square = K.shape[-2] == K.shape[-1]
    determinant = np.linalg.det(K) if square else np.prod(gains, axis=-1)
    largest = np.where(there & (gains[:, 0] > 0), gains[:, 0], 1.0)
    return Gains(gains, np.asarray(gains[:, -1] / largest), np.asarray(determinant))


class Evaluation:
    """What is computed of configurations.

    Parameters
    ----------
    task
        The task.
    side
        The sign of the determinant on the start's side of the type II singularities.
    min_conditioning
        Least conditioning that is not singular.
    cones
        Limits of balls and universal joints.
    holding
        Whether forces at rest are computed.
    clearance
        Least distance of two links, m; None: links are not looked at.
    ignore
        Pairs of links that may be nearer.
    **demands
        Loads and speeds that are asked for everywhere; see `Demands`.

    Raises
    ------
    MechanismError
        If there are fewer actuators than coordinates.
    InputError
        If there are too many limits, or links are to be looked at that have no shapes.
    """

    def __init__(
        self,
        task: Task,
        side: float,
        min_conditioning: float,
        *,
        cones: Sequence[Cone] = (),
        holding: bool = False,
        clearance: float | None = None,
        ignore: Iterable[tuple[str, str]] = (),
        **demands: Any,
    ) -> None:
        mechanism = task.mechanism
        self._demands = Demands(task, **demands)
        self._task, self._side, self._least, self._holding = task, side, min_conditioning, holding
        self._actuated = task.of_actuators
        if self._actuated.size < task.size:
            raise MechanismError(
                f"{self._actuated.size} actuators do not determine {task.size} coordinates: every "
                "point is singular"
            )
        self._clearance = clearance
        self._links = None
        if clearance is not None:
            stated = mechanism.collision_shapes
            if not (stated.shapes or stated.faults):
                raise InputError(f"{mechanism.name or 'the mechanism'} has no collision shapes")
            self._links = mechanism.link_distances(ignore)
        self._limits = task.position_limits(), ConeRooms(mechanism, cones)
        signals = [signal for one in self._limits for signal in one.signals]
        signals += self._demands.signals
        self.reasons = reason_names(signals, interference=clearance is not None)
        model = mechanism.model
        lower, upper = (
            np.asarray(limit, dtype=np.float64)[self._actuated]
            for limit in (model.lowerPositionLimit, model.upperPositionLimit)
        )
        limits, effects = mechanism.system.limits, mechanism.effects
        #: Limited joints that may be turned by whole turns.
        self._turning = mechanism.angular_velocities[limits.v]
        if effects is not None:
            self._turning = self._turning & (effects.stiffness[limits.v] == 0)
        self._bounded = np.flatnonzero(np.isfinite(lower) & np.isfinite(upper) & (lower < upper))
        self._ends = lower[self._bounded], upper[self._bounded]

    def empty(self, shape: tuple[int, ...]) -> TaskFields:
        """Return fields of a shape in which no point is reached."""
        na, m = self._actuated.size, self._task.size
        return TaskFields(
            np.full(shape, bit_of(self.reasons, UNREACHABLE), dtype=np.uint64),
            np.zeros((*shape, na)),
            np.zeros((*shape, m)),
            np.zeros(shape),
            np.zeros(shape),
            np.zeros(shape),
            np.zeros((*shape, na if self._holding else 0)),
            *(np.zeros((*shape, width)) for width in self._demands.widths),
        )

    @property
    def bytes_per_point(self) -> int:
        """What one point takes in memory."""
        return sum(part.nbytes for part in self.empty(()))

    def fields(self, q: Array, x: Array) -> TaskFields:
        """Return the fields of configurations (n, nq) at task coordinates (n, m)."""
        q = self._turned(q)
        a = q[:, self._actuated]
        K = self._task.jacobian(q, x=x, errors="mask")
        measured = gains_of(self._task, K)
        holding, forces = self._forces(q, x)
        speeds = self._demands.speed_share(K)
        return TaskFields(
            self._reason(q, x, measured, self._demands.broken(forces, speeds)),
            a,
            measured.gains,
            measured.conditioning,
            measured.determinant,
            self._stroke_left(a),
            holding,
            forces,
            speeds,
        )

    def _turned(self, q: Array) -> Array:
        """Return configurations whose joints are turned by whole turns into their limits.

        Fronts that meet behind an obstacle come with different turns; all are possible.
        """
        system, engine = self._task.mechanism.system, self._task.engines[1]
        limits, turn = system.limits, 2 * np.pi
        x = q[:, limits.q]
        turns = np.where(x < limits.lower, np.ceil((limits.lower - x) / turn), 0.0)
        turns = np.where(x > limits.upper, np.floor((limits.upper - x) / turn), turns)
        nearer = x + turn * turns
        turns[~self._turning | (nearer < limits.lower) | (nearer > limits.upper)] = 0.0
        moved = turns.any(axis=-1)
        if not moved.any():
            return q
        found = q.copy()
        found[:, limits.q] += turn * turns
        gaps = system.equations.largest_gaps(engine.gaps(found[moved]))
        open_ = np.flatnonzero(moved)[gaps > system.equations.open_limit]
        found[open_] = q[open_]  # a gear holds the joint
        return found

    def _reason(self, q: Array, x: Array, measured: Gains, broken: Bools) -> Flags:
        flags = np.zeros(len(q), dtype=np.uint64)
        still = np.zeros((len(q), self._task.mechanism.model.nv)), np.zeros(x.shape)
        rooms = [limits.rooms(q, still[0], x, still[1])[0] for limits in self._limits]
        for bit, one in enumerate(np.concatenate([*(~(r >= 0) for r in rooms), broken], -1).T):
            flags |= one.astype(np.uint64) << np.uint64(bit)
        kept = measured.conditioning >= self._least
        if measured.gains.shape[-1] == self._actuated.size:
            kept &= measured.determinant * self._side > 0
        flags[~kept] |= bit_of(self.reasons, SINGULAR)
        if self._links is not None:
            flags[self._touching(q)] |= bit_of(self.reasons, INTERFERENCE)
        return flags

    def _touching(self, q: Array) -> Array:
        """Return whether two links are nearer than the clearance, shape (n,)."""
        assert self._links is not None
        assert self._clearance is not None
        found = np.zeros(len(q), dtype=bool)
        for k, one in enumerate(q):
            self._links.set_state(one)
            near = np.flatnonzero(self._links.bounds() < self._clearance)
            found[k] = any(self._links.distance(int(p)).distance < self._clearance for p in near)
        return found

    def _stroke_left(self, a: Array) -> Array:
        lower, upper = self._ends
        room = np.minimum(a[:, self._bounded] - lower, upper - a[:, self._bounded])
        return np.asarray((room / (upper - lower)).min(axis=-1, initial=0.5))

    def _forces(self, q: Array, x: Array) -> tuple[Array, Array]:
        """Return the forces at rest, and the shares of the limits of forces, (n, na) or (n, 0)."""
        nothing = np.zeros((len(q), 0))
        if not (self._holding or self._demands.forces):
            return nothing, nothing
        W = self._demands.wrench_map(q, x)
        at_rest = self._demands.at_rest(q, W)
        return at_rest if self._holding else nothing, self._demands.force_share(at_rest, W)

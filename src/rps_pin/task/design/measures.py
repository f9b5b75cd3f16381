"""What candidates are measured by: all of them at all points of the region, in generated code.

From the middle of the region each point is reached on the straight line, in the assembly mode of
the middle (`rps_pin.task.workspace.filling`); a motion is followed from sample to sample.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import CompileError, InputError, MechanismError, SingularityError
from rps_pin.task.design.geometry.rods import RodClearances
from rps_pin.task.design.requirements import Motion, Requirements
from rps_pin.task.design.space import Candidates, Space
from rps_pin.task.design.start import packed, started
from rps_pin.task.paths.limits import JointRooms
from rps_pin.task.workspace.evaluate import gains_of

#: Poses that are computed at a time.
_BLOCK = 40_000
#: A home whose conditioning is below this decides no side of a singularity.
_SINGULAR = 1e-9


class Measures(NamedTuple):
    """Of candidates, shape (n,) each; NaN where nothing was reached."""

    unreached: Array
    """Share of the region's points that are not reached; where not even the middle is, 1 and the
    share of the way to it that is missing."""
    beyond: Array
    """Share of the points reached that are singular or beyond a singularity."""
    conditioning: Array
    """The worst."""
    room: Array
    """The least room to a limit, in shares; see `Requirements.limit_margin`."""
    limit: Array
    """Number of that limit in `Measuring.limits`."""
    off: Array
    """Share of the motions' samples that are not reached."""
    force: Array
    """The largest force of an actuator, N or N m."""
    force_share: Array
    """The largest as a share of its limit."""
    speed: Array
    """m/s or rad/s."""
    speed_share: Array
    stroke: Array
    """The longest way of an actuator, m or rad."""
    stiffness: Array
    """The least, N/m."""
    clearance: Array
    """The least of two rods, m."""
    mass: Array
    """kg."""
    size: Array
    """m."""


class Measuring:
    """Measures candidates of a space by requirements; sent to other processes as it is.

    Parameters
    ----------
    space
        The space.
    requirements
        The requirements.
    compiler
        See `rps_pin.codegen.compile_mechanism`.

    Raises
    ------
    MechanismError
        If there are fewer actuators than coordinates.
    InputError
        If the region or a motion is not one of the task, or an actuator has no limit that a motion
        could be compared with.
    SingularityError
        If home is singular, so that it decides no assembly mode.
    """

    def __init__(self, space: Space, requirements: Requirements, compiler: str = "auto") -> None:
        self.space, self.requirements, self._compiler = space, requirements, compiler
        task = space.task
        mechanism = task.mechanism
        if task.of_actuators.size < task.size:
            raise MechanismError(
                f"{task.of_actuators.size} actuators do not determine {task.size} coordinates"
            )
        self.points = requirements.region.grid(task)
        self.motions: list[Motion] = requirements.sampled(task)
        self._side = self._home_side()
        #: Characteristic length of the file's robot, m.
        self.length = task.characteristic_length
        self._stiffness = self._of_actuators(requirements.stiffness)
        self._rods = RodClearances(task, requirements.rods) if requirements.rods else None
        model = mechanism.model
        v = mechanism.actuated_indices
        self._most = np.asarray(model.effortLimit)[v], np.asarray(model.velocityLimit)[v]
        signals = JointRooms(mechanism).signals
        index = [model.joints[model.getJointId(one.joint.partition("[")[0])] for one in signals]
        parts = [int(one.joint.partition("[")[2].rstrip("]") or 0) for one in signals]
        self._at = np.array([j.idx_q + p for j, p in zip(index, parts, strict=True)], dtype=np.intp)
        angular = np.array([one.unit == "rad" for one in signals], dtype=bool)
        self._scale = np.where(angular, 1.0, mechanism.characteristic_length)
        self._upper = np.array([one.side == "upper" for one in signals], dtype=bool)
        #: Names of the limits.
        self.limits = (*(f"{one.joint} {one.side}" for one in signals), *space.room_names)

    @cached_property
    def key(self) -> str:
        """A digest of all that decides the measures."""
        given = self.requirements
        parts = [self.points, *(part for one in self.motions for part in one[1:])]
        numbers_ = given.min_conditioning, given.limit_margin, given.min_stiffness, self._stiffness
        rods = given.rods, given.min_clearance
        with _generated_code():
            identity = self.space.identity()
        found = hashlib.sha256(f"{identity} {numbers_} {rods} {self._compiler}".encode())
        for part in (*parts, *self._most):
            found.update(np.ascontiguousarray(part).tobytes())
        return found.hexdigest()

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what is compiled; another process compiles it, from the cache."""
        return {name: value for name, value in vars(self).items() if name != "engines"}

    def _home_side(self) -> float:
        task = self.space.task
        q, x = task.mechanism.home, task.home
        home = gains_of(task, task.jacobian(q[None], x=x[None], errors="mask"))
        if not home.conditioning[0] >= _SINGULAR:
            raise SingularityError(
                "home is singular, so that it decides no assembly mode: give another home in the "
                "description",
                1 / max(float(home.conditioning[0]), 1e-300),
                1 / _SINGULAR,
            )
        return float(np.sign(home.determinant[0]))

    def _of_actuators(self, given: Any) -> Array | None:
        if given is None:
            return None
        count = self.space.task.of_actuators.size
        found = np.asarray(given, dtype=np.float64)
        if found.shape not in ((), (count,)):
            raise InputError(
                f"stiffness has shape {found.shape}; expected one number, or ({count},)"
            )
        return np.broadcast_to(found, (count,)).copy()

    @cached_property
    def engines(self) -> tuple[Any, Any]:
        """Generated code of the extended mechanism and of the mechanism, for its forces."""
        task, groups = self.space.task, self.space.groups
        options: dict[str, Any] = {"compiler": self._compiler, "batches": True}
        with _generated_code():
            by_task = task.extended.compile(
                parameters=groups, functions=("kinematics", "closing"), **options
            )
            by_task.wait()
            if not self.motions:
                return by_task, None
            own = [group for group in groups if group in _possible(task.mechanism)]
            by_actuators = task.mechanism.compile(
                parameters=own, functions=("dynamics",), **options
            )
            by_actuators.wait()
        return by_task, by_actuators

    def __call__(self, values: Array) -> Measures:
        """Return the measures of candidates, shape (n, d)."""
        rows = len(self.points) + sum(len(one.x) for one in self.motions)
        block = max(1, _BLOCK // rows)
        parts = [self._measured(values[k : k + block]) for k in range(0, len(values), block)]
        return Measures(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def middles(self, values: Array) -> Array:
        """Return configurations (n, nq) at the middle of the region."""
        found = started(self.space, self.engines[0], values, self.points[0])
        return found.q[:, : self.space.task.mechanism.model.nq]

    def _measured(self, values: Array) -> Measures:
        task, engine = self.space.task, self.engines[0]
        candidates, count = self.space.candidates(values), len(values)
        numbers = packed(engine, candidates.numbers, count)
        start = started(self.space, engine, values, self.points[0])
        there = start.done >= 1.0
        goal = np.broadcast_to(self.points, (count, *self.points.shape))
        q, reached = self._reached(start.q, goal, numbers)
        reached &= there[:, None]
        K, side, conditioning = self._gains(q, numbers, reached, candidates.length)
        nq = task.mechanism.model.nq
        rooms = self._rooms(candidates, values, q[..., :nq], goal)
        rooms = np.where(reached[..., None], rooms, np.inf).min(axis=1)
        actuators = q[..., task.of_actuators]
        ends = (
            np.where(reached[..., None], actuators, -np.inf).max(axis=1),
            np.where(reached[..., None], actuators, np.inf).min(axis=1),
        )
        some = np.asarray(reached.any(axis=1))
        share = 1.0 - reached.mean(axis=1)
        forces = self._moved(candidates, start.q, numbers, there)
        return Measures(
            np.where(there, share, 2.0 - start.done),
            np.where(
                some, (reached & ~side).sum(axis=1) / np.maximum(reached.sum(axis=1), 1), np.nan
            ),
            _where(some, np.where(reached, conditioning, np.inf).min(axis=1)),
            _where(some, rooms.min(axis=1, initial=np.inf)),
            np.where(some, rooms.argmin(axis=1) if rooms.shape[1] else -1, -1).astype(np.float64),
            *forces,
            _where(some, (ends[0] - ends[1]).max(axis=1)),
            self._least_stiffness(K, reached, some),
            self._clearance(candidates, numbers, q, reached, some),
            candidates.mass,
            candidates.size,
        )

    def _reached(self, q: Array, goal: Array, numbers: Array) -> tuple[Array, Bools]:
        """Return configurations (n, k, nq) at goals (n, k, m), and which are reached."""
        count, points = goal.shape[:2]
        whole = np.repeat(q, points, axis=0)
        each = np.repeat(numbers, points, axis=0)
        found, ok = self.engines[0].continued(goal.reshape(count * points, -1), whole, each)
        return found.reshape(count, points, -1), ok.reshape(count, points).copy()

    def _gains(
        self, q: Array, numbers: Array, reached: Bools, length: Array
    ) -> tuple[Array, Bools, Array]:
        """Return K, NaN at type I, whether it is on home's side, and the conditioning.

        Angles of the task count as arcs of the candidates' lengths (n,), in the task's unit.
        """
        task, (count, points) = self.space.task, q.shape[:2]
        each = np.repeat(numbers, points, axis=0)
        T, *_, status = self.engines[0].generated(
            "motion_basis", None, each, q.reshape(-1, q.shape[-1])
        )
        K = T[:, task.mechanism.actuated_indices, :]
        good = (np.asarray(status) == 0) & reached.ravel()
        K = np.where(good[:, None, None], K, np.nan)
        # Angles of the task as arcs of each candidate's own length.
        arcs = np.repeat(task.characteristic_length / length, points)[:, None]
        K = K * np.where(task.angular, arcs, 1.0)[:, None, :]
        measured = gains_of(task, K)
        side = measured.conditioning > 0
        if K.shape[-1] == K.shape[-2]:
            side &= measured.determinant * self._side > 0
        shape = (count, points)
        return (
            K.reshape(*shape, *K.shape[1:]),
            side.reshape(shape),
            measured.conditioning.reshape(shape),
        )

    def _rooms(self, candidates: Candidates, values: Array, q: Array, x: Array) -> Array:
        """Return the room to each limit in shares, shape (n, k, limits)."""
        lower, upper = candidates.lower[:, self._at], candidates.upper[:, self._at]
        way = upper - lower
        unit = np.where(np.isfinite(way) & (way > 0), way, self._scale)[:, None]
        now = q[..., self._at]
        room = np.where(self._upper, upper[:, None] - now, now - lower[:, None]) / unit
        return np.concatenate([room, self.space.rooms(values, q, x)], axis=-1)

    def _moved(
        self, candidates: Candidates, start: Array, numbers: Array, there: Bools
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Return the share of samples off, and the largest forces and speeds with their shares."""
        count, (engine, dynamics) = len(start), self.engines
        if not self.motions:
            none = np.full(count, np.nan)
            return np.zeros(count), none, none, none, none
        own = packed(dynamics, candidates.numbers, count)
        nq, nv = self.space.task.mechanism.model.nq, self.space.task.mechanism.model.nv
        actuated = self.space.task.mechanism.actuated_indices
        tau, speed, reached = [], [], []
        for motion in self.motions:
            q, alive = start.copy(), there.copy()
            for x, rate, acceleration in zip(*motion[1:], strict=True):
                moved, ok = engine.continued(np.tile(x, (count, 1)), q, numbers)
                alive &= ok
                q = np.where(alive[:, None], moved, q)
                v, *_, bad = engine.generated(
                    "velocity", None, numbers, q, np.tile(rate, (count, 1))
                )
                a, *_, worse = engine.generated(
                    "acceleration", None, numbers, q, v, np.tile(acceleration, (count, 1))
                )
                whole = np.ascontiguousarray
                force, *_, worst = dynamics.generated(
                    "inverse_dynamics",
                    None,
                    own,
                    whole(q[:, :nq]),
                    whole(v[:, :nv]),
                    whole(a[:, :nv]),
                )
                good = alive & (np.asarray(bad) == 0) & (np.asarray(worse) == 0)
                good &= np.asarray(worst) == 0
                reached.append(good)
                tau.append(np.where(good[:, None], np.abs(force), 0.0))
                speed.append(np.where(good[:, None], np.abs(v[:, actuated]), 0.0))
        ok = np.array(reached)
        some = np.asarray(ok.any(axis=0))
        found = [1.0 - ok.mean(axis=0)]
        for values, most in zip((tau, speed), self._most, strict=True):
            largest = np.max(values, axis=0)
            with np.errstate(divide="ignore", invalid="ignore"):
                share = np.where(np.isfinite(most) & (most > 0), largest / most, 0.0)
            found += [_where(some, largest.max(axis=1)), _where(some, share.max(axis=1))]
        return found[0], found[1], found[2], found[3], found[4]

    def _least_stiffness(self, K: Array, reached: Bools, some: Bools) -> Array:
        """Return the least of K' diag(k) K in any direction, in one unit of the task, N/m."""
        if self._stiffness is None:
            return np.full(len(K), np.nan)
        there = reached & np.isfinite(K).all(axis=(-2, -1))
        rooted = np.sqrt(self._stiffness)[:, None] * K / self.space.task.scale
        values = np.linalg.svd(np.where(there[..., None, None], rooted, 0.0), compute_uv=False)
        least = np.where(there, values[..., -1] ** 2, np.inf).min(axis=1)
        return _where(some & np.asarray(there.any(axis=1)), least)

    def _clearance(
        self, candidates: Candidates, numbers: Array, q: Array, reached: Bools, some: Bools
    ) -> Array:
        """Return the least clearance of two rods, m."""
        if self._rods is None:
            return np.full(len(q), np.nan)
        found = self._rods.least(self.engines[0], candidates.numbers, numbers, q)
        return _where(some, np.where(reached, found, np.inf).min(axis=1))


@contextmanager
def _generated_code() -> Iterator[None]:
    """Say what to install where a part of the block is missing."""
    try:
        yield
    except ImportError as error:
        raise CompileError(
            f"a design needs generated code: pip install rps-pin[compile] ({error})", ""
        ) from error


def _where(some: Bools, values: Array) -> Array:
    return np.where(some, values, np.nan)


def _possible(mechanism: Any) -> tuple[str, ...]:
    """Return the groups of parameters that a mechanism has."""
    from rps_pin.codegen.expressions.parameters import Parameters  # noqa: PLC0415 (needs CasADi)

    return Parameters(mechanism.system).possible

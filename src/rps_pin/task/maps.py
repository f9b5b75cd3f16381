"""Positions, velocities and accelerations of a task and of its mechanism's actuators, both ways.

With x the task's coordinates, a the actuators', and q all joints' of a closed configuration,

    a = a(x),   a' = K x',   a'' = K x'' + x' H x',

and a(x) is continued within an assembly mode. K does not exist at a type I singularity (see
`singularity`), and is singular at one of type II.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from functools import cached_property, partial
from typing import Any, NamedTuple, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.constraints.rotation_vector import MOST_TURN
from rps_pin.codegen.engine.batches import Errors
from rps_pin.errors import InputError, MechanismError, RPSPinError, few
from rps_pin.numerics.linear_algebra import null_space, rank, singular_values
from rps_pin.task.coordinates import Extended, of_frame, of_joints
from rps_pin.task.engine import PinocchioEngine
from rps_pin.validation import choice, numbers, positive_number


class TaskState(NamedTuple):
    """A motion of all joints that a motion of the task makes."""

    q: Array
    """Configuration, shape (..., nq)."""
    v: Array
    """Velocity, shape (..., nv)."""
    a: Array
    """Acceleration, shape (..., nv)."""


class TaskMaps:
    """Coordinates of a task and their maps; see `Task`."""

    def __init__(
        self,
        mechanism: ClosedLoopModel,
        frame: str | None = None,
        coordinates: Sequence[str] | None = None,
        *,
        joints: Sequence[str] | None = None,
        reference: str = "universe",
        placement: Any = None,
        characteristic_length: float | None = None,
    ) -> None:
        if not isinstance(mechanism, ClosedLoopModel):
            raise InputError(
                f"a task is of a ClosedLoopModel, not of {type(mechanism).__name__}; generated "
                "code of a task: Task(...).compile()"
            )
        if (frame is None) != (coordinates is None) or (frame is None) == (joints is None):
            raise InputError("a task is of a frame and its coordinates, or of joints: give one")
        self.mechanism = mechanism
        if joints is not None:
            self._x = of_joints(mechanism, joints)
        else:
            assert frame is not None
            assert coordinates is not None
            self._x = of_frame(mechanism, frame, coordinates, reference, placement)
        self.extended, self.coordinates, self.angular = (
            self._x.mechanism,
            self._x.names,
            self._x.angular,
        )
        length = mechanism.characteristic_length
        if characteristic_length is not None:
            length = positive_number(characteristic_length, "characteristic_length", "m")
        self.characteristic_length = length
        #: Factors that take speeds in one unit (m/s) to those of the coordinates, shape (m,).
        self._units = np.where(self.angular, 1 / length, 1.0)
        self._nq, self._nv = mechanism.model.nq, mechanism.model.nv
        self._actuated = mechanism.actuated_indices
        self._by_task: Any = PinocchioEngine(self.extended)
        self._by_actuators: Any = PinocchioEngine(mechanism)
        self._options: dict[str, Any] = {
            "frame": frame,
            "coordinates": coordinates,
            "joints": joints,
            "reference": reference,
            "placement": placement,
            "characteristic_length": characteristic_length,
        }
        #: What `compile` was given.
        self.compile_options: dict[str, Any] = {}
        #: The extended mechanism on a graphics card, if `compile` was asked for it.
        self.card: Any = None
        self._refuse_wrong_count()

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), **self._options), (self.mechanism,)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return one with scratch memory of its own; generated code serves both."""
        copied: Self = _call_reduced(self.__reduce__(), memo)
        if self.compiled:
            copied._by_task, copied._by_actuators = self._by_task, self._by_actuators
            copied.compile_options, copied.card = self.compile_options, self.card
        return copied

    def __repr__(self) -> str:
        of = f"frame {self._x.frame!r}: " if self._x.frame else "joints "
        return f"{type(self).__name__}({of}{', '.join(self.coordinates)}; {self.mechanism!r})"

    def interpreted(self) -> Self:
        """Return the same task by the Pinocchio engine."""
        copied: Self = _call_reduced(self.__reduce__(), {})
        return copied

    def with_mechanism(self, mechanism: ClosedLoopModel) -> Self:
        """Return the same coordinates of another mechanism, one with other masses as an example."""
        return type(self)(mechanism, **self._options)

    @property
    def options(self) -> dict[str, Any]:
        """What it was made with, by the constructor's names, the mechanism apart."""
        return dict(self._options)

    @property
    def compiled(self) -> bool:
        """Whether generated code computes the maps: see `compile`."""
        return not isinstance(self._by_task, PinocchioEngine)

    @property
    def frame(self) -> str | None:
        """Name of the output frame; None for a task of joints."""
        return self._x.frame

    @property
    def size(self) -> int:
        """Number of coordinates, m."""
        return len(self.coordinates)

    @property
    def rank(self) -> int:
        """Rank of J at regular configurations."""
        return self._rank

    @property
    def extension(self) -> Extended:
        """How the extended mechanism holds the coordinates."""
        return self._x

    @property
    def engines(self) -> tuple[Any, Any]:
        """What computes the extended mechanism and the mechanism: engines of the same calls."""
        return self._by_task, self._by_actuators

    @property
    def output_frame(self) -> tuple[str | None, pin.SE3]:
        """Name of the output frame, none of a task of joints, and the placement of it there."""
        return self._x.frame, self._x.placement

    @property
    def scale(self) -> Array:
        """What a unit of each coordinate counts for as a length, shape (m,): 1, or m/rad."""
        return 1 / self._units

    def in_one_unit(self, K: Array) -> Array:
        """Return K (..., na, m) of speeds in one unit, m/s: angles count as arcs."""
        of_actuators = self.mechanism.velocity_scale[self._actuated]
        return np.asarray(K * self._units / of_actuators[:, None])

    @property
    def actuator_columns(self) -> tuple[str, ...]:
        """Names of the actuators' columns in tables of a motion: positions, speeds and forces."""
        mechanism = self.mechanism
        angular = mechanism.angular_velocities[mechanism.actuated_indices]
        units = (("m", "m_per_s", "N"), ("rad", "rad_per_s", "Nm"))
        return tuple(
            f"{name}_{what}_{units[int(turns)][k]}"
            for k, what in enumerate(("position", "speed", "force"))
            for name, turns in zip(mechanism.actuated, angular, strict=True)
        )

    @property
    def home(self) -> Array:
        """Coordinates at the mechanism's home, shape (m,)."""
        return self.at(self.mechanism.home)

    def compile(self, **options: Any) -> Self:
        """Return the same task in generated code, ten to a thousand times faster.

        Parameters
        ----------
        **options
            ``compiler``, ``batches`` and others; see `rps_pin.codegen.compile_mechanism`. With
            ``device="cuda"`` an NVIDIA card continues the configurations of
            `rps_pin.task.workspace`; everything else is computed by the processor.

        Raises
        ------
        CompileError
            As there.
        """
        compiled = type(self)(self.mechanism, **self._options)
        compiled.compile_options = dict(options)
        if choice(options.pop("device", "cpu"), "device", ("cpu", "cuda")) == "cuda":
            compiled.card = self.extended.compile(device="cuda", functions=("closing",))
        functions = options.pop("functions", ("kinematics", "closing"))
        compiled._by_task = self.extended.compile(functions=functions, **options)
        compiled._by_actuators = self.mechanism.compile(functions=functions, **options)
        return compiled

    @property
    def is_compiled(self) -> bool:
        """Whether it is in generated code, with batches."""
        return not isinstance(self._by_actuators, PinocchioEngine)

    # Positions ------------------------------------------------------------------------------------

    def at(self, q: ArrayLike, near: ArrayLike | None = None, *, errors: Errors = "raise") -> Array:
        """Return the task's coordinates at configurations, shape (..., m).

        Parameters
        ----------
        q
            Closed configurations, shape (..., nq).
        near
            Coordinates (..., m) that decide between the two rotation vectors of a rotation. Left
            out: the shorter one.
        """
        q_ = self._rows(q, self._nq, "q")
        if not self._x.added:
            return np.asarray(q_[..., self._x.idx_q])
        about = np.zeros(self.size) if near is None else self._rows(near, self.size, "near")
        whole = self.joined(q_, about)
        held = whole[..., self._x.idx_q]
        gaps = self._by_task.gaps(whole, **options_of(errors))
        return np.asarray(held - gaps[..., self._x.rows])

    def to_actuators(
        self,
        x: ArrayLike,
        near: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        errors: Errors = "raise",
    ) -> Array:
        """Return the actuators' positions of task coordinates, shape (..., na), m or rad.

        Those in the assembly mode of a configuration: the coordinates are followed on a straight
        line from there (see `ClosedLoopModel.complete`).

        Parameters
        ----------
        x
            Task coordinates, shape (..., m).
        near
            Closed configurations whose assembly mode is kept, shape (..., nq); home if left out.
        within_limits
            Whether joints must be within their limits.
        errors
            ``"mask"`` makes samples that fail NaN instead of raising the first one's error.

        Raises
        ------
        InputError
            If an array does not fit, or a rotation vector is a whole turn long.
        ClosureError
            If there is no such configuration, or it is outside joint limits; says by how much.
        SingularityError
            If the assembly mode ends on the way; says how far along.
        """
        q = self.configuration(x, near, within_limits=within_limits, errors=errors)
        return np.asarray(q[..., self.of_actuators])

    def configuration(
        self,
        x: ArrayLike,
        near: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        errors: Errors = "raise",
    ) -> Array:
        """Return the closed configurations of task coordinates, (..., nq); see `to_actuators`."""
        wanted = self._coordinates(x)
        q = self.mechanism.home if near is None else self._rows(near, self._nq, "near")
        if self._x.added:
            start = self.at(q, wanted, errors=errors)
            q = self.joined(q, start)
        found = self._by_task.complete(wanted, q, **_continued(within_limits, errors))
        return np.asarray(found[..., : self._nq])

    def follow(
        self, x: ArrayLike, near: ArrayLike | None = None, *, within_limits: bool = True
    ) -> Array:
        """Return the configurations of a sequence, each continued from the one before, (k, nq).

        Parameters
        ----------
        x
            Task coordinates in the order of the motion, shape (k, m).
        near, within_limits
            As for `to_actuators`; where the first begins.

        Raises
        ------
        RPSPinError
            As `to_actuators`; with the number of the sample.
        """
        wanted = self._coordinates(x)
        if wanted.ndim != 2:
            raise InputError(f"x has shape {wanted.shape}; a sequence has shape (k, {self.size})")
        q = self.mechanism.home if near is None else self._rows(near, self._nq, "near")
        found = np.empty((len(wanted), self._nq))
        for k, one in enumerate(wanted):
            try:
                found[k] = q = self.configuration(one, q, within_limits=within_limits)
            except RPSPinError as error:
                error.args = (f"sample {k}: {error}", *error.args[1:])
                raise
        return found

    def to_task(
        self,
        a: ArrayLike,
        near: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        errors: Errors = "raise",
    ) -> Array:
        """Return the task's coordinates of actuators' positions, shape (..., m), m or rad.

        Parameters
        ----------
        a
            Positions of the actuated joints, shape (..., na), m or rad.
        near, within_limits, errors
            As for `to_actuators`.

        Raises
        ------
        RPSPinError
            As `to_actuators`.
        """
        q = self.mechanism.home if near is None else self._rows(near, self._nq, "near")
        found = self.configuration_of(a, q, within_limits=within_limits, errors=errors)
        about = self.at(q) if any(self.angular) else None
        failed = np.isnan(found[..., :1])
        if not failed.any():
            return self.at(found, about, errors=errors)
        whole = np.where(failed, self.mechanism.home, found)
        return np.where(failed, np.nan, self.at(whole, about, errors=errors))

    # Velocities and accelerations -----------------------------------------------------------------

    def jacobian(
        self, q: ArrayLike, *, x: ArrayLike | None = None, errors: Errors = "raise"
    ) -> Array:
        """Return K = d(actuators)/d(task) at closed configurations, shape (..., na, m).

        As velocities of a `ClosedLoopModel`, it does not look whether the loops are closed; calls
        that return forces or inertia do, and refuse open ones.

        Parameters
        ----------
        q
            Closed configurations, shape (..., nq).
        x
            Coordinates there, shape (..., m), that decide between the two rotation vectors of a
            rotation, as `near` of `at`. Left out: the shorter one.

        Raises
        ------
        SingularityError
            If the task's coordinates do not determine the motion here (type I).
        """
        return self._basis(q, x, errors)[..., self._actuated, :]

    def hessian(
        self, q: ArrayLike, *, x: ArrayLike | None = None, errors: Errors = "raise"
    ) -> Array:
        """Return H = d2(actuators)/d(task)2, shape (..., na, m, m), symmetric.

        Exact: the accelerations at constant rates are x' H x', a quadratic form. Arguments are
        those of `jacobian`.
        """
        q_, count = self._rows(q, self._nq, "q"), self.size
        batch, axes = q_.shape[:-1], np.eye(self.size)

        def form(rate: Array) -> Array:
            return self.bias(q_, np.broadcast_to(rate, (*batch, count)), x=x, errors=errors)

        squares = [form(axis) for axis in axes]
        found = np.empty((*batch, self._actuated.size, count, count))
        for i in range(count):
            found[..., i, i] = squares[i]
            for k in range(i):
                mixed = (form(axes[i] + axes[k]) - squares[i] - squares[k]) / 2
                found[..., i, k] = found[..., k, i] = mixed
        return found

    def bias(
        self,
        q: ArrayLike,
        rate: ArrayLike,
        *,
        x: ArrayLike | None = None,
        errors: Errors = "raise",
    ) -> Array:
        """Return K' x' = x' H x', the actuators' accelerations at constant rates, (..., na).

        Parameters
        ----------
        q
            Closed configurations, shape (..., nq).
        rate
            x', shape (..., m).
        x
            As for `jacobian`.
        """
        _, _, a = self._motion(q, rate, np.zeros(self.size), x, errors)
        return np.asarray(a[..., self._actuated])

    def state(
        self,
        x: ArrayLike,
        rate: ArrayLike,
        acceleration: ArrayLike,
        near: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        errors: Errors = "raise",
    ) -> TaskState:
        """Return the motion of all joints that a motion of the task makes.

        Parameters
        ----------
        x, rate, acceleration
            Task coordinates and their derivatives by time, shape (..., m) each.
        near, within_limits, errors
            As for `to_actuators`.

        Raises
        ------
        RPSPinError
            As `to_actuators`.
        """
        q = self.configuration(x, near, within_limits=within_limits, errors=errors)
        return self.motion(q, rate, acceleration, x=x, errors=errors)

    def motion(
        self,
        q: ArrayLike,
        rate: ArrayLike,
        acceleration: ArrayLike,
        *,
        x: ArrayLike | None = None,
        errors: Errors = "raise",
    ) -> TaskState:
        """Return the motion of all joints at closed configurations (..., nq); see `state`.

        `x` is that of `jacobian`.
        """
        q_, v, a = self._motion(q, rate, acceleration, x, errors)
        return TaskState(q_, v[..., : self._nv], a[..., : self._nv])

    def rate(
        self,
        q: ArrayLike,
        v: ArrayLike,
        *,
        x: ArrayLike | None = None,
        errors: Errors = "raise",
    ) -> Array:
        """Return x' of velocities (..., nv) that keep the loops closed, shape (..., m).

        `x` is that of `jacobian`.
        """
        forward = self._frame_rows(q, x, errors)
        return np.asarray(np.einsum("...ij,...j->...i", forward, self._rows(v, self._nv, "v")))

    # From the actuators ---------------------------------------------------------------------------

    def configuration_of(
        self,
        a: ArrayLike,
        near: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        errors: Errors = "raise",
    ) -> Array:
        """Return the closed configurations of actuators' positions, (..., nq); see `to_task`."""
        _ = self.of_actuators  # or refuse
        q = self.mechanism.home if near is None else self._rows(near, self._nq, "near")
        found = self._by_actuators.complete(a, q, **_continued(within_limits, errors))
        return np.asarray(found)

    def velocity_of(self, q: ArrayLike, speed: ArrayLike, *, errors: Errors = "raise") -> Array:
        """Return the velocities of all joints that actuators' speeds make, shape (..., nv).

        Parameters
        ----------
        q
            Closed configurations, shape (..., nq).
        speed
            Of the actuators, shape (..., na), m/s or rad/s.

        Raises
        ------
        SingularityError
            If they do not determine the motion here.
        """
        return np.asarray(self._by_actuators.velocity(q, speed, **options_of(errors)))

    # Parts ----------------------------------------------------------------------------------------

    def _refuse_wrong_count(self) -> None:
        """Raise `MechanismError` unless the coordinates are as many as, and span, the motions."""
        description = self.mechanism.describe()
        counting = description.mobility - sum(one.size for one in description.idle)
        idle = description.mobility - counting
        if self.size != counting:
            more = "too many" if self.size > counting else "too few"
            raise MechanismError(
                f"the task has {self.size} coordinates ({', '.join(self.coordinates)}), which are "
                f"{more}: the mechanism has {counting} motions"
                + (f", {idle} idle freedoms not counted" if idle else "")
            )
        q = description.configuration
        self._rank = description.rank
        A, _, _ = self._in_motions(q)
        values = singular_values(A)
        if rank(values / max(values[0], 1e-300), 1e-8) < self.size:
            free = null_space(A.T, 1e-8)[:, 0]
            named = [
                name for name, part in zip(self.coordinates, free, strict=True) if abs(part) > 1e-6
            ]
            raise MechanismError(
                f"coordinates {few(named, 6)} of the task do not move independently of each other"
                if len(named) > 1
                else f"coordinate {named[0]} of the task does not move"
            )

    def _in_motions(self, q: Array) -> tuple[Array, Array, Array]:
        """Return A N, S N and the singular values of J, all in one unit, at (..., nq).

        N is an orthonormal basis of the motions that J's largest singular values leave, as many of
        these as the rank is at regular configurations.
        """
        system = self.mechanism.system
        J = system.scaled(self._by_actuators.jacobian(q))
        _, values, right = np.linalg.svd(J)
        N = np.swapaxes(right[..., self._rank :, :], -1, -2)
        A = self._frame_rows(q, None, "raise") * system.column_scale / self._units[:, None]
        return A @ N, N[..., self._actuated, :], values

    def _frame_rows(self, q: ArrayLike, x: ArrayLike | None, errors: Errors) -> Array:
        """Return A, shape (..., m, nv): x' = A v."""
        q_ = self._rows(q, self._nq, "q")
        found = np.zeros((*q_.shape[:-1], self.size, self._nv))
        if not self._x.added:
            model, names = self.mechanism.model, self.coordinates
            columns = [model.joints[model.getJointId(name)].idx_v for name in names]
            found[..., range(self.size), columns] = 1.0
            return found
        J = self._by_task.jacobian(self._whole(q_, x, errors), **options_of(errors))
        return np.asarray(-J[..., self._x.rows, : self._nv])

    def _basis(self, q: ArrayLike, x: ArrayLike | None, errors: Errors) -> Array:
        """Return T of the extended mechanism: v = T x', shape (..., nv + m, m)."""
        q_ = self._rows(q, self._nq, "q")
        whole = self._whole(q_, x, errors)
        return np.asarray(self._by_task.motion_basis(whole, **options_of(errors)))

    def _motion(
        self,
        q: ArrayLike,
        rate: ArrayLike,
        acceleration: ArrayLike,
        x: ArrayLike | None,
        errors: Errors,
    ) -> tuple[Array, Array, Array]:
        """Return q and, of the extended mechanism, v and a."""
        q_ = self._rows(q, self._nq, "q")
        whole, options = self._whole(q_, x, errors), options_of(errors)
        rate_ = self._rows(rate, self.size, "rate")
        acceleration_ = self._rows(acceleration, self.size, "acceleration")
        v = self._by_task.velocity(whole, rate_, **options)
        return q_, v, self._by_task.acceleration(whole, v, acceleration_, **options)

    def _closed(self, q: ArrayLike, errors: Errors) -> Array:
        """Return configurations, refused as those of `inverse_dynamics` are if loops are open.

        With ``errors="mask"``, open ones are NaN.
        """
        q_, equations = self._rows(q, self._nq, "q"), self.mechanism.system.equations
        gaps = self._by_actuators.gaps(q_, **options_of(errors))
        if not (equations.largest_gaps(gaps) > equations.open_limit).any():
            return q_
        return PinocchioEngine(self.mechanism).closed(q_, errors)

    def _whole(self, q: Array, x: ArrayLike | None, errors: Errors) -> Array:
        """Return configurations of the extended mechanism, with rotation vectors near x."""
        return self.joined(q, self.at(q, x, errors=errors)) if self._x.added else q

    def joined(self, q: Array, x: Array) -> Array:
        """Return configurations of the extended mechanism, with the frame's coordinates in them."""
        if not self._x.added:
            return q
        batch = np.broadcast_shapes(q.shape[:-1], x.shape[:-1])
        whole = np.empty((*batch, self._nq + self._x.added))
        whole[..., : self._nq] = q
        whole[..., self._x.idx_q] = x
        return whole

    @cached_property
    def of_actuators(self) -> Indices:
        """Where the actuators' positions are in q, shape (na,).

        Raises
        ------
        MechanismError
            If an actuated joint has not one coordinate of its own.
        """
        model, found = self.mechanism.model, []
        for name in self.mechanism.actuated:
            joint = model.joints[model.getJointId(name)] if model.existJointName(name) else None
            if joint is None or joint.nq != 1:
                raise MechanismError(f"actuated {name!r} has no coordinate of its own")
            found.append(joint.idx_q)
        return np.array(found, dtype=np.intp)

    def _coordinates(self, x: ArrayLike) -> Array:
        wanted = self._rows(x, self.size, "x")
        if self._x.added:
            turns = np.linalg.norm(wanted[..., list(self.angular)], axis=-1)
            longest = float(turns.max(initial=0.0))
            if longest > MOST_TURN:
                raise InputError(
                    f"x holds a rotation vector of {longest:.4g} rad; at most {MOST_TURN:.4g} is "
                    "possible: a rotation vector of a whole turn has no rates"
                )
        return wanted

    def _rows(self, given: ArrayLike, size: int, name: str) -> Array:
        found = numbers(given, name, f"numbers of shape (..., {size})")
        if found.shape[-1:] != (size,):
            raise InputError(f"{name} has shape {found.shape}; expected (..., {size})")
        if not np.isfinite(found).all():
            raise InputError(f"{name} holds numbers that are not finite")
        return found


def _call_reduced(reduced: tuple[Any, ...], memo: dict[int, Any]) -> Any:
    make, arguments = reduced
    return make(*deepcopy(arguments, memo))


def options_of(errors: Errors) -> dict[str, Any]:
    """Return the option of an engine; without one, generated code answers single calls fastest."""
    return {} if isinstance(errors, str) and errors == "raise" else {"errors": errors}


def _continued(within_limits: bool, errors: Errors) -> dict[str, Any]:
    """Return options of `complete`: nothing is looked for outside the assembly mode."""
    return {"within_limits": within_limits, "restarts": 0, **options_of(errors)}

"""What a mechanism is made of, and its positions: closing loops, the nearest, the completed one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.closed_loop.assembly.closing import close_gaps
from rps_pin.closed_loop.assembly.joint_limits import JointLimits
from rps_pin.closed_loop.assembly.nearest import NearestSearch
from rps_pin.closed_loop.constraints.closures import Closure, frame_id
from rps_pin.closed_loop.constraints.loops import LoopErrors, Loops, refuse_twice
from rps_pin.errors import ClosureError, InputError, MechanismError
from rps_pin.validation import real_vector

#: A loop counts as closed below this gap, in units of the characteristic length.
_CLOSED = 1e-12


class ClosedLoopPositions:
    """What a `ClosedLoopModel` is made of, and where it can stand; see there for the parameters."""

    def __init__(
        self,
        model: pin.Model,
        closures: Sequence[Closure],
        actuated: Sequence[str],
        *,
        home: ArrayLike | None = None,
        characteristic_length: float | None = None,
    ) -> None:
        self.model = model
        self.closures = tuple(closures)
        self.actuated = (actuated,) if isinstance(actuated, str) else tuple(actuated)
        refuse_twice("actuated joint", self.actuated)
        self._loops = loops = Loops(model, closures, characteristic_length)
        if not self.actuated:
            raise MechanismError("a mechanism needs at least one joint to actuate")
        self._actuated = self._velocity_indices(self.actuated, "to actuate")
        self._passive = np.setdiff1d(np.arange(model.nv), self._actuated)
        self._scales = loops.row_scale[:, None], loops.column_scale[self._passive]
        self._limits = JointLimits(model)
        self._frame_ids: dict[str, int] = {}
        self._home = pin.neutral(model) if home is None else self._normal(home, "home")

    # What it is made of ---------------------------------------------------------------------------

    @property
    def home(self) -> Array:
        """Configuration to start from, shape (nq,): as given, or Pinocchio's neutral one.

        A mechanism that was read from a file has its loops closed here if the file says where.
        """
        return self._home.copy()

    @property
    def constraint_size(self) -> int:
        """Number of closure rows, nc."""
        return self._loops.size

    @property
    def characteristic_length(self) -> float:
        """Length that makes angles and lengths comparable, m."""
        return self._loops.length

    @property
    def row_scale(self) -> Array:
        """What rows are multiplied with to be of one unit (m), shape (nc,)."""
        return self._loops.row_scale.copy()

    @property
    def velocity_scale(self) -> Array:
        """What velocities of one unit (m/s) are multiplied with to be theirs, shape (nv,)."""
        return self._loops.column_scale.copy()

    @property
    def angular_rows(self) -> Bools:
        """Which rows are angular (rad, N m), shape (nc,)."""
        return self._loops.angular_rows.copy()

    @property
    def angular_velocities(self) -> Bools:
        """Which velocities are angular (rad/s), shape (nv,)."""
        return self._loops.angular_velocities.copy()

    @property
    def actuated_indices(self) -> Indices:
        """Indices of the actuated joints in a velocity vector, shape (na,)."""
        return self._actuated.copy()

    def rows(self, closure: str) -> slice:
        """Return the rows of a closure, by its name, in `constraint_forces` and `LoopErrors`.

        Raises
        ------
        MechanismError
            If there is no closure of that name; lists those there are.
        """
        return self._loops.rows(closure)

    # Position -------------------------------------------------------------------------------------

    def loop_errors(
        self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None
    ) -> LoopErrors:
        """Return how far the loops are from closed at position, velocity and acceleration level.

        Parameters
        ----------
        q, v, a
            Configuration (nq,), velocity (nv,) and acceleration (nv,) as Pinocchio has them; v and
            a are zero if left out.
        """
        still = np.zeros(self.model.nv)
        return self._loops.errors(
            *self._checked_state(q, still if v is None else v, still if a is None else a)
        )

    def loop_gap(self, q: ArrayLike) -> float:
        """Return the largest gap between two closed frames, m.

        An angle between closed frames counts with the characteristic length as its lever.
        """
        return self._loops.worst(self._loops.gaps(real_vector(q, self.model.nq, "q")))[0]

    def close(
        self,
        q_guess: ArrayLike,
        *,
        fixed: Sequence[str] = (),
        within_limits: bool = True,
        restarts: int = 20,
    ) -> Array:
        """Return a configuration near a guess in which every loop is closed.

        The loops are closed by least-norm steps from the guess (see `closing`): the answer lies
        near it, and need not be the nearest (`project` finds that). Where the steps end in a dead
        end, they start again from random places farther and farther away.

        Parameters
        ----------
        q_guess
            Configuration, shape (nq,); quaternions need not be of unit length.
        fixed
            Names of joints that keep the guess's values.
        within_limits
            Whether the answer must lie within the model's joint limits. The guess need not.
        restarts
            How often to start again; always from the same places.

        Returns
        -------
        array
            Closed configuration, shape (nq,), gaps at most 1e-12 m (or 1e-12 characteristic
            lengths where that is more than a metre).

        Raises
        ------
        InputError
            If the guess has the wrong shape, is not finite, or holds a quaternion of no length.
        ClosureError
            If the loops do not close; says by how much, which, and what joints stand at a limit.
        """
        guess = self._normal(q_guess, "q_guess")
        held = np.zeros(self.model.nv, dtype=bool)
        held[self._velocity_indices(fixed, "to fix")] = True
        start = self._limits.clip(guess) if within_limits else guess
        outside = self._limits.outside(guess) if within_limits else {}
        if outside.keys() & set(fixed):
            phrases = ", ".join(outside[name] for name in fixed if name in outside)
            raise ClosureError(f"fixed joints are outside their limits: {phrases}", np.inf)
        best, best_gap, rng = start, np.inf, np.random.default_rng(0)
        for attempt in range(1 + restarts):
            q = self._closed_from(start, held, within_limits)
            if self._is_closed(q):
                return q
            gap, _ = self._loops.worst(self._loops.gaps(q))
            if gap < best_gap:
                best, best_gap = q, gap
            spread = np.pi * (attempt + 1) / max(restarts, 1)
            away = spread * rng.normal(size=self.model.nv) / self._units()
            start = pin.integrate(self.model, guess, np.where(held, 0.0, away))
            start = self._limits.clip(start) if within_limits else start
        raise self._open(guess, best, within_limits)

    def project(self, q_guess: ArrayLike, *, within_limits: bool = True) -> Array:
        """Return the closed configuration nearest to a guess.

        Nearest in the norm that makes angles lengths by `characteristic_length`; a local minimum of
        the distance (see `nearest`).

        Raises
        ------
        InputError, ClosureError
            As `close`; also if the steps do not settle.
        """
        guess = self._normal(q_guess, "q_guess")
        start = self.close(guess, within_limits=within_limits)
        none = np.zeros(self.model.nv, dtype=bool)
        search = NearestSearch(
            self.model,
            self._loops,
            self._limits if within_limits else None,
            lambda q: self._closed_from(q, none, within_limits),
            self._is_closed,
        )
        return search.run(guess, start)

    def complete(
        self,
        values: Mapping[str, ArrayLike] | ArrayLike,
        q_guess: ArrayLike | None = None,
        *,
        within_limits: bool = True,
    ) -> Array:
        """Return the closed configuration in which some joints have given values.

        Parameters
        ----------
        values
            By joint name, each with as many numbers as the joint has coordinates; or those of the
            actuated joints in order, shape (na,) (if each has one coordinate).
        q_guess
            Where the other joints start, shape (nq,); selects the assembly mode. `home` if left
            out.

        Raises
        ------
        InputError, MechanismError
            If a value has the wrong shape, or a joint is unknown.
        ClosureError
            If the loops do not close with these values.
        """
        q = self._normal(self._home if q_guess is None else q_guess, "q_guess")
        if not isinstance(values, Mapping):
            given = real_vector(values, len(self.actuated), "values")
            values = dict(zip(self.actuated, given, strict=True))
        self._velocity_indices(list(values), "to give a value")
        for name, value in values.items():
            joint = self.model.joints[self.model.getJointId(name)]
            of_joint = real_vector(np.atleast_1d(value), joint.nq, f"the value of joint {name!r}")
            q[joint.idx_q : joint.idx_q + joint.nq] = of_joint
        return self.close(q, fixed=list(values), within_limits=within_limits)

    # Inner workings -------------------------------------------------------------------------------

    def _closed_from(self, start: Array, held: Bools, within_limits: bool) -> Array:
        scale = self._loops.column_scale
        return close_gaps(
            start,
            gaps=lambda q: self._loops.row_scale * self._loops.gaps(q),
            jacobian=lambda q: self._scaled_rows(self._loops.jacobian(q)) * scale,
            integrate=lambda q, step: pin.integrate(self.model, q, scale * step),
            tolerance=_CLOSED * self.characteristic_length,
            held=held,
            box=self._limits if within_limits else None,
        )

    def _is_closed(self, q: Array) -> bool:
        gap, _ = self._loops.worst(self._loops.gaps(q))
        return gap <= _CLOSED * max(self.characteristic_length, 1.0)

    def _open(self, guess: Array, best: Array, within_limits: bool) -> ClosureError:
        """Return the error that says how far the loops stay open."""
        gaps = self._loops.gaps(best)
        gap, closure = self._loops.worst(gaps)
        before, _ = self._loops.worst(self._loops.gaps(guess))
        parts = self._loops.parts(gaps, closure)
        reached = self._limits.reached(best) if within_limits else []
        return ClosureError(
            f"the loops do not close from this guess: closure {closure!r} stays open by "
            f"{gap:.6g} m{parts}"
            + (f", with {', '.join(reached)}" if reached else "")
            + f"; largest gap of the guess: {before:.6g} m",
            gap,
        )

    def _units(self) -> Array:
        """Return what velocities are multiplied with to be of one unit, m/s."""
        units: Array = 1 / self._loops.column_scale
        return units

    def _scaled_rows(self, jacobian: Array) -> Array:
        scaled: Array = self._scales[0] * jacobian
        return scaled

    def _scaled(self, jacobian: Array) -> Array:
        """Return J with all entries in one unit."""
        scaled: Array = self._scales[0] * jacobian * self._loops.column_scale
        return scaled

    def _checked_state(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike
    ) -> tuple[Array, Array, Array]:
        """Return q, v and a as finite arrays of the right shapes."""
        return (
            real_vector(q, self.model.nq, "q"),
            real_vector(v, self.model.nv, "v"),
            real_vector(a, self.model.nv, "a"),
        )

    def _normal(self, q: ArrayLike, name: str) -> Array:
        """Return a checked configuration with quaternions of unit length."""
        normal: Array = pin.normalize(self.model, real_vector(q, self.model.nq, name))
        if not pin.isNormalized(self.model, normal, 1e-9):
            raise InputError(f"{name} holds a quaternion of no length: it is no orientation")
        return normal

    def _velocity_indices(self, joints: Sequence[str], purpose: str) -> Indices:
        indices: list[int] = []
        for name in joints:
            if not self.model.existJointName(name) or name == "universe":
                names = ", ".join(list(self.model.names)[1:])
                raise MechanismError(f"no joint {name!r} {purpose}; there are: {names}")
            joint = self.model.joints[self.model.getJointId(name)]
            indices.extend(range(joint.idx_v, joint.idx_v + joint.nv))
        return np.array(indices, dtype=np.intp)

    def _frame(self, name: str) -> int:
        if name not in self._frame_ids:
            self._frame_ids[name] = frame_id(self.model, name)
        return self._frame_ids[name]

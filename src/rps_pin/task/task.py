"""Task: the coordinates that a mechanism is for.

With x the task's coordinates, a the actuators' and K = da/dx, forces that belong to them do the
same work, and gains the same forces:

    f = K' tau,   G_x = K' G_a K + sum_i tau_i H_i.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.codegen.engine.batches import Errors
from rps_pin.errors import InputError, MechanismError, SingularityError
from rps_pin.numerics.linear_algebra import RANK_TOLERANCE
from rps_pin.task import polytope
from rps_pin.task.ellipsoids import Ellipsoids, ellipsoids
from rps_pin.task.maps import TaskMaps, options_of
from rps_pin.task.paths.limits import JointRooms, PositionLimits
from rps_pin.task.singularity import SingularityMeasures
from rps_pin.validation import numbers


class Task(TaskMaps):
    """What a mechanism is for: coordinates of a frame, or of joints.

    As many coordinates as the mechanism has motions, idle freedoms not counted. All array arguments
    take leading batch dimensions. An object serves one thread at a time, as its mechanism does;
    that of `compile` serves any number.

    Parameters
    ----------
    mechanism
        The mechanism.
    frame
        Name of the output frame.
    coordinates
        Of the frame: some of ``"x"``, ``"y"``, ``"z"``, the place of its origin (m), and ``"rx"``,
        ``"ry"``, ``"rz"``, its rotation vector (rad), in the reference frame's axes. A rotation
        vector is less than a whole turn long.
    joints
        Names of joints of one coordinate, in place of a frame and its coordinates.
    reference
        Name of the frame that coordinates are taken in; the world if left out.
    placement
        Where the output frame stands in the frame named: a `pin.SE3` or a matrix of shape (4, 4).
    characteristic_length
        Length that makes angles and lengths of the task comparable, m; that of the mechanism if
        left out.

    Attributes
    ----------
    mechanism : ClosedLoopModel
        As given.
    extended : ClosedLoopModel
        The mechanism with a joint without mass for each coordinate of the frame, after its own
        joints, and these as its actuated joints: its dynamics is that of the task.
    coordinates : tuple of str
        Names of the coordinates.
    angular : tuple of bool
        Which are angles.

    Raises
    ------
    InputError
        If neither a frame with coordinates nor joints are given, or both.
    MechanismError
        If a frame, joint or coordinate is unknown; if there are too many coordinates or too few, or
        some do not move independently.
    """

    # Forces ---------------------------------------------------------------------------------------

    def forces_to_actuators(
        self,
        q: ArrayLike,
        forces: ArrayLike,
        *,
        x: ArrayLike | None = None,
        errors: Errors = "raise",
    ) -> Array:
        """Return the actuators' forces that make forces of the task, shape (..., na), N or N m.

        K' tau = f; of least norm where there are more actuators than coordinates.

        Parameters
        ----------
        q
            Closed configurations, shape (..., nq).
        forces
            f, shape (..., m): the power is f . x'. Those of a rotation vector are moments about the
            axes only where it is zero; for moments use `wrench_to_actuators`.
        x
            As for `jacobian`.

        Raises
        ------
        ClosureError
            If the loops are open.
        SingularityError
            If the actuators do not determine the task here (type II).
        """
        K = self._gain(q, x, errors)
        f = self._rows(forces, self.size, "forces")
        return self._carried(K, f[..., None], errors)[..., 0]

    def forces_to_task(
        self,
        q: ArrayLike,
        tau: ArrayLike,
        *,
        x: ArrayLike | None = None,
        errors: Errors = "raise",
    ) -> Array:
        """Return the task's forces f = K' tau of actuators' forces (..., na), shape (..., m).

        `x` is that of `jacobian`.

        Raises
        ------
        ClosureError
            If the loops are open.
        """
        tau_ = self._rows(tau, self._actuated.size, "tau")
        return np.asarray(np.einsum("...ij,...i->...j", self._gain(q, x, errors), tau_))

    def actuator_forces(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, errors: Errors = "raise"
    ) -> Array:
        """Return the actuators' forces of a motion of all joints, shape (..., na), N or N m.

        Those of the mechanism's `inverse_dynamics`, in batches; in generated code if compiled.

        Parameters
        ----------
        q, v, a
            As `state` returns them, shapes (..., nq), (..., nv) and (..., nv).

        Raises
        ------
        RPSPinError
            As `ClosedLoopModel.inverse_dynamics`.
        """
        state = (
            self._rows(q, self._nq, "q"),
            self._rows(v, self._nv, "v"),
            self._rows(a, self._nv, "a"),
        )
        return np.asarray(self._by_actuators.inverse_dynamics(*state, **options_of(errors)).tau)

    def twist_map(
        self, q: ArrayLike, *, x: ArrayLike | None = None, errors: Errors = "raise"
    ) -> Array:
        """Return E, shape (..., 6, m): the output frame's twist is E x'.

        (linear, angular) of the frame's origin in world axes, m/s and rad/s. Arguments are those of
        `jacobian`.

        Raises
        ------
        MechanismError
            If the task is one of joints, which has no output frame.
        """
        if self._x.frame is None:
            raise MechanismError(
                "a task of joints has no output frame; name one: Task(mechanism, frame=...)"
            )
        whole = self._whole(self._rows(q, self._nq, "q"), x, errors)
        found: Array = self._by_task.frame_jacobian(whole, self._x.frame, **options_of(errors))
        offset = self._x.placement.translation
        if not offset.any():
            return found
        turned = self._by_task.frame_placement(whole, self._x.frame, **options_of(errors))
        lever = (turned[..., :3, :3] @ offset)[..., None]
        # The origin's velocity is v + w x lever.
        linear = found[..., :3, :] + np.cross(found[..., 3:, :], lever, axis=-2)
        return np.concatenate([linear, found[..., 3:, :]], axis=-2)

    def wrench_map(
        self, q: ArrayLike, *, x: ArrayLike | None = None, errors: Errors = "raise"
    ) -> Array:
        """Return W, (..., na, 6): actuators' forces W w make the wrench w of the output frame.

        W = K^-T E', with E of `twist_map`; arguments are those of `jacobian`, and the wrench is
        that of `wrench_to_actuators`.

        Raises
        ------
        ClosureError, SingularityError, MechanismError
            As `forces_to_actuators` and `twist_map`.
        """
        twists = np.swapaxes(self.twist_map(q, x=x, errors=errors), -1, -2)
        return self._carried(self._gain(q, x, errors), twists, errors)

    def wrench_to_actuators(
        self, q: ArrayLike, wrench: ArrayLike, *, errors: Errors = "raise"
    ) -> Array:
        """Return the actuators' forces that make a wrench of the output frame, (..., na).

        Parameters
        ----------
        q
            Closed configurations, shape (..., nq).
        wrench
            (force, moment) that the frame exerts at its origin, in world axes, N and N m, shape
            (..., 6). Parts that the closures bear need no actuator.

        Raises
        ------
        ClosureError, SingularityError, MechanismError
            As `forces_to_actuators` and `twist_map`.
        """
        given = self._rows(wrench, 6, "wrench")
        return np.asarray(np.einsum("...ij,...j->...i", self.wrench_map(q, errors=errors), given))

    # Gains and inertia ----------------------------------------------------------------------------

    def gains_to_actuators(
        self,
        q: ArrayLike,
        gains: ArrayLike,
        *,
        forces: ArrayLike | None = None,
        x: ArrayLike | None = None,
        errors: Errors = "raise",
    ) -> Array:
        """Return stiffness or damping of the actuators that gives the task's, (..., na, na).

        G_a = K^-T (G_x - sum_i tau_i H_i) K^-1: G_x = K' G_a K + sum_i tau_i H_i, where the second
        term, only of stiffness, is that of actuators that push while K changes.

        Parameters
        ----------
        q
            Closed configurations, shape (..., nq).
        gains
            G_x, shape (..., m, m), or its diagonal, (m,): N/m, N m/rad (stiffness) or N s/m.
        forces
            The actuators' forces tau there, shape (..., na); zero if left out. For damping leave
            them out.
        x
            As for `jacobian`.

        Raises
        ------
        ClosureError
            If the loops are open.
        SingularityError
            If the actuators do not determine the task here.
        MechanismError
            If there are more actuators than coordinates: their gains are not determined.
        """
        K = self._square(q, x, errors)
        wanted = self._matrix(gains, self.size, "gains")
        if forces is not None:
            wanted = wanted - self._geometric(q, forces, x, errors)
        half = np.swapaxes(self._solved(np.swapaxes(K, -1, -2), wanted, errors), -1, -2)
        return np.swapaxes(self._solved(np.swapaxes(K, -1, -2), half, errors), -1, -2)

    def gains_to_task(
        self,
        q: ArrayLike,
        gains: ArrayLike,
        *,
        forces: ArrayLike | None = None,
        x: ArrayLike | None = None,
        errors: Errors = "raise",
    ) -> Array:
        """Return stiffness or damping of the task that the actuators' gives, (..., m, m).

        K' G_a K + sum_i tau_i H_i; see `gains_to_actuators`. ``gains`` are (..., na, na) or (na,).
        """
        K = self._gain(q, x, errors)
        found = np.swapaxes(K, -1, -2) @ self._matrix(gains, self._actuated.size, "gains") @ K
        return found if forces is None else found + self._geometric(q, forces, x, errors)

    def mass_matrix(
        self, q: ArrayLike, *, x: ArrayLike | None = None, errors: Errors = "raise"
    ) -> Array:
        """Return the task's mass matrix, shape (..., m, m): the kinetic energy is x' M x' / 2.

        Arguments are those of `jacobian`.
        """
        q_ = self._rows(q, self._nq, "q")
        whole = self._whole(q_, x, errors)
        return np.asarray(self._by_task.mass_matrix(whole, **options_of(errors)))

    # Polytopes ------------------------------------------------------------------------------------

    def force_polytope(
        self,
        q: ArrayLike,
        limits: tuple[ArrayLike, ArrayLike] | None = None,
        *,
        used: ArrayLike | None = None,
    ) -> polytope.Polytope:
        """Return the forces of the task that actuators within limits make, at one configuration.

        Parameters
        ----------
        q
            Closed configuration, shape (nq,).
        limits
            Least and largest forces of the actuators, shape (na,) each, N or N m; left out, the
            model's effort limits.
        used
            Forces that the actuators exert already, (na,), for weight as an example; zero if left
            out.

        Raises
        ------
        InputError
            If an actuator has no limit.
        ClosureError
            If the loops are open.
        SingularityError
            If the actuators do not determine the task here.
        """
        lower, upper = self._limits(limits, self.mechanism.model.effortLimit, "force")
        if used is not None:
            taken = self._rows(used, self._actuated.size, "used")
            lower, upper = lower - taken, upper - taken
        K = self._gain(self._one(q), None, "raise")
        return polytope.of_forces(K, lower, upper, 1 / self._units)

    def speed_polytope(
        self, q: ArrayLike, limits: tuple[ArrayLike, ArrayLike] | None = None
    ) -> polytope.Polytope:
        """Return the rates of the task that actuators within limits make, at one configuration.

        Parameters
        ----------
        q
            Closed configuration, shape (nq,).
        limits
            Least (negative) and largest speeds of the actuators, (na,) each; left out, the model's.

        Raises
        ------
        InputError, SingularityError
            As `force_polytope`.
        """
        lower, upper = self._limits(limits, self.mechanism.model.velocityLimit, "speed")
        if not ((lower < 0) & (upper > 0)).all():
            raise InputError("limits of speeds: the least must be negative, the largest positive")
        return polytope.of_speeds(self.jacobian(self._one(q)), lower, upper, self._units)

    def ellipsoids(self, q: ArrayLike, *, x: ArrayLike | None = None) -> Ellipsoids:
        """Return the semi-axes of the ellipsoids of forces and speeds; see `Ellipsoids`.

        Their lengths in one unit are the gains of a workspace, and the inverses of these. Arguments
        are those of `jacobian`.

        Raises
        ------
        ClosureError
            If the loops are open.
        SingularityError
            If the actuators do not determine the task here.
        """
        K = self.in_one_unit(self._gain(q, x, "raise"))
        return ellipsoids(K, self._units, self.mechanism.max_condition)

    # Singularities --------------------------------------------------------------------------------

    def singularities(self, q: ArrayLike) -> SingularityMeasures:
        """Return how far configurations are from singularities; see `singularity`.

        Parameters
        ----------
        q
            Closed configurations, shape (..., nq).
        """
        A, S, values = self._in_motions(self._rows(q, self._nq, "q"))
        inputs = np.linalg.svd(A, compute_uv=False)
        type_i = inputs[..., self.size - 1]
        regular = type_i > RANK_TOLERANCE * np.maximum(inputs[..., 0], 1.0)
        K = S @ np.linalg.pinv(A)
        gains = np.linalg.svd(K, compute_uv=False)
        square = K.shape[-2] == K.shape[-1]
        determinant = np.linalg.det(K) if square else np.prod(gains, axis=-1)
        enough = K.shape[-2] >= self.size  # actuators
        rank = self._rank
        return SingularityMeasures(
            np.asarray(type_i),
            np.where(regular, gains[..., -1] if enough else 0.0, np.nan),
            values[..., rank - 1] / values[..., 0] if rank else np.ones(A.shape[:-2]),
            np.where(regular, determinant, np.nan),
        )

    def position_limits(self) -> PositionLimits:
        """Return the limits of positions that a path is checked against; see `check_path`."""
        return JointRooms(self.mechanism)

    # Parts ----------------------------------------------------------------------------------------

    def _gain(self, q: ArrayLike, x: ArrayLike | None, errors: Errors) -> Array:
        """Return K for forces, which open loops have none of."""
        q_ = self._closed(q, errors)
        gone = np.isnan(q_[..., :1])
        if not gone.any():
            return self.jacobian(q_, x=x, errors=errors)
        K = self.jacobian(np.where(gone, self.mechanism.home, q_), x=x, errors=errors)
        return np.where(gone[..., None], np.nan, K)

    def _one(self, q: ArrayLike) -> Array:
        found = self._rows(q, self._nq, "q")
        if found.ndim != 1:
            raise InputError(f"q has shape {found.shape}; expected ({self._nq},)")
        return found

    def _matrix(self, given: ArrayLike, size: int, name: str) -> Array:
        found = numbers(given, name, f"numbers of shape (..., {size}, {size}), or ({size},)")
        if not np.isfinite(found).all():
            raise InputError(f"{name} holds numbers that are not finite")
        if found.shape == (size,):
            return np.diag(found)
        if found.shape[-2:] != (size, size):
            raise InputError(
                f"{name} has shape {found.shape}; expected (..., {size}, {size}) or ({size},)"
            )
        return found

    def _geometric(
        self, q: ArrayLike, forces: ArrayLike, x: ArrayLike | None, errors: Errors
    ) -> Array:
        """Return sum_i tau_i H_i, shape (..., m, m)."""
        tau = self._rows(forces, self._actuated.size, "forces")
        return np.asarray(np.einsum("...ijk,...i->...jk", self.hessian(q, x=x, errors=errors), tau))

    def _square(self, q: ArrayLike, x: ArrayLike | None, errors: Errors) -> Array:
        if self._actuated.size != self.size:
            raise MechanismError(
                f"{self._actuated.size} actuators have no determined gains of {self.size} "
                "coordinates"
            )
        return self._gain(q, x, errors)

    def _carried(self, K: Array, f: Array, errors: Errors) -> Array:
        """Return tau with K' tau = f, of least norm in one unit; f (..., m, k)."""
        if self._actuated.size < self.size:
            raise MechanismError(
                f"{self._actuated.size} actuators do not make all forces of {self.size} coordinates"
            )
        return self._solved(np.swapaxes(K, -1, -2), f, errors)

    def _solved(self, matrix: Array, right: Array, errors: Errors) -> Array:
        """Return X with matrix X = right, matrix (..., m, na) = K'; checked in one unit."""
        of_actuators = self.mechanism.velocity_scale[self._actuated]
        scaled = np.swapaxes(self.in_one_unit(np.swapaxes(matrix, -1, -2)), -1, -2)
        values = np.linalg.svd(np.nan_to_num(scaled), compute_uv=False)
        limit = self.mechanism.max_condition
        bad = np.atleast_1d(values[..., -1] * limit < values[..., 0])
        if bad.any() and errors == "raise":
            largest = float((values[..., 0] / np.maximum(values[..., -1], 1e-300)).max())
            raise SingularityError(
                "the actuators do not determine the task here: d(actuators)/d(task) has the "
                f"condition number {largest:.3g}, above {limit:.3g}",
                largest,
                limit,
            )
        if bad.any():
            scaled = np.where(bad.reshape(values.shape[:-1])[..., None, None], np.nan, scaled)
        inverse = _pseudo_inverse(scaled)
        found: Array = (inverse / of_actuators[:, None] * self._units) @ right
        return found

    def _limits(
        self, given: tuple[ArrayLike, ArrayLike] | None, of_model: Array, what: str
    ) -> tuple[Array, Array]:
        """Return the least and largest of a quantity of the actuators, (na,) each."""
        if given is None:
            upper = np.asarray(of_model, dtype=np.float64)[self._actuated]
            lower = -upper
        else:
            size = self._actuated.size
            lower, upper = (numbers(one, "limits", f"{size} numbers each") for one in given)
            if lower.shape != (size,) or upper.shape != (size,):
                raise InputError(
                    f"limits have shapes {lower.shape} and {upper.shape}; expected ({size},) each"
                )
        endless = ~(np.isfinite(lower) & np.isfinite(upper))
        if endless.any():
            name = self.mechanism.actuated[int(np.flatnonzero(endless)[0])]
            raise InputError(f"actuator {name!r} has no {what} limit; give limits=(least, largest)")
        if not (lower < upper).all():
            raise InputError("limits: the least must be below the largest")
        return lower, upper


def _pseudo_inverse(matrix: Array) -> Array:
    """Return the pseudo-inverse of matrices; NaN of those that hold NaN."""
    found = np.linalg.pinv(np.nan_to_num(matrix))
    return np.asarray(found + 0.0 * np.swapaxes(matrix.sum(axis=(-2, -1), keepdims=True), -1, -2))

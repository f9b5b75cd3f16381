"""A mechanism in generated code: the names, arguments, results and errors of `ClosedLoopModel`.

Every array argument takes leading batch dimensions, which are broadcast. Generated code answers
with a status for each sample; what it flags (numbers that are not finite, open loops, a nearly
singular configuration) is handed to the Pinocchio engine, which answers or raises.
"""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache, partial
from typing import Any, Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.closed_loop.assembly.every.found_modes import FoundModes
from rps_pin.closed_loop.assembly.modes import assembly_modes
from rps_pin.closed_loop.constraints.closures import Closure
from rps_pin.closed_loop.constraints.equations import LoopErrors
from rps_pin.closed_loop.constraints.unit_parts import normalised, unit_parts
from rps_pin.closed_loop.dynamics import least_effort
from rps_pin.closed_loop.dynamics.derivatives import (
    ForwardDynamicsDerivatives,
    InverseDynamicsDerivatives,
    Linearisation,
    linearisation,
)
from rps_pin.closed_loop.dynamics.passive_joint_forces import JointEffects
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.closed_loop.simulation.damped import STIFF, viscous_rate
from rps_pin.closed_loop.simulation.result import Simulation
from rps_pin.closed_loop.simulation.stepper import Stepper
from rps_pin.closed_loop.summary import in_one_line
from rps_pin.codegen.engine.actuated import actuated_coordinates, continued_coordinates
from rps_pin.codegen.engine.applied import with_parameters
from rps_pin.codegen.engine.batches import Errors, by_samples, settled
from rps_pin.codegen.engine.forces import GeneratedForces, each, kept
from rps_pin.codegen.engine.generated import GeneratedCode
from rps_pin.codegen.engine.simulation import simulate
from rps_pin.codegen.expressions.functions import UNDER_WRENCHES
from rps_pin.codegen.expressions.routines import BLOCK
from rps_pin.errors import InputError, RPSPinError, SingularityError
from rps_pin.numerics.linear_algebra import condition_number
from rps_pin.validation import (
    choice,
    numbers,
    positive_number,
    read_only,
    real_vector,
    whole_number,
)

_NO_PARAMETERS = "the mechanism was compiled without parameters; name them in compile"
#: Answers of the Pinocchio engine for one sample, in the order of a function's outputs.
Reference = Callable[..., Sequence[Any]]


class CompiledMechanism:
    """Generated code of a mechanism; made by `ClosedLoopModel.compile`, which tells its options.

    One object serves any number of threads.

    Methods have the names, arguments and errors of `ClosedLoopModel`, with these additions: array
    arguments have leading batch dimensions, and results have them too; ``parameters`` gives the
    parameters' numbers, shape (..., np), instead of the nominal ones; ``threads`` computes a batch
    on so many; ``errors="mask"`` makes samples that fail NaN instead of raising the first one's
    error. What the Pinocchio engine has and this object has not is in ``mechanism``.

    Attributes
    ----------
    mechanism : ClosedLoopModel
        What the code was generated from. Its scratch memory is not used here.
    code : GeneratedCode
        The functions, their libraries and proofs.
    """

    def __init__(self, code: GeneratedCode) -> None:
        self.code, self.mechanism = code, code.mechanism
        self._codes: dict[tuple[str, ...], GeneratedCode] = {code.wrench_frames: code}
        self._lock, self._local = threading.Lock(), threading.local()
        self._plain = not (code.parameters or code.wrench_frames)
        self._calls, self._single = _Calls(code), _Single(code)
        self._is_actuated = code.partition.is_actuated
        self._chosen: dict[tuple[str, ...], bool] = {}  # whether these are the independent joints
        self._unit_parts = unit_parts(self.mechanism.model)
        self._underactuated = code.partition.actuated_rank < code.partition.independent.size

    def __copy__(self) -> CompiledMechanism:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> CompiledMechanism:
        """Return this one: it has no state, and serves any number of threads."""
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Refuse to be sent to another process, where the code is not loaded."""
        raise RPSPinError(
            f"a {type(self).__name__} cannot be pickled: pickle the mechanism, and compile it again"
        )

    def __repr__(self) -> str:
        return in_one_line(type(self).__name__, self.name, self.mechanism.system)

    def __str__(self) -> str:
        """Of the mechanism, and what compiled its functions."""
        built = ", ".join(f"{group} by {by}" for group, by in self.compilers.items())
        return f"{self.reference()}\ncompiled: {built or 'nothing yet'}"

    # Structure ------------------------------------------------------------------------------------

    @property
    def model(self) -> pin.Model:
        """The open tree."""
        return self.mechanism.model

    @property
    def closures(self) -> tuple[Closure, ...]:
        """The loop closures."""
        return self.mechanism.closures

    @property
    def actuated(self) -> tuple[str, ...]:
        """Names of the actuated joints."""
        return self.mechanism.actuated

    @property
    def actuated_indices(self) -> Indices:
        """Indices of the actuated joints in a velocity vector, shape (na,)."""
        return self.mechanism.actuated_indices

    @property
    def name(self) -> str:
        """The mechanism's name."""
        return self.mechanism.name

    @property
    def effects(self) -> JointEffects | None:
        """Damping, friction and springs of the joints."""
        return self.mechanism.effects

    @property
    def characteristic_length(self) -> float:
        """Length that makes angles and lengths comparable, m."""
        return self.mechanism.characteristic_length

    @property
    def max_condition(self) -> float:
        """Condition number above which `SingularityError` is raised."""
        return self.mechanism.max_condition

    @property
    def home(self) -> Array:
        """Closed configuration to start from, shape (nq,); a copy."""
        return self.reference().home

    @property
    def constraint_size(self) -> int:
        """Number of closure rows, nc."""
        return self.mechanism.constraint_size

    @property
    def parameters(self) -> tuple[str, ...]:
        """What each of the parameters is, in order; empty if none were named."""
        return self.code.labels

    @property
    def nominal_parameters(self) -> Array:
        """The parameters' numbers of the mechanism as it is, shape (np,)."""
        return self.code.nominal.copy()

    def parameter_values(self, changes: Mapping[str, ArrayLike]) -> Array:
        """Return the parameters' numbers with some changed, shape (np,).

        Parameters
        ----------
        changes
            New numbers: by label, as in `parameters`, or all of a group by its name.

        Raises
        ------
        InputError
            If there is no such label or group, or its numbers do not fit.
        """
        return self.code.parameter_values(changes)

    @property
    def compilers(self) -> dict[str, str]:
        """What compiled each group of functions that is in use now."""
        return {group: library.compiler for group, library in self.code.libraries.items()}

    def wait(self) -> None:
        """Wait for a better compiler's code that is being built in the background.

        Raises
        ------
        CompileError
            If that build failed; the code in use stays in use.
        """
        self.code.wait()

    def rows(self, closure: str) -> slice:
        """Return the rows of a closure, by its name; see `ClosedLoopModel.rows`."""
        return self.mechanism.rows(closure)

    # Position -------------------------------------------------------------------------------------

    def gaps(self, q: ArrayLike, **options: Any) -> Array:
        """Return the gaps of the closures' rows, m and rad, shape (..., nc)."""

        def answer(m: ClosedLoopModel, q: Array) -> Sequence[Any]:
            return (m.loop_errors(q).position,)

        return self._one("gaps", (q,), answer, **options)

    def loop_gap(self, q: ArrayLike, **options: Any) -> Any:
        """Return the largest gap between two closed frames, m, float or (...)."""
        gaps = self.gaps(q, **options)
        equations = self.mechanism.system.equations
        if gaps.ndim == 1:
            return equations.largest_gap(gaps)
        batch = gaps.shape[:-1]
        largest = [equations.largest_gap(gaps[index]) for index in np.ndindex(batch)]
        return np.array(largest, dtype=np.float64).reshape(batch)

    def loop_errors(
        self,
        q: ArrayLike,
        v: ArrayLike | None = None,
        a: ArrayLike | None = None,
        **options: Any,
    ) -> LoopErrors:
        """Return gaps, their rates and accelerations, (..., nc) each; by the Pinocchio engine."""

        def answer(m: ClosedLoopModel, q: Array, v: Array, a: Array) -> Sequence[Any]:
            return m.loop_errors(q, v, a)

        still = np.zeros(self.model.nv)
        given = (q, still if v is None else v, still if a is None else a)
        shapes = [(self.constraint_size,)] * 3
        return LoopErrors(*self._by_samples(answer, given, shapes, **options))

    def condition(self, q: ArrayLike, **options: Any) -> Any:
        """Return condition numbers of J_p, float or (...); see `ClosedLoopModel.condition`.

        By the Pinocchio engine where the actuated joints leave motions open, or are more.
        """
        if self._is_actuated:
            condition = partial(condition_number, tolerance=self.mechanism.system.rule.tolerance)
            return each(condition, self.passive_jacobian(q, **options), float)
        found = self._by_samples(lambda m, q: (m.condition(q),), (q,), [()], **options)[0]
        return found if np.ndim(found) else float(found)

    def jacobian(self, q: ArrayLike, **options: Any) -> Array:
        """Return J, shape (..., nc, nv); see `ClosedLoopModel.jacobian`."""
        return self._one("jacobian", (q,), lambda m, q: (m.jacobian(q),), **options)

    def close(
        self,
        q_guess: ArrayLike,
        *,
        fixed: Sequence[str] = (),
        within_limits: bool = True,
        restarts: int = 20,
        **options: Any,
    ) -> Array:
        """Return closed configurations near guesses, shape (..., nq); see `ClosedLoopModel.close`.

        Newton's steps of least norm, in generated code; where they do not close the loops, or leave
        the joint limits, or joints are fixed, as the Pinocchio engine does.
        """

        def answer(m: ClosedLoopModel, q: Array) -> Sequence[Any]:
            return (m.close(q, fixed=fixed, within_limits=within_limits, restarts=restarts), 0.0)

        whole_number(restarts, "restarts", 0)
        if fixed:
            return self._by_one(answer, (q_guess,), **options)
        return self._closed(
            "closed_near", (self._normalised(q_guess),), answer, within_limits, options
        )

    def project(self, q_guess: ArrayLike, *, within_limits: bool = True, **options: Any) -> Array:
        """Return the closed configurations nearest to guesses, shape (..., nq).

        As `ClosedLoopModel.project`; where the nearest one is outside the joint limits, the
        Pinocchio engine answers.
        """

        def answer(m: ClosedLoopModel, q: Array) -> Sequence[Any]:
            return (m.project(q, within_limits=within_limits), np.zeros(1))

        return self._closed("nearest", (self._normalised(q_guess),), answer, within_limits, options)

    def complete(
        self,
        values: Mapping[str, ArrayLike] | ArrayLike,
        q_guess: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        jump: bool = False,
        restarts: int = 20,
        **options: Any,
    ) -> Array:
        """Return the closed configurations in which some joints have given values, (..., nq).

        As `ClosedLoopModel.complete`; generated code where the values are those of the actuated
        joints, and these determine the motion. It halves its steps along the way where Newton's
        steps do not contract; where a step would be less than 1/64 of what is left, the Pinocchio
        engine follows it. A batch of values is an array (..., na) of the actuated joints'; by name,
        one value for each joint.
        """
        ordered: Any = values
        whole_number(restarts, "restarts", 0)
        given: dict[str, Any] = {"within_limits": within_limits, "jump": jump}
        # A path that ends is masked whatever else there is: nothing is looked for to tell of it.
        given["restarts"] = restarts if jump or options.get("errors") != "mask" else 0
        guess = self.reference().home if q_guess is None else self._normalised(q_guess)
        if isinstance(values, Mapping):
            if any(np.ndim(one) for one in values.values()) or set(values) != set(self.actuated):
                return self._by_one(
                    lambda m, q: (m.complete(values, q, **given),), (guess,), **options
                )
            ordered = [float(np.asarray(values[name])) for name in self.actuated]
        count = len(self.actuated)
        asked = numbers(ordered, "values", f"numbers of shape (..., {count})")
        if asked.shape[-1:] != (count,):
            raise InputError(f"values has shape {asked.shape}; expected (..., {count})")

        def answer(m: ClosedLoopModel, q: Array, wanted: Array) -> Sequence[Any]:
            return (m.complete(wanted[at], q, **given),)

        at = self._actuated_coordinates
        if at is None:
            return self._by_one(
                lambda m, q, x: (m.complete(x, q, **given),), (guess, asked), **options
            )
        batch = np.broadcast_shapes(asked.shape[:-1], guess.shape[:-1])
        wanted = np.broadcast_to(guess, (*batch, self.model.nq)).copy()
        wanted[..., at] = asked
        if self._continued_coordinates is None:
            return self._by_one(answer, (guess, wanted), **options)
        if jump:
            return self._closed(
                "closed", (wanted,), lambda m, q: (*answer(m, q, q), 0.0), within_limits, options
            )
        return self._closed("completed", (guess, wanted), answer, within_limits, options)

    def continued(
        self, values: Array, q: Array, parameters: Array | None = None
    ) -> tuple[Array, Bools]:
        """Return what `complete` finds by generated code alone, (n, nq), and of which samples.

        Closed configurations (n, nq) are continued to the actuated joints' values (n, na). Samples
        that are not reached cost some microseconds, not the Pinocchio engine's 50 ms; what is
        returned of them has no meaning.
        """
        at = self._continued_coordinates
        if at is None:
            options: dict[str, Any] = {"restarts": 0, "errors": "mask", "parameters": parameters}
            found = self.complete(values, q, within_limits=False, **options)
            return found, np.asarray(np.isfinite(found).all(axis=-1))
        wanted = q.copy()
        wanted[:, at] = values
        given = (q, wanted, *self._extra("completed", None, parameters))
        found, *_, status = self._generated(None)["completed"](*given)
        return found, np.asarray(status) == 0

    def assembly_modes(
        self,
        values: Mapping[str, ArrayLike] | ArrayLike | None = None,
        q_guess: ArrayLike | None = None,
        **options: Any,
    ) -> FoundModes:
        """Return the closed configurations with given joint values.

        As `ClosedLoopModel.assembly_modes`, with its options. A search has the same starts, with
        gaps and Jacobians by generated code.
        """

        def equations(q: Array) -> tuple[Array, Array]:
            return self.gaps(q), self.jacobian(q)

        mechanism = self.reference()
        guess = mechanism.search_start(q_guess)
        return assembly_modes(mechanism.system, values, guess, equations=equations, **options)

    def _by_one(self, answer: Reference, given: Sequence[ArrayLike], **options: Any) -> Array:
        """Return the Pinocchio engine's configurations, from where it starts."""
        shapes = [(self.model.nq,)]
        found = self._by_samples(lambda m, *q: answer(m, *q)[:1], given, shapes, **options)
        return np.asarray(found[0])

    def _closed(
        self,
        name: str,
        given: Sequence[Array],
        answer: Reference,
        within_limits: bool,
        options: Any,
    ) -> Array:
        """Return what a routine of Newton's steps finds, if that is within the limits."""
        limits = self.mechanism.system.limits

        def outside(q: Array) -> Any:
            return limits.beyond(q).any(axis=-1)

        refused = outside if within_limits and limits.q.size else None
        return np.asarray(self._run(name, given, answer, refused=refused, **options)[0])

    @cached_property
    def _actuated_coordinates(self) -> Indices | None:
        """Where the actuated joints are in q; None if one has not one coordinate of its own."""
        return actuated_coordinates(self.code)

    @cached_property
    def _continued_coordinates(self) -> Indices | None:
        """The same where generated code continues by them."""
        return continued_coordinates(self.code)

    def _normalised(self, q: ArrayLike) -> Array:
        """Return configurations with quaternions of unit length."""
        nq = self.model.nq
        given = numbers(q, "q_guess", f"numbers of shape (..., {nq})")
        if given.shape[-1:] != (nq,):
            raise InputError(f"q_guess has shape {given.shape}; expected (..., {nq})")
        if given.ndim == 1:
            return self.mechanism.system.normalised(given, "q_guess")
        return normalised(given, self._unit_parts, "q_guess")

    # Velocity and acceleration --------------------------------------------------------------------

    def motion_basis(
        self, q: ArrayLike, independent: Sequence[str] | None = None, **options: Any
    ) -> Array:
        """Return T, shape (..., nv, m); see `ClosedLoopModel.motion_basis`."""

        def answer(m: ClosedLoopModel, q: Array) -> Sequence[Any]:
            return (m.motion_basis(q, independent),)

        return self._independently("motion_basis", (q,), answer, independent, options)

    def velocity(
        self,
        q: ArrayLike,
        v_actuated: ArrayLike,
        independent: Sequence[str] | None = None,
        **options: Any,
    ) -> Array:
        """Return velocities that keep the loops closed, (..., nv); see `ClosedLoopModel`."""

        def answer(m: ClosedLoopModel, q: Array, u: Array) -> Sequence[Any]:
            return (m.velocity(q, u, independent),)

        return self._independently("velocity", (q, v_actuated), answer, independent, options)

    def acceleration(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a_actuated: ArrayLike,
        independent: Sequence[str] | None = None,
        **options: Any,
    ) -> Array:
        """Return accelerations that keep the loops closed, (..., nv); see `ClosedLoopModel`."""

        def answer(m: ClosedLoopModel, q: Array, v: Array, w: Array) -> Sequence[Any]:
            return (m.acceleration(q, v, w, independent),)

        given = (q, v, a_actuated)
        return self._independently("acceleration", given, answer, independent, options)

    def frame_placement(self, q: ArrayLike, frame: str, **options: Any) -> Array:
        """Return homogeneous placements of a frame, (..., 4, 4); see `ClosedLoopModel`."""

        def answer(m: ClosedLoopModel, q: Array) -> Sequence[Any]:
            return (m.frame_placement(q, frame),)

        name = f"frame_{self.mechanism.system.frame(frame)}"
        return np.asarray(self._run(name, (q,), answer, **options)[0])

    def frame_jacobian(
        self,
        q: ArrayLike,
        frame: str,
        independent: Sequence[str] | None = None,
        *,
        axes: Literal["world", "frame"] = "world",
        **options: Any,
    ) -> Array:
        """Return closed-loop Jacobians of a frame, (..., 6, m); see `ClosedLoopModel`."""
        choice(axes, "axes", ("world", "frame"))

        def answer(m: ClosedLoopModel, q: Array) -> Sequence[Any]:
            return (m.frame_jacobian(q, frame, independent, axes=axes),)

        def world(m: ClosedLoopModel, q: Array) -> Sequence[Any]:
            return m.frame_placement(q, frame), m.frame_jacobian(q, frame, independent)

        if not self._has(independent):
            shapes = [(6, self._mobility(independent))]
            return np.asarray(self._by_samples(answer, (q,), shapes, **options)[0])
        name = f"frame_jacobian_{self.mechanism.system.frame(frame)}"
        placement, jacobian = self._run(name, (q,), world, **options)
        if axes == "world":
            return np.asarray(jacobian)
        turn = np.swapaxes(placement[..., :3, :3], -1, -2)
        return np.concatenate([turn @ jacobian[..., :3, :], turn @ jacobian[..., 3:, :]], axis=-2)

    # Inverse dynamics -----------------------------------------------------------------------------

    def inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        parameters: ArrayLike | None = None,
        errors: Errors = "raise",
        threads: int = 1,
    ) -> GeneratedForces:
        """Return the forces of motions; see `ClosedLoopModel.inverse_dynamics`."""
        usual = wrenches is None and parameters is None and threads == 1
        usual = usual and errors.__class__ is str and errors == "raise"
        if usual and not self._underactuated:
            single = self._single.inverse_dynamics(q, v, a)
            if single and not single[-1]:
                at = q.copy(), None  # type: ignore[union-attr]
                return GeneratedForces(single[0], single[1], single[2], None, (self, at, None))

        def answer(m: ClosedLoopModel, q: Array, v: Array, a: Array, w: Any) -> Sequence[Any]:
            result = m.inverse_dynamics(q, v, a, wrenches=w)
            lacking = result.unproduced is not None
            found = [result.tau, result.constraint_forces, np.array([result.residual])]
            unproduced = result.unproduced if lacking else np.zeros(m.model.nv)
            return [*found, unproduced, np.array([float(lacking)])]

        # Generated code has no such force where there are enough actuators; at singular poses of
        # more motions the Pinocchio engine has.
        singular = () if self._underactuated else (self.model.nv, 1)
        tau, multipliers, residual, *rest = self._run(
            "inverse_dynamics",
            (q, v, a),
            answer,
            wrenches,
            parameters=parameters,
            errors=errors,
            threads=threads,
            more=singular,
        )
        unproduced = None
        if rest:
            lacking = ~(rest[1][..., 0] <= least_effort.RESIDUAL**2)  # NaN without an answer
            if np.any(lacking):
                unproduced = np.where(lacking[..., None], rest[0], 0.0)
        numbers_ = None if parameters is None else np.array(parameters, dtype=np.float64)
        here = self, kept(np.asarray(q, dtype=np.float64)), numbers_
        return GeneratedForces(tau, multipliers, residual, unproduced, here)

    def passive_jacobian(self, q: ArrayLike, **options: Any) -> Array:
        """Return J_p, all entries in one unit, shape (..., nc, np)."""
        system = self.mechanism.system
        rows, columns, _ = system.factorisation.scales
        jacobian = self.jacobian(q, **options)[..., system.passive]
        return np.asarray(rows * jacobian * columns)

    def generalised_force(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        **options: Any,
    ) -> Array:
        """Return S' tau + J' lambda, (..., nv); see `ClosedLoopModel.generalised_force`."""

        def answer(m: ClosedLoopModel, q: Array, v: Array, a: Array, w: Any) -> Sequence[Any]:
            return (m.generalised_force(q, v, a, wrenches=w),)

        return self._one("generalised_force", (q, v, a), answer, wrenches, **options)

    def constraint_forces(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        tau: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        **options: Any,
    ) -> Array:
        """Return lambda of motions under forces, (..., nc); see `ClosedLoopModel`."""

        def answer(
            m: ClosedLoopModel, q: Array, v: Array, a: Array, tau: Array, w: Any
        ) -> Sequence[Any]:
            return (m.constraint_forces(q, v, a, tau, wrenches=w),)

        return self._one("constraint_forces", (q, v, a, tau), answer, wrenches, **options)

    # Forward dynamics -----------------------------------------------------------------------------

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        **options: Any,
    ) -> Array:
        """Return accelerations under actuator forces, (..., nv); see `ClosedLoopModel`."""
        if not (wrenches or options):
            single = self._single.forward_dynamics(q, v, tau)
            if single and not single[1]:
                return single[0]  # type: ignore[no-any-return]

        def answer(m: ClosedLoopModel, q: Array, v: Array, tau: Array, w: Any) -> Sequence[Any]:
            return (m.forward_dynamics(q, v, tau, wrenches=w),)

        return self._one("forward_dynamics", (q, v, tau), answer, wrenches, **options)

    def mass_matrix(
        self, q: ArrayLike, independent: Sequence[str] | None = None, **options: Any
    ) -> Array:
        """Return T' M T, shape (..., m, m); see `ClosedLoopModel.mass_matrix`."""

        def answer(m: ClosedLoopModel, q: Array) -> Sequence[Any]:
            return (m.mass_matrix(q, independent),)

        return self._independently("mass_matrix", (q,), answer, independent, options)

    def bias(
        self, q: ArrayLike, v: ArrayLike, independent: Sequence[str] | None = None, **options: Any
    ) -> Array:
        """Return the reduced bias, shape (..., m); see `ClosedLoopModel.bias`."""

        def answer(m: ClosedLoopModel, q: Array, v: Array) -> Sequence[Any]:
            return (m.bias(q, v, independent),)

        return self._independently("bias", (q, v), answer, independent, options)

    def gravity_forces(
        self, q: ArrayLike, independent: Sequence[str] | None = None, **options: Any
    ) -> Array:
        """Return the forces that carry the weight, (..., m); see `ClosedLoopModel`."""

        def answer(m: ClosedLoopModel, q: Array) -> Sequence[Any]:
            return (m.gravity_forces(q, independent),)

        return self._independently("gravity_forces", (q,), answer, independent, options)

    def energy(self, q: ArrayLike, v: ArrayLike, **options: Any) -> tuple[Any, Any]:
        """Return kinetic and potential energy, J, floats or (...); see `ClosedLoopModel.energy`."""

        def answer(m: ClosedLoopModel, q: Array, v: Array) -> Sequence[Any]:
            return (np.array(m.energy(q, v)),)

        both = self._one("energy", (q, v), answer, **options)
        if both.ndim == 1:
            return float(both[0]), float(both[1])
        return both[..., 0], both[..., 1]

    # Wrenches, by the Pinocchio engine ------------------------------------------------------------

    def closure_wrenches(
        self, q: ArrayLike, constraint_forces: ArrayLike, **options: Any
    ) -> dict[str, Array]:
        """Return the wrench in each closure of frames, (..., 6), by name.

        See `ClosedLoopModel.closure_wrenches`; by the Pinocchio engine, sample by sample.
        """
        closures = self.mechanism.system.equations.closed_frames
        names = [closed.closure.name for closed in closures]

        def answer(m: ClosedLoopModel, q: Array, multipliers: Array) -> Sequence[Any]:
            found = m.closure_wrenches(q, multipliers)
            return [found[name] for name in names]

        shapes = [(6,)] * len(names)
        found = self._by_samples(answer, (q, constraint_forces), shapes, **options)
        return dict(zip(names, found, strict=True))

    def joint_wrenches(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        constraint_forces: ArrayLike,
        *,
        axes: Literal["world", "joint"] = "joint",
        **options: Any,
    ) -> dict[str, Array]:
        """Return the wrench that each joint of the tree carries, (..., 6), by name.

        See `ClosedLoopModel.joint_wrenches`; by the Pinocchio engine, sample by sample.
        """
        choice(axes, "axes", ("world", "joint"))
        names = list(self.model.names)[1:]

        def answer(m: ClosedLoopModel, *given: Any) -> Sequence[Any]:
            *motion, wrenches = given
            found = m.joint_wrenches(*motion, wrenches=wrenches, axes=axes)
            return [found[name] for name in names]

        given, shapes = (q, v, a, constraint_forces), [(6,)] * len(names)
        found = self._by_samples(answer, given, shapes, True, **options)
        return dict(zip(names, found, strict=True))

    # Derivatives ----------------------------------------------------------------------------------

    def inverse_dynamics_derivatives(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        **options: Any,
    ) -> InverseDynamicsDerivatives:
        """Return derivatives of actuator forces, (..., rows, columns); see `ClosedLoopModel`."""
        if wrenches is None and not options and self._is_actuated:
            single = self._single.inverse_dynamics_derivatives(q, v, a)
            if single and not single[-1]:
                return InverseDynamicsDerivatives._make(single[:-1])

        def answer(m: ClosedLoopModel, q: Array, v: Array, a: Array, w: Any) -> Sequence[Any]:
            return m.inverse_dynamics_derivatives(q, v, a, wrenches=w)

        if not self.code.partition.is_actuated:
            m, nv = len(self.actuated_indices), self.model.nv
            shapes = [(m, nv)] * 3 + [(m, m)] * 3
            given = (q, v, a)
            found = self._by_samples(answer, given, shapes, True, wrenches=wrenches, **options)
        else:
            name, given = "inverse_dynamics_derivatives", (q, v, a)
            found = self._run(name, given, answer, wrenches, **options)
        return InverseDynamicsDerivatives(*found)

    def forward_dynamics_derivatives(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        independent: Sequence[str] | None = None,
        *,
        wrenches: Wrenches | None = None,
        **options: Any,
    ) -> ForwardDynamicsDerivatives:
        """Return derivatives of the acceleration, (..., rows, columns); see `ClosedLoopModel`."""
        if wrenches is None and not options and self._has(independent):
            single = self._single.forward_dynamics_derivatives(q, v, tau)
            if single and not single[-1]:
                return ForwardDynamicsDerivatives._make(single[:-1])

        def answer(m: ClosedLoopModel, q: Array, v: Array, tau: Array, w: Any) -> Sequence[Any]:
            return m.forward_dynamics_derivatives(q, v, tau, independent, wrenches=w)

        given = (q, v, tau)
        if not self._has(independent):
            na, nv, m = len(self.actuated_indices), self.model.nv, self._mobility(independent)
            shapes = [(nv, nv), (nv, nv), (nv, na), (m, m), (m, m), (m, na)]
            found = self._by_samples(answer, given, shapes, True, wrenches=wrenches, **options)
        else:
            found = self._run("forward_dynamics_derivatives", given, answer, wrenches, **options)
        return ForwardDynamicsDerivatives(*found)

    def linearize(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        independent: Sequence[str] | None = None,
        **options: Any,
    ) -> Linearisation:
        """Return A (..., 2 m, 2 m) and B (..., 2 m, na); see `ClosedLoopModel.linearize`."""
        found = self.forward_dynamics_derivatives(q, v, tau, independent, **options)
        return linearisation(found)

    # By parameters --------------------------------------------------------------------------------

    def gaps_by_parameters(self, q: ArrayLike, **options: Any) -> Array:
        """Return the gaps' derivatives by the parameters, q held, shape (..., nc, np)."""
        return self._by_parameters("gaps_by_parameters", (q,), "loop_errors", None, options)

    def inverse_dynamics_by_parameters(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        **options: Any,
    ) -> Array:
        """Return the actuator forces' derivatives by the parameters, shape (..., na, np).

        The actuated joints' positions, velocities and accelerations are held, and the rest of the
        mechanism follows with its loops closed: the derivatives of the forces that the same motion
        of the actuators takes. Where these do not determine the motion, they are those of the
        forces T' f at the independent velocities, shape (..., m, np).

        Raises
        ------
        InputError
            If the mechanism was compiled without parameters.
        SingularityError
            If a configuration is singular or nearly.
        """
        name, given = "inverse_dynamics_by_parameters", (q, v, a)
        return self._by_parameters(name, given, "inverse_dynamics", wrenches, options)

    def forward_dynamics_by_parameters(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        **options: Any,
    ) -> Array:
        """Return the independent accelerations' derivatives by the parameters, (..., m, np).

        Forces, and the independent joints' positions and velocities, are held; see
        `inverse_dynamics_by_parameters`.
        """
        name, given = "forward_dynamics_by_parameters", (q, v, tau)
        return self._by_parameters(name, given, "forward_dynamics", wrenches, options)

    def _by_parameters(
        self,
        name: str,
        given: Sequence[ArrayLike],
        answered: str,
        wrenches: Wrenches | None,
        options: Any,
    ) -> Array:
        if not self.code.parameters:
            raise InputError(_NO_PARAMETERS)

        def answer(m: ClosedLoopModel, *arrays: Any) -> Sequence[Any]:
            getattr(m, answered)(*arrays[:3])  # which says what is wrong, if it is wrong
            raise SingularityError(
                "the configuration is too nearly singular for derivatives by parameters",
                math.inf,
                m.max_condition,
            )

        return self._one(name, given, answer, wrenches, **options)

    # Simulation -----------------------------------------------------------------------------------

    def step(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        duration: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        **options: Any,
    ) -> tuple[Array, Array]:
        """Return closed q (..., nq) and v (..., nv) after one step under constant actuator forces.

        Of order 4, as `Stepper.advance` takes it; the dependent joints are closed, the independent
        ones stay. Where the damping at home is stiff for the step, the Pinocchio engine takes it.
        """
        longest: Any = duration
        if duration.__class__ is not float:
            longest = np.max(numbers(duration, "duration", "positive numbers of s"), initial=0.0)
        stiff = bool(longest * self._damping_rate > 0.5 * STIFF)
        if duration.__class__ is float and not (wrenches or options or stiff):
            single = self._single.step(q, v, tau, _length(duration))
            if single and not single[-1]:
                return single[0], single[1]

        def answer(
            m: ClosedLoopModel, q: Array, v: Array, tau: Array, h: Array, w: Any
        ) -> Sequence[Any]:
            stepper = Stepper(m, q, v, wrenches=w)
            stepper.advance(tau, float(h[0]))
            return stepper.q, stepper.v, np.nan

        h = numbers(duration, "duration", "positive numbers of s")[..., None]
        if not np.all((h > 0) & (h < np.inf)):
            if h.ndim == 1:
                positive_number(duration, "duration", "s")
            raise InputError("duration: all must be positive numbers of s, finite")
        if stiff:
            shapes = [(self.model.nq,), (self.model.nv,), ()]
            given = (q, v, tau, h)
            found = self._by_samples(answer, given, shapes, True, wrenches=wrenches, **options)
        else:
            found = self._run("step", (q, v, tau, h), answer, wrenches, **options)
        return found[0], found[1]

    @cached_property
    def _damping_rate(self) -> float:
        """Largest rate at which viscous damping takes speeds away at home, 1/s, or 0."""
        try:
            return viscous_rate(self.reference().system, self.home)
        except RPSPinError:
            return 0.0

    def steps(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        duration: float,
        count: int,
        *,
        wrenches: Wrenches | None = None,
        **options: Any,
    ) -> tuple[Array, Array]:
        """Return the states after each of many steps under constant forces, many in one call of C.

        Parameters
        ----------
        q, v, tau, wrenches
            As for `step`.
        duration
            Of one step, s.
        count
            Of steps.

        Returns
        -------
        q, v : arrays
            Shapes (..., count, nq) and (..., count, nv).
        """
        h = np.full(BLOCK, positive_number(duration, "duration", "s"))
        states: list[tuple[Array, Array]] = []
        left = whole_number(count, "count")
        while left:
            whole = left >= BLOCK and not options and duration * self._damping_rate <= 0.5 * STIFF
            found = self.generated("steps", wrenches, None, q, v, tau, h) if whole else None
            if found is not None and not np.any(found[-1]):
                qs, vs = (one.reshape(*one.shape[:-1], BLOCK, -1) for one in found[:2])
            else:  # one by one: options, a rest, or a state that the code flags
                next_q, next_v = self.step(q, v, tau, duration, wrenches=wrenches, **options)
                qs, vs = next_q[..., None, :], next_v[..., None, :]
            q, v = qs[..., -1, :], vs[..., -1, :]
            states.append((qs, vs))
            left -= qs.shape[-2]
        every_q, every_v = zip(*states, strict=True)
        return np.concatenate(every_q, axis=-2), np.concatenate(every_v, axis=-2)

    def simulate(
        self, q: ArrayLike, v: ArrayLike | None = None, *, duration: float, **options: Any
    ) -> Simulation:
        """Return the motion from a closed state; see `ClosedLoopModel.simulate`.

        Steps of fixed length that end with a projection are generated code, under constant wrenches
        or none; the Pinocchio engine takes the others.
        """
        return simulate(self, q, v, duration=duration, **options)

    # Calls ----------------------------------------------------------------------------------------

    def reference(self, parameters: ArrayLike | None = None) -> ClosedLoopModel:
        """Return a copy of the mechanism for this thread, with scratch memory of its own.

        With parameters, shape (np,), it has these numbers; its home is not closed for them then.
        """
        try:
            mechanism: ClosedLoopModel = self._local.mechanism
        except AttributeError:
            mechanism = self._local.mechanism = copy.copy(self.mechanism)
        if parameters is None:
            return mechanism
        if not self.parameters:
            raise InputError(_NO_PARAMETERS)
        values = real_vector(parameters, len(self.parameters), "parameters")
        return with_parameters(mechanism, self.code.parameters, values)

    def generated(
        self,
        name: str,
        wrenches: Wrenches | None,
        parameters: ArrayLike | None,
        *given: ArrayLike,
    ) -> tuple[Any, ...]:
        """Return a function's results and status."""
        return self._generated(wrenches)[name](*given, *self._extra(name, wrenches, parameters))

    def _run(
        self,
        name: str,
        given: Sequence[ArrayLike],
        answer: Reference,
        wrenches: Wrenches | None = None,
        *,
        parameters: ArrayLike | None = None,
        errors: Errors = "raise",
        threads: int = 1,
        refused: Callable[[Array], Any] | None = None,
        more: Sequence[int] = (),
    ) -> Sequence[Any]:
        """Return a function's results, those of flagged samples by the Pinocchio engine.

        `refused` tells of the first result which samples are flagged too. `more` are the sizes of
        results that only the Pinocchio engine has: they are returned where a sample is flagged.
        """
        _checked(errors, threads)
        if self._plain and not wrenches and parameters is None:
            call = self._calls[name]  # a builtin function, which leaves keywords to Python
            *found, status = call(*given) if threads == 1 else call(*given, threads=threads)
        else:
            extra = self._extra(name, wrenches, parameters)
            *found, status = self._generated(wrenches)[name](*given, *extra, threads=threads)
        if refused is not None:
            status = status | refused(found[0])
            status = int(status) if found[0].ndim == 1 else status
        if status.__class__ is int and not status:
            return found  # type: ignore[no-any-return]
        if more and np.any(status):
            found = [*found, *(np.zeros((*np.shape(status), size)) for size in more)]
        return self._settled(name, found, status, given, answer, wrenches, parameters, errors)

    def _one(
        self,
        name: str,
        given: Sequence[ArrayLike],
        answer: Reference,
        wrenches: Wrenches | None = None,
        **options: Any,
    ) -> Array:
        """Return the only result of a function."""
        if wrenches is None and not options:
            single = getattr(self._single, name)(*given)
            if single and not single[-1]:
                return single[0]  # type: ignore[no-any-return]
        return np.asarray(self._run(name, given, answer, wrenches, **options)[0])

    def _independently(
        self,
        name: str,
        given: Sequence[ArrayLike],
        answer: Reference,
        independent: Sequence[str] | None,
        options: Any,
    ) -> Array:
        """Return the result of a function of independent joints, if it is generated for these."""
        if self._has(independent):
            return self._one(name, given, answer, **options)
        m = self._mobility(independent)
        nv, others = self.model.nv, (m,)
        shape: dict[str, tuple[int, ...]] = {"motion_basis": (nv, m), "mass_matrix": (m, m)}
        shape |= {"velocity": (nv,), "acceleration": (nv,)}
        shapes = [shape.get(name, others)]
        return np.asarray(self._by_samples(answer, given, shapes, **options)[0])

    def _mobility(self, independent: Sequence[str] | None) -> int:
        """Return the number of the independent velocities."""
        return int(self.mechanism.system.independent(independent).size)

    def _has(self, independent: Sequence[str] | None) -> bool:
        """Return whether these are the independent velocities of the generated code."""
        if independent is None:
            return self._is_actuated
        names = (independent,) if isinstance(independent, str) else tuple(independent)
        if names not in self._chosen:
            chosen = self.mechanism.system.independent(independent)
            self._chosen[names] = np.array_equal(chosen, self.code.partition.independent)
        return self._chosen[names]

    def _by_samples(
        self,
        answer: Reference,
        given: Sequence[ArrayLike],
        shapes: Sequence[tuple[int, ...]],
        under: bool = False,
        *,
        wrenches: Wrenches | None = None,
        parameters: ArrayLike | None = None,
        errors: Errors = "raise",
        threads: int = 1,
    ) -> Sequence[Any]:
        """Return the Pinocchio engine's answers; `threads` are no use to it.

        `shapes` are those of a sample's answers, and `under` says whether wrenches count.
        """
        _checked(errors, threads)
        code = self._generated(wrenches)
        extra = self._inputs(code, under, wrenches, parameters)
        answers = self._answers(answer, len(given), code, under)
        return by_samples(answers, (*given, *extra), shapes, errors)

    def _settled(
        self,
        name: str,
        found: Sequence[Any],
        status: Any,
        given: Sequence[ArrayLike],
        answer: Reference,
        wrenches: Wrenches | None,
        parameters: ArrayLike | None,
        errors: Errors,
    ) -> Sequence[Any]:
        if status.__class__ is int and not status:
            return found
        code, under = self._generated(wrenches), name in UNDER_WRENCHES
        extra = self._inputs(code, under, wrenches, parameters)
        answers = self._answers(answer, len(given), code, under)
        return settled(found, status, (*given, *extra), answers, errors)

    def _answers(
        self, answer: Reference, count: int, code: GeneratedCode, under: bool
    ) -> Reference:
        """Return the answer of a sample's arguments with wrenches and parameters behind them."""

        def of_sample(*arrays: Any) -> Sequence[Any]:
            motion, rest = arrays[:count], list(arrays[count:])
            mechanism = self.reference(rest.pop() if code.parameters else None)
            if not under:
                return answer(mechanism, *motion)
            frames = code.wrench_frames
            acting = dict(zip(frames, np.reshape(rest.pop(), (-1, 6)), strict=True)) if rest else {}
            return answer(mechanism, *motion, acting or None)

        return of_sample

    def _generated(self, wrenches: Wrenches | None) -> GeneratedCode:
        """Return the code for wrenches at these frames; it is built if it is not there."""
        if not wrenches or set(wrenches) <= set(self.code.wrench_frames):
            return self.code
        frames = tuple(sorted(wrenches))
        for name in frames:
            self.mechanism.system.frame(name)
        with self._lock:
            if frames not in self._codes:
                self._codes[frames] = self.code.with_wrenches(frames)
            return self._codes[frames]

    def _extra(
        self, name: str, wrenches: Wrenches | None, parameters: ArrayLike | None
    ) -> Sequence[ArrayLike]:
        """Return wrenches and parameters as a function takes them."""
        if self._plain and not wrenches and parameters is None:
            return ()
        return self._inputs(self._generated(wrenches), name in UNDER_WRENCHES, wrenches, parameters)

    def _inputs(
        self,
        code: GeneratedCode,
        under: bool,
        wrenches: Wrenches | None,
        parameters: ArrayLike | None,
    ) -> list[ArrayLike]:
        extra: list[ArrayLike] = []
        if under and code.wrench_frames:
            given = wrenches or {}
            none = np.zeros(6)
            extra.append(_stacked([given.get(name, none) for name in code.wrench_frames]))
        if code.parameters:
            extra.append(code.nominal if parameters is None else parameters)
        elif parameters is not None:
            raise InputError(_NO_PARAMETERS)
        return extra


class _Calls(dict[str, Callable[..., Any]]):
    """Calls of functions by name, each looked up once."""

    def __init__(self, code: GeneratedCode) -> None:
        super().__init__()
        self._code = code

    def __missing__(self, name: str) -> Callable[..., Any]:
        self[name] = call = self._code[name].call
        return call


class _Single:
    """`CompiledFunction.one` of functions by name, each looked up once.

    They return nothing for other arguments than float64 arrays of one sample, and so for mechanisms
    with parameters or wrenches, whose functions have more arguments.
    """

    def __init__(self, code: GeneratedCode) -> None:
        self._code = code

    def __getattr__(self, name: str) -> Any:
        one = self._code[name].one
        setattr(self, name, one)
        return one


def _checked(errors: Errors, threads: int) -> None:
    """Refuse options that are not possible."""
    if errors.__class__ is not str or errors not in ("raise", "mask"):
        choice(errors, "errors", ("raise", "mask"))
    if threads != 1:
        whole_number(threads, "threads")


@lru_cache(maxsize=8)
def _length(duration: float) -> Array:
    """Return a step's length as a function takes it, (1,); InputError if it is not positive."""
    return read_only(np.array([positive_number(duration, "duration", "s")]))


def _stacked(wrenches: Sequence[ArrayLike]) -> Array:
    """Return wrenches, (..., 6) each, one behind the other, (..., 6 k)."""
    arrays = [numbers(w, "a wrench", "numbers of shape (..., 6)") for w in wrenches]
    for array in arrays:
        if array.shape[-1:] != (6,):
            raise InputError(f"a wrench has shape {array.shape}; expected (..., 6)")
    batch = np.broadcast_shapes(*(array.shape[:-1] for array in arrays))
    return np.concatenate([np.broadcast_to(array, (*batch, 6)) for array in arrays], axis=-1)

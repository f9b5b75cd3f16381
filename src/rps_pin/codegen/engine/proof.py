"""Proof of generated code: every function against the Pinocchio engine, each time it is built.

The states are closed and random: near home, farther away, and one as near to a singularity as a
short walk leads. With parameters, the mechanism has other numbers than the nominal ones. Each
function is called for one state after another and for all in a batch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.dynamics.generalised_forces import tree_mass
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.closed_loop.simulation.stepper import Stepper
from rps_pin.codegen.calls import CompiledFunction
from rps_pin.codegen.engine.applied import with_parameters
from rps_pin.codegen.expressions.independent import regular_samples
from rps_pin.codegen.expressions.parameters import Parameters
from rps_pin.codegen.expressions.routines import BLOCK
from rps_pin.errors import CompileError, RPSPinError, SingularityError
from rps_pin.numerics.linear_algebra import Decomposition, condition_number

#: Largest difference from the Pinocchio engine, relative to the largest number of a result.
ACCEPTED = 1e-10
#: In a rounded file (see `RankRule`) the two engines leave out the nearly redundant rows in ways
#: that differ by the square of what is left out, times the condition number of J_d or J_p;
#: multipliers by what is left out. So many times it.
_OF_ROUNDING = 10.0
#: And above this times the condition number a state proves nothing.
_TOO_ROUGH = 1e-2
#: Functions that solve with the reduced mass matrix: at ill-conditioned states more is accepted,
#: the rounding unit times the condition numbers of that matrix and of J_d, up to a limit.
_BY_INERTIA = frozenset(("forward_dynamics", "forward_dynamics_derivatives", "step", "steps"))
_ACCEPTED_AT_MOST = 1e-7
#: And of derivatives: so many times the rounding unit times the square of the condition of J_d.
_OF_SLOPES = 10.0
#: A weight below this is no measure of wrenches, in forces of the motion.
_WEIGHTLESS = 1e-6
#: Results that are all below this may be zero: differences are relative to this then. In units of
#: the mechanism; see `Proof`.
_ZERO = 1e-3
#: Functions whose results are proportional to the masses.
_OF_MASS = frozenset(
    (
        "inverse_dynamics",
        "constraint_forces",
        "generalised_force",
        "mass_matrix",
        "bias",
        "gravity_forces",
        "energy",
        "inverse_dynamics_derivatives",
    )
)
#: And those below this much of a function's largest number: they are left of sums that cancel.
_CANCELLED = 1e-3
#: Derivatives by parameters are compared with differences of order 4 instead.
_OF_DIFFERENCES, _DIFFERENCE = 1e-7, 1e-4
_STENCIL = ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))
#: Speeds of a proof's states, over that of a fall; its steps in time, those of a call together, in
#: the time in which these speeds pass one rad; and Newton's guesses, rad or characteristic lengths.
_SPEED, _STEP, _AWAY = 0.3, 1e-5, 1e-3
#: Condition number of J_d up to which Newton's method contracts from such guesses; beside a
#: singularity it does from proportionally nearer ones.
_CONTRACTS = 100.0
#: Condition number of J_d that the walk towards a singularity does not pass.
_SINGULAR = 1e3
#: And above which a state is too near to one to be of use.
_USABLE = 1e4
#: Velocities from which on a proof has one state.
_LARGE = 200
#: Condition number of J_d above which generated code may flag a state.
_MAY_FLAG = 1e3


class Sample(NamedTuple):
    """A closed state of a mechanism, forces on it, and a guess near it."""

    q: Array
    v: Array
    a: Array
    tau: Array
    u: Array
    w: Array
    wrenches: Array
    """Of all frames, shape (6 k,)."""
    parameters: Array
    near: Array
    """q with its dependent velocities moved a little."""
    condition: float
    """Of J_d, in one unit."""
    mass: float
    """Largest entry of the tree's mass matrix; 1 if it has no mass."""
    accepted: float
    """Largest relative difference of accelerations."""
    rounding: float
    """What is left out of a rounded file, times the condition number of J_d or J_p."""


class Proof:
    """States of a mechanism, and what the Pinocchio engine answers there.

    Speeds, steps in time and what counts as zero are in units of the mechanism: its characteristic
    length, the largest entry of its mass matrix, and the time in which it falls (1 s without
    gravity), so that a proof does not depend on the mechanism's size.

    Parameters
    ----------
    mechanism
        The mechanism; a copy of it is used.
    independent
        Indices of the independent velocities.
    parameters, wrench_frames
        As for `MechanismExpressions`.
    redundant
        Whether some of the closures' rows depend on others.
    """

    def __init__(
        self,
        mechanism: ClosedLoopModel,
        independent: Indices,
        parameters: Sequence[str],
        wrench_frames: Sequence[str],
        redundant: bool = False,
    ) -> None:
        self._rng = np.random.default_rng(0)
        nominal = [_nominal(mechanism, group) for group in parameters]
        moved = [
            _range(mechanism, group, one, redundant)
            for group, one in zip(parameters, nominal, strict=True)
        ]
        #: How far parameters are moved for derivatives of what needs closed loops.
        self._direction = np.concatenate([np.zeros(0), *moved])
        #: And for those of the gaps, which may open.
        free = [
            _range(mechanism, group, one, False)
            for group, one in zip(parameters, nominal, strict=True)
        ]
        self._opening = np.concatenate([np.zeros(0), *free])
        self._parameters = np.concatenate([np.zeros(0), *nominal])
        self._parameters += 0.03 * self._direction * self._rng.uniform(size=self._direction.size)
        self._nominal, self._groups = mechanism, tuple(parameters)
        self._m = with_parameters(mechanism, parameters, self._parameters)
        self._left_out = _left_out(self._m)
        equations = self._m.system.equations
        #: Rate of a proof's motions, 1/s.
        self._rate = _SPEED * equations.speed / equations.length or 1.0
        #: Its step in time, s.
        self.step: float = _STEP / self._rate
        self._length: float = equations.length
        self._frames, self._independent = tuple(wrench_frames), independent
        nv = mechanism.model.nv
        self._dependent = np.setdiff1d(np.arange(nv), independent)
        home = self._m.close(mechanism.home, within_limits=False)
        found = regular_samples(self._m.system, home).configurations
        # The Pinocchio engine's work grows with the cube of a mechanism's size.
        large = nv > _LARGE
        places = [q for q in found if self._condition(q) < _USABLE][: 1 if large else 5]
        if not places:
            raise CompileError(f"{mechanism.name}: all states near home are singular", "")
        if not large:
            places.append(self._towards_singularity(places[-1]))
        self.samples = [
            sample for sample in map(self._sample, places) if sample.rounding <= _TOO_ROUGH
        ]
        if not self.samples:
            raise CompileError(
                f"{mechanism.name}: the file's numbers are rounded too coarsely for a proof: "
                f"{mechanism.system.rule.rounding}",
                "",
            )

    def _sample(self, q: Array) -> Sample:
        rng, m, model = self._rng, self._m, self._m.model
        q = self._closed(self._closed(q))
        basis = self._basis(q)
        # Near a singularity dependent velocities are many times larger than independent ones.
        own = m.velocity_scale[self._independent]
        fastest = float(np.abs(basis * own / m.velocity_scale[:, None]).max(initial=1.0))
        slow = self._rate / fastest * self._length * own
        u, w = slow * rng.normal(size=(2, self._independent.size))
        w *= self._rate
        v = basis @ u
        move = np.zeros(model.nv)
        move[self._dependent] = rng.normal(size=self._dependent.size)
        away = _AWAY * self._length * min(1.0, _CONTRACTS / self._condition(q))
        near = pin.integrate(model, q, away * move * m.system.column_scale)
        a = self._acceleration(q, v, w)
        weight = float(
            np.abs(pin.computeGeneralizedGravity(model, m.system.data, q)).max(initial=0)
        )
        mass, condition = tree_mass(m.system, q), self._condition(q)
        largest, accepted = float(np.abs(mass).max()) or 1.0, self._accepted(q, mass, condition)
        wrenches = max(weight, _WEIGHTLESS * largest * self._rate**2) * rng.normal(
            size=6 * len(self._frames)
        )
        try:
            tau = m.inverse_dynamics(q, v, a, wrenches=self._acting(wrenches)).tau
        except SingularityError:  # actuators that hardly move one of the motions
            tau = 0.1 * weight * rng.normal(size=m.system.actuated.size)
        rounding = self._left_out and self._left_out * max(condition, self._of_actuators(q))
        accepted = max(accepted, _OF_ROUNDING * rounding**2)
        return Sample(
            *(q, v, a, tau, u, w, wrenches, self._parameters, near),
            *(condition, largest, accepted, rounding),
        )

    def _of_actuators(self, q: Array) -> float:
        """Return the condition number of J_p, or 0 if the Pinocchio engine does not solve by it."""
        condition = self._m.condition(q)
        return condition if np.isfinite(condition) else 0.0

    def _accepted(self, q: Array, mass: Array, condition: float) -> float:
        """Return the largest relative difference of accelerations, given M and J_d's condition."""
        motions = self._m.allowed_motions(q)
        reduced = motions.T @ mass @ motions
        spread = condition_number(reduced / (np.abs(reduced).max(initial=0.0) or 1.0))
        rounding = np.finfo(np.float64).eps * condition * spread
        return float(min(max(ACCEPTED, rounding), _ACCEPTED_AT_MOST))

    def _closed(self, q: Array) -> Array:
        """Return q after one of Newton's steps of least norm: closed to rounding error."""
        system = self._m.system
        factors = system.decomposed(self._m.jacobian(q))
        gaps = system.row_scale * self._m.loop_errors(q).position
        step = -system.column_scale * factors.least_norm(gaps)
        return np.asarray(pin.integrate(self._m.model, q, step))

    def _followers(self, q: Array, right: Array) -> Array:
        """Return the dependent x_d with J_d x_d = right (nc, ...), in the least-squares sense."""
        system = self._m.system
        rows = system.scaled(self._m.jacobian(q))[:, self._dependent]
        factors = Decomposition(rows, system.rule.tolerance)
        solved = factors.least_norm((system.row_scale * right.T).T)
        return np.asarray((system.column_scale[self._dependent] * solved.T).T)

    def _open_by(self, q: Array) -> float:
        """Return the largest gap at q, m; in a rounded file of what J_d can close."""
        m = self._m
        if m.system.rule.rank is None:
            return m.loop_gap(q)
        gaps = m.loop_errors(q).position
        along = m.jacobian(q)[:, self._dependent] @ self._followers(q, gaps)
        return m.system.equations.largest_gap(along)

    def _condition(self, q: Array) -> float:
        """Return the condition number of J_d, in one unit."""
        return condition_number(self._m.system.scaled(self._m.jacobian(q))[:, self._dependent])

    def _towards_singularity(self, q: Array) -> Array:
        """Return the end of a walk in an allowed direction, short of a singularity."""
        m, best, worst = self._m, q, 0.0
        if not self._independent.size:
            return q
        direction = self._rng.normal(size=self._independent.size)
        direction *= m.velocity_scale[self._independent]
        for _ in range(30):
            try:
                step = self._basis(q) @ direction
                step *= 0.1 * m.characteristic_length / np.linalg.norm(step / m.velocity_scale)
                q = m.close(pin.integrate(m.model, q, step), within_limits=False, restarts=0)
            except (RPSPinError, np.linalg.LinAlgError):
                break
            now = self._condition(q)
            if not now < _SINGULAR:
                break
            if now > worst:
                best, worst = q, now
        return best

    # Comparison -----------------------------------------------------------------------------------

    def compare(self, name: str, function: CompiledFunction) -> float:
        """Return the largest relative difference of a function from the Pinocchio engine.

        Raises
        ------
        CompileError
            If it is above what is accepted, or the function flags a state that is regular.
        """
        worst, compared = 0.0, 0
        given = [self._arguments(function, sample) for sample in self.samples]
        *batch, flags = function(*(np.array(one) for one in zip(*given, strict=True)))
        for i, (sample, arguments) in enumerate(zip(self.samples, given, strict=True)):
            *found, status = function(*arguments)
            if status or flags[i]:
                if sample.condition < _MAY_FLAG:
                    raise CompileError(
                        f"generated code of {name} flags a regular state (status {status}, in a "
                        f"batch {flags[i]}; condition number {sample.condition:.3g})",
                        "",
                    )
                continue
            try:
                expected = self.expected(name, sample, found)
            except SingularityError:  # of actuators, as far as the numbers of a rounded file tell
                if not self._left_out:
                    raise
                continue
            sizes = [np.abs(one).max(initial=0.0) for one in expected if one is not None]
            if name == "forward_dynamics":  # those of the actuators and of the weight cancel
                unforced = self._m.forward_dynamics(sample.q, sample.v, 0.0 * sample.tau)
                sizes.append(np.abs(unforced).max(initial=0.0))
            zero = _ZERO * self.unit(name, sample)
            known = 1.0 if sample.rounding else _CANCELLED  # what cancels is not known better
            least = max(zero, known * float(np.max(sizes, initial=0.0)))
            for k, (one, of_batch, wanted) in enumerate(zip(found, batch, expected, strict=False)):
                if wanted is not None:
                    for result in (one, of_batch[i]):
                        limits = least, self.limit(name, sample, function.outputs[k].name)
                        relative = self._difference(function, k, result, wanted, limits)
                        worst = max(worst, relative)
            compared += 1
        if not compared:
            raise CompileError(f"generated code of {name} flags all {len(given)} states", "")
        return worst

    def unit(self, name: str, sample: Sample) -> float:
        """Return the size of a function's results where they are not zero, at least."""
        rate, length = self._rate, max(self._length, 1.0)
        if name in _OF_MASS:
            return sample.mass * (1.0 if name == "mass_matrix" else rate**2)
        if name == "velocity":
            return rate * length
        if name in ("acceleration", "forward_dynamics", "forward_dynamics_derivatives"):
            return rate**2 * length
        return length

    def limit(self, name: str, sample: Sample, result: str = "") -> float:
        """Return the largest relative difference of a function's result that is accepted."""
        power = 1 if result == "multipliers" else 2
        of_rounding = _OF_ROUNDING * sample.rounding**power
        if name.endswith("_by_parameters"):
            return max(_OF_DIFFERENCES, of_rounding)
        limit = sample.accepted if name in _BY_INERTIA else max(ACCEPTED, of_rounding)
        if name.endswith("_derivatives"):  # dT = -J_d^-1 dJ T
            of_slopes = _OF_SLOPES * np.finfo(np.float64).eps * sample.condition**2
            limit = max(limit, min(of_slopes, _ACCEPTED_AT_MOST))
        return float(limit)

    def _difference(
        self,
        function: CompiledFunction,
        k: int,
        found: Array,
        wanted: Any,
        limits: tuple[float, float],
    ) -> float:
        """Return the relative difference of a result; raise if it is above what is accepted.

        `limits` are the least size that counts, and the largest relative difference.
        """
        least, accepted = limits
        wanted = np.asarray(wanted)
        if wanted.shape != found.shape:
            raise CompileError(
                f"generated code of {function.name}: {function.outputs[k].name} has shape "
                f"{found.shape}, not {wanted.shape}",
                "",
            )
        error = np.abs(found - wanted)
        size = max(float(np.abs(wanted).max(initial=0.0)), least)
        relative = float(error.max(initial=0.0)) / size
        if not relative <= accepted:
            at = np.unravel_index(int(np.argmax(error)), error.shape)
            raise CompileError(
                f"generated code of {function.name} does not agree with the Pinocchio engine: "
                f"{function.outputs[k].name}{list(map(int, at))} = {float(found[at])!r}, not "
                f"{float(wanted[at])!r}: {relative:.3g} relative, at most {accepted:g} is accepted",
                "",
            )
        return relative

    def _arguments(self, function: CompiledFunction, sample: Sample) -> list[Array]:
        values = sample._asdict()
        values["given"] = sample.near
        if function.name in ("gaps", "closed", "closed_near"):
            values["q"] = sample.near
        sizes = {one.name: one.shape[0] for one in function.inputs}
        count = sizes.get("h", 0)
        values["h"] = np.full(count, self.step / max(count, 1))
        return [values[one.name] for one in function.inputs]

    # What the Pinocchio engine answers ------------------------------------------------------------

    def expected(self, name: str, s: Sample, found: Sequence[Array]) -> Sequence[Any]:
        """Return the answers of a function; None, or none at the end, where there is none."""
        m, acting = self._m, self._acting(s.wrenches)
        if name.startswith("frame_"):
            frame = m.model.frames[int(name.rpartition("_")[2])].name
            return m.frame_placement(s.q, frame), self._frame_jacobian(s.q, frame)
        if name.endswith("_by_parameters"):
            return (self._slope(s, name, found[0]) if s is self.samples[0] else None,)
        if name == "nearest":
            nearest = m.project(s.near, within_limits=False)
            away = pin.difference(m.model, nearest, s.near) / m.velocity_scale
            return found[0] + self._open_by(found[0]), np.array([away @ away])
        if name == "closed_near":
            # The answer is any closed configuration.
            return (found[0] + self._open_by(found[0]),)
        answers: Mapping[str, Callable[[], Sequence[Any]]] = {
            "gaps": lambda: (m.loop_errors(s.near).position,),
            "jacobian": lambda: (m.jacobian(s.q),),
            "motion_basis": lambda: (self._basis(s.q),),
            "velocity": lambda: (s.v,),
            "acceleration": lambda: (s.a,),
            "inverse_dynamics": lambda: self._inverse_dynamics(s),
            "forward_dynamics": lambda: (self._accelerated(s),),
            "constraint_forces": lambda: (
                m.constraint_forces(s.q, s.v, s.a, s.tau, wrenches=acting),
            ),
            "generalised_force": lambda: (m.generalised_force(s.q, s.v, s.a, wrenches=acting),),
            "mass_matrix": lambda: (
                self._reduced(s.q, tree_mass(m.system, s.q) @ self._basis(s.q)),
            ),
            "bias": lambda: (self._bias(s),),
            "gravity_forces": lambda: (
                self._reduced(s.q, pin.computeGeneralizedGravity(m.model, m.system.data, s.q)),
            ),
            "energy": lambda: (np.array(m.energy(s.q, s.v)),),
            "closed": lambda: (self._completed(s, found[0]),),
            "completed": lambda: (self._completed(s, found[0]),),
            "step": lambda: self._steps(s, 1),
            "steps": lambda: self._steps(s, BLOCK) if s is self.samples[0] else (None, None),
            "inverse_dynamics_derivatives": lambda: m.inverse_dynamics_derivatives(
                s.q, s.v, s.a, wrenches=acting
            ),
            "forward_dynamics_derivatives": lambda: m._derivatives.forward(
                s.q, s.v, s.tau, self._independent, acting
            ),
        }
        return answers[name]()

    def _accelerated(self, s: Sample) -> Array:
        """Return the Pinocchio engine's acceleration, after a step of iterative refinement.

        In coordinates in which T' M T has a diagonal of ones: with bodies of very different sizes
        the rounding errors of others are larger than what is accepted.
        """
        m, acting = self._m, self._acting(s.wrenches)
        a, basis = m.forward_dynamics(s.q, s.v, s.tau, wrenches=acting), self._basis(s.q)
        mass = basis.T @ tree_mass(m.system, s.q) @ basis
        rest = basis[m.actuated_indices].T @ s.tau
        rest -= basis.T @ m.generalised_force(s.q, s.v, a, wrenches=acting)
        size = np.sqrt(np.diag(mass))
        along = np.linalg.solve(mass / np.outer(size, size), rest / size) / size
        return np.asarray(a + basis @ along)

    def _completed(self, s: Sample, q: Array) -> Array:
        """Return q, or what differs from it, if it is open or has not the given coordinates.

        It need not be s.q: near a singularity two configurations are near the guess.
        """
        model = self._m.model
        # Moves of a ball about two of its axes add up to one about the third.
        simple = [joint.idx_v for joint in list(model.joints)[1:] if joint.nq == 1]
        chosen = np.isin(self._independent, simple)
        moved = pin.difference(model, s.near, q)[self._independent[chosen]]
        return np.asarray(q + np.abs(moved).max(initial=self._open_by(q)))

    def _slope(self, s: Sample, name: str, found: Array) -> Array | None:
        """Return a function's derivatives by the parameters, corrected in one random direction.

        The derivative in that direction is the Pinocchio engine's, by differences; there is none if
        no parameter can be moved with the loops closed.
        """
        answer = {
            "gaps_by_parameters": self._gaps,
            "inverse_dynamics_by_parameters": self._reduced_force,
            "forward_dynamics_by_parameters": self._independent_acceleration,
        }[name]
        direction = self._opening if name == "gaps_by_parameters" else self._direction
        direction = direction * self._rng.uniform(0.5, 1.0, direction.size)
        if not direction.any():
            return None
        slope, mechanism = np.zeros(found.shape[:-1]), self._m
        for times, weight in _STENCIL:
            values = s.parameters + times * _DIFFERENCE * direction
            self._m = with_parameters(self._nominal, self._groups, values)
            slope += weight / _DIFFERENCE * answer(s)
        self._m = mechanism
        error = slope - found @ direction
        return np.asarray(found + np.multiply.outer(error, direction) / (direction @ direction))

    def _gaps(self, s: Sample) -> Array:
        return self._m.loop_errors(s.q).position

    def _followed(self, s: Sample) -> tuple[Array, Array]:
        """Return q and v of the independent positions and velocities, the loops closed."""
        m, q = self._m, s.q
        for _ in range(6):
            move = np.zeros(m.model.nv)
            move[self._dependent] = -self._followers(q, m.loop_errors(q).position)
            q = pin.integrate(m.model, q, move)
        return q, self._basis(q) @ s.u

    def _reduced_force(self, s: Sample) -> Array:
        q, v = self._followed(s)
        a, acting = self._acceleration(q, v, s.w), self._acting(s.wrenches)
        return self._reduced(q, self._m.generalised_force(q, v, a, wrenches=acting))

    def _independent_acceleration(self, s: Sample) -> Array:
        q, v = self._followed(s)
        a = self._m.forward_dynamics(q, v, s.tau, wrenches=self._acting(s.wrenches))
        return np.asarray(a[self._independent])

    def _acting(self, wrenches: Array) -> dict[str, Array] | None:
        parts = wrenches.reshape(-1, 6)
        return dict(zip(self._frames, parts, strict=True)) or None

    def _basis(self, q: Array) -> Array:
        """Return T, shape (nv, m), of the independent velocities."""
        basis = np.zeros((self._m.model.nv, self._independent.size))
        basis[self._independent] = np.eye(self._independent.size)
        basis[self._dependent] = -self._followers(q, self._m.jacobian(q)[:, self._independent])
        return basis

    def _acceleration(self, q: Array, v: Array, w: Array) -> Array:
        """Return a with J a + J' v = 0 and independent entries w."""
        bias = self._m.system.equations.bias(q, v).copy()
        a = self._basis(q) @ w
        a[self._dependent] -= self._followers(q, bias)
        return np.asarray(a)

    def _reduced(self, q: Array, force: Array) -> Array:
        return np.asarray(self._basis(q).T @ force)

    def _bias(self, s: Sample) -> Array:
        drift = self._acceleration(s.q, s.v, np.zeros(self._independent.size))
        return self._reduced(s.q, self._m.generalised_force(s.q, s.v, drift))

    def _inverse_dynamics(self, s: Sample) -> Sequence[Any]:
        found = self._m.inverse_dynamics(s.q, s.v, s.a, wrenches=self._acting(s.wrenches))
        none = np.zeros(self._m.model.nv)
        unproduced = none if found.unproduced is None else found.unproduced
        return found.tau, found.constraint_forces, None, unproduced, None

    def _frame_jacobian(self, q: Array, frame: str) -> Array:
        m = self._m
        index, axes = m.system.frame(frame), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(m.model, m.system.data, q, index, axes)
        return np.asarray(jacobian.reshape(6, -1) @ self._basis(q))

    def _steps(self, s: Sample, count: int) -> Sequence[Any]:
        stepper = Stepper(self._m, s.q, s.v, wrenches=self._acting(s.wrenches))
        states = []
        for _ in range(count):
            stepper.advance(s.tau, self.step / count)
            states.append((stepper.q, stepper.v))
        qs, vs = zip(*states, strict=True)
        return np.concatenate(qs), np.concatenate(vs)


def _left_out(mechanism: ClosedLoopModel) -> float:
    """Return the size of what is left out of a rounded file's closures; 0 if it is exact."""
    rounding = mechanism.system.rule.rounding
    if rounding is None:
        return 0.0
    return max(rounding.dropped, rounding.gap / mechanism.characteristic_length)


def _nominal(mechanism: ClosedLoopModel, group: str) -> Array:
    return Parameters(mechanism.system, [group]).nominal


def _range(mechanism: ClosedLoopModel, group: str, nominal: Array, redundant: bool) -> Array:
    """Return how far the parameters of a group may be moved, so that inertias stay such.

    Where rows are redundant, lengths and directions are not moved: that could lock the mechanism.
    """
    kind = group.partition(":")[0]
    if kind in ("placement", "closure"):
        return np.full(nominal.size, 0.0 if redundant else 0.05)
    if kind == "payload":
        mass = sum(inertia.mass for inertia in mechanism.model.inertias) or 1.0
        length = mechanism.characteristic_length
        inertia = 1e-2 * length**2
        of_mass = [1.0, *[1e-3 * length] * 3, inertia, 0.0, inertia, 0.0, 0.0, inertia]
        return mass * np.array(of_mass)
    if kind == "gravity":
        return np.full(3, np.linalg.norm(nominal) or 1.0)
    return np.where(nominal, np.abs(nominal), 1e-3 * np.abs(nominal).max())

"""Every call of a mechanism, its answers counted in other units; see `tests.scaled`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin import ClosedLoopModel, RPSPinError
from rps_pin.closed_loop import ForceDistribution, Stepper
from tests.scaled import Array, UnitsOf

#: An answer in the units of the unscaled mechanism, or the error that it ended in.
Answer = Array | str

#: Random starts of a search for assembly modes.
SEARCHED = 200


class Inputs:
    """Configurations, motions and forces of a mechanism, in its own units."""

    def __init__(self, mechanism: ClosedLoopModel, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        model, nv = mechanism.model, mechanism.model.nv
        home, length = mechanism.home, mechanism.characteristic_length
        columns = np.where(mechanism.angular_velocities, 1.0, length)
        #: About as fast as it falls.
        rate = 1.5 * np.sqrt(9.81 / length)
        self.guess = pin.integrate(model, home, 0.2 * columns * rng.normal(size=nv))
        self.far = pin.integrate(model, home, 2.0 * columns * rng.normal(size=nv))
        self.regular = mechanism.describe().configuration
        motions = mechanism.allowed_motions(self.regular)
        self.v = rate * length * motions @ rng.normal(size=motions.shape[1])
        self.any = rate * columns * rng.normal(size=nv)
        own = columns[mechanism.actuated_indices]
        mass = sum(inertia.mass for inertia in model.inertias) or 1.0
        self.u, self.w = (rate**k * own * rng.normal(size=own.size) for k in (1, 2))
        self.tau = mass * 9.81 * length / own * rng.normal(size=own.size)
        self.step = own * 0.02 * rng.normal(size=own.size)
        self.wrench = mass * 9.81 * np.repeat([1.0, length], 3) * rng.normal(size=6)
        links = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY]
        self.frame = (links or [model.names[model.njoints - 1]])[-1]
        self.time = 1 / rate
        self.limits = mass * 9.81 * length / own * 20.0


def answers(mechanism: Any, inputs: Inputs, units: UnitsOf) -> dict[str, Answer]:
    """The answers of a mechanism in other units, or of its engine, in those of the inputs.

    Where a call is refused, the error's name is the answer.
    """
    asked = _Asked(mechanism, inputs, units)
    asked.positions()
    asked.motions()
    asked.forces()
    asked.slopes()
    asked.simulations()
    if isinstance(mechanism, ClosedLoopModel):
        asked.descriptions()
    return asked.found


class _Asked:
    """The calls of a mechanism, by kind."""

    def __init__(self, mechanism: Any, inputs: Inputs, units: UnitsOf) -> None:
        self.m, self.inputs, self.u = mechanism, inputs, units
        self.energy, self.time = units.units.energy, units.units.time
        self.to_v, self.to_a = units.v / self.time, units.v / self.time**2
        self.q, self.v = inputs.regular * units.q, inputs.v * self.to_v
        self.a = np.zeros_like(self.v)
        self.tau = inputs.tau * self.energy / units.actuated
        self.wrenches = {inputs.frame: inputs.wrench * units.wrench}
        self.found: dict[str, Answer] = {}

    def add(self, name: str, call: Callable[[], Any], *factors: Any) -> Any:
        """Keep an answer, or several, each divided by its factor."""
        try:
            given = call()
        except RPSPinError as error:
            self.found[name] = type(error).__name__
            return None
        parts = given if isinstance(given, tuple) else (given,)
        assert len(parts) == len(factors), name
        for k, (part, factor) in enumerate(zip(parts, factors, strict=True)):
            key = name if len(parts) == 1 else f"{name} {k}"
            self.found[key] = np.asarray(part, float) / factor
        return given

    def positions(self) -> None:
        m, u, inputs, q, length = self.m, self.u, self.inputs, self.q, self.u.units.length
        self.add("home", lambda: m.home, u.q)
        self.add("characteristic length", lambda: m.characteristic_length, length)
        self.add("close", lambda: m.close(inputs.guess * u.q), u.q)
        self.add("close from afar", lambda: m.close(inputs.far * u.q), u.q)
        self.add("project", lambda: m.project(inputs.guess * u.q), u.q)
        self.add("gap", lambda: m.loop_gap(inputs.guess * u.q), length)
        self.add("frame", lambda: m.frame_placement(q, inputs.frame)[:3, 3], length)
        positions = _actuated_positions(m, q)
        if positions is None:
            return
        step = inputs.step * u.actuated
        self.add("complete", lambda: m.complete(positions + step, q), u.q)
        self.add("complete far", lambda: m.complete(positions + 30 * step, q), u.q)
        self.add("jump", lambda: m.complete(positions + step, q, jump=True), u.q)
        if isinstance(m, ClosedLoopModel) and m.describe().mobility == len(positions):
            wanted = positions + step
            modes = self.add("modes", lambda: m.assembly_modes(wanted, q, starts=SEARCHED).q, u.q)
            self.found["number of modes"] = str(None if modes is None else len(modes))

    def motions(self) -> None:
        m, u, inputs, q, v, time = self.m, self.u, self.inputs, self.q, self.v, self.time
        to_v, to_a = self.to_v, self.to_a
        rates, rates_2 = inputs.u * u.actuated / time, inputs.w * u.actuated / time**2
        self.add("jacobian", lambda: m.jacobian(q), u.row[:, None] / u.v)
        self.add("condition", lambda: _nearness(m.condition(q)), 1.0)
        self.add("basis", lambda: m.motion_basis(q), u.v[:, None] / u.actuated)
        for axes in ("world", "frame"):
            self.add(
                f"frame jacobian {axes}",
                lambda axes=axes: m.frame_jacobian(q, inputs.frame, axes=axes),
                u.frame[:, None] / u.actuated,
            )
        moved = inputs.guess * u.q, inputs.any * to_v, inputs.any * to_a
        by_row = u.row, u.row / time, u.row / time**2
        self.add("errors", lambda: tuple(m.loop_errors(*moved)), *by_row)
        made = self.add("velocity", lambda: m.velocity(q, rates), to_v)
        v = v if made is None else made
        made = self.add("acceleration", lambda: m.acceleration(q, v, rates_2), to_a)
        self.a = self.a if made is None else made
        opened = _opened(self.v, to_v)
        self.add("open velocity", lambda: m.acceleration(q, opened, rates_2), to_a)
        self.v = v

    def forces(self) -> None:
        m, u, energy, state = self.m, self.u, self.energy, (self.q, self.v, self.a)
        q, v, _ = state
        acted = {"": None, " with wrenches": self.wrenches}
        by_force = energy / u.actuated, energy / u.row
        inverse = None
        for name, wrenches in acted.items():
            inverse = self.add(
                f"inverse{name}",
                lambda w=wrenches: _inverse(m.inverse_dynamics(*state, wrenches=w)),
                *(*by_force, 1.0),
            )
            self.add(
                f"forward{name}",
                lambda w=wrenches: m.forward_dynamics(q, v, self.tau, wrenches=w),
                self.to_a,
            )
        self.add("generalised force", lambda: m.generalised_force(*state), energy / u.v)
        self.add("constraint forces", lambda: m.constraint_forces(*state, self.tau), by_force[1])
        per = u.actuated[:, None] * u.actuated
        self.add("mass", lambda: m.mass_matrix(q), energy * self.time**2 / per)
        self.add("bias", lambda: m.bias(q, v), by_force[0])
        self.add("gravity", lambda: m.gravity_forces(q), by_force[0])
        self.add("energy", lambda: np.array(m.energy(q, v)), energy)
        if inverse is None:
            return
        forces, acting = inverse[1], {"wrenches": self.wrenches}
        self.add("closures", lambda: _table(m.closure_wrenches(q, forces)), u.wrench)
        self.add("joints", lambda: _table(m.joint_wrenches(*state, forces, **acting)), u.wrench)

    def slopes(self) -> None:
        m, u, energy, time, state = self.m, self.u, self.energy, self.time, (self.q, self.v)
        by, every = u.actuated[:, None], u.v[:, None]
        per = by * u.actuated
        orders = 1.0, time, time**2
        self.add(
            "inverse derivatives",
            lambda: tuple(m.inverse_dynamics_derivatives(*state, self.a)),
            *(energy * order / (by * u.v) for order in orders),
            *(energy * order / per for order in orders),
        )
        self.add(
            "forward derivatives",
            lambda: tuple(m.forward_dynamics_derivatives(*state, self.tau)),
            *(every / u.v / time**2, every / u.v / time, every * u.actuated / energy / time**2),
            *(by / u.actuated / time**2, by / u.actuated / time, per / energy / time**2),
        )
        of_state = np.concatenate([u.actuated, u.actuated / time])
        by_state = of_state[:, None] / time / of_state
        self.add("linearisation", lambda: m.linearize(*state, self.tau).A, by_state)

    def simulations(self) -> None:
        m, u, state, natural = self.m, self.u, (self.q, self.v), self.inputs.time * self.time
        baumgarte = {"closing": "baumgarte", "baumgarte_gain": 0.2 / natural}
        runs: dict[str, dict[str, Any]] = {
            "rk4": {"step": 0.02 * natural},
            "adaptive": {"step": 0.05 * natural, "method": "adaptive"},
            "baumgarte": {"step": 0.02 * natural, **baumgarte},
        }
        for name, options in runs.items():
            options |= {"duration": 0.1 * natural, "tau": self.tau}
            self.add(
                f"simulate {name}",
                lambda o=options: _last(m.simulate(*state, **o)),
                *(u.q, self.to_v, self.energy),
            )

    def descriptions(self) -> None:
        m, u, energy, state = self.m, self.u, self.energy, (self.q, self.v)
        step = 0.02 * self.inputs.time * self.time
        self.add("stepper", lambda: _stepped(m, *state, self.tau, step), u.q, self.to_v)
        limits = self.inputs.limits * energy / u.actuated
        for name, wide in (("", 1.0), (" within little", 0.01)):
            self.add(
                f"distribution{name}",
                lambda wide=wide: tuple(
                    ForceDistribution(m, torque_limits=wide * limits).solve(*state, self.a)
                )[:2],
                *(energy / u.actuated, energy / u.row),
            )
        described = m.describe()
        numbers = described.mobility, described.rank, described.redundant_rows
        words = described.actuation, described.actuated_rank, described.home_is_singular
        freedoms = described.idle, described.lacking
        self.found["description"] = str((numbers, words, freedoms, described.rounding is None))
        self.found["singular values"] = described.singular_values


def _opened(v: Array, to_v: Array) -> Array:
    """A velocity that opens the loops by a part in a thousand."""
    return v + 1e-3 * np.abs(v / to_v).max() * to_v * np.cos(np.arange(v.size))


def _table(wrenches: dict[str, Array]) -> Array:
    return np.array([*wrenches.values()]).reshape(-1, 6)


def _inverse(result: Any) -> tuple[Any, ...]:
    return result.tau, result.constraint_forces, _nearness(result.condition)


def _nearness(condition: float) -> Array:
    """The inverse of a condition number, beside 1, which rounding errors of it are relative to."""
    return np.array([1.0, 1.0 / condition])


def _last(result: Any) -> tuple[Any, ...]:
    return result.q[-1], result.v[-1], result.kinetic[-1] + result.potential[-1]


def _stepped(m: ClosedLoopModel, q: Array, v: Array, tau: Array, step: float) -> tuple[Any, ...]:
    stepper = Stepper(m, q, v)
    stepper.advance(tau, 3 * step, 3)
    return stepper.q, stepper.v


def _actuated_positions(m: Any, q: Array) -> Array | None:
    """The actuated joints' coordinates, or None if one has several."""
    model = m.model
    joints = [
        model.joints[model.getJointId(name)] for name in m.actuated if model.existJointName(name)
    ]
    if len(joints) < len(m.actuated) or any(joint.nq != 1 for joint in joints):
        return None
    return np.array([q[joint.idx_q] for joint in joints])


def differences(
    one: dict[str, Answer], other: dict[str, Answer], least: float = 0.0
) -> dict[str, float | str]:
    """How far two sets of answers are apart, relative to the largest entry of each; or verdicts."""
    found: dict[str, float | str] = {}
    for name in one.keys() | other.keys():
        a, b = one.get(name, "none"), other.get(name, "none")
        if isinstance(a, str) or isinstance(b, str):
            one_, other_ = (x if isinstance(x, str) else "answered" for x in (a, b))
            if one_ != other_:
                found[name] = f"{one_} / {other_}"
            continue
        if a.size:
            with np.errstate(invalid="ignore"):
                size = max(np.abs(a).max(), least)
                apart = np.where(a == b, 0.0, np.abs(a - b))  # infinite ones, too
            found[name] = float(apart.max() / (size or 1.0))
    return found

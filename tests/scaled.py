"""Mechanisms and robots in other units: every length, mass and time times a factor.

With lengths counted in a unit 1/L as large, masses in 1/M and times in 1/T, a mechanism is the same
one; its numbers are multiplied by the power of L, M and T that their dimension says, and so is each
answer. What does not is a number without unit in the code.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, JointCoupling, JointEffects, LoopClosure
from rps_pin.closed_loop.constraints.closures import Closure
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.parameters import RPSParameters

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Units:
    """Factors of length, mass and time."""

    length: float
    mass: float
    time: float

    @property
    def energy(self) -> float:
        return self.mass * self.length**2 / self.time**2

    @property
    def force(self) -> float:
        return self.mass * self.length / self.time**2

    @property
    def inertia(self) -> float:
        return self.mass * self.length**2

    @property
    def acceleration(self) -> float:
        return self.length / self.time**2


class UnitsOf:
    """The factor of each coordinate, velocity and row of a mechanism."""

    def __init__(self, mechanism: ClosedLoopModel, units: Units) -> None:
        model = mechanism.model
        self.units = units
        self.v = np.where(mechanism.angular_velocities, 1.0, units.length)
        self.row = np.where(mechanism.angular_rows, 1.0, units.length)
        self.q = coordinate_units(model, units.length)
        self.actuated = self.v[mechanism.actuated_indices]
        self.frame = np.repeat([units.length, 1.0], 3)
        self.wrench = units.energy / self.frame


def coordinate_units(model: pin.Model, length: float) -> Array:
    """The factor of each coordinate: of the translations among them, the length's."""
    found = np.ones(model.nq)
    for joint in list(model.joints)[1:]:
        kind = joint.shortname()
        if kind == "JointModelFreeFlyer":
            found[joint.idx_q : joint.idx_q + 3] = length
        elif "Prismatic" in kind or kind.startswith("JointModelP") or "Translation" in kind:
            moved = 2 if kind == "JointModelPlanar" else joint.nq
            found[joint.idx_q : joint.idx_q + moved] = length
    return found


def _velocity_units(model: pin.Model, length: float) -> Array:
    found = np.ones(model.nv)
    for joint in list(model.joints)[1:]:
        kind, first = joint.shortname(), joint.idx_v
        if kind == "JointModelFreeFlyer":
            found[first : first + 3] = length
        elif "Prismatic" in kind or kind.startswith("JointModelP") or "Translation" in kind:
            found[first : first + (2 if kind == "JointModelPlanar" else joint.nv)] = length
    return found


def _placement(placement: pin.SE3, length: float) -> pin.SE3:
    return pin.SE3(placement.rotation, length * placement.translation)


def _inertia(inertia: pin.Inertia, units: Units) -> pin.Inertia:
    return pin.Inertia(
        units.mass * inertia.mass, units.length * inertia.lever, units.inertia * inertia.inertia
    )


def scaled_model(model: pin.Model, units: Units) -> pin.Model:
    """A model in other units."""
    other, length = model.copy(), units.length
    per_q, per_v = coordinate_units(model, length), _velocity_units(model, length)
    for i in range(1, model.njoints):
        other.jointPlacements[i] = _placement(model.jointPlacements[i], length)
        other.inertias[i] = _inertia(model.inertias[i], units)
    for i, frame in enumerate(model.frames):
        other.frames[i].placement = _placement(frame.placement, length)
        other.frames[i].inertia = _inertia(frame.inertia, units)
    other.gravity.linear = units.acceleration * model.gravity.linear
    other.armature = units.inertia * model.armature / per_v**2
    for name in ("lowerPositionLimit", "upperPositionLimit"):
        setattr(other, name, _times(getattr(model, name), per_q))
    for name in ("lowerEffortLimit", "upperEffortLimit"):
        setattr(other, name, _times(getattr(model, name), units.energy / per_v))
    for name in ("lowerVelocityLimit", "upperVelocityLimit"):
        setattr(other, name, _times(getattr(model, name), per_v / units.time))
    return other


def _times(values: Array, factors: Array) -> Array:
    """Limits in other units; the largest numbers stand for none."""
    limited = np.abs(values) < 1e300
    return np.where(limited, np.where(limited, values, 0.0) * factors, values)


def scaled_closure(closure: Closure, model: pin.Model, length: float) -> Closure:
    """A closure in other units."""
    if isinstance(closure, JointCoupling):
        per_v = _velocity_units(model, length)

        def of(name: str) -> float:
            return float(per_v[model.joints[model.getJointId(name)].idx_v])

        own = of(closure.joint)
        if closure.polynomial is not None:
            (other,) = closure.others
            numbers = [c * own / of(other) ** k for k, c in enumerate(closure.polynomial)]
            return JointCoupling(closure.joint, other, name=closure.name, polynomial=numbers)
        if isinstance(closure.other, str):
            return JointCoupling(
                closure.joint,
                closure.other,
                closure.ratio * own / of(closure.other),
                closure.offset * own,
                closure.name,
            )
        ratios = {name: ratio * own / of(name) for name, ratio in closure.other.items()}
        return JointCoupling(closure.joint, ratios, offset=closure.offset * own, name=closure.name)
    placements = {}
    for side in ("placement_a", "placement_b"):
        given = getattr(closure, side)
        if given is not None:
            placements[side] = _placement(pin.SE3(np.array(given)), length)
    return LoopClosure(
        closure.frame_a,
        closure.frame_b,
        closure.kind,
        closure.name,
        closure.axis,
        closure.axis_b,
        closure.distance and length * closure.distance,
        **placements,
    )


def scaled_effects(
    effects: JointEffects | None, model: pin.Model, units: Units
) -> JointEffects | None:
    """Damping, friction and springs in other units; one kind of joint only may have friction."""
    if effects is None:
        return None
    per_v = _velocity_units(model, units.length)
    rubbing = per_v[effects.friction > 0]
    return JointEffects(
        damping=units.energy * units.time / per_v**2 * effects.damping,
        friction=units.energy / per_v * effects.friction,
        stiffness=units.energy / per_v**2 * effects.stiffness,
        rest=per_v * effects.rest,
        friction_speed=effects.friction_speed
        / units.time
        * (float(rubbing[0]) if rubbing.size else 1.0),
    )


def scaled_mechanism(
    mechanism: ClosedLoopModel, units: Units, home: bool = True
) -> ClosedLoopModel:
    """A mechanism in other units."""
    model, length = mechanism.model, units.length
    given = mechanism._given_length
    return ClosedLoopModel(
        scaled_model(model, units),
        [scaled_closure(closure, model, length) for closure in mechanism.closures],
        mechanism.actuated,
        home=mechanism.home * coordinate_units(model, length) if home else None,
        effects=scaled_effects(mechanism.effects, model, units),
        name=mechanism.name,
        characteristic_length=given and length * given,
        max_condition=mechanism.max_condition,
        accuracy=mechanism.accuracy,
    )


_LENGTHS = ("base_radius", "platform_radius", "leg_com", "rod_com")
_MASSES = ("platform_mass", "leg_mass", "rod_mass")
_INERTIAS = ("platform_inertia", "leg_inertia", "rod_inertia")


def scaled_parameters(p: RPSParameters, units: Units) -> RPSParameters:
    """A 3-RPS in other units; one kind of joint only may have dry friction."""
    factors: dict[str, float] = dict.fromkeys(_LENGTHS, units.length)
    factors |= dict.fromkeys(_MASSES, units.mass) | dict.fromkeys(_INERTIAS, units.inertia)
    factors |= {
        "actuator_force_limit": units.force,
        "actuator_speed_limit": units.length / units.time,
        "gravity": units.acceleration,
        "prismatic_damping": units.mass / units.time,
        "prismatic_friction": units.force,
        "revolute_damping": units.inertia / units.time,
        "revolute_friction": units.energy,
        "friction_speed": (units.length if p.prismatic_friction else 1.0) / units.time,
    }
    changes = {name: getattr(p, name) * factor for name, factor in factors.items()}
    shortest, longest = p.leg_length_limits
    changes["leg_length_limits"] = (shortest * units.length, longest * units.length)
    return p.replace(**changes)


def scaled_payload(payload: Payload, units: Units) -> Payload:
    return Payload(
        payload.mass * units.mass,
        np.asarray(payload.centre) * units.length,
        np.asarray(payload.inertia) * units.inertia,
    )


def drawn_units(seed: int, count: int, largest: float = 9.0) -> Iterator[Units]:
    """Factors between 1e-9 and 1e9: powers of ten, and any."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        powers = rng.uniform(-largest, largest, 3)
        yield Units(*(10.0 ** (np.round(powers) if k % 2 else powers)))

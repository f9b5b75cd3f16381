"""Friction in the legs' joints: d v + f tanh(v / v_s), viscous and dry, smooth near zero speed.

Dry friction reaches 76 % of f at the speed v_s and creeps below it, instead of sticking; see
`rps_pin.closed_loop.dynamics.passive_joint_forces`, whose formula this is.
"""

from __future__ import annotations

import pinocchio as pin

from rps_pin.closed_loop import JointEffects
from rps_pin.rps.leg_frames import LEGS
from rps_pin.rps.parameters import RPSParameters

_KINDS = ("prismatic", "revolute")
#: Names of the parameters of friction that are zero without it.
FRICTION = tuple(f"{kind}_{what}" for kind in _KINDS for what in ("damping", "friction"))


def has_friction(p: RPSParameters) -> bool:
    """Return whether a robot's joints have any friction."""
    return any(getattr(p, name) for name in FRICTION)


def friction_effects(model: pin.Model, p: RPSParameters) -> JointEffects | None:
    """Return the friction of the robot's tree as its mechanism takes it, or None without any."""
    if not has_friction(p):
        return None

    def named(what: str) -> dict[str, float]:
        return {f"leg_{i}_{kind}": getattr(p, f"{kind}_{what}") for i in LEGS for kind in _KINDS}

    return JointEffects.named(
        model,
        damping=named("damping"),
        friction=named("friction"),
        friction_speed=p.friction_speed,
    )

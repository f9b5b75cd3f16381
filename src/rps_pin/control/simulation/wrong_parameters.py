"""A machine that is not what its controller believes: other masses, and friction."""

from __future__ import annotations

from rps_pin.errors import InputError
from rps_pin.rps.kinematics.leg_equations import checked_positive
from rps_pin.rps.parameters import RPSParameters

_FRICTION = (
    *("prismatic_damping", "prismatic_friction", "revolute_damping"),
    *("revolute_friction", "friction_speed"),
)


def wrong_parameters(
    parameters: RPSParameters,
    *,
    masses: float = 1.0,
    platform: float = 1.0,
    legs: float = 1.0,
    rods: float = 1.0,
    **friction: float,
) -> RPSParameters:
    """Return parameters with other masses and inertias; centres of mass stay where they are.

    Parameters
    ----------
    parameters
        What the controller believes.
    masses
        Factor of all masses and inertias; 1.2 for 20 % more.
    platform, legs, rods
        Further factors of the platform's, the cylinders' and the rods' own.
    **friction
        ``prismatic_damping`` (N s/m), ``prismatic_friction`` (N), ``revolute_damping`` (N m s/rad),
        ``revolute_friction`` (N m), ``friction_speed`` (rad/s or m/s), instead of the believed.

    Raises
    ------
    InputError
        If a factor is not positive, or friction negative.
    """
    for name in friction:
        if name in RPSParameters.model_fields and name not in _FRICTION:
            raise InputError(f"{name} is no friction; that is: {', '.join(_FRICTION)}")
    factors = {"masses": masses, "platform": platform, "legs": legs, "rods": rods}
    for name, factor in factors.items():
        checked_positive(factor, name)
    p = parameters
    return p.replace(
        platform_mass=p.platform_mass * masses * platform,
        platform_inertia=p.platform_inertia * masses * platform,
        leg_mass=p.leg_mass * masses * legs,
        leg_inertia=p.leg_inertia * masses * legs,
        rod_mass=p.rod_mass * masses * rods,
        rod_inertia=p.rod_inertia * masses * rods,
        **friction,
    )

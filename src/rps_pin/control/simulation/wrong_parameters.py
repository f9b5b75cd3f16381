"""Parameters of a machine that differs from its controller's model: masses and friction."""

from __future__ import annotations

from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.parameters import RPSParameters
from rps_pin.validation import positive_number

_FRICTION = (
    *("prismatic_damping", "prismatic_friction", "revolute_damping"),
    *("revolute_friction", "friction_speed"),
)


@refuses_other_kinds
def wrong_parameters(
    parameters: RPSParameters,
    *,
    masses: float = 1.0,
    platform: float = 1.0,
    legs: float = 1.0,
    rods: float = 1.0,
    **friction: float,
) -> RPSParameters:
    """Return parameters with scaled masses and inertias, the centres of mass unchanged.

    Parameters
    ----------
    parameters
        The controller's.
    masses
        Factor of all masses and inertias; 1.2 for 20 % more.
    platform, legs, rods
        Further factors for the platform, the cylinders and the rods.
    **friction
        ``prismatic_damping`` (N s/m), ``prismatic_friction`` (N), ``revolute_damping`` (N m s/rad),
        ``revolute_friction`` (N m), ``friction_speed`` (rad/s or m/s): replaces the controller's.

    Raises
    ------
    InputError
        If a factor is not positive, or friction is negative.
    """
    for name in friction:
        if name in RPSParameters.model_fields and name not in _FRICTION:
            raise InputError(f"{name} is not a friction parameter; these are: {_FRICTION}")
    factors = {"masses": masses, "platform": platform, "legs": legs, "rods": rods}
    whole, *parts = (positive_number(factor, name) for name, factor in factors.items())
    scaled = {
        f"{part}_{quantity}": getattr(parameters, f"{part}_{quantity}") * whole * factor
        for part, factor in zip(("platform", "leg", "rod"), parts, strict=True)
        for quantity in ("mass", "inertia")
    }
    return parameters.replace(**scaled, **friction)

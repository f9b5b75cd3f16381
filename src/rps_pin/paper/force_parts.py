"""Actuator forces of a path by cause, computed once for all masses.

The forces are those of the paper's method, Lagrange's equations of the first kind. They are linear
in the masses and inertias: those of a few unit robots give those of every interpretation of the
bodies.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.paper import interpretations as choices
from rps_pin.paper import paper_data as paper
from rps_pin.paper.lagrange import lagrange_forces
from rps_pin.rps.parameters import RPSParameters
from rps_pin.trajectories.path import PathSample


class UnitRobot:
    """A robot of given radii: a platform of 1 kg with Table 1's inertia, legs without mass."""

    def __init__(self, base_radius: float, platform_radius: float) -> None:
        self.parameters = RPSParameters(
            base_radius=base_radius,
            platform_radius=platform_radius,
            platform_mass=1.0,
            platform_inertia=np.diag(paper.PLATFORM_INERTIA),
            leg_mass=0.0,
            leg_com=0.0,
            leg_inertia=0.0,
            leg_inertia_about="com",
            gravity=np.zeros(3),
        )


class ForceParts(NamedTuple):
    """Actuator forces of a path by cause, shape (n, 3) each: a unit of each gives so much."""

    mass: Array
    """Inertia of a platform of 1 kg, N."""
    inertia: Array
    """Of Table 1's inertia tensor, N; the platform without mass."""
    inertia_as_printed: Array
    """The same with Eq. 14 as printed."""
    leg_inertia: Array
    """Of legs with 1 kg m^2 about their joints, N."""
    weight: Array
    """Of a platform of 1 kg at rest, N."""
    leg_weight: Array
    """Of legs with m_leg r = 1 kg m at rest, N."""


def force_parts(robot: UnitRobot, motion: PathSample) -> ForceParts:
    """Return the actuator forces along a motion by cause, by differences of Lagrange's equations.

    Parameters
    ----------
    robot
        Of the radii that follow the path.
    motion
        Poses, rates and accelerations, shape (n, 3) each.

    Raises
    ------
    SingularityError
        If a pose is singular.
    """

    def forces(as_printed: tuple[str, ...] = (), **changes: Any) -> Array:
        parameters = robot.parameters.replace(**changes) if changes else robot.parameters
        return lagrange_forces(parameters, *motion, as_printed=as_printed).force

    unit = forces()
    mass = forces(platform_mass=2.0) - unit
    legs: dict[str, Any] = {"leg_mass": 1.0, "leg_inertia_about": "com"}
    down = np.array([0.0, 0.0, -choices.STANDARD_GRAVITY])
    weight = forces(gravity=down) - unit
    turning = forces(**legs, leg_inertia=1.0) - unit
    lever = forces(**legs, leg_com=1.0)
    lever_and_weight = forces(**legs, leg_com=1.0, gravity=down)
    return ForceParts(
        mass=mass,
        inertia=unit - mass,
        inertia_as_printed=forces(as_printed=("eq_14",)) - mass,
        leg_inertia=turning,
        weight=weight,
        leg_weight=lever_and_weight - lever - weight,
    )


def combined(parts: ForceParts, interpretation: choices.BodyInterpretation) -> Array:
    """Return the actuator forces (n, 3) of an interpretation of the bodies, N."""
    bodies = choices.BODIES[interpretation.bodies]
    lever = paper.LEG_COM_MM * 1e-3
    # Eq. 16 as printed: I_leg + m_leg r^2
    about_com = bodies.leg_mass * lever**2 if bodies.about == "com" else 0.0
    leg_inertia = paper.LEG_INERTIA + about_com
    right = interpretation.eq_14 == choices.EQ_14[0]
    inertia = parts.inertia if right else parts.inertia_as_printed
    force: Array = bodies.platform_mass * parts.mass + inertia + leg_inertia * parts.leg_inertia
    if interpretation.gravity != "no gravity":
        as_meant = interpretation.gravity == choices.GRAVITIES[0]
        weighed = bodies.platform_mass if as_meant else 1.0  # Eq. 19
        force = force + weighed * parts.weight + bodies.leg_mass * lever * parts.leg_weight
    return force

"""Actuator forces of a motion by cause: gravity, inertia, Coriolis, friction, payload, wrench.

The actuator forces are linear in what the bodies' motion takes (see `force_equations`), so that
each cause has its own part, and the parts add up to the whole. Gravity, inertia and Coriolis are
those of the robot itself, without its payload: of platform, cylinders and rods.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.dynamics.actuator_forces import ForceShare, forces_of
from rps_pin.rps.dynamics.force_equations import ForceTerms, inertia_entries, vector_entries
from rps_pin.rps.dynamics.friction import FRICTION, has_friction
from rps_pin.rps.dynamics.loads import checked_wrench
from rps_pin.rps.kinematics.legs import PoseLegs, check_legs
from rps_pin.rps.kinematics.pose import checked_motion
from rps_pin.rps.kinematics.samples import Errors, maskable
from rps_pin.rps.robot import RPSRobot
from rps_pin.task.sizing.force_causes import ForceParts

_NO_VECTOR = (0.0, 0.0, 0.0)
#: Changes of `ForceTerms` that leave friction, or the bodies, out.
_NO_FRICTION: dict[str, Any] = dict.fromkeys(FRICTION, 0.0)
_NO_BODIES: dict[str, Any] = {
    **dict.fromkeys(["platform_mass", "leg_moment", "leg_inertia", "rod_mass"], 0.0),
    **{"platform_moment": _NO_VECTOR, "platform_inertia": (0.0,) * 6},
}


@dataclass(frozen=True)
class ForceCauses(ForceParts):
    """Parts of the actuator forces, shape (..., 3) each, N; positive pushes the leg out."""

    gravity: Array
    """Holding platform and legs against gravity."""
    inertia: Array
    """Accelerating them: what is proportional to the pose's acceleration."""
    coriolis: Array
    """Coriolis and centrifugal forces: what is quadratic in the pose's rate."""
    friction: Array
    """Of prismatic and revolute joints."""
    payload: Array
    """Carrying and moving the payload: its gravity, inertia and Coriolis forces."""
    external: Array
    """Withstanding the external wrench."""


@refuses_other_kinds
@maskable("legs", pose=1, rate=1, acceleration=1, wrench=1)
def force_causes(
    robot: RPSRobot,
    pose: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    *,
    wrench: ArrayLike | None = None,
    legs: PoseLegs | None = None,
    errors: Errors = "raise",
) -> ForceCauses:
    """Return the parts of the actuator forces of samples.

    Parameters
    ----------
    robot
        The 3-RPS, with its payload and friction.
    pose, rate, acceleration, wrench
        As for `RPSRobot.actuator_forces`.
    legs
        Those of the poses, if they are known: `MotionRun.legs`.
    errors
        ``"raise"`` refuses the first sample that is out of reach or singular; with ``"mask"`` the
        parts of such samples are NaN.

    Raises
    ------
    InputError, UnreachableError, SingularityError
        As `RPSRobot.actuator_forces`.
    """
    x, dx, ddx = checked_motion(pose, rate, acceleration)
    check_legs(legs, x)
    load = None if wrench is None else checked_wrench(wrench, x.shape[:-1])
    still = np.zeros_like(x)
    bodies = replace(ForceTerms.of(robot.parameters), **_NO_FRICTION)
    weightless = replace(bodies, gravity=_NO_VECTOR)
    bodiless = replace(robot.force_terms, **_NO_BODIES)
    shares = {
        "gravity": ForceShare(bodies, still, still, None),
        "inertia": ForceShare(weightless, still, ddx, None),
        "coriolis": ForceShare(weightless, dx, still, None),
    }
    if has_friction(robot.parameters):
        shares["friction"] = ForceShare(bodiless, dx, still, None)
    if robot.payload is not None:
        carried = replace(
            replace(bodiless, **_NO_FRICTION),
            platform_mass=robot.payload.mass,
            platform_moment=vector_entries(robot.payload.first_moment),
            platform_inertia=inertia_entries(robot.payload.inertia_about_platform),
        )
        shares["payload"] = ForceShare(carried, dx, ddx, None)
    if load is not None:
        shares["external"] = ForceShare(replace(weightless, **_NO_BODIES), still, still, load)
    found, suspect = forces_of(list(shares.values()), x, robot.parameters, legs)
    if suspect.any() or not np.isfinite(found).all():
        robot.actuator_forces(x, dx, ddx, wrench=wrench)  # raises where there are no forces
    parts = dict(zip(shares, found, strict=True))
    return ForceCauses(
        **{field.name: parts.get(field.name, still) for field in fields(ForceCauses)}
    )

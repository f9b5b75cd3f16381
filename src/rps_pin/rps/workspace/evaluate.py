"""Everything a workspace knows of a batch of poses: its fields, and why each point is out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.rps.kinematics.pose import position
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.jacobian import leg_jacobian
from rps_pin.rps.workspace.measures import measures
from rps_pin.rps.workspace.reasons import Flags, Reason, broken_limits

#: A pose whose conditioning, 1/cond(K), is below this counts as singular unless told otherwise.
MIN_CONDITIONING = 1e-3


class Fields(NamedTuple):
    """Fields over points of a workspace; all zero where a point is unreachable."""

    reason: Flags
    """`Reason` bits, shape (...), 0 inside."""
    pose: Array
    """(z, tilt_x, tilt_y), shape (..., 3), m and rad."""
    position: Array
    """Of the platform's centre, base axes, shape (..., 3), m."""
    length: Array
    """Leg lengths, shape (..., 3), m."""
    angle: Array
    """Leg angles, shape (..., 3), rad."""
    determinant: Array
    """Of d(length)/d(z, h tilt_x, h tilt_y), shape (...): its sign is the side of a singularity."""
    conditioning: Array
    """1/cond of d(length)/d(z, h tilt_x, h tilt_y), shape (...): 0 singular, 1 at best."""
    transmission: Array
    """Load carried per unit of actuator force, shape (...); see `measures`."""

    def part(self, where: tuple[slice, ...]) -> Fields:
        """Return the fields of a part of the points."""
        return Fields(
            self.reason[where],
            self.pose[where],
            self.position[where],
            self.length[where],
            self.angle[where],
            self.determinant[where],
            self.conditioning[where],
            self.transmission[where],
        )

    def fill(self, where: tuple[slice, ...], values: Fields) -> None:
        """Copy the fields of a part of the points into these."""
        for name in self._fields:
            getattr(self, name)[where] = getattr(values, name)


def side_of_singularity(parameters: RPSParameters, start: Array) -> float:
    """Return the determinant of the scaled Jacobian at a pose (3,); its sign is the side."""
    legs = leg_jacobian(start, parameters.base_radius, parameters.platform_radius)
    return float(measures(legs.jacobian).determinant)


def evaluate(
    parameters: RPSParameters,
    pose: Array,
    side: float,
    *,
    found: Bools | None = None,
    min_conditioning: float = MIN_CONDITIONING,
) -> Fields:
    """Return the fields of poses, and why each is out.

    Parameters
    ----------
    parameters
        The robot with its limits.
    pose
        Shape (..., 3), m and rad.
    side
        The determinant's sign on the start's side of the singularities.
    found
        Whether there is a pose at all, shape (...); where not, the point is unreachable.
    min_conditioning
        Least 1/cond that is not singular.
    """
    p = parameters
    legs = leg_jacobian(pose, p.base_radius, p.platform_radius)
    measure = measures(legs.jacobian)
    reason = broken_limits(p, pose, legs.length, legs.angle)
    singular = (measure.conditioning < min_conditioning) | (measure.determinant * side <= 0)
    reason |= np.uint16(Reason.SINGULAR) * singular
    fields = Fields(
        reason,
        pose,
        position(pose, p.platform_radius),
        legs.length,
        legs.angle,
        measure.determinant,
        measure.conditioning,
        measure.transmission,
    )
    if found is not None and not found.all():
        for field in fields:
            field[~found] = 0
        reason[~found] = Reason.UNREACHABLE
    return fields

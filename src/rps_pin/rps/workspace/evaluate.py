"""Fields of a batch of poses: legs, measures, and the reasons why a pose is outside."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.rps.kernels import legs as kernels
from rps_pin.rps.kernels import tips as ring
from rps_pin.rps.kinematics.inverse_kinematics import spherical_angles
from rps_pin.rps.kinematics.legs import LegGeometry, leg_geometry
from rps_pin.rps.kinematics.pose import components, stacked, tilt_of
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.measures import measures
from rps_pin.rps.workspace.reasons import Flags, Reason, broken_limits
from rps_pin.task.workspace.evaluate import MIN_CONDITIONING


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
        return Fields._make(field[where] for field in self)

    def fill(self, where: tuple[slice, ...], values: Fields) -> None:
        """Copy the fields of a part of the points into these."""
        for name in self._fields:
            getattr(self, name)[where] = getattr(values, name)


class _Legs(NamedTuple):
    """Legs of n poses, and how their lengths change with the pose; legs come first."""

    length: Array
    """d, shape (3 legs, n), m."""
    angle: Array
    """phi, shape (3 legs, n), rad."""
    jacobian: list[tuple[Array, Array, Array]]
    """Rows of d(length)/d(z, h tilt_x, h tilt_y), dimensionless; zero for a leg of no length."""
    position: Array
    """Of the platform's centre, shape (n, 3), m."""
    cone: Array | None
    """Angles of the spherical joints, shape (3 legs, n), rad; None where they have no limit."""


def _legs(parameters: RPSParameters, pose: Array) -> _Legs:
    """Return the legs of poses (n, 3): the kernels on contiguous arrays."""
    g, h = parameters.base_radius, parameters.platform_radius
    z, _, _ = components(pose)
    x, y, tilt = tilt_of(pose)
    radial, height = ring.tips(z, x, y, tilt, h)
    tips = np.asarray(ring.at_legs(radial)), np.asarray(ring.at_legs(height))
    d, cosine, sine, vanishing = leg_geometry(*tips, g)
    cone = None
    if parameters.spherical_cone_limit < math.pi:
        geometry = LegGeometry(d.T, cosine.T, sine.T, vanishing.T)
        cone = spherical_angles(parameters, pose, geometry, (x, y, tilt)).T
    if vanishing.any():  # the leg has no direction
        cosine, sine = np.where(vanishing, 0.0, cosine), np.where(vanishing, 0.0, sine)
    by_x, by_y, *heights = ring.tip_slopes(x, y, tilt)
    columns = [
        kernels.along_leg(cosine, sine, ring.at_legs(out), ring.at_legs(up))
        for out, up in zip((by_x, by_y), heights, strict=True)
    ]
    return _Legs(
        d,
        np.arctan2(sine, cosine),
        list(zip(sine, *columns, strict=True)),
        stacked(0.5 * radial[1], 0.5 * radial[2], z),
        cone,
    )


def side_of_singularity(parameters: RPSParameters, start: Array) -> float:
    """Return the determinant of the scaled Jacobian at a pose (3,); its sign is the side."""
    return float(measures(_legs(parameters, start[None]).jacobian).determinant[0])


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
    legs = _legs(parameters, pose.reshape(-1, 3))
    determinant, conditioning, transmission = measures(legs.jacobian)
    reason = broken_limits(parameters, legs.length, legs.angle, legs.cone)
    singular = (conditioning < min_conditioning) | (determinant * side <= 0)
    reason |= np.uint16(Reason.SINGULAR) * singular
    shape = pose.shape[:-1]
    fields = Fields(
        reason.reshape(shape),
        pose,
        legs.position.reshape(pose.shape),
        np.ascontiguousarray(legs.length.T).reshape(pose.shape),
        np.ascontiguousarray(legs.angle.T).reshape(pose.shape),
        determinant.reshape(shape),
        conditioning.reshape(shape),
        transmission.reshape(shape),
    )
    if found is not None and not found.all():
        for field in fields:
            field[~found] = 0
        fields.reason[~found] = Reason.UNREACHABLE
    return fields

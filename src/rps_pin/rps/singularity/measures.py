"""Measures of how far poses of the 3-RPS are from singularities: definitions, names, thresholds.

The legs and the platform move together by A pose' = B d', with row i of A the derivative of
|B_i - A_i|^2 / 2 with respect to the pose and B = diag(d_1, d_2, d_3); K = B^-1 A is d(length) /
d(pose). Three things can fail:

- **Type I**: B loses rank. A leg has no length; turning it does not move its tip.
- **Type II** (parallel): K loses rank. The platform moves while every actuator stands still, and no
  actuator force resists it.
- **Constraint**: the loops' Jacobian J loses rank. The legs' planes no longer forbid torsion, and
  the robot's two operation modes meet. Unit forces across the three legs' planes have no resultant,
  only a couple, sum_i B_i x t_i = 3 h cos(beta/2) n, with n a unit vector and beta the tilt; it
  vanishes at beta = pi and nowhere else.

Every measure is dimensionless; the platform's radius h makes angles lengths. A number has the same
name wherever it is printed or written:

====================== ============================================ ======== ===================
name                   definition                                   range    zero at
====================== ============================================ ======== ===================
`type_i`               shortest leg / h                             0 to inf type I
`type_ii`              least rms(d') / rms(tip speed) of all        0 to 1   type II
                       motions of the platform
`constraint`           cos(beta/2), signed                          -1 to 1  constraint
`determinant`          product of the three gains rms(d') / rms(tip -1 to 1  type II
                       speed), with the sign of det K
`distance`             least of `type_i`, `type_ii`, `constraint`   0 to 1   any of the three
                       in size: *the* distance to a singularity
`passive_conditioning` 1 / cond(J_p), J_p the passive columns of J; 0 to 1   any of the three
                       of any mechanism, 1 / `condition`
`conditioning`         1 / cond(K), K by (z, h tilt_x, h tilt_y)    0 to 1   type II
`transmission`         load on the platform per force of the most   0 to 1   type II
                       loaded actuator
====================== ============================================ ======== ===================

The first five are `rps_pin.task.SingularityMeasures`; `conditioning` and `transmission` are fields
of workspaces (`rps_pin.rps.workspace.Fields`).

========================================== ====================== ======= =========================
threshold                                  of                     default below it
========================================== ====================== ======= =========================
`check_path(threshold=...)`                `distance`             1e-3    a path grazes
`Controller(near_singular=...)`            `type_ii`              0.05    the status says so
`Controller(stop_singular=...)`            `type_ii`              0.01    the controller stops
`workspace(min_conditioning=...)`          `conditioning`         1e-3    a pose is outside
`ClosedLoopModel(max_condition=...)`       `passive_conditioning` 1e-8    forces are refused
                                           = 1 / max_condition
========================================== ====================== ======= =========================

The relations between the determinants, with K in (z, tilt_x, tilt_y):

    |det J_p|            = d_1 d_2 d_3 (3 sqrt(3)/4) h |beta cot(beta/2) det K|,
    |det df/dphi| (Eq. 8) = 8 |det J_p|.

(J_p has rows in m and platform columns in base axes about its centre. Follow B_i' = (tip
velocities) through the wrenches along the legs and across their planes for the first, and project
the tips' velocities on the changes of the triangle's sides for the second: the triangle's inertia
gives 27/2 h^3, its sides 108 h^3.) Below half a turn all three vanish together: that is type II. At
beta = pi, det J_p and Eq. 8's Jacobian vanish with the constraint's measure and det K need not;
and these two also vanish with a leg's length, type I.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics import rates
from rps_pin.rps.kinematics.legs import RADIAL, refuse_vanishing
from rps_pin.rps.kinematics.pose import checked_pose, rotation
from rps_pin.rps.kinematics.samples import Errors, maskable, refuse
from rps_pin.rps.parameters import RPSParameters
from rps_pin.task.singularity import SingularityMeasures


@refuses_other_kinds
@maskable(pose=1)
def singularity_measures(
    parameters: RPSParameters, pose: ArrayLike, *, errors: Errors = "raise"
) -> SingularityMeasures:
    """Return how far poses are from type I, type II and constraint singularities.

    Parameters
    ----------
    pose
        Shape (..., 3), tilted by less than a whole turn.
    errors
        Where a leg has no length, its direction is not determined and neither is type II:
        ``"raise"`` refuses such a pose, ``"mask"`` answers 0 for its `type_ii` and `determinant`,
        and NaN for a pose that is tilted by a whole turn or more.

    Raises
    ------
    InputError
        If the pose has the wrong shape, is not finite, or is tilted by a whole turn or more (there
        the coordinates fail, not the robot).
    UnreachableError
        If a leg has no length.
    """
    x = checked_tilt(pose)
    tip = rates.tip_jacobians(parameters, x)
    legs, vanishing = rates.masked_leg_jacobians(parameters, x)
    if errors == "raise":
        refuse_vanishing(legs.length, vanishing)
    regular = ~vanishing.any(axis=-1)
    gains = np.linalg.svd(gain_matrix(tip, legs)[0], compute_uv=False)
    return SingularityMeasures(
        legs.length.min(axis=-1) / parameters.platform_radius,
        np.where(regular, gains[..., 2], 0.0),
        np.cos(np.hypot(x[..., 1], x[..., 2]) / 2),
        np.where(regular, _determinant(tip, legs), 0.0),
    )


def passive_conditioning(parameters: RPSParameters, pose: ArrayLike) -> Array:
    """Return 1 / cond(J_p), J_p the loops' Jacobian of the passive joints, shape (...).

    The inverse of ``robot.mechanism.condition`` for whole batches: 0 at a singularity of any of the
    three kinds, 1 at best; angles are made lengths by h. It is the relative distance of J_p to the
    nearest singular matrix.

    Parameters
    ----------
    pose
        Shape (..., 3).

    Raises
    ------
    InputError
        If the pose has the wrong shape or is not finite.
    """
    x = checked_pose(pose)
    h = parameters.platform_radius
    legs, _ = rates.masked_leg_jacobians(parameters, x)
    arm = RADIAL @ np.swapaxes(rotation(x), -1, -2)  # from the centre to each tip, over h
    upright = np.array([0.0, 0.0, 1.0])
    # A leg that turns moves its tip by d n: n = sin(phi) e_i + cos(phi) z.
    n = np.sin(legs.angle)[..., None] * RADIAL + np.cos(legs.angle)[..., None] * upright
    J = np.zeros((*x.shape[:-1], 9, 9))
    for i in range(3):
        rows = slice(3 * i, 3 * i + 3)
        J[..., rows, 0:3] = np.eye(3)
        J[..., rows, 3:6] = -_skew(arm[..., i, :])
        J[..., rows, 6 + i] = -legs.length[..., i, None] / h * n[..., i, :]
    values = np.linalg.svd(J, compute_uv=False)
    return np.asarray(values[..., -1] / values[..., 0])


def checked_tilt(pose: ArrayLike) -> Array:
    """Return poses as `checked_pose`; refuse tilts of a whole turn, where (tilt_x, tilt_y) fail."""
    x = checked_pose(pose)
    tilt = np.hypot(x[..., 1], x[..., 2])

    def error(first: tuple[int, ...], where: str) -> InputError:
        return InputError(
            f"pose{where} is tilted by {tilt[first]:.6g} rad; here it must be below 2 pi, where "
            "(tilt_x, tilt_y) are singular coordinates. The same placement has a tilt up to pi"
        )

    refuse(tilt > 2 * math.pi * (1 - 1e-6), error)
    return x


def signed_determinant(parameters: RPSParameters, pose: Array) -> Array:
    """Return `SingularityMeasures.determinant` alone, of checked poses; 0 with a vanishing leg."""
    legs, vanishing = rates.masked_leg_jacobians(parameters, pose)
    determinant = _determinant(rates.tip_jacobians(parameters, pose), legs)
    return np.where(vanishing.any(axis=-1), 0.0, determinant)


def gain_matrix(tip: rates.TipJacobians, legs: rates.LegJacobians) -> tuple[Array, Array]:
    """Return M = K L^-T / sqrt(3) and L, L L' = Q: leg speeds per unit platform speed."""
    L = np.asarray(np.linalg.cholesky(_speed_form(tip)), dtype=np.float64)
    transposed = np.linalg.solve(L, np.swapaxes(legs.length_jacobian, -1, -2))
    return np.asarray(np.swapaxes(transposed, -1, -2) / math.sqrt(3), dtype=np.float64), L


def _speed_form(tip: rates.TipJacobians) -> Array:
    """Return Q with pose' . Q pose' the mean of the tips' squared speed, shape (..., 3, 3)."""
    U, W = tip.radial_jacobian, tip.height_jacobian
    form: Array = (np.swapaxes(U, -1, -2) @ U + np.swapaxes(W, -1, -2) @ W) / 3
    return form


def _determinant(tip: rates.TipJacobians, legs: rates.LegJacobians) -> Array:
    """Return det K / sqrt(det Q) / 3^(3/2), the product of the gains with its sign."""
    size = np.sqrt(np.linalg.det(_speed_form(tip)))
    product: Array = np.linalg.det(legs.length_jacobian) / (3 * math.sqrt(3) * size)
    return product


def _skew(vector: Array) -> Array:
    """Return [v]x, shape (..., 3, 3)."""
    matrix: Array = -np.cross(np.eye(3), vector[..., None, :])
    return np.swapaxes(matrix, -1, -2)

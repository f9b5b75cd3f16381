"""Inverse dynamics of the 3-RPS as the paper does it: Lagrange's equations of the first kind.

In the coordinates x = (d_1, d_2, d_3, phi_1, phi_2, phi_3) of Eq. 10, with Eq. 8 as constraints f,

    d/dt dL/dx' - dL/dx = (F, 0) + A' lambda,    A = df/dx         (Eq. 22, without friction).

The three equations of phi have no unknowns but the multipliers (Eq. 25), those of d then give the
forces (Eq. 24):

    A_phi' lambda = (M x'' + c + gravity)_phi,    F = (M x'' + c + gravity)_d - A_d' lambda.

The terms are those of `rps_pin.paper.lagrange_terms`. The paper's legs are a cylinder each that
only turns; rods that slide, if they have mass, are bodies of these equations too.

Multipliers depend on how the platform's energy is written for coordinates that do not close the
robot, forces do not: energies that agree on closed motions have Lagrange equations that differ by a
combination of the rows of A. The multipliers here belong to the energies of `lagrange_terms`.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.system import MAX_CONDITION
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.paper.lagrange_terms import lagrange_terms
from rps_pin.rps.kinematics.legs import leg_motion
from rps_pin.rps.kinematics.pose import checked_motion
from rps_pin.rps.kinematics.rates import accepted_gains, times
from rps_pin.rps.kinematics.samples import Errors, maskable
from rps_pin.rps.parameters import RPSParameters


class LagrangeDynamics(NamedTuple):
    """The forces of a motion, and the equations they come from (see `LagrangeTerms`)."""

    force: Array
    """F of legs 1 to 3, shape (..., 3), N; positive pushes the leg out: Eq. 24."""
    multipliers: Array
    """lambda of f_1, f_2, f_3, shape (..., 3), N/m: Eq. 25."""
    mass_matrix: Array
    """M, shape (..., 6, 6), kg, kg m and kg m^2."""
    coriolis: Array
    """c, shape (..., 6), N and N m."""
    gravity: Array
    """Derivative of the potential energy, shape (..., 6), N and N m."""
    constraint_jacobian: Array
    """A = df/dx, shape (..., 3, 6), m and m^2."""


@refuses_other_kinds
@maskable(pose=1, rate=1, acceleration=1)
def lagrange_forces(
    parameters: RPSParameters,
    pose: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    *,
    as_printed: Collection[str] = (),
    max_gain: float = MAX_CONDITION,
    errors: Errors = "raise",
) -> LagrangeDynamics:
    """Return the actuators' forces by Lagrange's equations of the first kind: Eq. 8 to 25.

    Limits of the robot are not considered.

    Parameters
    ----------
    pose, rate, acceleration
        Pose (m, rad, rad) and its first and second time derivatives, shape (..., 3) each.
    as_printed
        Equations to take as the paper prints them, misprints and all, of
        `lagrange_terms.PRINTED`: ``"eq_14"``, ``"eq_19"``. None if left out. (The two
        interpretations of Eq. 16 are ``RPSParameters.leg_inertia_about``.)
    max_gain
        Largest accepted 1 over the smallest singular value of A_phi, whose entries, made those of
        distances by arcs, are cosines.
    errors
        ``"raise"`` refuses the first sample with a leg of no length or at a singularity; with
        ``"mask"`` the results of such samples are NaN.

    Raises
    ------
    InputError
        If an argument has the wrong shape or is not finite, there is no such printed
        equation, or `max_gain` is not positive.
    UnreachableError
        If a leg has no length.
    SingularityError
        If Eq. 25 does not determine the multipliers: at the parallel singularities, where the
        forces are infinite, and where the platform is turned by exactly half a turn and meets the
        robot's other operation mode.
    """
    motion = checked_motion(pose, rate, acceleration)
    legs = leg_motion(*motion, parameters.platform_radius, parameters.base_radius)
    terms = lagrange_terms(parameters, *legs[:4], as_printed=as_printed)
    x_acceleration = np.concatenate([legs.acceleration, legs.angle_acceleration], axis=-1)
    effort = times(terms.mass_matrix, x_acceleration) + terms.coriolis + terms.gravity
    multipliers = _multipliers(parameters, legs.length, terms.constraint_jacobian, effort, max_gain)
    by_length = np.swapaxes(terms.constraint_jacobian[..., :3], -1, -2)
    force = effort[..., :3] - times(by_length, multipliers)
    return LagrangeDynamics(force, multipliers, *terms)


def _multipliers(
    parameters: RPSParameters, length: Array, jacobian: Array, effort: Array, max_gain: float
) -> Array:
    """Solve Eq. 25 for lambda, arcs d_i dphi_i instead of angles and distances instead of f."""
    side = 2 * math.sqrt(3.0) * parameters.platform_radius  # f = side * (distance - sqrt(3) h)
    cosines = jacobian[..., 3:] / (side * length[..., None, :])
    accepted_gains(
        cosines,
        max_gain,
        "Eq. 25 does not determine the multipliers{where}: the legs' angles could change with "
        "their lengths held, a gain of {gain:.3g}; at most {limit:.3g} is accepted",
    )
    across = effort[..., 3:] / length
    solved = np.linalg.solve(np.swapaxes(cosines, -1, -2), across[..., None])[..., 0]
    return np.asarray(solved / side, dtype=np.float64)

"""The terms of Lagrange's equations of the 3-RPS in the paper's coordinates x = (d, phi).

The Lagrangian (Eq. 9) is that of

- the platform (Eq. 13, 14): m V'V/2 + Omega' R I R' Omega/2. With the second moments
  S = tr(I)/2 - I of the platform's mass, in its axes, and the vectors r = (P, u, v, n) of
  `rps_pin.paper.lagrange_vectors`, this is the same as

      K = 1/2 sum_ab Y_ab r_a' . r_b',    Y = diag(m, S),

  exact for every rigid platform, products of inertia included, and quadratic in the rates of r:

      M = r_x' Y r_x,    c = r_x' Y (d/dt r_x) x';

- the legs' cylinders (Eq. 16, 17): J phi'^2/2 each, J about the revolute joint. Eq. 16 as printed
  adds m_leg r^2 to an I_leg that is said to be about that joint already. The interpretation is
  `RPSParameters.leg_inertia_about`: with ``"joint"`` J = I_leg, with ``"com"``
  J = I_leg + m_leg r^2, Eq. 16 as printed;
- the legs' rods, which the paper leaves out: with the rod's centre of mass at l = d - rod_com along
  the leg, m (d'^2 + l^2 phi'^2)/2 + I phi'^2/2;
- the weights (Eq. 19 to 21), for gravity G in any direction: -m G.P, -m_leg r G.s_i, -m l G.s_i.

Two equations can also be taken as the paper prints them (`PRINTED`), to see what that does:

- ``"eq_14"``: the platform's inertia in base axes is R I R, where R I R' is right. R I R is not
  symmetric; the energy sees its symmetric part only.
- ``"eq_19"``: the platform's potential energy is 9.81 p_z, where m is missing: as for 1 kg.

`docs/derive_lagrange.py` derives every term from these energies with SymPy.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.paper import lagrange_vectors as vectors
from rps_pin.rps.kernels import leg_equations
from rps_pin.rps.kinematics.leg_equations import checked_lengths
from rps_pin.rps.kinematics.rates import times
from rps_pin.rps.parameters import RPSParameters
from rps_pin.validation import choice, one_shape, real_array

#: The equations that can be taken as printed.
PRINTED = ("eq_14", "eq_19")


class LagrangeTerms(NamedTuple):
    """The equations M x'' + c + gravity = (F, 0) + A' lambda, Eq. 22, in x = (d, phi).

    Rows 0 to 2 are those of d (N, Eq. 24), rows 3 to 5 those of phi (N m, Eq. 25).
    """

    mass_matrix: Array
    """M, shape (..., 6, 6), kg, kg m and kg m^2."""
    coriolis: Array
    """c, Coriolis and centrifugal terms, shape (..., 6), N and N m."""
    gravity: Array
    """Derivative of the potential energy, shape (..., 6), N and N m."""
    constraint_jacobian: Array
    """A = df/dx of Eq. 8, shape (..., 3, 6), m and m^2."""


class Energies(NamedTuple):
    """Kinetic and potential energies, shape (...) each, J; potential zero at the base's centre."""

    platform_kinetic: Array
    """Eq. 13."""
    legs_kinetic: Array
    """Eq. 16, and that of the rods."""
    platform_potential: Array
    """Eq. 19 and 20."""
    legs_potential: Array
    """Eq. 21, and that of the rods."""


def lagrange_terms(
    parameters: RPSParameters,
    length: ArrayLike,
    angle: ArrayLike,
    speed: ArrayLike,
    angle_rate: ArrayLike,
    *,
    as_printed: Collection[str] = (),
) -> LagrangeTerms:
    """Return the terms of Lagrange's equations at any coordinates, closed or not.

    Parameters
    ----------
    length, angle
        d (m) and phi (rad), shape (..., 3).
    speed, angle_rate
        d' (m/s) and phi' (rad/s), shape (..., 3).
    as_printed
        Equations to take as the paper prints them, of `PRINTED`; none if left out.

    Raises
    ------
    InputError
        If an argument is not finite, a length not positive, shapes do not go together, or there is
        no such printed equation.
    """
    d, phi, dd, dphi = _checked(length, angle, speed, angle_rate)
    printed = _printed(as_printed)
    rate, r = _moving(parameters, d, phi, dd, dphi)
    mass, coriolis = _platform_inertia_terms(parameters, r, rate, "eq_14" in printed)
    _add_legs_inertia_terms(parameters, d, dd, dphi, mass, coriolis)
    gravity = -_weighed_mass(parameters, printed) * times(
        np.swapaxes(r.jacobian[..., 0, :, :], -1, -2), parameters.gravity
    )
    gravity += _legs_gravity(parameters, d, phi)
    return LagrangeTerms(mass, coriolis, gravity, _constraint_jacobian(parameters, d, phi))


def energies(
    parameters: RPSParameters, *coordinates: ArrayLike, as_printed: Collection[str] = ()
) -> Energies:
    """Return the energies of Eq. 13, 16, 19 and 21. Arguments and errors as `lagrange_terms`."""
    d, phi, dd, dphi = _checked(*coordinates)
    printed = _printed(as_printed)
    rate, r = _moving(parameters, d, phi, dd, dphi)
    platform, _ = _platform_inertia_terms(parameters, r, rate, "eq_14" in printed)
    legs, unused = np.zeros_like(platform), np.zeros_like(rate)
    _add_legs_inertia_terms(parameters, d, dd, dphi, legs, unused)
    moments = parameters.leg_mass * parameters.leg_com + parameters.rod_mass * (
        d - parameters.rod_com
    )
    return Energies(
        (rate * times(platform, rate)).sum(axis=-1) / 2,
        (rate * times(legs, rate)).sum(axis=-1) / 2,
        -_weighed_mass(parameters, printed) * (r.value[..., 0, :] @ parameters.gravity),
        -(moments * (vectors.leg_vectors(phi).along @ parameters.gravity)).sum(axis=-1),
    )


def constraints(parameters: RPSParameters, length: ArrayLike, angle: ArrayLike) -> Array:
    """Return f_1, f_2, f_3 of Eq. 8, shape (..., 3), m^2: zero where the robot is closed.

    Parameters
    ----------
    length, angle
        d (m) and phi (rad), shape (..., 3).

    Raises
    ------
    InputError
        If an argument is not finite, a length not positive, or shapes do not go together.
    """
    d, phi, _, _ = _checked(length, angle)
    g, h = parameters.base_radius, parameters.platform_radius
    d, phi = np.moveaxis(d, -1, 0), np.moveaxis(phi, -1, 0)
    constant = leg_equations.constants(d, g, h)
    return np.stack(
        [*leg_equations.residuals(d * np.cos(phi), d * np.sin(phi), g, constant)], axis=-1
    )


# Inner workings -----------------------------------------------------------------------------------


def _moving(
    parameters: RPSParameters, d: Array, phi: Array, dd: Array, dphi: Array
) -> tuple[Array, vectors.MovingVectors]:
    """Return the coordinates' rate, shape (..., 6), and the platform's vectors r."""
    rate = np.concatenate([dd, dphi], axis=-1)
    tips = vectors.tip_vectors(parameters.base_radius, d, phi, dd, dphi)
    return rate, vectors.platform_vectors(tips, parameters.platform_radius, rate)


def _printed(as_printed: Collection[str]) -> frozenset[str]:
    names = (as_printed,) if isinstance(as_printed, str) else as_printed
    return frozenset(choice(name, "as_printed", PRINTED) for name in names)


def _checked(
    length: ArrayLike, angle: ArrayLike, speed: ArrayLike = (0, 0, 0), rate: ArrayLike = (0, 0, 0)
) -> tuple[Array, ...]:
    return one_shape(
        length=checked_lengths(length),
        angle=real_array(angle, "angle", (3,)),
        speed=real_array(speed, "speed", (3,)),
        angle_rate=real_array(rate, "angle_rate", (3,)),
    )


def _constraint_jacobian(parameters: RPSParameters, length: Array, angle: Array) -> Array:
    """Return A = df/dx of Eq. 8, shape (..., 3, 6), of d (m) and phi (rad), shape (..., 3)."""
    g = parameters.base_radius
    d, phi = np.moveaxis(length, -1, 0), np.moveaxis(angle, -1, 0)
    cosine, sine = np.cos(phi), np.sin(phi)
    w, z = d * cosine, d * sine
    rho = g - w
    by_angles = leg_equations.slopes(w, z, g)
    matrix = np.zeros((*length.shape, 6))
    for row, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
        # f_ij = rho_i^2 + rho_i rho_j + rho_j^2 + (z_i - z_j)^2 - 3 h^2, drho_i/dd_i = -cos(phi_i)
        matrix[..., row, i] = -(2 * rho[i] + rho[j]) * cosine[i] + 2 * (z[i] - z[j]) * sine[i]
        matrix[..., row, j] = -(2 * rho[j] + rho[i]) * cosine[j] - 2 * (z[i] - z[j]) * sine[j]
        matrix[..., row, 3 + i], matrix[..., row, 3 + j] = by_angles[2 * row : 2 * row + 2]
    return matrix


def _weighed_mass(parameters: RPSParameters, printed: frozenset[str]) -> float:
    """Return the mass in the platform's potential energy: Eq. 19, or 1 kg as it is printed."""
    return 1.0 if "eq_19" in printed else parameters.platform_mass


def _platform_inertia_terms(
    parameters: RPSParameters, r: vectors.MovingVectors, rate: Array, literal: bool
) -> tuple[Array, Array]:
    """Return the platform's M (..., 6, 6) and c (..., 6): Eq. 13."""
    inertia = parameters.platform_inertia
    weights = np.zeros((4, 4))
    weights[0, 0] = parameters.platform_mass
    if not literal:
        weights[1:, 1:] = np.trace(inertia) / 2 * np.eye(3) - inertia
    # The pairs (vector, component) as one axis: sum_ab Y_ab r_a . r_b = r' (Y x 1) r.
    metric = np.kron(weights, np.eye(3))
    jacobian = r.jacobian.reshape(*rate.shape[:-1], 12, 6)
    jacobian_rate = r.jacobian_rate.reshape(*rate.shape[:-1], 12, 6)
    momenta = np.swapaxes(jacobian, -1, -2) @ metric
    mass, coriolis = momenta @ jacobian, times(momenta, times(jacobian_rate, rate))
    if literal:
        turning_mass, turning_coriolis = _printed_turning_terms(inertia, r, rate)
        mass, coriolis = mass + turning_mass, coriolis + turning_coriolis
    return mass, coriolis


def _printed_turning_terms(
    inertia: Array, r: vectors.MovingVectors, rate: Array
) -> tuple[Array, Array]:
    """Return M and c of Omega' (R I R) Omega/2: Eq. 14 as printed.

    Omega = sum_a r_a x r_a'/2 over the axes r = (u, v, n), the columns of R; with Omega = W x' and
    the symmetric part Q of R I R, Lagrange's terms are

        W' (Q W x'' + Q W' x' + Q' Omega) + (W' - dOmega/dx)' Q Omega - Omega' dQ/dx Omega/2.
    """
    axes, by_x, by_x_rate = (part[..., 1:, :, :] for part in (r.value[..., None], *r[1:]))
    velocity = (by_x @ rate[..., None, :, None])[..., 0]
    cross, cross_rate = vectors.skew(axes[..., 0]), vectors.skew(velocity)
    W = (cross @ by_x).sum(axis=-3) / 2
    turned, moved = (cross @ by_x_rate).sum(axis=-3) / 2, (cross_rate @ by_x).sum(axis=-3) / 2
    # d/dt W = (r' x r_x + r x r_x')/2, and dOmega/dx = (-r' x r_x + r x r_x')/2.
    W_rate, spin_slope = turned + moved, turned - moved
    spin = times(W, rate)

    R = np.swapaxes(axes[..., 0], -1, -2)
    R_rate = np.swapaxes(velocity, -1, -2)
    R_slope = np.moveaxis(by_x, (-1, -2, -3), (-3, -2, -1))  # dR/dx_k, shape (..., 6, 3, 3)
    Q = _symmetric(R @ inertia @ R)
    Q_rate = _symmetric(R_rate @ inertia @ R + R @ inertia @ R_rate)
    wide = R[..., None, :, :]
    Q_slope = _symmetric(R_slope @ inertia @ wide + wide @ inertia @ R_slope)

    to_x = np.swapaxes(W, -1, -2)
    change = np.swapaxes(W_rate - spin_slope, -1, -2)
    coriolis = (
        times(to_x, times(Q, times(W_rate, rate)) + times(Q_rate, spin))
        + times(change, times(Q, spin))
        - np.einsum("...i,...kij,...j->...k", spin, Q_slope, spin) / 2
    )
    return to_x @ Q @ W, coriolis


def _symmetric(matrix: Array) -> Array:
    half: Array = (matrix + np.swapaxes(matrix, -1, -2)) / 2
    return half


def _add_legs_inertia_terms(
    parameters: RPSParameters, d: Array, dd: Array, dphi: Array, mass: Array, coriolis: Array
) -> None:
    """Add cylinders (Eq. 16) and rods to M and c, in place."""
    p = parameters
    about_joint = p.leg_inertia_about_com + p.leg_mass * p.leg_com**2
    lever = d - p.rod_com
    turning = about_joint + p.rod_inertia + p.rod_mass * lever**2
    for leg in range(3):
        mass[..., leg, leg] += p.rod_mass
        mass[..., 3 + leg, 3 + leg] += turning[..., leg]
    coriolis[..., :3] -= p.rod_mass * lever * dphi**2
    coriolis[..., 3:] += 2 * p.rod_mass * lever * dd * dphi


def _legs_gravity(parameters: RPSParameters, d: Array, phi: Array) -> Array:
    """Return the derivatives of the legs' potential energy, shape (..., 6): Eq. 21 and rods."""
    p = parameters
    s, t = vectors.leg_vectors(phi)
    moment = p.leg_mass * p.leg_com + p.rod_mass * (d - p.rod_com)
    return np.concatenate([-p.rod_mass * (s @ p.gravity), -moment * (t @ p.gravity)], axis=-1)

"""Signed measures of singularities along a path of the 3-RPS, with their exact rates."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.rps.kinematics import rates
from rps_pin.rps.kinematics.pose import checked_motion
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.singularity.measures import checked_tilt, gain_matrix


class MeasureRates(NamedTuple):
    """Signed measures of poses on a path, and their time derivatives."""

    value: Array
    """Signed type II, constraint, and d_1/h, d_2/h, d_3/h, shape (..., 5)."""
    rate: Array
    """Their time derivatives, shape (..., 5), 1/s."""


def measure_rates(parameters: RPSParameters, pose: ArrayLike, rate: ArrayLike) -> MeasureRates:
    """Return the signed measures and their exact time derivatives along a motion.

    With the gains' matrix M = K L^-T / sqrt(3), L L' = Q and Q the mean of the tips' squared speed
    as a quadratic form of pose', the least gain sigma with M v = sigma u has, for w = L^-T v,

        sigma' = u' K' w / sqrt(3) - sigma w' Q' w / 2.

    Where two gains are equal it is the derivative of one of them. A leg without length has 0 for
    its measure's and for type II's value and rate.

    Parameters
    ----------
    pose, rate
        Pose and its time derivative, shape (..., 3) each.

    Raises
    ------
    InputError
        As `singularity_measures`.
    """
    x, dx, _ = checked_motion(pose, rate)
    legs = rates.masked_leg_jacobians(parameters, x)
    return rates_of_legs(parameters, checked_tilt(x), dx, *legs)


def rates_of_legs(
    parameters: RPSParameters, x: Array, dx: Array, legs: rates.LegJacobians, vanishing: Bools
) -> MeasureRates:
    """Return `measure_rates` of poses and rates (..., 3) whose legs are known."""
    h = parameters.platform_radius
    tip, tip_rates = rates.tip_jacobians(parameters, x), rates.tip_jacobian_rates(parameters, x, dx)
    change = rates.jacobian_rates_of_legs(parameters, x, dx, legs)
    M, L = gain_matrix(tip, legs)
    left, gains, right = np.linalg.svd(M)
    sigma, u = gains[..., 2], left[..., :, 2]
    w = np.linalg.solve(np.swapaxes(L, -1, -2), right[..., 2, :, None])[..., 0]  # L^-T v
    moving = [np.einsum("...ij,...j->...i", matrix, w) for matrix in (*tip[2:], *tip_rates)]
    # w' Q' w = 2/3 ((U w) . (U' w) + (W w) . (W' w))
    w_dQ_w = 2 / 3 * (moving[0] * moving[2] + moving[1] * moving[3]).sum(axis=-1)
    stretch = np.einsum("...i,...ij,...j->...", u, change.length_jacobian, w) / math.sqrt(3)
    sign = np.where(np.linalg.det(M) < 0, -1.0, 1.0)
    gain = np.stack([sign * sigma, sign * (stretch - sigma * w_dQ_w / 2)])
    regular = ~vanishing.any(axis=-1)
    beta = np.hypot(x[..., 1], x[..., 2])
    # d/dt cos(beta/2) = -sin(beta/2) / (2 beta) w . w'
    couple_rate = -np.sinc(beta / (2 * np.pi)) / 4 * (x[..., 1:] * dx[..., 1:]).sum(axis=-1)
    speed = np.einsum("...ij,...j->...i", legs.length_jacobian, dx)
    least = np.where(regular, gain, 0.0)
    couple = np.cos(beta / 2), couple_rate
    lengths = np.where(vanishing, 0.0, [legs.length, speed]) / h
    value, rate = (
        np.concatenate([least[k][..., None], couple[k][..., None], lengths[k]], axis=-1)
        for k in range(2)
    )
    return MeasureRates(value, rate)

"""The formulas that hold as printed, typed here and compared with the package's results.

Random poses and motions of Table 1's robot. Errors are relative to the size of what is compared
(lengths to h), the largest over all states.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.paper import paper_data as paper
from rps_pin.paper.lagrange_terms import constraints, energies
from rps_pin.paper.paper_helix import corrected_turn, regular_helix
from rps_pin.rps.kinematics.assembly_modes import eliminant
from rps_pin.rps.kinematics.legs import RADIAL, LegMotion
from rps_pin.rps.kinematics.pose import PlatformMotion
from rps_pin.rps.robot import RPSRobot

SEED = 17
_STATES = 1000
_ROOT_3 = math.sqrt(3.0)


def formula_checks() -> dict[int | str, float]:
    """Return the largest error of each equation, by its number, and "8 closed"."""
    robot = RPSRobot.from_preset("sokolov")
    rng = np.random.default_rng(SEED)
    size, way = rng.uniform(0.0, 1.0, _STATES), rng.uniform(-math.pi, math.pi, _STATES)
    height = rng.uniform(0.3, 0.8, _STATES)
    pose = np.stack([height, size * np.cos(way), size * np.sin(way)], axis=-1)
    rate = rng.normal(size=(_STATES, 3))
    platform, legs = robot.motion(pose, rate, rng.normal(size=(_STATES, 3)))
    return {
        **_kinematics(robot, pose, platform, legs),
        **_rates(robot, pose, rate, platform, legs),
        **_energies(robot, platform, legs),
        **_helix(robot),
    }


def _kinematics(
    robot: RPSRobot, pose: Array, platform: PlatformMotion, legs: LegMotion
) -> dict[int | str, float]:
    g, h = robot.parameters.base_radius, robot.parameters.platform_radius
    u, v, p = platform.rotation[..., 0], platform.rotation[..., 1], platform.position
    eq_1 = p[:, None] + h * RADIAL @ np.swapaxes(platform.rotation, -1, -2)
    eq_2 = np.stack(
        [p + h * u, p - h / 2 * u + _ROOT_3 / 2 * h * v, p - h / 2 * u - _ROOT_3 / 2 * h * v],
        axis=1,
    )
    eq_3 = (eq_2[:, 0, 1], eq_2[:, 1, 1] + _ROOT_3 * eq_2[:, 1, 0],
            eq_2[:, 2, 1] - _ROOT_3 * eq_2[:, 2, 0])  # fmt: skip
    eq_4 = (u[:, 1] - v[:, 0], (p[:, 1] + h * u[:, 1]) / h, p[:, 0] / h - (u[:, 0] - v[:, 1]) / 2)
    d, phi = legs.length, legs.angle
    found = robot.inverse_kinematics(pose)
    inwards = g - d * np.cos(phi)
    x, y = np.array([1, -1 / 2, -1 / 2]), np.array([0, _ROOT_3 / 2, -_ROOT_3 / 2])
    eq_7 = np.stack([inwards * x, inwards * y, d * np.sin(phi)], axis=-1)
    open_angle = phi + 0.3  # not closed: Eq. 8 is tried where it is not zero, too
    return {
        1: _largest(eq_1 - eq_2) / h,
        2: _largest(eq_2 - eq_7) / h,
        3: _largest(np.array(eq_3)) / h,
        4: _largest(np.array(eq_4)),
        6: _largest(np.linalg.norm(eq_2 - g * RADIAL, axis=-1) - found.length) / h,
        7: _largest(eq_7 - eq_1) / h,
        8: _largest(eq_8(d, open_angle, g, h) - constraints(robot.parameters, d, open_angle))
        / h**2,
        "8 closed": _largest(eq_8(d, phi, g, h)) / h**2,
        20: _largest((d * np.sin(phi)).mean(axis=-1) - pose[:, 0]) / h,
    }


def eq_8(d: Array, phi: Array, g: float, h: float) -> Array:
    """Return f_1, f_2, f_3 of Eq. 8 as printed, shape (..., 3), m^2."""
    rows = []
    for i, j in ((0, 1), (1, 2), (2, 0)):
        a, b, x, y = d[..., i], d[..., j], phi[..., i], phi[..., j]
        rows.append(
            a**2 + b**2 + 3 * g**2 - 3 * h**2
            + a * b * np.cos(x) * np.cos(y) - 2 * a * b * np.sin(x) * np.sin(y)
            - 3 * g * a * np.cos(x) - 3 * g * b * np.cos(y)
        )  # fmt: skip
    return np.stack(rows, axis=-1)


def _rates(
    robot: RPSRobot, pose: Array, rate: Array, platform: PlatformMotion, legs: LegMotion
) -> dict[int | str, float]:
    """Compare rates with central differences of placements and angles."""
    step = 1e-5
    (p2, R2), (p1, R1) = (robot.platform_placement(pose + s * step * rate) for s in (1, -1))
    after, before = (robot.inverse_kinematics(pose + s * step * rate) for s in (1, -1))
    velocity = (p2 - p1) / (2 * step)
    spin = np.swapaxes(platform.rotation, -1, -2) @ (R2 - R1) / (2 * step)  # [Omega]x, body axes
    found = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
    r = paper.LEG_COM_MM * 1e-3

    def centre(angle: Array) -> Array:
        return r * np.stack([-np.cos(angle), np.sin(angle)], axis=-1)

    moved = np.linalg.norm(centre(after.angle) - centre(before.angle), axis=-1) / (2 * step)
    return {
        15: _largest(
            [
                _largest(velocity - platform.velocity) / _largest(platform.velocity),
                _largest(found - platform.angular_velocity) / _largest(platform.angular_velocity),
            ]
        ),
        17: _largest(moved - np.abs(r * legs.angle_rate)) / _largest(r * legs.angle_rate),
        18: _largest((after.angle - before.angle) / (2 * step) - legs.angle_rate)
        / _largest(legs.angle_rate),
    }


def _energies(robot: RPSRobot, platform: PlatformMotion, legs: LegMotion) -> dict[int | str, float]:
    p = robot.parameters
    found = energies(p, *legs[:4])
    spin = platform.angular_velocity
    eq_13 = (
        p.platform_mass * (platform.velocity**2).sum(axis=-1) / 2
        + (spin * (spin @ p.platform_inertia)).sum(axis=-1) / 2
    )
    eq_21 = 9.81 * p.leg_com * p.leg_mass * np.sin(legs.angle).sum(axis=-1)
    return {
        13: _largest(found.platform_kinetic - eq_13) / _largest(eq_13),
        21: _largest(found.legs_potential - eq_21) / _largest(eq_21),
    }


def _helix(robot: RPSRobot) -> dict[int | str, float]:
    radius, pitch, height = paper.HELIX_RADIUS * 1e-3, paper.HELIX_PITCH * 1e-3, 0.4
    path = regular_helix(robot)
    times = np.linspace(0.0, path.duration, _STATES)
    phi = corrected_turn(times)[0]
    x, y, z = robot.platform_placement(path.sample(times).pose)[0].T
    return {
        26: _largest(x - radius * np.cos(phi)) / radius,
        27: _largest(y - radius * np.sin(phi)) / radius,
        28: _largest(z - height - pitch / (2 * math.pi) * phi) / pitch,
    }


# How many solutions Eq. 8 has -------------------------------------------------------------------


def degree_of_eq_8(count: int = 20) -> int:
    """Return Eq. 8's degree in cos(phi_1) once phi_2 and phi_3 are eliminated.

    The eliminant is sampled and fitted by Chebyshev polynomials of degree 12, for random lengths:
    coefficients below 1e-9 of the largest are rounding. Each zero is a pair +-phi_1: twice as many
    solutions.
    """
    rng = np.random.default_rng(SEED)
    cosine = np.cos(math.pi * (np.arange(40) + 0.5) / 40)
    degree = 0
    for lengths in rng.uniform(0.3, 0.7, size=(count, 3)):
        values = np.array([float(eliminant(lengths, np.asarray(c), 0.46, 0.23)) for c in cosine])
        series = np.abs(np.polynomial.chebyshev.chebfit(cosine, values, 12))
        degree = max(degree, int(np.flatnonzero(series > 1e-9 * series.max())[-1]))
    return degree


def solution_counts(count: int = 1000) -> dict[int, int]:
    """Return how many of random triples of leg lengths have so many real solutions of Eq. 8."""
    lengths = np.random.default_rng(SEED).uniform(0.15, 0.75, size=(count, 3))
    exists = RPSRobot.from_preset("sokolov").assembly_modes(lengths).exists
    found, times = np.unique(exists.sum(axis=-1), return_counts=True)
    return {int(n): int(t) for n, t in zip(found, times, strict=True)}


def _largest(values: ArrayLike) -> float:
    return float(np.abs(values).max())

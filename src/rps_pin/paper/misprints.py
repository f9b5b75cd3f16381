"""Misprints in Sections 2 and 4 of the paper, each compared with the correct form by computation.

Every check computes the printed formula and the correct one at random states and compares both with
a computation that uses neither: rotations from SciPy's Euler angles, rigid bodies made of point
masses, central differences, the constraint models' forces. Formulas are typed here as the paper
prints them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from rps_pin.arrays import Array
from rps_pin.paper import paper_data as paper
from rps_pin.paper.lagrange import lagrange_forces
from rps_pin.paper.lagrange_terms import constraints, lagrange_terms
from rps_pin.paper.paper_helix import corrected_turn, printed_turn
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot

SEED = 20241124
#: Random states of a check.
STATES = 1000


class Misprint(NamedTuple):
    """One misprint and the computation that shows it."""

    error_printed: float
    """What the printed form misses by; relative but for Eq. 29, where it is in rad."""
    error_right: float
    """What the right form misses by, in the same measure."""

    @property
    def confirmed(self) -> bool:
        """Whether the printed form fails, and the right one does not."""
        return self.error_printed > 1e-3 and self.error_right < 1e-6

    @property
    def verdict(self) -> str:
        """``"confirmed"``, or that it is not."""
        return "confirmed" if self.confirmed else "**not confirmed**"


def formula_misprints() -> dict[int, Misprint]:
    """Return the checks of the formulas by the equation's number, in the paper's order."""
    rng = np.random.default_rng(SEED)
    return {
        5: eq_5(rng),
        11: eq_11(rng),
        12: eq_12(rng),
        14: eq_14(rng),
        16: eq_16(),
        19: eq_19(rng),
        29: eq_29(),
    }


# Kinematics ---------------------------------------------------------------------------------------


def eq_5(rng: np.random.Generator) -> Misprint:
    """Put the platform where Eq. 5 says, and see whether its tips keep the legs' planes (Eq. 3).

    The printed form is given the better of the two orders in which the angles can be meant.
    """
    alpha, beta = rng.uniform(-math.pi, math.pi, STATES), rng.uniform(0.1, 3.0, STATES)
    turn, other_order = (
        Rotation.from_euler("ZYZ", np.stack([a, beta, -a], axis=-1)).as_matrix()
        for a in (alpha, -alpha)
    )
    sideways = (1 - np.cos(beta)) / 2
    along, across = sideways * np.cos(2 * alpha), sideways * np.sin(2 * alpha)
    zero = np.zeros(STATES)
    printed = np.stack([-across, along, zero], axis=-1)
    right = np.stack([-along, across, zero], axis=-1)
    return Misprint(
        min(_off_plane(printed, turn), _off_plane(printed, other_order)),
        _off_plane(right, turn),
    )


def _off_plane(position: Array, turn: Array) -> float:
    """Return the largest distance of a tip (Eq. 1, h = 1) from its leg's plane: Eq. 3."""
    tip = position[:, None, :] + RADIAL @ np.swapaxes(turn, -1, -2)
    (x1, y1), (x2, y2), (x3, y3) = (tip[:, leg, :2].T for leg in range(3))
    root = math.sqrt(3.0)
    off = (y1 + 0 * x1, (y2 + root * x2) / 2, (y3 - root * x3) / 2)
    return float(np.abs(off).max())


def eq_11(rng: np.random.Generator) -> Misprint:
    """See which of Eq. 7 and Eq. 8 vanishes on closed robots."""
    robot = RPSRobot.from_preset("sokolov")
    legs = robot.inverse_kinematics(_poses(rng, robot.parameters))
    g, h = robot.parameters.base_radius, robot.parameters.platform_radius
    rho, height = g - legs.length * np.cos(legs.angle), legs.length * np.sin(legs.angle)
    tips = rho[..., None] * RADIAL + height[..., None] * np.array([0.0, 0.0, 1.0])  # Eq. 7
    values = constraints(robot.parameters, legs.length, legs.angle)  # Eq. 8
    return Misprint(
        float(np.linalg.norm(tips, axis=(-2, -1)).min() / h),
        float(np.abs(values).max() / h**2),
    )


# Lagrange's equations -----------------------------------------------------------------------------


def eq_12(rng: np.random.Generator) -> Misprint:
    """Compare the gradient of the term that Eq. 12 adds to L with the term of Eq. 22."""
    robot = RPSRobot.from_preset("sokolov")
    p, h = robot.parameters, robot.parameters.platform_radius
    legs = robot.inverse_kinematics(_poses(rng, p))
    x = np.concatenate([legs.length, legs.angle], axis=-1)
    multipliers = rng.normal(size=(STATES, 3))

    def slopes(at: Array) -> Array:
        still = np.zeros(3)
        terms = lagrange_terms(p, at[..., :3], at[..., 3:], still, still)
        return np.asarray(terms.constraint_jacobian)

    wanted = np.einsum("...j,...ji->...i", multipliers, slopes(x))
    right, printed = np.empty_like(x), np.empty_like(x)
    for i in range(6):
        step = np.zeros(6)
        step[i] = 1e-5 * h if i < 3 else 1e-5
        up, down = x + step, x - step
        change = constraints(p, up[:, :3], up[:, 3:]) - constraints(p, down[:, :3], down[:, 3:])
        right[:, i] = (multipliers * change).sum(axis=-1) / (2 * step[i])
        bend = (slopes(up) - slopes(down))[..., i]
        printed[:, i] = (multipliers * bend).sum(axis=-1) / (2 * step[i])
    scale = np.abs(wanted).max(axis=-1, keepdims=True)
    return Misprint(
        min(float((np.abs(sign * printed - wanted) / scale).max()) for sign in (1, -1)),
        float((np.abs(right - wanted) / scale).max()),
    )


def eq_14(rng: np.random.Generator) -> Misprint:
    """Compare both with the inertia of eight point masses where the rotation puts them."""
    points = rng.normal(size=(8, 3))
    turn = Rotation.random(STATES, random_state=np.random.RandomState(SEED)).as_matrix()
    moved = points @ np.swapaxes(turn, -1, -2)
    wanted, local = _inertia(moved), _inertia(points)
    size = float(np.abs(local).max())
    return Misprint(
        float(np.abs(turn @ local @ turn - wanted).max()) / size,
        float(np.abs(turn @ local @ np.swapaxes(turn, -1, -2) - wanted).max()) / size,
    )


def _inertia(points: Array) -> Array:
    square = (points**2).sum(axis=(-2, -1))
    products = np.einsum("...ki,...kj->...ij", points, points)
    inertia: Array = square[..., None, None] * np.eye(3) - products
    return inertia


def eq_16() -> Misprint:
    """Sum the kinetic energy of a leg's parts: masses m/2 at r +- s on a bar that turns by 1 rad/s.

    s is such that the bar has Table 1's m_leg, r, and I_leg about the joint.
    """
    m, r, inertia = paper.LEG_MASS, paper.LEG_COM_MM * 1e-3, paper.LEG_INERTIA
    s = math.sqrt(inertia / m - r**2)
    wanted = sum(0.5 * (m / 2) * place**2 for place in (r + s, r - s))
    printed = 0.5 * m * r**2 + 0.5 * inertia
    return Misprint(
        abs(printed - wanted) / wanted,
        abs(0.5 * inertia - wanted) / wanted,
    )


def eq_19(rng: np.random.Generator) -> Misprint:
    """Lift Table 1's robot slowly: the actuators' work must be its gain of height, times weight."""
    robot = RPSRobot(RPSParameters.from_preset("sokolov").replace(leg_mass=0.0, leg_inertia=0.0))
    p = robot.parameters
    pose, rate = _poses(rng, p), rng.normal(size=(STATES, 3))
    rate[:, 0] = 1.0
    still = np.zeros_like(pose)
    speed = robot.motion(pose, rate, still)[1].speed
    wanted = paper.PLATFORM_MASS * 9.81

    def misses(*as_printed: str) -> float:
        force = lagrange_forces(p, pose, still, still, as_printed=as_printed).force
        return float(np.abs((force * speed).sum(axis=-1) - wanted).max() / wanted)

    return Misprint(
        misses("eq_19"),
        misses(),
    )


# The helix ----------------------------------------------------------------------------------------


def eq_29() -> Misprint:
    """See by how much phi jumps where its last branch begins."""

    def jump(printed: bool) -> float:
        turn = printed_turn if printed else corrected_turn
        before, after = np.nextafter(paper.BRAKE_START, 0.0), paper.BRAKE_START
        return float(abs(turn(after)[0] - turn(before)[0]))

    return Misprint(
        jump(True),
        jump(False),
    )


def _poses(rng: np.random.Generator, parameters: RPSParameters) -> Array:
    """Return random poses well above the base, shape (n, 3)."""
    size, way = rng.uniform(0.0, 0.6, STATES), rng.uniform(-math.pi, math.pi, STATES)
    height = parameters.base_radius * rng.uniform(0.9, 2.0, STATES)
    return np.stack([height, size * np.cos(way), size * np.sin(way)], axis=-1)

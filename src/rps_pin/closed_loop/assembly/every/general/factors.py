"""Joints as products of turns, slides and balls."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.assembly.every.solutions import NoFormulationError
from rps_pin.closed_loop.constraints.system import ConstraintSystem


@dataclass
class Factor:
    """A factor of a joint; `at` is its first unknown, `q` its first coordinate in q."""

    at: int
    q: int
    axis: Array = field(default_factory=lambda: np.zeros(3))
    size: int = 1


@dataclass
class Turn(Factor):
    """By an angle about an axis."""

    by_cosine: bool = False
    """Whether q holds its cosine and sine."""

    def __post_init__(self) -> None:
        k = pin.skew(self.axis)
        #: R = K_0 + sin K_1 + cos K_2.
        self.parts = np.eye(3) + k @ k, np.asarray(k), -k @ k


@dataclass
class Slide(Factor):
    """Along an axis."""


@dataclass
class Ball(Factor):
    """By a quaternion (x, y, z, w)."""

    size: int = 4


@dataclass
class JointFactors:
    """A joint behind its parent: a placement that stands, lengths in units, and factors."""

    parent: int
    turn: Array
    at: Array
    factors: list[Factor]


def joint_factors(
    system: ConstraintSystem, held: Bools, about: Array, unit: float
) -> tuple[list[JointFactors], int]:
    """Return all joints, the world first, and the number of unknowns.

    Raises
    ------
    NoFormulationError
        If a joint is no product of turns, slides and balls, or moves in part.
    """
    model, data = system.model, system.data
    pin.forwardKinematics(model, data, about)
    found, size = [JointFactors(0, np.eye(3), np.zeros(3), [])], 0
    for index in range(1, model.njoints):
        joint = model.joints[index]
        stands = held[joint.idx_v : joint.idx_v + joint.nv]
        if stands.any() and not stands.all():
            raise NoFormulationError(f"joint {model.names[index]!r} is given in part")
        place = data.liMi[index] if stands.all() else model.jointPlacements[index]
        factors = [] if stands.all() else _factors(model, index, size)
        size += sum(one.size for one in factors)
        at = np.array(place.translation) / unit
        found.append(JointFactors(model.parents[index], np.array(place.rotation), at, factors))
    return found, size


def _factors(model: pin.Model, index: int, first: int) -> list[Factor]:
    joint = model.joints[index]
    name, q, axes = joint.shortname(), joint.idx_q, np.eye(3)
    shift: list[Factor] = [Slide(first + i, q + i, axes[i]) for i in range(3)]
    found: list[Factor] = []
    if joint.nv == 1 and joint.nq in (1, 2) and "Mimic" not in name:
        description = joint.createData()
        joint.calc(description, pin.neutral(model))
        motion = np.asarray(description.S).reshape(6)
        if not motion[:3].any():
            found = [Turn(first, q, motion[3:], by_cosine=joint.nq == 2)]
        elif not motion[3:].any():
            found = [Slide(first, q, motion[:3])]
    elif "SphericalZYX" in name:
        found = [Turn(first + i, q + i, axes[2 - i]) for i in range(3)]
    elif "Spherical" in name:
        found = [Ball(first, q)]
    elif "FreeFlyer" in name:
        found = [*shift, Ball(first + 3, q + 3)]
    elif "Translation" in name:
        found = shift
    elif "Planar" in name:
        found = [*shift[:2], Turn(first + 2, q + 2, axes[2], by_cosine=True)]
    if not found:
        raise NoFormulationError(f"joint {model.names[index]!r} is no product of turns and slides")
    return found
